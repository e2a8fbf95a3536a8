#pragma once

#include "datasets/error.hpp"
#include "datasets/io.hpp"

#include <CLI/CLI.hpp>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

/// The crampfit command, one file a verb.
namespace crampfit::cli {

enum class ExitStatus {
    done = 0,
    incomplete = 1,     // the run or fit did not reach its end; what it has is saved
    bad_input = 2,      // or bad usage
    interrupted = 130,  // what it has is saved
};

/// Options that every verb takes.
struct CommonOptions {
    std::vector<std::string> settings;  // KEY=VALUE
    int threads = 1;
    bool quiet = false;
    std::filesystem::path log;  // empty: none
};

/// Adds them to the command and sets their defaults.
void add_common_options(CLI::App& command, CommonOptions& common);

/// Splits each KEY=VALUE at its first '='. Throws InputError for one without a key or '='.
Overrides overrides_of(const CommonOptions& common);

/// Throws InputError unless a result can be saved there without harm to what is read.
void check_output(const std::filesystem::path& output, const std::vector<std::filesystem::path>& inputs,
                  const std::string& option = "-o");

/// Writes a result where `check_output` had nothing against it. What fails now, as on a full disk, is no bad input: throws
/// std::runtime_error.
template <class Result>
void save(const Result& result, const std::filesystem::path& output) {
    try {
        write(result, output);
    } catch (const InputError& error) {
        throw std::runtime_error(error.what());
    }
}

/// The files that a scene, or a study and its scenes, are read from.
std::vector<std::filesystem::path> files_of(const Scene& scene);
std::vector<std::filesystem::path> files_of(const Study& study);

/// A line on standard error, where there is one: a run does not end because nobody listens.
void complain(const std::string& line);

/// Writes to standard output. A reader that has left, such as `head`, is no error.
void print(const std::string& text);

/// A line on standard error, unless --quiet, and in the log.
void report(const CommonOptions& common, const std::string& line);

/// How something has ended: with --quiet, too, where it did not reach its end.
void report_end(const CommonOptions& common, const std::string& line, ExitStatus status);

}  // namespace crampfit::cli

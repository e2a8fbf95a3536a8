#include "cli/common.hpp"

#include "cli/ranks.hpp"
#include "datasets/error.hpp"
#include "datasets/whole_file.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace crampfit::cli {

namespace {

constexpr int most_threads = 4096;  // more is a slip of the finger

/// By what they are, or where they will be.
bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
    std::error_code error;
    return !a.empty() && !b.empty() &&
           (std::filesystem::equivalent(a, b, error) ||
            std::filesystem::weakly_canonical(a, error) == std::filesystem::weakly_canonical(b, error));
}

}  // namespace

void add_common_options(CLI::App& command, CommonOptions& common) {
    common.threads = std::min(cores_of_rank(), most_threads);
    command.add_option("--set", common.settings, "Override a key of the file, as in materials.EW.toughness=\"120 J/m^2\"")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    command
        .add_option("--threads", common.threads,
                    "Forward runs side by side in a fit, or threads in a step of explicit dynamics; all cores unless told")
        ->type_name("N")
        ->check(CLI::Range(1, most_threads));
    command.add_flag("--quiet", common.quiet, "No progress on standard error, only errors");
    command.add_option("--log", common.log, "Append what happens, with the time, to this file")->type_name("FILE");
}

Overrides overrides_of(const CommonOptions& common) {
    Overrides overrides;
    for (const std::string& setting : common.settings) {
        const std::size_t equals = setting.find('=');
        if (equals == std::string::npos || equals == 0) throw InputError("command line", "--set", setting, "must be KEY=VALUE");
        overrides.emplace_back(trim(setting.substr(0, equals)), trim(setting.substr(equals + 1)));
    }
    return overrides;
}

void check_output(const std::filesystem::path& output, const std::vector<std::filesystem::path>& inputs,
                  const std::string& option) {
    if (output.empty()) throw InputError("command line", option, "", "must be the name of a file");
    for (const std::filesystem::path& input : inputs)
        if (is_same_file(output, input))
            throw InputError("command line", option, output.string(), "must not be a file that is read or made otherwise");
    for (const auto& sink : spdlog::default_logger()->sinks())
        if (const auto log = std::dynamic_pointer_cast<spdlog::sinks::basic_file_sink_mt>(sink))
            if (is_same_file(output, log->filename()))
                throw InputError("command line", option, output.string(), "must not be the log");
    require_writable(output);
}

std::vector<std::filesystem::path> files_of(const Scene& scene) {
    std::vector<std::filesystem::path> files{scene.file, scene.specimen.file};
    if (const auto& picture = scene.specimen.picture) files.insert(files.end(), {picture->file, picture->orientation});
    return files;
}

std::vector<std::filesystem::path> files_of(const Study& study) {
    std::vector<std::filesystem::path> files;
    for (const Experiment& experiment : study.experiments) {
        files.push_back(experiment.data_file);
        if (const auto& fields = experiment.fields) files.insert(files.end(), {fields->file, fields->times_file});
        if (const auto& photograph = experiment.photograph) files.insert(files.end(), {photograph->file, photograph->track});
    }
    for (const Scene* scene : scenes_of(study))
        for (const std::filesystem::path& file : files_of(*scene)) files.push_back(file);
    return files;
}

void complain(const std::string& line) { std::fputs(("crampfit: " + line + '\n').c_str(), stderr); }

void print(const std::string& text) {
    const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
    if (!written && errno != EPIPE)
        throw InputError("standard output", "", "", fmt::format("cannot be written: {}", std::strerror(errno)));
}

void report(const CommonOptions& common, const std::string& line) {
    spdlog::info(line);
    if (!common.quiet) complain(line);
}

void report_end(const CommonOptions& common, const std::string& line, ExitStatus status) {
    spdlog::info(line);
    if (!common.quiet || status != ExitStatus::done) complain(line);
}

}  // namespace crampfit::cli

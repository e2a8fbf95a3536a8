#pragma once

#include "cli/common.hpp"
#include "cli/progress.hpp"
#include "cli/ranks.hpp"
#include "cli/stop.hpp"
#include "datasets/experiment.hpp"

#include <CLI/CLI.hpp>

#include <filesystem>
#include <string>

namespace crampfit::cli {

/// What the verbs take that run a study.
struct StudyArguments {
    std::filesystem::path study;
    std::filesystem::path output;
    bool resume = false;

    std::filesystem::path runs() const { return output.string() + ".runs"; }
};

/// Adds them to a verb; `result` is what its output is called.
void add_study_arguments(CLI::App& verb, StudyArguments& arguments, const char* result);

/// Throws InputError unless the result, and the runs beside it, can be saved without harm to what is read.
void check_outputs(const StudyArguments& arguments, const std::vector<std::filesystem::path>& inputs);

/// Reads the study and the pictures of its scenes. From here on signals ask for a stop.
Study open_study(const std::filesystem::path& file, const CommonOptions& common);

/// Shows each forward run as it ends.
class RunsLine {
  public:
    RunsLine(const CommonOptions& common, const char* left) : common_(common), line_(common, "runs", left) {}

    /// `failure` says why the run failed, if it did.
    void show(int runs, int most, const std::string& failure, const std::string& details);

  private:
    const CommonOptions& common_;
    ProgressLine line_;
};

/// Options of the fit or the sensitivity study, all but their progress.
template <class Options>
Options study_options(const StudyArguments& arguments, const CommonOptions& common, Ranks& ranks) {
    Options options;
    options.threads = common.threads;
    options.stop_requested = &stop_requested();
    options.keeping = {arguments.runs(), arguments.resume};
    options.farm = ranks.farm();
    return options;
}

}  // namespace crampfit::cli

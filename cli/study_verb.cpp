#include "cli/study_verb.hpp"

#include "imaging/photograph.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>

namespace crampfit::cli {

void add_study_arguments(CLI::App& verb, StudyArguments& arguments, const char* result) {
    verb.add_option("study", arguments.study, "The study")->type_name("STUDY.toml")->required();
    verb.add_option("-o,--output", arguments.output, "Where the result goes")->type_name(result)->required();
    verb.add_flag("--resume", arguments.resume, "Go on from the runs that an earlier call has kept beside its output");
}

void check_outputs(const StudyArguments& arguments, const std::vector<std::filesystem::path>& inputs) {
    check_output(arguments.output, inputs);
    check_output(arguments.runs(), inputs);
}

Study open_study(const std::filesystem::path& file, const CommonOptions& common) {
    Study study = read_study(file, overrides_of(common));
    load_pictures(study);
    stop_on_signals();
    spdlog::info("the study is read");
    return study;
}

void RunsLine::show(int runs, int most, const std::string& failure, const std::string& details) {
    if (!failure.empty()) report(common_, failure);
    line_.show(std::min(1.0, static_cast<double>(runs) / std::max(1, most)), runs, details);
}

}  // namespace crampfit::cli

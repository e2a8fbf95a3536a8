#include "inverse/sensitivity.hpp"

#include "cli/progress.hpp"
#include "cli/stop.hpp"
#include "cli/verbs.hpp"
#include "imaging/picture.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>

namespace crampfit::cli {

namespace {

struct Arguments {
    std::filesystem::path study;
    std::filesystem::path output;
    bool resume = false;
};

ExitStatus exit_status(SensitivityStatus status) {
    switch (status) {
    case SensitivityStatus::finished:
        return ExitStatus::done;
    case SensitivityStatus::interrupted:
        return ExitStatus::interrupted;
    case SensitivityStatus::failed:
        return ExitStatus::incomplete;
    }
    throw std::logic_error("a sensitivity status without an exit status");
}

Sensitivity run(const Study& study, const Arguments& arguments, const CommonOptions& common) {
    ProgressLine line(common, "runs");
    SensitivityOptions options;
    options.threads = common.threads;
    options.stop_requested = &stop_requested();
    options.keeping = {arguments.output.string() + ".runs", arguments.resume};
    options.progress = [&](const SensitivityProgress& progress) {
        if (!progress.failure.empty())
            report(common, progress.failure);
        const double fraction = static_cast<double>(progress.runs) / std::max(1, progress.planned);
        line.show(std::min(1.0, fraction), progress.runs,
                  fmt::format("{} runs of {}, {} failed", progress.runs, progress.planned, progress.failed));
    };
    return study_sensitivity(study, options);
}

/// The result for a person; `crampfit csv OUT.h5 indices` prints all digits.
std::string table_text(const Sensitivity& sensitivity) {
    std::size_t output = std::string("output").size(), parameter = std::string("parameter").size();
    for (const SensitivityIndex& index : sensitivity.indices) {
        output = std::max(output, index.output.size());
        parameter = std::max(parameter, index.parameter.size());
    }
    std::string text =
        fmt::format("{:<{}}  {:<{}}  {:<10}  {:>11}  95 % interval\n", "output", output, "parameter", parameter, "kind", "value");
    for (const SensitivityIndex& index : sensitivity.indices)
        text += fmt::format("{:<{}}  {:<{}}  {:<10}  {:>11.4g}  {:.4g} .. {:.4g}\n", index.output, output, index.parameter,
                            parameter, index.kind, index.value, index.lower_95, index.upper_95);
    return text;
}

ExitStatus study_and_save(const Arguments& arguments, const CommonOptions& common) {
    check_output(arguments.output, arguments.study);
    Study study = read_study(arguments.study, overrides_of(common));
    if (study.scene)
        load_specimen(*study.scene);
    for (Experiment& experiment : study.experiments)
        load_specimen(experiment.scene);
    stop_on_signals();
    spdlog::info("the study is read");
    const Sensitivity sensitivity = run(study, arguments, common);
    write(sensitivity, arguments.output);
    report(common, fmt::format("{}: {}; {}, saved as {}", name(sensitivity.status), sensitivity.message,
                               duration_text(sensitivity.seconds), arguments.output.string()));
    print(table_text(sensitivity));
    return exit_status(sensitivity.status);
}

}  // namespace

Verb sensitivity_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<Arguments>();
    CLI::App* verb = command.add_subcommand("sensitivity", "Local, Morris and Sobol sensitivity of the chosen outputs");
    verb->add_option("study", arguments->study, "The study")->type_name("STUDY.toml")->required();
    verb->add_option("-o,--output", arguments->output, "Where the result goes")->type_name("OUT.h5")->required();
    verb->add_flag("--resume", arguments->resume, "Go on from the runs that an earlier call has kept beside its output");
    return {verb, [arguments, &common] { return study_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

#include "inverse/sensitivity.hpp"

#include "cli/study_verb.hpp"
#include "cli/verbs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace crampfit::cli {

namespace {

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

Sensitivity run(const Study& study, const StudyArguments& arguments, const CommonOptions& common, Ranks& ranks) {
    RunsLine line(common, "left");
    auto options = study_options<SensitivityOptions>(arguments, common, ranks);
    options.progress = [&](const SensitivityProgress& progress) {
        line.show(progress.runs, progress.planned, progress.failure,
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

ExitStatus study_and_save(const StudyArguments& arguments, const CommonOptions& common) {
    Ranks ranks(common.threads);
    if (!ranks.leads()) {
        ranks.serve([&](int) { return output_function(open_study(arguments.study, common), &stop_requested()); });
        return ExitStatus::done;
    }
    check_outputs(arguments, {arguments.study});
    const Study study = open_study(arguments.study, common);
    check_outputs(arguments, files_of(study));
    const Sensitivity sensitivity = run(study, arguments, common, ranks);
    save(sensitivity, arguments.output);
    const ExitStatus status = exit_status(sensitivity.status);
    const std::string end = fmt::format("{}: {}; {}, saved as {}", name(sensitivity.status), sensitivity.message,
                                        duration_text(sensitivity.seconds), arguments.output.string());
    report_end(common, end, status);
    print(table_text(sensitivity));
    return status;
}

}  // namespace

Verb sensitivity_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<StudyArguments>();
    CLI::App* verb = command.add_subcommand("sensitivity", "Local, Morris and Sobol sensitivity of the chosen outputs");
    add_study_arguments(*verb, *arguments, "OUT.h5");
    return {verb, [arguments, &common] { return study_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

#include "cli/study_verb.hpp"
#include "cli/verbs.hpp"
#include "inverse/compare.hpp"
#include "inverse/crack_paths.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>

namespace crampfit::cli {

namespace {

ExitStatus exit_status(FitStatus status) {
    switch (status) {
    case FitStatus::converged:
        return ExitStatus::done;
    case FitStatus::interrupted:
        return ExitStatus::interrupted;
    case FitStatus::run_limit:
    case FitStatus::failed:
        return ExitStatus::incomplete;
    }
    throw std::logic_error("a fit status without an exit status");
}

Fit run(const Study& study, const StudyArguments& arguments, const CommonOptions& common, Ranks& ranks) {
    RunsLine line(common, "left at most");
    auto options = study_options<FitOptions>(arguments, common, ranks);
    options.progress = [&](const FitProgress& progress) {
        const std::string most = progress.runs <= progress.max_runs ? fmt::format(" of {} at most", progress.max_runs) : "";
        line.show(progress.runs, progress.max_runs, progress.failure,
                  fmt::format("{}: {} runs{}, best misfit {:.4g}", progress.stage, progress.runs, most, progress.best_misfit));
    };
    Fit fit = fit_models(study, options);
    fit.crack_paths = crack_paths(study, fit, common.threads, &stop_requested());
    return fit;
}

/// What the other ranks do for the one that leads.
void serve(const StudyArguments& arguments, const CommonOptions& common, Ranks& ranks) {
    std::optional<Study> study;
    ranks.serve([&](int model) {
        if (!study) study = open_study(arguments.study, common);
        return fit_function(study->models.empty() ? *study : model_of(*study, static_cast<std::size_t>(model)),
                            &stop_requested());
    });
}

/// The result for a person; `crampfit csv FIT.h5 parameters` prints all digits.
std::string table_text(const Fit& fit) {
    std::size_t width = std::string("parameter").size();
    for (const FittedParameter& parameter : fit.parameters) width = std::max(width, parameter.name.size());
    std::string text =
        fmt::format("{:<{}}  {:>11}  {:>14}  {:>23}  unit\n", "parameter", width, "value", "standard error", "95 % interval");
    for (const FittedParameter& parameter : fit.parameters)
        text += fmt::format("{:<{}}  {:>11.4g}  {:>14.3g}  {:>23}  {}{}\n", parameter.name, width, parameter.value,
                            parameter.standard_error, fmt::format("{:.4g} .. {:.4g}", parameter.lower_95, parameter.upper_95),
                            parameter.unit, parameter.at_bound ? "  (at a bound)" : "");
    for (const ComparedModel& model : fit.models) {
        const SimulatedPath path = together(fit, model.name);
        const std::string off = path.compared_length > 0 ? fmt::format("  path off by {:.3g} mm on average, {:.3g} mm at most",
                                                                       1e3 * path.mean_distance, 1e3 * path.largest_distance)
                                                         : "";
        text += fmt::format("{:<24}  misfit {:>9.4g}  AIC {:>9.4g}  BIC {:>9.4g}  weight {:.3g}{}\n", model.name, model.misfit,
                            model.aic, model.bic, model.weight, off);
    }
    return text;
}

ExitStatus fit_and_save(const StudyArguments& arguments, const CommonOptions& common) {
    Ranks ranks(common.threads);
    if (!ranks.leads()) {
        serve(arguments, common, ranks);
        return ExitStatus::done;
    }
    check_outputs(arguments, {arguments.study});
    const Study study = open_study(arguments.study, common);
    check_outputs(arguments, files_of(study));
    const Fit fit = run(study, arguments, common, ranks);
    save(fit, arguments.output);
    double of_runs = 0;
    for (const auto& run : fit.runs) of_runs += run.seconds;
    const ExitStatus status = exit_status(fit.status);
    bool is_first = true;  // how it has ended; the others say what to make of it
    for (const std::string& sentence : sentences(fit.message)) {
        report_end(common, sentence, is_first ? status : ExitStatus::done);
        is_first = false;
    }
    report(common, fmt::format("{} runs in {}, each by itself {} in all, saved as {}", fit.runs.size(),
                               duration_text(fit.seconds), duration_text(of_runs), arguments.output.string()));
    print(table_text(fit));
    return status;
}

}  // namespace

Verb fit_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<StudyArguments>();
    CLI::App* verb = command.add_subcommand("fit", "Adjust parameters until the simulations match the experiments");
    add_study_arguments(*verb, *arguments, "FIT.h5");
    return {verb, [arguments, &common] { return fit_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

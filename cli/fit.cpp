#include "inverse/fit.hpp"

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

Fit run(const Study& study, const Arguments& arguments, const CommonOptions& common) {
    ProgressLine line(common, "runs");
    FitOptions options;
    options.threads = common.threads;
    options.stop_requested = &stop_requested();
    options.keeping = {arguments.output.string() + ".runs", arguments.resume};
    options.progress = [&](const FitProgress& progress) {
        if (!progress.failure.empty())
            report(common, progress.failure);
        const double fraction = std::min(1.0, static_cast<double>(progress.runs) / std::max(1, progress.max_runs));
        line.show(fraction, progress.runs,
                  fmt::format("{}: {} runs{}, best misfit {:.4g}", progress.stage, progress.runs,
                              progress.runs <= progress.max_runs ? fmt::format(" of {} at most", progress.max_runs) : "",
                              progress.best_misfit));
    };
    return fit_study(study, options);
}

/// The result for a person; `crampfit csv FIT.h5 parameters` prints all digits.
std::string table_text(const Fit& fit) {
    std::size_t width = std::string("parameter").size();
    for (const FittedParameter& parameter : fit.parameters)
        width = std::max(width, parameter.name.size());
    std::string text = fmt::format("{:<{}}  {:>11}  {:>14}  {:>23}  unit\n", "parameter", width, "value",
                                   "standard error", "95 % interval");
    for (const FittedParameter& parameter : fit.parameters)
        text += fmt::format("{:<{}}  {:>11.4g}  {:>14.3g}  {:>23}  {}{}\n", parameter.name, width, parameter.value,
                            parameter.standard_error,
                            fmt::format("{:.4g} .. {:.4g}", parameter.lower_95, parameter.upper_95), parameter.unit,
                            parameter.at_bound ? "  (at a bound)" : "");
    return text;
}

ExitStatus fit_and_save(const Arguments& arguments, const CommonOptions& common) {
    check_output(arguments.output, arguments.study);
    Study study = read_study(arguments.study, overrides_of(common));
    for (Experiment& experiment : study.experiments)
        load_specimen(experiment.scene);
    stop_on_signals();
    spdlog::info("the study is read");
    const Fit fit = run(study, arguments, common);
    write(fit, arguments.output);
    report(common, fmt::format("{}: {}; {} runs in {}, saved as {}", name(fit.status), fit.message, fit.runs.size(),
                               duration_text(fit.seconds), arguments.output.string()));
    print(table_text(fit));
    return exit_status(fit.status);
}

}  // namespace

Verb fit_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<Arguments>();
    CLI::App* verb = command.add_subcommand("fit", "Adjust parameters until the simulations match the experiments");
    verb->add_option("study", arguments->study, "The study")->type_name("STUDY.toml")->required();
    verb->add_option("-o,--output", arguments->output, "Where the fit goes")->type_name("FIT.h5")->required();
    verb->add_flag("--resume", arguments->resume, "Go on from the runs that an earlier call has kept beside its output");
    return {verb, [arguments, &common] { return fit_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

#include "inverse/study_check.hpp"

#include "datasets/error.hpp"
#include "inverse/minimize.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

void require(bool holds, const Study& study, const std::string& key, const std::string& value, const std::string& rule) {
    if (!holds) {
        throw InputError(study.file.empty() ? "study" : study.file.string(), key, value, rule);
    }
}

std::string text(double value) { return fmt::format("{:g}", value); }

void check_parameter(const Study& study, const Parameter& p, std::size_t index) {
    const std::string at = fmt::format("parameters.{}.", index);
    const auto columns = {"misfit", "status", "seconds"};  // of the table of runs, beside the parameters
    require(std::ranges::find(columns, p.name) == columns.end(), study, at + "name", p.name, "is the name of another column");
    require(!p.keys.empty(), study, at + "key", "absent", "a parameter needs a key of the scenes");
    require(std::isfinite(p.lower) && std::isfinite(p.upper) && p.lower < p.upper, study, at + "upper", text(p.upper),
            "must be above lower = " + text(p.lower));
    require(p.initial >= p.lower && p.initial <= p.upper, study, at + "initial", text(p.initial),
            fmt::format("must lie between lower = {:g} and upper = {:g}", p.lower, p.upper));
    require(p.scale == Scale::linear || p.lower > 0, study, at + "lower", text(p.lower), "must be positive on a log scale");
    require(!p.prior || p.prior->sd > 0, study, at + "prior.sd", p.prior ? text(p.prior->sd) : "", "must be positive");
}

void check_experiment(const Study& study, const Experiment& experiment, std::size_t index) {
    const std::string at = fmt::format("experiments.{}.", index);
    require(std::isfinite(experiment.weight) && experiment.weight > 0, study, at + "weight", text(experiment.weight),
            "must be positive");
    const Noise& noise = experiment.noise;
    const std::pair<const char*, std::optional<double>> sigmas[] = {{"force", noise.force},
                                                                    {"crack_length", noise.crack_length},
                                                                    {"displacement", noise.displacement},
                                                                    {"time", noise.time},
                                                                    {"displacement_field", noise.displacement_field}};
    for (const auto& [column, sigma] : sigmas) {
        require(!sigma || (std::isfinite(*sigma) && *sigma > 0), study, at + "noise." + column, text(sigma.value_or(0)),
                "must be positive; leave it out to have it estimated");
    }
}

}  // namespace

void check_study(const Study& study) {
    require(!study.experiments.empty(), study, "experiments", "none", "a fit needs an experiment with data");
    require(!study.parameters.empty(), study, "parameters", "none", "a fit needs a parameter to adjust");
    for (std::size_t i = 0; i < study.parameters.size(); ++i) {
        check_parameter(study, study.parameters[i], i);
    }
    for (std::size_t i = 0; i < study.experiments.size(); ++i) {
        check_experiment(study, study.experiments[i], i);
    }
    const OptimizerChoice& optimizer = study.optimizer;
    const auto& names = method_names();
    require(std::find(names.begin(), names.end(), optimizer.method) != names.end(), study, "optimizer.method", optimizer.method,
            fmt::format("must be one of {}", fmt::join(names, ", ")));
    require(optimizer.starts >= 1, study, "optimizer.starts", std::to_string(optimizer.starts), "must be at least 1");
    require(optimizer.max_runs >= 1, study, "optimizer.max_runs", std::to_string(optimizer.max_runs), "must be at least 1");
    require(study.uncertainty.posterior >= 0, study, "uncertainty.posterior", std::to_string(study.uncertainty.posterior),
            "must not be negative");
}

void check_one_model(const Study& study) {
    require(study.models.empty(), study, "compare", study.compared_key,
            "only a fit compares models: leave it out, and give the key's value in the scene or by --set");
}

void check_sensitivity_study(const Study& study) {
    check_one_model(study);
    require(!scenes_of(study).empty(), study, "scene", "none", "a sensitivity study needs a scene, or experiments with scenes");
    require(!study.outputs.empty(), study, "outputs", "none", "a sensitivity study needs outputs to look at");
    for (const Scene* scene : scenes_of(study)) {
        for (const StudyOutput& output : study.outputs) {
            const double end = scene->stop.displacement.value_or(output.at);
            require(output.at <= end * (1 + 1e-9), study, "outputs", output.name,
                    fmt::format("no run comes there: stop.displacement is {:g} mm", 1e3 * end));
        }
    }
    require(!study.parameters.empty(), study, "parameters", "none", "a sensitivity study needs a parameter to vary");
    for (std::size_t i = 0; i < study.parameters.size(); ++i) {
        check_parameter(study, study.parameters[i], i);
    }
}

}  // namespace crampfit

#include "inverse/sensitivity.hpp"

#include "datasets/error.hpp"
#include "inverse/kept_walks.hpp"
#include "inverse/local_design.hpp"
#include "inverse/morris.hpp"
#include "inverse/objective.hpp"
#include "inverse/outputs.hpp"
#include "inverse/pool.hpp"
#include "inverse/saltelli.hpp"
#include "inverse/scene_runs.hpp"
#include "inverse/study_check.hpp"
#include "inverse/unit_box.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace crampfit {
namespace {

constexpr int default_rows = 512;         // of Sobol's method
constexpr int default_trajectories = 20;  // of Morris' method

/// The outputs of a study as a function on its unit cube.
class OutputModel {
  public:
    OutputModel(const Study& study, Forward forward, const std::atomic<bool>* stop)
        : study_(study), runs_(study, std::move(forward), stop), box_(study.parameters) {
        for (std::size_t i = 0; i < runs_.size(); ++i) {
            for (const StudyOutput& output : study.outputs) {
                names_.push_back({runs_.size() > 1 ? study.experiments[i].name + ": " + output.name : output.name,
                                  unit_of(output.kind)});
            }
        }
    }

    const UnitBox& box() const { return box_; }
    const std::vector<StudiedOutput>& names() const { return names_; }

    /// `residuals` are the outputs; empty when a scene's run failed.
    Evaluation evaluate(const Eigen::VectorXd& x, int threads) const {
        const Eigen::VectorXd values = box_.values(x);
        std::vector<SceneRuns::Outcome> outcomes(runs_.size());
        parallel_for(static_cast<int>(outcomes.size()), threads,
                     [&](int i) { outcomes[static_cast<std::size_t>(i)] = runs_.run(static_cast<std::size_t>(i), values); });
        Evaluation result;
        std::vector<double> outputs;
        bool good = true;
        for (std::size_t i = 0; i < outcomes.size(); ++i) {
            const SceneRuns::Outcome& outcome = outcomes[i];
            const std::string who = outcomes.size() > 1 ? study_.experiments[i].name + ": " : "";
            result.status += (result.status.empty() ? "" : "; ") + who + outcome.status;
            result.seconds += outcome.seconds;
            good = good && outcome.record;
            for (std::size_t k = 0; good && k < study_.outputs.size(); ++k) {
                outputs.push_back(output_of(*outcome.record, study_.outputs[k]));
            }
        }
        if (good) {
            result.residuals = Eigen::Map<Eigen::VectorXd>(outputs.data(), static_cast<Eigen::Index>(outputs.size()));
        }
        return result;
    }

  private:
    const Study& study_;
    SceneRuns runs_;
    UnitBox box_;
    std::vector<StudiedOutput> names_;
};

using Evaluations = std::vector<std::shared_ptr<const Evaluation>>;

/// Collects the rows of the table `indices`.
class Indices {
  public:
    Indices(Sensitivity& result, SensitivityMethod method) : result_(result), method_(name(method)) {}

    void add(std::size_t output, const char* kind, const std::vector<Estimate>& of_parameters) {
        for (std::size_t j = 0; j < of_parameters.size(); ++j) {
            const auto& [value, lower, upper] = of_parameters[j];
            result_.indices.push_back({result_.outputs[output].name, result_.parameters[j].name, method_, value,
                                       std::min(lower, upper), std::max(lower, upper), kind});
        }
    }

  private:
    Sensitivity& result_;
    const char* method_;
};

// One output's values at all points; not a number where it could not be had.
std::vector<double> values_of(const Evaluations& evaluations, std::size_t output) {
    std::vector<double> values;
    for (const auto& evaluation : evaluations) {
        const bool there = evaluation && evaluation->usable();
        values.push_back(there ? evaluation->residuals[static_cast<Eigen::Index>(output)]
                               : std::numeric_limits<double>::quiet_NaN());
    }
    return values;
}

std::vector<Estimate> scaled(std::vector<Estimate> estimates, const std::vector<double>& factors) {
    for (std::size_t j = 0; j < estimates.size(); ++j) {
        estimates[j] = {estimates[j].value * factors[j], estimates[j].lower_95 * factors[j], estimates[j].upper_95 * factors[j]};
    }
    return estimates;
}

// Derivatives by the parameters in their units, and elasticities: p / y dy/dp.
void add_local(Indices& indices, std::size_t output, const UnitBox& box, const Eigen::VectorXd& x,
               const std::vector<Estimate>& by_x, double value) {
    std::vector<double> by_parameter, relative;
    for (Eigen::Index j = 0; j < box.size(); ++j) {
        const double slope = box.slope(j, x[j]);
        by_parameter.push_back(box.parameters()[static_cast<std::size_t>(j)].unit_factor / slope);
        relative.push_back(box.value(j, x[j]) / slope / value);
    }
    indices.add(output, "derivative", scaled(by_x, by_parameter));
    indices.add(output, "elasticity", scaled(by_x, relative));
}

// Runs what the method asks for, and makes of it what it gives.
void apply_method(const Study& study, const UnitBox& box, Objective& objective, unsigned seed, Sensitivity& result) {
    const int samples = study.sensitivity.samples;
    Indices indices(result, study.sensitivity.method);
    const auto for_each_output = [&](const std::vector<Eigen::VectorXd>& points, const auto& add) {
        const Evaluations evaluations = objective.at(points);
        for (std::size_t k = 0; k < result.outputs.size(); ++k) {
            add(k, values_of(evaluations, k));
        }
    };
    switch (study.sensitivity.method) {
    case SensitivityMethod::local: {
        // Derivatives that a solver gives exactly would take the place of these differences.
        const LocalDesign design(box.initial());
        for_each_output(design.points(), [&](std::size_t k, const std::vector<double>& values) {
            add_local(indices, k, box, design.points().front(), design.derivatives(values), values.front());
        });
        break;
    }
    case SensitivityMethod::morris: {
        const MorrisDesign design(box.size(), samples > 0 ? samples : default_trajectories, seed);
        for_each_output(design.points(), [&](std::size_t k, const std::vector<double>& values) {
            const MorrisDesign::Measures measures = design.measures(values);
            indices.add(k, "mu_star", measures.mu_star);
            indices.add(k, "sigma", measures.sigma);
        });
        break;
    }
    case SensitivityMethod::sobol: {
        const SaltelliDesign design(box.size(), samples > 0 ? samples : default_rows, seed);
        for_each_output(design.points(), [&](std::size_t k, const std::vector<double>& values) {
            const SaltelliDesign::Indices of_output = design.indices(values);
            indices.add(k, "first", of_output.first);
            indices.add(k, "total", of_output.total);
        });
        break;
    }
    }
}

// How many runs the method takes, those at the same point counted each time.
int runs_of(const Study& study) {
    const int p = static_cast<int>(study.parameters.size());
    const int samples = study.sensitivity.samples;
    switch (study.sensitivity.method) {
    case SensitivityMethod::local:
        return 1 + 4 * p;
    case SensitivityMethod::morris:
        return (samples > 0 ? samples : default_trajectories) * (p + 1);
    case SensitivityMethod::sobol:
        return (samples > 0 ? samples : default_rows) * (p + 2);
    }
    return 0;
}

void fill_parameters(const UnitBox& box, Sensitivity& result) {
    for (const Parameter& parameter : box.parameters()) {
        StudiedParameter& row = result.parameters.emplace_back();
        row.name = parameter.name;
        for (const std::string& key : parameter.keys) {
            row.key += (row.key.empty() ? "" : " ") + key;
        }
        row.unit = parameter.unit;
        row.initial = parameter.initial / parameter.unit_factor;
        row.lower = parameter.lower / parameter.unit_factor;
        row.upper = parameter.upper / parameter.unit_factor;
    }
}

void fill_runs(const UnitBox& box, const std::vector<Run>& runs, Sensitivity& result) {
    for (const Run& run : runs) {
        SensitivityRun& row = result.runs.emplace_back();
        row.parameters = in_units(box, run.x);
        row.outputs.assign(result.outputs.size(), std::numeric_limits<double>::quiet_NaN());
        if (run.evaluation->usable()) {
            row.outputs.assign(run.evaluation->residuals.begin(), run.evaluation->residuals.end());
        }
        row.status = run.evaluation->status;
        row.seconds = run.evaluation->seconds;
    }
}

// Failed runs and outputs that some runs do not have, counted.
void conclude(const std::vector<Run>& runs, bool stopped, Sensitivity& result) {
    const auto failed = std::count_if(runs.begin(), runs.end(), [](const Run& run) { return !run.evaluation->usable(); });
    const auto good = static_cast<std::ptrdiff_t>(runs.size()) - failed;
    result.status = stopped     ? SensitivityStatus::interrupted
                    : good == 0 ? SensitivityStatus::failed
                                : SensitivityStatus::finished;
    result.message = fmt::format("{} runs ended well", good);
    if (failed > 0) {
        const auto first = std::find_if(runs.begin(), runs.end(), [](const Run& run) { return !run.evaluation->usable(); });
        result.message += fmt::format("; {} of {} runs failed and are left out; the first: {}", failed, runs.size(),
                                      first->evaluation->status);
    }
    for (std::size_t k = 0; k < result.outputs.size() && good > 0; ++k) {
        const auto without = std::count_if(result.runs.begin(), result.runs.end(), [&](const SensitivityRun& run) {
            return std::isnan(run.outputs[k]);
        }) - failed;
        if (without > 0) {
            result.message += fmt::format("; {} runs have no '{}' and are left out there", without, result.outputs[k].name);
        }
    }
}

}  // namespace

void SensitivityOptions::validate() const {
    if (threads < 0) {
        throw InputError("sensitivity options", "threads", std::to_string(threads), "must be 0, for one a core, or more");
    }
}

Sensitivity study_sensitivity(const Study& study, const SensitivityOptions& options) {
    options.validate();
    check_sensitivity_study(study);
    const auto begin = std::chrono::steady_clock::now();
    const OutputModel model(study, options.forward ? options.forward : KeptWalks(study).exact(),
                            options.stop_requested);
    Sensitivity result;
    result.seed = options.seed;
    result.study_text = study.text;
    result.outputs = model.names();
    fill_parameters(model.box(), result);

    SensitivityProgress progress;
    progress.planned = runs_of(study);
    RunStore store(options.keeping, study, options.stop_requested);
    Objective objective(
        model.box().size(),
        [&](const Eigen::VectorXd& x, int threads) {
            return store.at(model.box().values(x), [&] { return model.evaluate(x, threads); });
        },
        progress.planned, thread_count(options.threads), options.stop_requested, [&](const Run& run) {
            ++progress.runs;
            progress.failed += run.evaluation->usable() ? 0 : 1;
            progress.failure = failure_text(study, model.box().values(run.x), *run.evaluation);
            if (options.progress) {
                options.progress(progress);
            }
        });
    apply_method(study, model.box(), objective, options.seed, result);
    fill_runs(model.box(), objective.runs(), result);
    conclude(objective.runs(), objective.stopped(), result);
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return result;
}

}  // namespace crampfit

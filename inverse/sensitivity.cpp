#include "inverse/sensitivity.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "inverse/kept_walks.hpp"
#include "inverse/local_design.hpp"
#include "inverse/morris.hpp"
#include "inverse/objective.hpp"
#include "inverse/output_model.hpp"
#include "inverse/pool.hpp"
#include "inverse/run_store.hpp"
#include "inverse/saltelli.hpp"
#include "inverse/study_check.hpp"
#include "inverse/unit_box.hpp"
#include "inverse/walk_slopes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

namespace crampfit {
namespace {

constexpr int default_rows = 512;         // of Sobol's method
constexpr int default_trajectories = 20;  // of Morris' method

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

// How many of the runs that ended well have no such output.
std::ptrdiff_t lacking(const std::vector<Run>& runs, std::size_t output) {
    return std::ranges::count_if(runs, [&](const Run& run) {
        return run.evaluation->usable() && std::isnan(run.evaluation->residuals[static_cast<Eigen::Index>(output)]);
    });
}

// They are left out. Beyond a hundredth what is left is no box, where Sobol's indices are of parameters that vary independently.
bool leaves_no_box(const std::vector<Run>& runs, std::size_t output) {
    const auto good = std::ranges::count_if(runs, [](const Run& run) { return run.evaluation->usable(); });
    return static_cast<double>(lacking(runs, output)) > 0.01 * static_cast<double>(good);
}

bool has_failed(const Run& run) { return !run.evaluation->usable() && !was_stopped(*run.evaluation); }

// The same of runs that failed, where it is the parameters that made them fail and not chance: then their means, squares and
// products are not those of as many runs drawn from all.
bool failures_leave_no_box(const std::vector<Run>& runs) {
    constexpr double most_chance = 4;  // standard deviations
    const auto all = static_cast<double>(runs.size()), failed = static_cast<double>(std::ranges::count_if(runs, has_failed));
    if (failed <= 0.01 * all || failed == all) {
        return false;
    }
    const auto hangs_on = [&](const auto& quantity) {
        double sum = 0, squares = 0, sum_of_failed = 0;
        for (const Run& run : runs) {
            const double q = quantity(run.x);
            sum += q;
            squares += q * q;
            sum_of_failed += has_failed(run) ? q : 0.0;
        }
        const double mean = sum / all, variance = squares / all - mean * mean;
        return std::abs(sum_of_failed - failed * mean) > most_chance * std::sqrt(failed * (1 - failed / all) * variance);
    };
    const Eigen::Index p = runs.front().x.size();
    for (Eigen::Index i = 0; i < p; ++i) {
        if (hangs_on([i](const Eigen::VectorXd& x) { return x[i]; })) {
            return true;
        }
        for (Eigen::Index j = 0; j <= i; ++j) {
            if (hangs_on([i, j](const Eigen::VectorXd& x) { return (x[i] - 0.5) * (x[j] - 0.5); })) {
                return true;
            }
        }
    }
    return false;
}

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
        for (double* number : {&estimates[j].value, &estimates[j].lower_95, &estimates[j].upper_95}) {
            *number *= factors[j];
            if (std::isnan(*number)) {
                *number = std::numeric_limits<double>::quiet_NaN();  // 0 / 0 has a sign on some machines
            }
        }
    }
    return estimates;
}

// From derivatives by the parameters in SI, those by the parameters in their units, and elasticities: p / y dy/dp.
void add_local(Indices& indices, std::size_t output, const UnitBox& box, const std::vector<Estimate>& by_si, double value) {
    std::vector<double> units, relative;
    for (const Parameter& parameter : box.parameters()) {
        units.push_back(parameter.unit_factor);
        relative.push_back(parameter.initial / value);
    }
    indices.add(output, "derivative", scaled(by_si, units));
    indices.add(output, "elasticity", scaled(by_si, relative));
}

// Of one output by each parameter in SI; the interval spans what is seen from either side.
std::vector<Estimate> estimates_of(const WalkSlopes& slopes, std::size_t output) {
    const auto row = static_cast<Eigen::Index>(output);
    std::vector<Estimate> by_si;
    for (Eigen::Index j = 0; j < slopes.from_below.cols(); ++j) {
        const double below = slopes.from_below(row, j), above = slopes.from_above(row, j);
        by_si.push_back({0.5 * (below + above), below, above});
    }
    return by_si;
}

/// Derivatives that one run's walk has, by some parameters: their numbers in the study, and those at the initial point.
struct ExactSlopes {
    std::vector<std::size_t> parameters;
    std::function<std::optional<WalkSlopes>()> at_initial;
};

// By differences of whole runs, but for parameters by which they are known. Whether the output jumps among them.
bool add_differences(Indices& indices, std::size_t output, const UnitBox& box, const LocalDesign& design,
                     const std::vector<double>& values, const ExactSlopes& exact, const std::optional<WalkSlopes>& slopes) {
    const Eigen::VectorXd& x = design.points().front();
    std::vector<double> to_si;
    for (Eigen::Index j = 0; j < box.size(); ++j) {
        to_si.push_back(1.0 / box.slope(j, x[j]));
    }
    bool jumps = false;
    std::vector<Estimate> by_si = scaled(design.derivatives(values, &jumps), to_si);
    if (slopes) {
        const std::vector<Estimate> known = estimates_of(*slopes, output);
        for (std::size_t k = 0; k < known.size(); ++k) {
            by_si[exact.parameters[k]] = known[k];
        }
    }
    add_local(indices, output, box, by_si, values.front());
    return jumps;
}

std::optional<WalkSlopes> slopes_at(const Study& study, const KeptWalks& walks, const Eigen::VectorXd& values,
                                    const std::atomic<bool>* stop) {
    const OutputModel near(study, walks.near({values.begin(), values.end()}), stop);
    return walk_slopes([&](const Eigen::VectorXd& v) { return near.at(v, 1); }, values, study.parameters);
}

// The same study of those parameters alone that stand for numbers of the wood; the others have their initial values.
std::pair<Study, std::vector<std::size_t>> of_wood_alone(const Study& study) {
    std::pair<Study, std::vector<std::size_t>> part{study, {}};
    part.first.parameters.clear();
    for (std::size_t j = 0; j < study.parameters.size(); ++j) {
        const Parameter& parameter = study.parameters[j];
        if (std::ranges::all_of(parameter.keys, [](const std::string& key) { return key.starts_with("materials."); })) {
            part.first.parameters.push_back(parameter);
            part.second.push_back(j);
            continue;
        }
        for (std::size_t k = 0; k < parameter.keys.size(); ++k) {
            set_number(*part.first.scene, parameter.keys[k], parameter.factor(k) * parameter.initial);
        }
    }
    return part;
}

// Runs what the method asks for, and makes of it what it gives.
void apply_method(const Study& study, const UnitBox& box, Objective& objective, const ExactSlopes& exact, unsigned seed,
                  Sensitivity& result) {
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
        const std::optional<WalkSlopes> slopes = exact.at_initial ? exact.at_initial() : std::nullopt;
        if (exact.parameters.size() == study.parameters.size()) {
            for_each_output({box.initial()}, [&](std::size_t k, const std::vector<double>& values) {
                if (slopes) {
                    add_local(indices, k, box, estimates_of(*slopes, k), values.front());
                }
            });
            break;
        }
        const LocalDesign design(box.initial(), exact.parameters);
        for_each_output(design.points(), [&](std::size_t k, const std::vector<double>& values) {
            if (add_differences(indices, k, box, design, values, exact, slopes)) {
                result.message +=
                    fmt::format("; '{}' jumps near the initial point, its derivatives are told from one side of that",
                                result.outputs[k].name);
            }
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
        for_each_output(design.points(), [&](std::size_t k, std::vector<double> values) {
            if (failures_leave_no_box(objective.runs()) || leaves_no_box(objective.runs(), k)) {
                std::ranges::fill(values, std::numeric_limits<double>::quiet_NaN());
            }
            const SaltelliDesign::Indices of_output = design.indices(values);
            indices.add(k, "first", of_output.first);
            indices.add(k, "total", of_output.total);
        });
        break;
    }
    }
}

// How many runs the method takes, those at the same point counted each time.
int runs_of(const Study& study, std::size_t exact) {
    const int p = static_cast<int>(study.parameters.size());
    const int samples = study.sensitivity.samples;
    switch (study.sensitivity.method) {
    case SensitivityMethod::local:
        return 1 + 4 * (p - static_cast<int>(exact));
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
void conclude(const std::vector<Run>& runs, SensitivityMethod method, bool stopped, Sensitivity& result) {
    const auto is_good = [](const Run& run) { return run.evaluation->usable(); };
    const auto failed = std::ranges::count_if(runs, has_failed);
    const auto good = std::ranges::count_if(runs, is_good);
    const bool told = std::ranges::any_of(result.indices, [](const SensitivityIndex& index) { return !std::isnan(index.value); });
    result.status = stopped ? SensitivityStatus::interrupted : told ? SensitivityStatus::finished : SensitivityStatus::failed;
    result.message = fmt::format("{} runs ended well", good) + result.message;
    if (failed > 0) {
        const auto first = std::ranges::find_if(runs, has_failed);
        const bool no_box = method == SensitivityMethod::sobol && failures_leave_no_box(runs);
        result.message += fmt::format("; {} of {} runs failed {}; the first: {}", failed, runs.size(),
                                      no_box ? "where the parameters made them, and without those the parameters are not "
                                               "independent any more: no Sobol indices; narrow the box"
                                             : "and are left out",
                                      first->evaluation->status);
    }
    for (std::size_t k = 0; k < result.outputs.size() && good > 0; ++k) {
        if (const auto without = lacking(runs, k); without > 0) {
            const bool no_box = method == SensitivityMethod::sobol && leaves_no_box(runs, k);
            result.message +=
                fmt::format("; {} runs have no '{}' {}", without, result.outputs[k].name,
                            no_box ? "and without them parameters are not independent any more: no Sobol indices of it; "
                                     "narrow the box, or choose an output that all runs have"
                                   : "and are left out there");
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
    const auto begin = std::chrono::steady_clock::now();
    check_sensitivity_study(study);
    const KeptWalks walks(study);
    const bool own = !options.forward;
    // The same bits for any number of threads: runs that go on from one another are made one after the other.
    const bool in_order = own && walks.only_toughness() && walks.depend_on_order();
    const Forward forward = !own ? options.forward : in_order ? walks.exact() : walks.in_any_order();
    const OutputModel model(study, forward, options.stop_requested);
    const int threads = thread_count(options.threads);
    ExactSlopes exact;
    const bool is_local = own && study.sensitivity.method == SensitivityMethod::local;
    const bool all_exact = is_local && walks.has_exact_slopes();
    std::pair<Study, std::vector<std::size_t>> part;
    std::optional<KeptWalks> part_walks;
    if (all_exact) {
        exact.parameters.resize(study.parameters.size());
        std::iota(exact.parameters.begin(), exact.parameters.end(), std::size_t{0});
        exact.at_initial = [&] {
            return slopes_at(study, walks, model.box().values(model.box().initial()), options.stop_requested);
        };
    } else if (is_local && study.scene) {
        part = of_wood_alone(study);
        if (!part.second.empty() && part_walks.emplace(part.first).has_exact_slopes()) {
            exact.parameters = part.second;
            exact.at_initial = [&] {
                const UnitBox box(part.first.parameters);
                return slopes_at(part.first, *part_walks, box.values(box.initial()), options.stop_requested);
            };
        }
    }
    Sensitivity result;
    result.seed = options.seed;
    result.study_text = study.text;
    result.scene_settings = scene_settings_text(study);
    result.outputs = model.names();
    fill_parameters(model.box(), result);

    SensitivityProgress progress;
    progress.planned = runs_of(study, exact.parameters.size());
    Sharing shared([&](const Eigen::VectorXd& values, int share) { return model.at(values, in_order ? threads : share); },
                   threads, in_order ? nullptr : options.farm);
    RunStore store(options.keeping, study, options.stop_requested);
    Objective objective(
        model.box().size(),
        [&](const Eigen::VectorXd& x, int share) {
            const Eigen::VectorXd values = model.box().values(x);
            return store.at(values, [&] { return shared(values, share); });
        },
        progress.planned, in_order ? 1 : shared.places(), options.stop_requested,
        [&](const Run& run) {
            ++progress.runs;
            progress.failed += run.evaluation->usable() ? 0 : 1;
            progress.failure = failure_text(study, model.box().values(run.x), *run.evaluation);
            if (options.progress) {
                options.progress(progress);
            }
        });
    apply_method(study, model.box(), objective, exact, options.seed, result);
    fill_runs(model.box(), objective.runs(), result);
    conclude(objective.runs(), study.sensitivity.method, objective.stopped(), result);
    if (exact.at_initial && !result.indices.empty()) {
        std::vector<std::string> names;
        for (const std::size_t j : exact.parameters) {
            names.push_back("'" + study.parameters[j].name + "'");
        }
        result.message += all_exact
                              ? "; derivatives are exact, by the solver"
                              : fmt::format("; derivatives by {} are exact, by the solver, the others by differences of runs",
                                            fmt::join(names, ", "));
    }
    if (std::ranges::any_of(study.parameters, [](const Parameter& parameter) { return parameter.prior.has_value(); })) {
        result.message += "; priors do not count, parameters go evenly over their box";
    }
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return result;
}

StudyFunction output_function(const Study& study, const std::atomic<bool>* stop) {
    const auto kept = std::make_shared<const Study>(study);
    const auto model = std::make_shared<OutputModel>(*kept, KeptWalks(*kept).in_any_order(), stop);
    return [kept, model](const Eigen::VectorXd& values, int threads) { return model->at(values, threads); };
}

std::vector<std::string> output_names(const Study& study) {
    std::vector<std::string> names;
    const OutputModel model(study, Forward(), nullptr);
    for (const auto& output : model.names()) {
        names.push_back(output.name);
    }
    return names;
}

std::optional<Eigen::MatrixXd> output_slopes(const Study& study, const Eigen::VectorXd& values, const std::atomic<bool>* stop) {
    const KeptWalks walks(study);
    const auto slopes = walks.has_exact_slopes() ? slopes_at(study, walks, values, stop) : std::nullopt;
    return slopes ? std::optional(slopes->mean()) : std::nullopt;
}

}  // namespace crampfit

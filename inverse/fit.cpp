#include "inverse/fit.hpp"

#include "datasets/error.hpp"
#include "inverse/close_look.hpp"
#include "inverse/curve_distance.hpp"
#include "inverse/differences.hpp"
#include "inverse/explore.hpp"
#include "inverse/grid_share.hpp"
#include "inverse/kept_walks.hpp"
#include "inverse/lack_of_fit.hpp"
#include "inverse/pool.hpp"
#include "inverse/run_end.hpp"
#include "inverse/run_store.hpp"
#include "inverse/search.hpp"
#include "inverse/study_check.hpp"
#include "inverse/study_model.hpp"
#include "inverse/study_runs.hpp"
#include "inverse/uncertainty.hpp"
#include "inverse/walk_slopes.hpp"
#include "inverse/wide_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <limits>
#include <mutex>
#include <optional>

namespace crampfit {
namespace {

constexpr double bound_tolerance = 1e-4;   // of the box
constexpr int held_runs_a_parameter = 10;  // at most, to follow what cannot be told; the table of runs does not hold them

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

/// Tells the caller after each run where the fit stands.
class Reporter {
  public:
    Reporter(const FitOptions& options, const Study& study, const UnitBox& box) : options_(options), study_(study), box_(box) {
        progress_.max_runs = study.optimizer.max_runs;
        progress_.best_misfit = std::numeric_limits<double>::infinity();
    }

    void set_stage(const std::string& stage) {
        const std::lock_guard lock(mutex_);
        progress_.stage = stage;
    }

    // After a run that is none of the fit's own.
    void look() {
        const std::lock_guard lock(mutex_);
        tell("");
    }

    void add(const Run& run) {
        const std::lock_guard lock(mutex_);
        ++progress_.runs;
        if (run.evaluation->usable() && run.evaluation->misfit < progress_.best_misfit) {
            take_as_best(run);
        }
        tell(failure_text(study_, box_.values(run.x), *run.evaluation));
    }

    // All runs have been weighed anew: misfits of before say nothing any more.
    void start_anew_from(const Run& best) {
        const std::lock_guard lock(mutex_);
        take_as_best(best);
        tell("");
    }

  private:
    void tell(const std::string& failure) {
        progress_.seconds = seconds_since(begin_);
        progress_.failure = failure;
        if (options_.progress) {
            options_.progress(progress_);
        }
    }

    void take_as_best(const Run& run) {
        progress_.best_misfit = run.evaluation->misfit;
        progress_.best = in_units(box_, run.x);
    }

    const FitOptions& options_;
    const Study& study_;
    const UnitBox& box_;
    Clock::time_point begin_ = Clock::now();
    std::mutex mutex_;
    FitProgress progress_;
};

FittedParameter describe(const Parameter& parameter) {
    FittedParameter result;
    result.name = parameter.name;
    for (const std::string& key : parameter.keys) {
        result.key += (result.key.empty() ? "" : " ") + key;
    }
    result.unit = parameter.unit;
    result.initial = parameter.initial / parameter.unit_factor;
    return result;
}

// From the unit cube to the parameters' units: intervals end by end, so that on a log scale they are not symmetric; the
// covariance by the slope at the best point (delta method).
void fill_parameters(Fit& fit, const UnitBox& box, const Eigen::VectorXd& x, const Uncertainty& uncertainty) {
    constexpr double most_of_box = 0.5;
    const Eigen::Index p = box.size();
    Eigen::VectorXd slope(p);
    for (Eigen::Index j = 0; j < p; ++j) {
        const Parameter& parameter = box.parameters()[static_cast<std::size_t>(j)];
        slope[j] = box.slope(j, x[j]) / parameter.unit_factor;
        FittedParameter fitted = describe(parameter);
        fitted.value = box.value(j, x[j]) / parameter.unit_factor;
        fitted.standard_error = slope[j] * std::sqrt(uncertainty.covariance(j, j));
        fitted.lower_95 = box.value(j, uncertainty.lower_95[j]) / parameter.unit_factor;
        fitted.upper_95 = box.value(j, uncertainty.upper_95[j]) / parameter.unit_factor;
        fitted.at_bound = x[j] < bound_tolerance || x[j] > 1 - bound_tolerance;
        const bool to_lower = uncertainty.lower_95[j]<bound_tolerance, to_upper = uncertainty.upper_95[j]> 1 - bound_tolerance;
        if (fitted.at_bound) {
            fit.message += fmt::format("'{}' stands at its {} bound. ", parameter.name, x[j] < 0.5 ? "lower" : "upper");
        } else if (to_lower != to_upper && uncertainty.upper_95[j] - uncertainty.lower_95[j] > most_of_box) {
            fit.message +=
                fmt::format("The data do not bound '{}' {} within its bounds. ", parameter.name, to_lower ? "below" : "above");
        }
        fit.parameters.push_back(fitted);
    }
    fit.covariance = slope.asDiagonal() * uncertainty.covariance * slope.asDiagonal();
    const Eigen::VectorXd sd = uncertainty.covariance.diagonal().cwiseSqrt();
    fit.correlation = uncertainty.covariance.cwiseQuotient(sd * sd.transpose());
}

void fill_runs(Fit& fit, const UnitBox& box, const std::vector<Run>& runs) {
    for (const Run& run : runs) {
        fit.runs.push_back({in_units(box, run.x), run.evaluation->misfit, run.evaluation->status, run.evaluation->seconds});
    }
}

// No run to speak of: nothing is known beyond the box.
void fill_failure(Fit& fit, const UnitBox& box, const Objective& objective) {
    const Eigen::Index p = box.size();
    const Uncertainty nothing{{},
                              Eigen::MatrixXd::Identity(p, p) / 12.0,
                              Eigen::VectorXd::Zero(p),
                              Eigen::VectorXd::Ones(p),
                              std::numeric_limits<double>::infinity(),
                              ""};
    fill_parameters(fit, box, box.initial(), nothing);
    for (FittedParameter& parameter : fit.parameters) {
        parameter.value = std::numeric_limits<double>::quiet_NaN();
    }
    fit.misfit = nothing.reduced_chi_square;
    fit.reduced_chi_square = nothing.reduced_chi_square;
    fit.message += objective.runs().empty()
                       ? "No run was made. "
                       : fmt::format("No run ended well; the first: {}. ", objective.runs().front().evaluation->status);
}

std::string contradicted_priors(const UnitBox& box, const Eigen::VectorXd& x) {
    constexpr double far = 3;  // standard deviations
    std::string text;
    const Eigen::VectorXd values = box.values(x);
    for (Eigen::Index j = 0; j < box.size(); ++j) {
        const Parameter& parameter = box.parameters()[static_cast<std::size_t>(j)];
        const double off = parameter.prior ? (values[j] - parameter.prior->mean) / parameter.prior->sd : 0.0;
        if (std::abs(off) > far) {
            text += fmt::format(
                "The data and the prior of '{}' contradict each other: the fit lies {:.2g} standard deviations of the "
                "prior {} its mean. ",
                parameter.name, std::abs(off), off > 0 ? "above" : "below");
        }
    }
    return text;
}

const char* explain(FitStatus status) {
    switch (status) {
    case FitStatus::converged:
        return "Converged. ";
    case FitStatus::run_limit:
        return "All runs that optimizer.max_runs allows were used up before the end. ";
    case FitStatus::interrupted:
        return "Interrupted. ";
    case FitStatus::failed:
        return "Failed. ";
    }
    return "";
}

}  // namespace

void FitOptions::validate() const {
    if (threads < 0) {
        throw InputError("fit options", "threads", std::to_string(threads), "must be 0, for one a core, or more");
    }
}

Fit fit_study(const Study& as_given, const FitOptions& options) {
    options.validate();
    const auto begin = Clock::now();
    const bool own = !options.forward;
    check_study(as_given);
    const Study study = with_runs_to_the_data(as_given);
    StudyModel(study, {}, 0.0, nullptr);  // bad data are refused before there is a file for runs
    const int threads = thread_count(options.threads);
    RunStore store(options.keeping, study, options.stop_requested);
    const UnitBox box(study.parameters);
    Reporter reporter(options, study, box);
    StudyRuns runs(
        study, options, store, 1.0, [&](const Run& run) { reporter.add(run); },
        [&](const Run& best) { reporter.start_anew_from(best); });
    const bool by_walks = runs.by_walks(), only_toughness = runs.only_toughness();
    const StudyModel& model = runs.model();
    Objective& objective = runs.objective();

    // The differences that the intervals rest on are part of the budget, and must not be eaten up by the search.
    const int reserve = std::min(static_cast<int>(2 * box.size()), study.optimizer.max_runs / 3);
    objective.set_budget_left(study.optimizer.max_runs - reserve);
    const auto stage = [&](const std::string& name) { reporter.set_stage(name); };
    WideSearch before(study, options, store, [&] { reporter.look(); });
    const bool has_begun = by_walks && before.find_start(stage);
    SearchResult found = has_begun  ? runs.descend(1, before.best(), stage)
                         : by_walks ? runs.descend(stage)
                                    : runs.search(box.initial(), stage);
    found.method += before.method();
    objective.set_budget_left(objective.budget_left() + reserve);

    Fit fit;
    fit.method = found.method;
    fit.seed = options.seed;
    fit.study_text = study.text;
    fit.scene_settings = scene_settings_text(study);
    if (!objective.best()) {
        fit.status = objective.stopped() ? FitStatus::interrupted : FitStatus::failed;
        fit.message = explain(fit.status);
        fill_failure(fit, box, objective);
    } else {
        reporter.set_stage("uncertainty");
        std::vector<std::string> names;
        for (const Parameter& parameter : study.parameters) {
            names.push_back(parameter.name);
        }
        std::optional<CloseLook> close;  // where runs near the best one are cheap, as the simulation has derivatives
        std::future<Evaluation> wide;    // there, on cells twice as wide, what the look is about
        Run looked_at;                   // that
        const auto estimate = [&] {
            if (!runs.has_walks()) {
                return estimate_uncertainty(objective, model.curves(), names, difference_step, Window(box.size()));
            }
            const auto look = [&] {
                if (wide.valid()) {  // of what was the best point before: the same runs for any number of threads
                    wide.wait();
                }
                looked_at = *objective.best();
                const Eigen::VectorXd x = looked_at.x;
                runs.walks().catch_up(runs.values_at(x));
                wide = std::async(threads > 1 ? std::launch::async : std::launch::deferred, [&, x] { return before.at(x); });
                const std::vector<bool> exact = runs.walks().exact_near();
                const bool all_exact = std::all_of(exact.begin(), exact.end(), [](bool one) { return one; });
                int left = held_runs_a_parameter * static_cast<int>(box.size());
                const auto lowest_held = [&, left](const Eigen::VectorXd& start,
                                                   Eigen::Index held) mutable -> std::optional<Run> {
                    if (left <= 0) {
                        return std::nullopt;
                    }
                    Objective beside = objective.branch(left, objective.threads());
                    const auto lowest = descend_held(beside, runs.nearby(), start, held, options.seed);
                    left = beside.budget_left();
                    return lowest;
                };
                const NearRuns near{runs.nearby().near(x), all_exact, runs.walks().depend_on_order() ? 1 : objective.threads(),
                                    lowest_held};
                return look_close(objective, near, x, model.curves(), names, options.seed);
            };
            // A method that the study names has had its search; a lower point that a look comes upon is taken as it is.
            close = look_and_descend(objective, look, [&] {
                if (by_walks) {
                    found.converged = runs.descend_again();
                }
            });
            return close ? close->uncertainty
                         : estimate_uncertainty(objective, model.curves(), names, difference_step, Window(box.size()));
        };
        const auto look_around = [&](const Uncertainty& about) {
            if (!study.uncertainty.profile && study.uncertainty.posterior == 0) {
                return Exploration();
            }
            const bool cheap = own ? runs.has_walks() : options.cheap_runs;
            const auto stations = static_cast<int>(about.best.evaluation->modelled.size());
            return explore(objective, close ? &*close : nullptr, about, study.uncertainty, stations, cheap, options.seed, stage);
        };
        Uncertainty uncertainty = estimate();
        Exploration exploration = look_around(uncertainty);
        // It may have come upon a better point. About that one, then, where it is not as good as the same.
        if (!close && is_lower(*objective.best(), uncertainty.best, uncertainty)) {
            objective.set_budget_left(reserve);
            uncertainty = estimate();
            exploration = look_around(uncertainty);
        }
        const Run best = *objective.best();
        const Run& about = wide.valid() ? looked_at : uncertainty.best;
        const Evaluation there = !own ? Evaluation() : wide.valid() ? wide.get() : before.at(about.x);
        fit.status = objective.stopped() ? FitStatus::interrupted : found.converged ? FitStatus::converged : FitStatus::run_limit;
        fit.message = explain(fit.status);
        fill_parameters(fit, box, best.x, uncertainty);
        fit.message += uncertainty.message;
        if (close && !only_toughness) {
            fit.message += "What is said of intervals rests on runs moved from the best one by its derivatives. ";
        }
        fill_exploration(fit, box, uncertainty, exploration);
        if (own) {
            if (there.usable() && uncertainty.slope.size() > 0) {
                take_in_grid(fit, box, best.x, left_by_grid(study, model, about, there, uncertainty));
            } else {
                take_in_untold_grid(fit, box, best.x,
                                    there.usable() ? "no slopes at the best point" : "cells twice as wide: " + there.status);
            }
        }
        fit.misfit = best.evaluation->misfit;
        fit.reduced_chi_square = uncertainty.reduced_chi_square;
        fit.residuals = model.residuals(*best.evaluation);
        fit.checks = check_fit(fit.residuals, static_cast<int>(box.size()));
        fit.distances = curve_distances(fit.residuals);
        fit.message +=
            contradicted_priors(box, best.x) + opposite_forces(fit.residuals) + lack_of_fit(fit.checks) + model.remarks();
        if (own) {
            fit.message += runs.walks().other_strain(runs.values_at(best.x));
            fit.message +=
                fmt::format("Beyond the noise of the data the model is taken to know what it says to within {:.2g} %. ",
                            100 * model.resolution());
        }
    }
    if (options.tell_wide_deviance && by_walks && objective.best() && !objective.stopped() && before.descend(stage)) {
        options.tell_wide_deviance(before.deviance(),
                                   model.likely_knowledge(*objective.best()->evaluation, solver_resolution).deviance);
    }
    fill_runs(fit, box, objective.runs());
    fit.seconds = seconds_since(begin);
    return fit;
}

namespace {

// Without a fit nothing tells how much of it is needed: at equilibrium the noise is what the study says.
double resolution_before_fit(const KeptWalks& walks) { return walks.at_equilibrium() ? 0.0 : solver_resolution; }

}  // namespace

StudyFunction fit_function(const Study& study, const std::atomic<bool>* stop) {
    check_one_model(study);
    const auto kept = std::make_shared<const Study>(with_runs_to_the_data(study));
    const KeptWalks walks(*kept);
    const auto model = std::make_shared<StudyModel>(*kept, walks.in_any_order(), resolution_before_fit(walks), stop);
    return [kept, model](const Eigen::VectorXd& values, int threads) { return model->at(values, threads); };
}

std::size_t residual_count(const Study& as_given) {
    const Study study = with_runs_to_the_data(as_given);
    return StudyModel(study, Forward(), 0.0, nullptr).residual_count();
}

std::optional<Eigen::MatrixXd> fit_slopes(const Study& as_given, const Eigen::VectorXd& values, const std::atomic<bool>* stop) {
    const Study study = with_runs_to_the_data(as_given);
    const KeptWalks walks(study);
    if (!walks.has_exact_slopes()) {
        return std::nullopt;
    }
    const StudyModel near(study, walks.near({values.begin(), values.end()}), resolution_before_fit(walks), stop);
    const auto slopes = walk_slopes([&](const Eigen::VectorXd& v) { return near.at(v, 1); }, values, study.parameters);
    return slopes ? std::optional(slopes->mean()) : std::nullopt;
}

}  // namespace crampfit

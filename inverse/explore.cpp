#include "inverse/explore.hpp"

#include "inverse/differences.hpp"
#include "inverse/local_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

namespace crampfit {
namespace {

constexpr int runs_of_a_profile = 5000;
constexpr double long_chain = 50;     // in correlation times: as the authors of emcee advise (Foreman-Mackey et al. 2013)
constexpr int runs_for_a_sample = 4;  // those left out at the begin and moves that are not made included

// Stands for the model where runs are dear: polynomials of the residuals over the runs about the best one, as wide as the
// intervals are. Absent where too few runs are near.
std::optional<Objective> surrogate(const Objective& objective, const Uncertainty& uncertainty) {
    const Eigen::VectorXd& x = uncertainty.best.x;
    const double widest = uncertainty.quantile * std::sqrt(uncertainty.covariance.diagonal().maxCoeff());
    const auto model = LocalModel::fit(objective.runs(), x, std::clamp(widest, difference_reach, 0.5));
    if (!model) {
        return std::nullopt;
    }
    return Objective(
        x.size(),
        [model = *model](const Eigen::VectorXd& at, int) {
            Evaluation evaluation;
            evaluation.residuals = model.residuals(at);
            evaluation.misfit = evaluation.residuals.squaredNorm();
            return evaluation;
        },
        0, 1);
}

}  // namespace

Exploration explore(Objective& objective, CloseLook* close, const Uncertainty& uncertainty, const UncertaintyChoice& choice,
                    int data_residuals, bool cheap, unsigned seed, const std::function<void(const std::string&)>& stage) {
    Exploration result;
    std::optional<Objective> polynomials = cheap ? std::nullopt : surrogate(objective, uncertainty);
    if (uncertainty.model_variance.size() == 0 || (!cheap && !polynomials)) {
        result.message = "Too few runs ended well near the best one for a profile or a posterior. ";
        return result;
    }
    if ((!cheap || (close && !close->is_exact)) && !uncertainty.untold.empty()) {
        result.message = "No profile and no posterior: what runs about the best one tell does not reach as far as what cannot be "
                         "told. ";
        return result;
    }
    Objective& model = !cheap ? *polynomials : close ? close->objective : objective;
    const Window window = cheap && close ? close->window : Window(uncertainty.best.x.size());
    if (!cheap) {
        result.message =
            "Profile and posterior rest on polynomials of the residuals over the runs about the best one, as each run "
            "of the model is dear. ";
    }
    if (choice.profile) {
        stage("profile");
        const Run best = cheap ? uncertainty.best : [&] {
            model.set_budget_left(1);
            return Run{uncertainty.best.x, model.at(uncertainty.best.x)};
        }();
        for (Eigen::Index j = 0; j < model.parameters(); ++j) {
            const double rise = uncertainty.rise[j];
            if (cheap && close) {
                CloseLook::Along way = close->along(j);
                way.objective.set_budget_left(runs_of_a_profile);
                const double half_width = uncertainty.quantile * std::sqrt(way.covariance(0, 0));
                Profile profile = profile_likelihood(way.objective, way.best, 0, half_width, rise, way.alone);
                for (double& x : profile.x) {
                    x = std::clamp(way.window.origin[j] + x * way.window.axes(j, 0), 0.0, 1.0);
                }
                result.profiles.push_back(profile);
                const std::vector<Run> seen = way.seen();
                result.seen.insert(result.seen.end(), seen.begin(), seen.end());
            } else {
                model.set_budget_left(runs_of_a_profile);
                const double half_width = uncertainty.quantile * std::sqrt(uncertainty.covariance(j, j));
                result.profiles.push_back(profile_likelihood(model, best, j, half_width, rise));
            }
        }
    }
    if (choice.posterior > 0) {
        stage("posterior");
        model.set_budget_left(1000 * static_cast<int>(model.parameters()) + runs_for_a_sample * choice.posterior);
        const auto log_likelihood = [&](const Evaluation& evaluation) {
            const Eigen::VectorXd& r = evaluation.residuals;
            const double of_priors = r.tail(r.size() - data_residuals).squaredNorm() / uncertainty.prior_weight;
            return -0.5 * (r.head(data_residuals).squaredNorm() / uncertainty.temperature + of_priors);
        };
        const Eigen::MatrixXd inverse = window.axes.inverse();
        result.posterior = draw_ensemble(model, log_likelihood, window.share(uncertainty.best.x),
                                         inverse * uncertainty.covariance * inverse.transpose(), choice.posterior, seed);
        for (Run& sample : result.posterior.samples) {
            sample.x = window.inside(sample.x);
        }
        const double time = result.posterior.correlation_time.maxCoeff();
        result.message += fmt::format(
            "{} samples of the posterior, worth {:.0f} independent ones ({:.0f} % of the moves made); flat within the bounds on "
            "each parameter's scale but for priors. ",
            result.posterior.samples.size(), static_cast<double>(result.posterior.samples.size()) / time,
            100 * result.posterior.acceptance);
        if (result.posterior.sweeps < long_chain * time) {
            result.message +=
                fmt::format("So short a chain shows that roughly: its correlation time is {:.0f} of {} sweeps; {:.0f} "
                            "samples would show it well. ",
                            time, result.posterior.sweeps,
                            static_cast<double>(choice.posterior) * long_chain * time / result.posterior.sweeps);
        }
    }
    return result;
}

void fill_exploration(Fit& fit, const UnitBox& box, const Uncertainty& uncertainty, const Exploration& exploration) {
    fit.message += exploration.message;
    for (std::size_t j = 0; j < exploration.profiles.size(); ++j) {
        const auto k = static_cast<Eigen::Index>(j);
        const Profile& profile = exploration.profiles[j];
        FittedParameter& parameter = fit.parameters[j];
        const auto value_at = [&](double x) { return box.value(k, x) / box.parameters()[j].unit_factor; };
        for (std::size_t i = 0; i < profile.x.size(); ++i) {
            fit.profile.push_back({parameter.name, value_at(profile.x[i]), profile.misfit[i]});
        }
        const double least = *std::min_element(profile.misfit.begin(), profile.misfit.end());
        auto [lower, upper] = interval(profile, least, uncertainty.rise[k]);
        std::tie(lower, upper) = holding(exploration.seen, least, uncertainty.rise[k], k, lower, upper);
        // The model's own scatter, which no profile of it shows, comes on top.
        const double x = uncertainty.best.x[k];
        const double own = uncertainty.quantile * std::sqrt(uncertainty.model_variance[k]);
        parameter.lower_95 = value_at(std::max(0.0, x - std::hypot(x - lower, own)));
        parameter.upper_95 = value_at(std::min(1.0, x + std::hypot(upper - x, own)));
        if (lower == 0.0 || upper == 1.0) {
            const std::string text =
                fmt::format("The data do not bound '{}' {} within {}. ", parameter.name,
                            lower > 0.0   ? "above"
                            : upper < 1.0 ? "below"
                                          : "above or below",
                            profile.x.front() > 0.0 && profile.x.back() < 1.0 ? "many standard errors" : "its bounds");
            if (fit.message.find(text) == std::string::npos) {
                fit.message += text;
            }
        }
    }
    if (!exploration.profiles.empty() && fit.message.find("profile likelihood") == std::string::npos) {
        fit.message += "The intervals are those of the profile likelihood. ";
    }
    for (const Run& sample : exploration.posterior.samples) {
        fit.posterior.push_back({in_units(box, sample.x), sample.evaluation->misfit});
    }
}

}  // namespace crampfit

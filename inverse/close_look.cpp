#include "inverse/close_look.hpp"

#include "inverse/differences.hpp"
#include "inverse/profile.hpp"
#include "inverse/walk_descent.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {
namespace {

constexpr double first_distance = 1e-5;  // of the box
constexpr double rise = 9;               // of the misfit, in what the noise explains: three standard errors, the others held
constexpr double room = 3;               // for correlation, and from one window to a wider one
constexpr double errors_wide = 12;       // half width in standard errors: a difference is three quarters of one
constexpr double agreement = 1.4;        // of a window with the errors that it finds
constexpr int most_rounds = 6;
constexpr int most_profiles = 4;  // in windows of rising width

bool all_told(const Uncertainty& u) { return u.untold.empty() && u.model_variance.size() > 0; }

bool is_whole(const Window& window) { return window.width().minCoeff() >= 1.0; }

// As far along each axis, either way, as the misfit needs to rise.
Window as_wide_as_the_misfit_says(const Objective::Evaluate& near, const Eigen::VectorXd& x) {
    const Evaluation here = near(x, 1);
    const double noise =
        std::max(1.0, here.misfit / static_cast<double>(std::max<Eigen::Index>(1, here.residuals.size() - x.size())));
    const auto distance = [&](Eigen::Index j, double side) {
        double d = first_distance;
        for (; d < 1.0; d *= 2) {
            Eigen::VectorXd at = x;
            at[j] = std::clamp(x[j] + side * d, 0.0, 1.0);
            const Evaluation there = near(at, 1);
            if (!there.usable() || there.misfit - here.misfit > rise * noise) {
                break;
            }
        }
        return d;
    };
    Eigen::VectorXd below(x.size()), above(x.size());
    for (Eigen::Index j = 0; j < x.size(); ++j) {
        below[j] = room * distance(j, -1);
        above[j] = room * distance(j, 1);
    }
    return {x, below, above};
}

// Alike to either side: the edge of a jump nearby says nothing of the valley along it.
Window wider(const Window& window, const Eigen::VectorXd& x) {
    return {x, Eigen::VectorXd(room * (x - window.low).cwiseMax(window.high - x))};
}

// Puts the profile's intervals in the place of those of a parabola. False where one of them does not end in the window.
bool take_profile(CloseLook& look) {
    Uncertainty& u = look.uncertainty;
    if (u.model_variance.size() == 0) {
        return false;
    }
    const bool told = all_told(u);
    const double level = u.quantile * u.quantile * u.widening;
    Eigen::VectorXd lower(u.lower_95.size()), upper(u.lower_95.size());
    for (Eigen::Index j = 0; j < lower.size(); ++j) {
        double below = 0, above = 0;  // distances
        const double own = told ? u.quantile * std::sqrt(u.model_variance[j]) : 0.0;
        if (told) {
            const double variance = u.covariance(j, j) - u.model_variance[j];
            const Eigen::VectorXd valley = u.covariance.col(j) / u.covariance(j, j);
            const auto end = [&](int side) {
                const double least = look.objective.best()->evaluation->misfit;
                return profile_end(look.objective, u.best, j, side, u.quantile * std::sqrt(variance), valley, least, level);
            };
            const auto low = end(-1), high = low ? end(1) : std::nullopt;
            if (!high) {
                return false;
            }
            below = *low;
            above = *high;
        } else {
            constexpr double coarse = 0.1;  // of the window: twice the profile's steps
            const Profile profile = profile_likelihood(look.objective, u.best, j, coarse, level);
            const auto ends = interval(profile, *std::min_element(profile.misfit.begin(), profile.misfit.end()), level);
            if (ends.first <= 0.0 || ends.second >= 1.0) {
                return false;
            }
            below = u.best.x[j] - ends.first;
            above = ends.second - u.best.x[j];
        }
        // The model's own scatter, which no profile of it shows, comes on top.
        lower[j] = std::max(0.0, u.best.x[j] - std::hypot(below, own));
        upper[j] = std::min(1.0, u.best.x[j] + std::hypot(above, own));
    }
    // A descent that stays above its lowest point makes a profile narrow, never wide: a parabola that is there has its say.
    u.lower_95 = told ? Eigen::VectorXd(lower.cwiseMin(u.lower_95)) : lower;
    u.upper_95 = told ? Eigen::VectorXd(upper.cwiseMax(u.upper_95)) : upper;
    if (!told) {
        u.covariance = ((upper - lower) / (2 * u.quantile)).cwiseAbs2().asDiagonal();
        u.message.erase(u.message.find(u.untold), u.untold.size());
        u.untold.clear();
    }
    u.message += told ? "The intervals are the wider of those of the covariance and of the profile likelihood. "
                      : "The intervals are those of the profile likelihood. ";
    return true;
}

}  // namespace

Uncertainty CloseLook::in_box() const {
    Uncertainty result = uncertainty;
    const Eigen::VectorXd width = window.width();
    result.best.x = window.inside(uncertainty.best.x);
    result.covariance = width.asDiagonal() * uncertainty.covariance * width.asDiagonal();
    result.lower_95 = window.inside(uncertainty.lower_95);
    result.upper_95 = window.inside(uncertainty.upper_95);
    if (result.model_variance.size() > 0) {
        result.model_variance = width.cwiseAbs2().cwiseProduct(uncertainty.model_variance);
    }
    return result;
}

std::optional<CloseLook> look_close(const Objective& objective, const Objective::Evaluate& near, const Eigen::VectorXd& x,
                                    const std::vector<int>& curve_lengths, const std::vector<std::string>& names, unsigned seed) {
    // Nothing where the user's stop comes before the first run.
    const auto look = [&](const Window& window) -> std::optional<CloseLook> {
        const auto evaluate = [near, window](const Eigen::VectorXd& y, int threads) { return near(window.inside(y), threads); };
        CloseLook here{
            window, Objective(x.size(), evaluate, std::numeric_limits<int>::max(), objective.threads(), objective.stop()), {}};
        spread_about(here.objective, window.share(x), difference_step, seed);
        if (!here.objective.best()) {
            return std::nullopt;
        }
        here.uncertainty = estimate_uncertainty(here.objective, curve_lengths, names, difference_step);
        return here;
    };
    const auto first = look(as_wide_as_the_misfit_says(near, x));
    if (!first) {
        return std::nullopt;
    }
    CloseLook found = *first;
    while (!all_told(found.uncertainty) && !is_whole(found.window)) {
        auto here = look(wider(found.window, x));
        if (!here) {
            break;
        }
        found = std::move(*here);
    }
    for (int round = 0; round < most_rounds && all_told(found.uncertainty) && !objective.stopped(); ++round) {
        const Eigen::VectorXd errors = found.uncertainty.covariance.diagonal().cwiseSqrt().cwiseProduct(found.window.width());
        const Window wanted(x, errors_wide * errors);
        const Eigen::VectorXd ratio = wanted.width().cwiseQuotient(found.window.width());
        if (ratio.maxCoeff() < agreement && ratio.minCoeff() > 1 / agreement) {
            break;
        }
        auto here = look(wanted);
        if (!here || !all_told(here->uncertainty)) {
            break;
        }
        found = std::move(*here);
    }
    auto profiled = std::optional(all_told(found.uncertainty) ? found : *first);
    for (int i = 0; i < most_profiles && profiled && !objective.stopped(); ++i) {
        if (take_profile(*profiled)) {
            return profiled;
        }
        profiled = look(wider(profiled->window, x));
    }
    return found;
}

}  // namespace crampfit

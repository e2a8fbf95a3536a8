#include "inverse/close_look.hpp"

#include "inverse/differences.hpp"
#include "inverse/walk_descent.hpp"

#include <algorithm>
#include <limits>

namespace crampfit {
namespace {

constexpr double first_widths[] = {1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001};  // half widths, of the box
constexpr double errors_wide = 12;          // half width in standard errors: a difference is three quarters of one
constexpr double agreement = 1.4;           // of a window with the errors that it finds
constexpr double least_width = 1e-5;        // of the box
constexpr int most_rounds = 6;

bool all_told(const Uncertainty& u) { return ((u.upper_95 - u.lower_95).array() < 1.0).all(); }

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

CloseLook look_close(const Objective& objective, const Objective::Evaluate& near, const Eigen::VectorXd& x,
                     const std::vector<int>& curve_lengths, const std::vector<std::string>& names, unsigned seed) {
    const auto look = [&](const Window& window) {
        const auto evaluate = [near, window](const Eigen::VectorXd& y, int threads) { return near(window.inside(y), threads); };
        CloseLook here{window, Objective(x.size(), evaluate, std::numeric_limits<int>::max(), objective.threads(), objective.stop()), {}};
        spread_about(here.objective, window.share(x), difference_step, seed);
        here.uncertainty = estimate_uncertainty(here.objective, curve_lengths, names, difference_step);
        return here;
    };
    CloseLook found = look(Window(x, first_widths[0]));
    for (std::size_t i = 1; i < std::size(first_widths) && !all_told(found.uncertainty) && !objective.stopped(); ++i) {
        CloseLook narrower = look(Window(x, first_widths[i]));
        if (all_told(narrower.uncertainty)) {
            found = std::move(narrower);
        }
    }
    for (int round = 0; round < most_rounds && all_told(found.uncertainty) && !objective.stopped(); ++round) {
        const Eigen::VectorXd half = found.uncertainty.covariance.diagonal().cwiseSqrt().cwiseProduct(found.window.width());
        const Window wanted(x, (errors_wide * half).cwiseMax(least_width));
        const Eigen::VectorXd ratio = wanted.width().cwiseQuotient(found.window.width());
        if (ratio.maxCoeff() < agreement && ratio.minCoeff() > 1 / agreement) {
            break;
        }
        CloseLook here = look(wanted);
        if (!all_told(here.uncertainty)) {
            break;
        }
        found = std::move(here);
    }
    return found;
}

}  // namespace crampfit

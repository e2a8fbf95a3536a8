#include "inverse/differences.hpp"
#include "inverse/local_model.hpp"
#include "inverse/minimize.hpp"

#include <algorithm>
#include <optional>
#include <vector>

namespace crampfit {
namespace {

// Parts of the box. The last radius is that of the differences: below it a run's noise outweighs what a step changes.
constexpr double first_radius = 0.12;
constexpr double largest_radius = 0.3;
constexpr double last_radius = difference_step;
constexpr double least_step = 0.02 * difference_step;
constexpr double least_gain = 2e-4;  // of the misfit: of hundreds, a small part of what moves a parameter by one standard error
constexpr int most_stalls = 2;       // steps at the last radius that gain nothing
constexpr int most_tries = 3;        // of a run beside a point

// Runs the differences about x, each one that fails nearer by a little, some times at most: a side that no run has seen may be
// where the misfit is lower.
void run_about(Objective& objective, const Eigen::VectorXd& x, double radius) {
    std::vector<Eigen::VectorXd> points = stencil(x, radius);
    for (int i = 0; i < most_tries && !points.empty(); ++i) {
        const auto runs = objective.at(points);
        std::vector<Eigen::VectorXd> nearer;
        for (std::size_t k = 0; k < points.size(); ++k) {
            if (runs[k] && !runs[k]->usable()) {
                nearer.push_back(x + 0.8 * (points[k] - x));
            }
        }
        points = std::move(nearer);
    }
}

// A model of the runs about x; where they do not span all directions, after running the differences about it.
std::optional<LocalModel> model_about(Objective& objective, const Eigen::VectorXd& x, double radius) {
    auto model = LocalModel::fit(objective.runs(), x, 1.5 * radius);
    if (!model) {
        run_about(objective, x, radius);
        model = LocalModel::fit(objective.runs(), x, 1.5 * radius);
    }
    return model;
}

// Runs what has not been run of the differences about x; whether there were any.
bool refresh(Objective& objective, const Eigen::VectorXd& x, double radius) {
    const std::size_t before = objective.runs().size();
    run_about(objective, x, radius);
    return objective.runs().size() > before;
}

// Looks round farther away before an end is believed: a model's noise makes hollows about as wide as its last steps. And to where
// the differences alone say: runs that steps have left close by tell more of the noise.
bool in_a_hollow(Objective& objective, const Run& best) {
    run_about(objective, best.x, first_radius);
    std::vector<Run> apart{best};
    for (const Run& run : objective.runs()) {
        if ((run.x - best.x).cwiseAbs().maxCoeff() > 0.3 * last_radius) {
            apart.push_back(run);
        }
    }
    if (const auto model = LocalModel::fit(apart, best.x, 1.5 * last_radius)) {
        objective.at(lowest_point(*model, best.x, last_radius));
    }
    return objective.best()->evaluation->misfit < (1 - least_gain) * best.evaluation->misfit;
}

}  // namespace

// A Gauss-Newton trust region on regression models of the residuals: Wild (2017), POUNDERS; Cartis and Roberts (2019),
// DFO-GN. Ours fits by least squares all runs in reach instead of interpolating a chosen few, which averages the noise
// of the model, and its radius ends at the difference step instead of going to zero.
Solution minimize_on_models(Objective& objective, const Eigen::VectorXd& start) {
    objective.at(start);
    double radius = first_radius;
    int stalls = 0;
    while (!objective.exhausted() && objective.best()) {
        const Run best = *objective.best();
        const auto model = model_about(objective, best.x, radius);
        if (!model) {
            if (radius <= last_radius) {
                return {false, "too many runs failed around the best one"};
            }
            radius = std::max(0.5 * radius, last_radius);
            continue;
        }
        const Eigen::VectorXd trial = lowest_point(*model, best.x, radius);
        const double step = (trial - best.x).cwiseAbs().maxCoeff();
        const double expected = model->residuals(best.x).squaredNorm() - model->residuals(trial).squaredNorm();
        const bool promising = step >= least_step && expected >= least_gain * best.evaluation->misfit;
        if (radius <= last_radius && (!promising || stalls >= most_stalls)) {
            if (refresh(objective, best.x, radius)) {
                stalls = objective.best()->evaluation->misfit < best.evaluation->misfit ? 0 : stalls;
                continue;
            }
            if (!in_a_hollow(objective, best)) {
                return {true, promising ? "the noise of the model hides any further gain" : "no step promises a smaller misfit"};
            }
            radius = first_radius;
            stalls = 0;
            continue;
        }
        if (!promising) {
            radius = std::max(radius / 3, last_radius);
            continue;
        }
        // The point half way costs no time where a second core is idle, and tells the next model about the curvature.
        objective.at(std::vector<Eigen::VectorXd>{trial, 0.5 * (trial + best.x)});
        const double gain = best.evaluation->misfit - objective.best()->evaluation->misfit;
        if (gain < 0.1 * expected) {
            stalls += radius <= last_radius ? 1 : 0;
            radius = std::max(0.5 * radius, last_radius);
        } else {
            stalls = 0;
            radius = gain > 0.5 * expected && step > 0.9 * radius ? std::min(2 * radius, largest_radius) : radius;
        }
    }
    return {false, objective.best() ? "the runs were used up" : "the run at the start failed"};
}

}  // namespace crampfit

#include "inverse/grid_share.hpp"

#include "forward/kept_walk.hpp"

#include <Eigen/QR>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace crampfit {
namespace {

// Of the largest, all columns being of length one: below that a slope is curvature.
constexpr double resolved = 1e-3;

// Of a parameter's size: farther off, the wide cells are not near enough to the truth for errors to go with a power of the
// cell, nor slopes at the best point for the way there. From there to twice as far what is told of the others loses its weight.
constexpr double farthest_told = 0.1;

// Of the variance that the data leave: not worth a word.
constexpr double nothing = 1e-4;

// Of a toughness: what is left where two grids happen to agree.
constexpr double least_of_toughness = 0.01;

bool is_toughness(const Parameter& parameter) {
    return std::ranges::any_of(parameter.keys, [](const std::string& key) { return key.ends_with(".toughness"); });
}

bool is_modulus(const Parameter& parameter) {
    return std::ranges::any_of(parameter.keys, [](const std::string& key) { return key.starts_with("materials."); }) &&
           !is_toughness(parameter);
}

bool has_two_grids(const Experiment& experiment) { return KeptWalk(experiment.scene).extrapolates(); }

// What a parameter's shifts are large or small beside, SI: its value, and where that may be near 0 half of its box.
double size_of(const Parameter& parameter, double value) {
    return parameter.scale == Scale::linear ? std::max(std::abs(value), 0.5 * (parameter.upper - parameter.lower)) : value;
}

// Data tell nothing of it.
bool is_whole_box(const Parameter& parameter, const FittedParameter& fitted) {
    const double rounding = 1e-9 * (parameter.upper - parameter.lower);
    return fitted.lower_95 * parameter.unit_factor <= parameter.lower + rounding &&
           fitted.upper_95 * parameter.unit_factor >= parameter.upper - rounding;
}

// A shift [SI] of a parameter from a value, as a part of it, or in its unit where the value may be near 0.
std::string shift_text(const Parameter& parameter, double value, double shift) {
    return size_of(parameter, value) > std::abs(value)
               ? fmt::format("'{}' {:+.2g} {}", parameter.name, shift / parameter.unit_factor, parameter.unit)
               : fmt::format("'{}' {:+.2g} %", parameter.name, 100 * shift / value);
}

// Moves the end of an interval on by a part of the box, within it.
void go_on(const UnitBox& box, Eigen::Index j, double& end, double by) {
    const double unit = box.parameters()[static_cast<std::size_t>(j)].unit_factor;
    end = box.value(j, box.share(j, end * unit) + by) / unit;
}

// Of a parameter in its unit, by its place in the box.
double slope_in_unit(const UnitBox& box, Eigen::Index j, const Eigen::VectorXd& x) {
    return box.slope(j, x[j]) / box.parameters()[static_cast<std::size_t>(j)].unit_factor;
}

void add_covariance(Fit& fit, const Eigen::MatrixXd& more) {
    fit.covariance += more;
    const Eigen::VectorXd sd = fit.covariance.diagonal().cwiseSqrt();
    for (Eigen::Index j = 0; j < sd.size(); ++j) {
        fit.parameters[static_cast<std::size_t>(j)].standard_error = sd[j];
    }
    fit.correlation = fit.covariance.cwiseQuotient(sd * sd.transpose());
}

// [parameters x columns of `change`]
Eigen::MatrixXd least_squares(const Eigen::MatrixXd& slope, const Eigen::MatrixXd& change) {
    const Eigen::VectorXd scale = slope.colwise().norm().unaryExpr([](double length) { return length > 0 ? 1 / length : 1.0; });
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factors;
    factors.setThreshold(resolved);
    factors.compute(slope * scale.asDiagonal());
    return scale.asDiagonal() * factors.solve(change);
}

// Changes of residuals, each stretch of an experiment's curve on which they go one way in a column of its own.
Eigen::MatrixXd stretches_of(const Eigen::VectorXd& change, const std::vector<FitResidual>& stations) {
    std::vector<Eigen::Index> column(stations.size(), 0);
    for (std::size_t i = 1; i < stations.size(); ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        const bool goes_on = stations[i].experiment == stations[i - 1].experiment && stations[i].kind == stations[i - 1].kind &&
                             change[row] * change[row - 1] >= 0;
        column[i] = column[i - 1] + (goes_on ? 0 : 1);
    }
    Eigen::MatrixXd found = Eigen::MatrixXd::Zero(change.size(), column.empty() ? 1 : column.back() + 1);
    for (std::size_t i = 0; i < stations.size(); ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        found(row, column[i]) = change[row];
    }
    return found;
}

// Takes in what the grid leaves as far as it is trusted, from 1 to 0, and else a tenth of each parameter by itself. `left` to
// either side, but not more than that tenth [parameters, of the unit cube].
void take_in(Fit& fit, const UnitBox& box, const Eigen::VectorXd& x, const Eigen::VectorXd& left, double trust) {
    Eigen::VectorXd own(box.size());  // in the parameters' units
    for (Eigen::Index j = 0; j < box.size(); ++j) {
        FittedParameter& fitted = fit.parameters[static_cast<std::size_t>(j)];
        const Parameter& parameter = box.parameters()[static_cast<std::size_t>(j)];
        const double most = farthest_told * size_of(parameter, box.value(j, x[j])) / box.slope(j, x[j]);
        const double by = std::lerp(most, std::min(std::abs(left[j]), most), trust);
        go_on(box, j, fitted.lower_95, -by);
        go_on(box, j, fitted.upper_95, by);
        own[j] = slope_in_unit(box, j, x) * std::copysign(by, left[j]);
    }
    Eigen::MatrixXd more = trust * own * own.transpose();
    more.diagonal() = own.cwiseAbs2();
    add_covariance(fit, more / 3.0);  // the mean square of what is spread evenly, from 0 to 1 or from -1 to 1
}

std::string untold_grid(const std::string& why) {
    return fmt::format(
        "What the grid leaves cannot be told: {}. Intervals go on by up to a tenth of the value to either side for "
        "it, which may be too little: finer cells would tell. ",
        why);
}

}  // namespace

Eigen::VectorXd left_by_grid(const Study& study, StudyModel model, const Run& best, Evaluation wide, const Uncertainty& about) {
    const Eigen::VectorXd values = model.box().values(best.x);
    Evaluation here = *best.evaluation;
    const std::vector<FitResidual> before = model.residuals(here);
    model.set_resolution(model.likely_resolution(wide, solver_resolution));
    model.weigh(here, values);
    model.weigh(wide, values);
    const std::vector<FitResidual> after = model.residuals(here);
    std::map<std::string, double> share;
    bool on_one_grid = false;
    for (const Experiment& experiment : study.experiments) {
        const bool two_grids = has_two_grids(experiment);
        // Of the difference between what a scene gives and what it gives on wide cells: that between the two grids by themselves.
        share[experiment.name] = two_grids ? 0.75 : 1.0;
        on_one_grid = on_one_grid || !two_grids;
    }
    Eigen::VectorXd change = wide.residuals - here.residuals;
    Eigen::MatrixXd slope = about.slope;
    for (std::size_t i = 0; i < before.size(); ++i) {  // priors, which follow, know of no grid
        const auto row = static_cast<Eigen::Index>(i);
        slope.row(row) *= before[i].sigma / after[i].sigma;
        change[row] *= share.at(before[i].experiment);
    }
    const Eigen::MatrixXd parts = least_squares(slope, stretches_of(change, before));
    const Eigen::VectorXd together = parts.rowwise().sum(), apart = parts.rowwise().norm();
    Eigen::VectorXd left = together;
    for (Eigen::Index j = 0; j < left.size(); ++j) {
        left[j] = std::copysign(std::max(std::abs(together[j]), apart[j]), together[j]);
    }
    for (Eigen::Index j = 0; j < left.size() && on_one_grid; ++j) {
        const Parameter& parameter = model.box().parameters()[static_cast<std::size_t>(j)];
        if (is_modulus(parameter)) {
            const double most = farthest_told * size_of(parameter, values[j]) / model.box().slope(j, best.x[j]);
            left[j] = std::copysign(std::max(std::abs(left[j]), std::min(3 * std::abs(left[j]), most)), left[j]);
        }
    }
    return left;
}

void take_in_grid(Fit& fit, const UnitBox& box, const Eigen::VectorXd& x, Eigen::VectorXd left) {
    const Eigen::VectorXd values = box.values(x);
    const Eigen::VectorXd shifts = box.values(x + left) - values;
    double farthest = 0.0;  // of what can be told
    bool is_something = false;
    std::vector<std::string> told;
    for (Eigen::Index j = 0; j < box.size(); ++j) {
        const Parameter& parameter = box.parameters()[static_cast<std::size_t>(j)];
        if (is_toughness(parameter)) {
            const double least = least_of_toughness * values[j] / box.slope(j, x[j]);
            left[j] = std::copysign(std::max(std::abs(left[j]), least), left[j]);
        }
        if (is_whole_box(parameter, fit.parameters[static_cast<std::size_t>(j)])) {
            continue;
        }
        farthest = std::max(farthest, std::abs(shifts[j]) / (farthest_told * size_of(parameter, values[j])));
        is_something = is_something || std::pow(left[j] * slope_in_unit(box, j, x), 2) > nothing * fit.covariance(j, j);
        told.push_back(shift_text(parameter, values[j], shifts[j]));
    }
    if (told.empty()) {
        return;
    }
    const Eigen::VectorXd of_data = fit.covariance.diagonal();
    const double trust = std::clamp(2.0 - farthest, 0.0, 1.0);
    take_in(fit, box, x, left, trust);
    if (farthest > 1.0) {
        fit.message += untold_grid(
            fmt::format("a fit on cells twice as wide, which would tell it, lies too far off: {}", fmt::join(told, ", ")));
        return;
    }
    if (!is_something) {
        fit.message += "A run on cells twice as wide says that the grid leaves less than a hundredth of a standard error. ";
        return;
    }
    const double most = (1.0 - of_data.array() / fit.covariance.diagonal().array()).maxCoeff();
    fit.message +=
        fmt::format("By what the grid leaves, told by a run on cells twice as wide, the truth may lie farther off: {}. "
                    "Intervals take that in on both sides, of a toughness 1 % at least; it makes up to {:.0f} % of a variance. ",
                    fmt::join(told, ", "), 100 * most);
}

void take_in_untold_grid(Fit& fit, const UnitBox& box, const Eigen::VectorXd& x, const std::string& why) {
    take_in(fit, box, x, Eigen::VectorXd::Zero(box.size()), 0.0);
    fit.message += untold_grid(why);
}

}  // namespace crampfit

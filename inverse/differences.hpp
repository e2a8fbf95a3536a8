#pragma once

#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <optional>
#include <vector>

namespace crampfit {

/// Step of all differences, as a part of the box. Explicit runs are noisy: the derivative's error is noise / step +
/// curvature x step^2, and over a decade of toughness on a log scale 3 % of the box is a 7 % change, well above what
/// vibration and the increments of the crack do to a run, and well below what a fit looks for.
inline constexpr double difference_step = 0.03;
inline constexpr double difference_reach = 1.5 * difference_step;  // about a point, takes in its differences

/// The points about x that differences need: x +- step along each axis, without those that lie outside the unit cube.
std::vector<Eigen::VectorXd> stencil(const Eigen::VectorXd& x, double step = difference_step);

/// Derivative of the residuals [residuals x parameters] by central differences, the runs side by side; one-sided next
/// to a bound or a failed run, and with half the step where both sides failed. Absent if x itself or a column cannot be
/// had.
std::optional<Eigen::MatrixXd> jacobian(Objective& objective, const Eigen::VectorXd& x);

}  // namespace crampfit

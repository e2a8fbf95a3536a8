#pragma once

#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace crampfit {

/// How sure the best point is, in the unit cube.
struct Uncertainty {
    Run best;                    // the run that all of this is about
    Eigen::MatrixXd covariance;  // [parameters x parameters]
    Eigen::VectorXd lower_95;    // [parameters]
    Eigen::VectorXd upper_95;    // [parameters]
    double reduced_chi_square = 0;
    std::string message;                  // what the intervals rest on, and what cannot be told, for a person
    double widening = 1;                  // s: of variances, for what the noise does not explain
    double quantile = 2;                  // of Student's distribution, from standard error to interval
    std::string untold = {};              // which parameters cannot be told (apart), for a person; part of `message` too
    Eigen::MatrixXd slope = {};           // J [residuals x parameters]; empty where it is not known
    Eigen::VectorXd model_variance = {};  // diagonal of V [parameters]; empty where it is not known
};

/// Intervals about the best run, from how the residuals change with the parameters near it. Runs the differences about
/// the best point that have not been run yet. `curve_lengths` are the lengths of the measured curves, in the order in
/// which the residuals hold them; priors follow. `names` are the parameters'; `step` is that of differences, a part of the box.
/// There must be a usable run.
///
/// covariance = s (J^T J)^-1 + V, J being the slope of a polynomial fitted to the runs about the best point and
///  s = max(1, chi^2 tau), chi^2 the reduced chi-square and tau the correlation time of the residuals along their
///  curves: what
///      the stated noise does not explain is taken for noise, and residuals that go together count once;
///  V = how far the model's own scatter, run by run, moves the best point, and how far the best run is from the lowest
///  point of
///      the polynomial: noise, or a search that ended early.
/// A direction in which the box has less than two standard errors either side of its middle is undetermined: it gets
/// the variance of a uniform distribution over the box, and the parameters that it is made of get the whole box as
/// their interval.
Uncertainty estimate_uncertainty(Objective& objective, const std::vector<int>& curve_lengths,
                                 const std::vector<std::string>& names, double step);

/// The 97.5 % point of Student's t distribution.
double student_975(int degrees_of_freedom);

}  // namespace crampfit

#pragma once

#include "inverse/objective.hpp"
#include "inverse/window.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace crampfit {

/// The measured curves that residuals are of, in the order in which the residuals hold them; priors follow.
struct MeasuredCurves {
    std::vector<int> lengths;        // residuals of each curve
    std::vector<double> roots = {};  // of the weight by which each curve's residuals have been multiplied; empty: all 1

    double root(std::size_t curve) const { return roots.empty() ? 1.0 : roots[curve]; }
};

/// A direction of which the data say nothing, told by the parameters that it is made of.
struct Untold {
    std::vector<Eigen::Index> parameters;
    std::string sentence;       // for a person
    Eigen::VectorXd direction;  // [parameters], its largest entry 1
};

/// How sure the best point is, in the unit cube.
struct Uncertainty {
    Run best;                    // the run that all of this is about
    Eigen::MatrixXd covariance;  // [parameters x parameters]
    Eigen::VectorXd lower_95;    // [parameters]
    Eigen::VectorXd upper_95;    // [parameters]
    double reduced_chi_square = 0;
    std::string message;                  // what the intervals rest on, and what cannot be told, for a person
    double widening = 1;                  // s: of variances, for what the noise does not explain
    double prior_weight = 1;              // c: on the misfit of priors
    double temperature = 1;               // T: of the data's likelihood exp(-misfit / 2 T), s and the weights taken in
    double quantile = 2;                  // of Student's distribution, from standard error to interval
    std::vector<Untold> untold = {};      // their sentences are part of `message` too
    Eigen::MatrixXd slope = {};           // J [residuals x parameters]; empty where it is not known
    Eigen::VectorXd model_variance = {};  // diagonal of V [parameters]; empty where it is not known
    Eigen::VectorXd rise = {};            // of the misfit at the ends of a parameter's interval; empty where it is not known
};

/// Intervals about the best run, from how the residuals change with the parameters near it. Runs the differences about
/// the best point that have not been run yet. `names` are the parameters'; `step` is that of differences, a part of the box.
/// The objective's points are those of a window of the box, and differences go along its axes; all that is told is of the box.
/// There must be a usable run.
///
/// covariance = H^-1 (s J^T W^2 J + c^2 P) H^-1 + V,  H = J^T W J + c P, J being the slope of a polynomial fitted to the runs
/// about the best point, without priors, and
///  W = the weights: they say how much a curve has to say, not how large its noise is, so that a factor on all of them changes
///  nothing (the sandwich of White 1980, Econometrica 48, for noise that is known); (J^T J / s + P)^-1 where s and all weights
///  are 1;
///  P = what the priors know, which nothing widens; c = the mean weight, by which they have been multiplied;
///  s = max(1, chi^2 tau), chi^2 the reduced chi-square of the data without weights and tau the correlation time of the
///  residuals along their curves: what the stated noise does not explain is taken for noise, and residuals that go together
///  count once;
///  V = how far the model's own scatter, run by run, moves the best point, and how far the best run is from the lowest
///  point of the polynomial: noise, or a search that ended early.
/// A direction in which the window has less than two standard errors either side of its middle is undetermined: it gets
/// the variance of a uniform distribution over the window, or the box where that is less, and the parameters that it is made of
/// get the whole box as their interval.
Uncertainty estimate_uncertainty(Objective& objective, const MeasuredCurves& curves, const std::vector<std::string>& names,
                                 double step, const Window& window);

/// How many neighbouring residuals count as one: 1 + 2 sum rho_k, rho_k their autocorrelation at distance k, up to the first that
/// chance explains; the mean over curves of so many.
double correlation_time(const Eigen::VectorXd& residuals, const std::vector<int>& curve_lengths);

/// The 97.5 % point of Student's t distribution.
double student_975(int degrees_of_freedom);

}  // namespace crampfit

#pragma once

#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <functional>
#include <vector>

namespace crampfit {

/// A sample of a posterior, and how good it is.
struct Ensemble {
    std::vector<Run> samples;          // in the order drawn, after what was left out at the begin
    double acceptance = 0;             // part of the moves that were made
    int sweeps = 0;                    // over all walkers, without what was left out
    Eigen::VectorXd correlation_time;  // of each parameter along the chain, in sweeps over all walkers [parameters]
};

/// Draws from exp(log_likelihood) over the unit cube with the affine-invariant ensemble of Goodman and Weare (2010),
/// Communications in Applied Mathematics and Computational Science 5, stretch move with a = 2; both halves of the walkers in
/// turn, as in Foreman-Mackey et al. (2013), so that each half's runs are made side by side. The walkers begin about `centre`
/// with this covariance, nearer to it where that is hardly likely at all; a third of the sweeps, fifty at least, are left out at
/// the begin. A failed run has no likelihood.
Ensemble draw_ensemble(Objective& objective, const std::function<double(const Evaluation&)>& log_likelihood,
                       const Eigen::VectorXd& centre, const Eigen::MatrixXd& covariance, int samples, unsigned seed);

}  // namespace crampfit

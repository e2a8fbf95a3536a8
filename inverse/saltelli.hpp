#pragma once

#include "inverse/estimate.hpp"

#include <Eigen/Core>

#include <span>
#include <vector>

namespace crampfit {

/// Which runs Sobol's variance-based indices take, and the indices once they have been made: Saltelli et al. (2010),
/// Variance based sensitivity analysis of model output, Computer Physics Communications 181, with their radial design
/// of two Sobol matrices A and B and, for each parameter, A with the column of B.
class SaltelliDesign {
  public:
    SaltelliDesign(Eigen::Index parameters, int rows, unsigned seed);

    /// Points of the unit cube, (parameters + 2) a row: A, B, then A with column j of B.
    const std::vector<Eigen::VectorXd>& points() const { return points_; }

    struct Indices {
        std::vector<Estimate> first;  // [parameters] V(E(y|x_j)) / V(y)
        std::vector<Estimate> total;  // [parameters] 1 - V(E(y|all but x_j)) / V(y)
    };

    /// Of the function's values at the points [points]; a row that has one that is not a number is left out for the
    /// parameters that need it. A function that does not vary has indices of 0.
    Indices indices(std::span<const double> values) const;

  private:
    Eigen::Index parameters_;
    int rows_;
    unsigned seed_;
    std::vector<Eigen::VectorXd> points_;
};

}  // namespace crampfit

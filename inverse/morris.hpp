#pragma once

#include "inverse/estimate.hpp"

#include <Eigen/Core>

#include <span>
#include <vector>

namespace crampfit {

/// Which runs Morris' screening takes, and its measures once they have been made: Morris (1991), Factorial sampling
/// plans for preliminary computational experiments, Technometrics 33; mu* of Campolongo, Cariboni and Saltelli (2007).
/// On four levels, with steps of two thirds of the cube.
class MorrisDesign {
  public:
    MorrisDesign(Eigen::Index parameters, int trajectories, unsigned seed);

    /// Points of the unit cube, (parameters + 1) a trajectory, each one step along one axis from the one before.
    const std::vector<Eigen::VectorXd>& points() const { return points_; }

    struct Measures {
        std::vector<Estimate> mu_star;  // [parameters] mean of the elementary effects' sizes
        std::vector<Estimate> sigma;    // [parameters] standard deviation of the elementary effects
    };

    /// Of the function's values at the points [points]; steps from or to one that is not a number are left out. An
    /// elementary effect is a change of the function over the change of x, which goes from 0 to 1.
    Measures measures(std::span<const double> values) const;

  private:
    Eigen::Index parameters_;
    int trajectories_;
    unsigned seed_;
    std::vector<Eigen::VectorXd> points_;
};

}  // namespace crampfit

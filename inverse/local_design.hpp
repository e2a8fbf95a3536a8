#pragma once

#include "inverse/estimate.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <span>
#include <vector>

namespace crampfit {

/// Which runs the derivatives at a point take by differences, and the derivatives once they have been made: for each
/// parameter the slope of the polynomial through the point and four more on its axis, on both sides of it, or on one
/// side next to a bound.
class LocalDesign {
  public:
    /// `x` lies in the unit cube [parameters]. No runs for parameters that are `left_out`, by number.
    explicit LocalDesign(const Eigen::VectorXd& x, const std::vector<std::size_t>& left_out = {});

    /// Points of the unit cube: x itself, then four a parameter that is not left out.
    const std::vector<Eigen::VectorXd>& points() const { return points_; }

    /// Of the function's values at the points [points], the derivatives by x [parameters]. The interval is what two
    /// points less would change: the polynomial's own error and the noise of the function; where there is a kink among the
    /// points, it takes in the slopes from both sides, and the derivative is their mean. Points that are not a number
    /// are left out, and so are those beyond a jump of the function, which is then told; not a number where less than three
    /// are left, nor by parameters that are left out.
    std::vector<Estimate> derivatives(std::span<const double> values, bool* jumps = nullptr) const;

  private:
    std::vector<std::size_t> parameters_;  // that are not left out
    std::vector<Eigen::VectorXd> points_;
};

}  // namespace crampfit

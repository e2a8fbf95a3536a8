#pragma once

#include <Eigen/Core>

#include <vector>

namespace crampfit {

/// The first points of a Sobol sequence in the unit cube [count][dimensions], with the direction numbers of Joe and Kuo
/// (2008) as Boost.Random has them, shifted digit by digit by an amount drawn from the seed: none of them lies on the
/// cube's faces, and a power of two of them stays as even as it was. Up to 3667 dimensions.
std::vector<Eigen::VectorXd> sobol_points(int count, Eigen::Index dimensions, unsigned seed);

/// One of them, by its number from 0.
Eigen::VectorXd sobol_point(int number, Eigen::Index dimensions, unsigned seed);

}  // namespace crampfit

#pragma once

#include "datasets/fit.hpp"

#include <vector>

namespace crampfit {

/// Tests of whether what is left of each measured curve is noise. `residuals` hold the curves one after another, `parameters` is
/// how many were fitted to all of them.
///
/// chi-square: the sum of squares of residuals / sigma, as often this large for points - parameters degrees of freedom, those
/// shared out by the curves' lengths. Autocorrelation at distance one: normal with mean -1/n and variance 1/n for white noise
/// (Box, Jenkins and Reinsel 1994, section 2.1.6), as often this large.
std::vector<FitCheck> check_fit(const std::vector<FitResidual>& residuals, int parameters);

/// What a person should know about it; empty when nothing is wrong: with `checks` tests, one in a hundred fits that are right is
/// said to be wrong.
std::string lack_of_fit(const std::vector<FitCheck>& checks);

/// Names experiments whose forces go against the modelled ones, as with a load cell of the other sign; empty when there is none.
std::string opposite_forces(const std::vector<FitResidual>& residuals);

}  // namespace crampfit

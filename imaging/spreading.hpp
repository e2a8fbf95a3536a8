#pragma once

#include "datasets/displacement_field.hpp"
#include "imaging/subset.hpp"

#include <vector>

namespace crampfit {

/// Follows all points of a lattice that `at_start` calls not_reached: some are found by search, and from these the
/// matches spread to neighbours, the most reliable first (Pan 2009, "Reliability-guided digital image correlation for
/// image deformation"; reliability is the ZNCC). Points are taken in rounds of a fixed number, so that the result is
/// the same for any number of threads. Gives a match for each point; its status is that of the last attempt, or
/// `at_start`.
std::vector<SubsetMatch> spread_matches(const ReferencePicture& reference, const FinePicture& image, const PointLattice& lattice,
                                        const std::vector<PointStatus>& at_start, int subset, int order, int threads);

}  // namespace crampfit

#pragma once

#include "imaging/border_line.hpp"

#include <vector>

namespace crampfit {

/// Where LW ends and the EW of the next ring begins: the sharp rise of gray with the growth. Rises are found in profiles
/// across the rings by their prominence against the contrast around them, joined from profile to profile along the ring
/// coordinate, kept where at least half of the profiles show them, and laid through the steepest places by dynamic
/// programming. From the pith outward. `blank` is 255 where nothing is photographed (`find_blank`). `ring_width` [pixels] is a
/// guess, or 0 for none.
std::vector<BorderLine> find_ring_borders(const StraightWood& wood, const cv::Mat& valid, const cv::Mat& blank,
                                          const RingCoordinate& rings, double ring_width);

/// Median distance of neighbouring borders along the growth [pixels]; 0 for less than two borders.
double typical_ring_width(const std::vector<BorderLine>& borders);

}  // namespace crampfit

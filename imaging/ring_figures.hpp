#pragma once

#include "datasets/specimen.hpp"
#include "imaging/ring_borders.hpp"

#include <vector>

namespace crampfit {

/// A border in the picture, with a vertex every few columns of the frame and one at each end.
BorderPolyline polyline_of(const BorderLine& line, std::int64_t ring, const GrowthFrame& frame);

/// A polyline as a border in the frame, cut off at the picture's edge. Throws InputError for one that lies outside the
/// picture or has no extent along the rings.
BorderLine line_of(const BorderPolyline& polyline, const GrowthFrame& frame);

/// Widths and LW fractions of the rings between neighbouring borders. Widths are means over the columns where both are; LW
/// fractions are of straight lines from the inner border, at right angles to it, that reach the outer one within what is seen of
/// the ring. (Where a ring is cut off askew, as by the picture's side, areas have too little of the LW or of the EW.) `classes`
/// and `features` are in the frame; `latewood` is LW's class.
std::vector<RingFigures> ring_figures(const std::vector<BorderLine>& borders, const cv::Mat& classes, int latewood,
                                      const cv::Mat& features);

}  // namespace crampfit

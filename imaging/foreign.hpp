#pragma once

#include "datasets/specimen.hpp"
#include "imaging/wood_classes.hpp"

#include <opencv2/core.hpp>

namespace crampfit {

/// What in a picture is no wood, from its gray (float, 0..1) and, where it has colour, its hue (blue, green, red, float,
/// 0..1; or empty). In the growth frame. A map of `Feature` numbers:
/// - background: too dark for wood, or green or blue, and connected to the picture's edge; islands in it, too
/// - crack: too dark, thin, and running across the rings
/// - mark: other patches that are too dark, or blue or green: ink, holes, dirt
/// Too dark is darker than LW by a quarter of the contrast of LW to EW. Light background is not told from wood.
cv::Mat find_foreign(const cv::Mat& gray, const cv::Mat& bgr, const WoodLevels& levels, double ring_width);

/// 1 where a pixel is wood that counts (float): not foreign, and not right beside it.
cv::Mat countable(const cv::Mat& features);

}  // namespace crampfit

#pragma once

#include <opencv2/core.hpp>

namespace crampfit {

/// Takes out uneven light: log gray is fitted by a polynomial of second degree in place, over the pixels that count
/// (`valid` is not 0; all when empty), and divided by its departure from its mean. LW (`late`, not 0) may be darker by a factor,
/// fitted too but left in: a picture of a few broad rings is not evenly lit by as much as its LW lies to one side.
cv::Mat flatten(const cv::Mat& gray, const cv::Mat& valid, const cv::Mat& late);

}  // namespace crampfit

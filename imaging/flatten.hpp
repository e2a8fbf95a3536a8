#pragma once

#include <opencv2/core.hpp>

namespace crampfit {

/// Takes out uneven light: log gray is fitted by a polynomial of second degree in place, over the pixels that count
/// (`valid` is not 0; all when empty), and divided by its departure from its mean. Rings are far too fine for it to follow.
cv::Mat flatten(const cv::Mat& gray, const cv::Mat& valid);

}  // namespace crampfit

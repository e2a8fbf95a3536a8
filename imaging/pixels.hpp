#pragma once

#include "imaging/gray_picture.hpp"

#include <opencv2/core.hpp>

namespace crampfit {

/// A picture as it stands in its file: one channel or blue, green, red; 8 or 16 bit. Errors and bounds as in read_gray.
cv::Mat read_pixels(const std::filesystem::path& file, const PictureKey& asked_by);

}  // namespace crampfit

#pragma once

#include "imaging/correlate.hpp"
#include "imaging/end_grain.hpp"
#include "imaging/segment.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <string>

namespace crampfit::test {

inline cv::Mat picture_of(const EndGrain& grown) {
    return cv::Mat(grown.rows, grown.columns, CV_8UC3, const_cast<std::uint8_t*>(grown.bgr.data())).clone();
}

/// What `segment` makes of a picture file with these pixels.
inline Segmentation segment_pixels(const cv::Mat& pixels, const SegmentOptions& options = {}, const std::string& name = "a.png") {
    const TemporaryFolder folder;
    EXPECT_TRUE(cv::imwrite((folder / name).string(), pixels));
    return segment(folder / name, options);
}

inline FinePicture fine(const GrayPicture& picture) {
    return {picture.columns, picture.rows, {picture.gray.begin(), picture.gray.end()}};
}

}  // namespace crampfit::test

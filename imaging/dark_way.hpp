#pragma once

#include <opencv2/core.hpp>

#include <optional>
#include <vector>

namespace crampfit {

/// A dark line that a picture shows and its reference does not.
struct DarkWay {
    std::vector<cv::Point2d> points;  // from the mouth to where it is lost, about a pixel apart [px]
    std::vector<double> half_width;   // at each point [px]
    bool ends_inside = true;          // false: it runs from border to border of what counts
};

/// The direction in which a line ends at its back or its front, over its last `reach` points.
cv::Point2d direction_at(const std::vector<cv::Point2d>& line, bool back, int reach);

/// The crack that has opened between two pictures that lie on each other [float]; `counts` is 0 where one of them shows nothing.
/// A pixel is dark when it is darker than all of the reference nearby, so that what has moved a little does not count. A crack
/// darkens and never brightens: what is brighter than all of the reference nearby measures what noise and other motion do, and a
/// crack has to stand out from that. None where there is no such line.
std::optional<DarkWay> find_dark_way(const cv::Mat& reference, const cv::Mat& seen, const cv::Mat& counts);

}  // namespace crampfit

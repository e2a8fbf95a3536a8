#pragma once

#include "imaging/dark_way.hpp"
#include "imaging/line_up.hpp"

namespace crampfit {

/// A crack's way in the wood at rest. What is dark lies between sides that have moved apart, seldom by as much: the wood along
/// either side is lined up with the reference by itself, which takes the crack's edge there back to where it was; the way is in
/// the middle of both. The way is in places of the reference as `whole` lines the image up; ways of narrow cracks stay as they
/// are. `weight` is as of `line_up`.
std::vector<cv::Point2d> closed_way(const cv::Mat& reference, const cv::Mat& image, const cv::Mat& weight, const Alignment& whole,
                                    const DarkWay& way);

}  // namespace crampfit

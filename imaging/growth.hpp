#pragma once

#include "imaging/growth_axis.hpp"
#include "imaging/orientation.hpp"

#include <string>

namespace crampfit {

struct GrowthGuess {
    GrowthAxis growth;
    std::string reason;
    bool shown = true;  // by the picture; else its sense is assumed
};

/// Rings lie across the axis that is nearer to the mean direction. Along it LW ends sharply and begins gradually, so the
/// steepest steps of gray are rises; where steps are alike both ways, rings are arcs about the pith and the radial
/// directions spread out with the growth, more than rings wave; where neither shows, + is assumed, and said.
/// `gray` and `valid`, 0 where a pixel must not count and else 1, are float.
GrowthGuess guess_growth(const cv::Mat& gray, const cv::Mat& valid, const OrientationField& field);

}  // namespace crampfit

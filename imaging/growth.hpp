#pragma once

#include "imaging/growth_axis.hpp"
#include "imaging/orientation.hpp"

#include <string>

namespace crampfit {

struct GrowthGuess {
    GrowthAxis growth;
    std::string reason;
};

/// Rings lie across the axis that is nearer to the mean direction. Along it LW ends sharply and begins gradually, so the
/// steepest steps of gray are rises; where steps are alike both ways, rings are arcs about the pith and the radial
/// directions spread out with the growth; where neither shows, + is assumed, and said.
GrowthGuess guess_growth(const cv::Mat& gray, const OrientationField& field);

}  // namespace crampfit

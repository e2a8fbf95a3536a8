#pragma once

#include "imaging/orientation.hpp"

#include <optional>

namespace crampfit {

/// Radial directions of rings about one pith: at a place p of the picture (x right, y down) the wood grew along
/// away + turn (p - middle). Straight rings have a turn of 0 and their pith nowhere.
struct RadialFan {
    cv::Point2d middle;  // of the picture [pixels]
    cv::Point2d away;    // radial direction there, any length
    double turn = 0;     // [1/pixel]
    double scatter = 0;  // standard deviation of the measured directions about these, by their median [rad]

    cv::Point2d direction(const cv::Point2d& place) const { return away + turn * (place - middle); }
    /// None where rings are straight.
    std::optional<cv::Point2d> pith() const;
};

/// The fan away from a given pith [pixels] of a picture.
RadialFan fan_from(const cv::Point2d& pith, cv::Size picture);

/// The fan that fits measured directions best: smallest is the sum of coherency^2 rho(sine of the angle to it), rho being
/// Cauchy's, whose scale follows the median (Holland & Welsch 1977), so that rays, cracks and knots count little. Found by
/// reweighted homogeneous least squares: with t along the ring, t . (away + turn (p - middle)) = 0 is linear, and its weight
/// is one over the squared length of what stands in brackets (Sampson 1982). None where the picture shows no directions.
std::optional<RadialFan> fit_fan(const OrientationField& field, cv::Size picture);

/// Turns all directions to those of a fan.
void turn_to_fan(OrientationField& field, const RadialFan& fan);

}  // namespace crampfit

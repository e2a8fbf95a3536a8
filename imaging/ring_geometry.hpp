#pragma once

#include "imaging/end_grain.hpp"
#include "imaging/random_field.hpp"

#include <array>

namespace crampfit {

/// The growth rings of synthetic end grain as pure geometry: which ring a place lies in, and how far along in it.
class RingGeometry {
  public:
    /// Options must be valid.
    RingGeometry(const EndGrainOptions& options, const RandomField& random);

    struct Place {
        double distance = 0;            // from the pith [m]
        double angle = 0;               // of the line from the pith, counter-clockwise from +x, in [-pi, pi] [rad]
        double radius = 0;              // warped: equal all along a ring's border [m]
        Vec2 gradient = Vec2::UnitX();  // of the warped radius; normal to the rings
    };

    /// `position` is in the block [m].
    Place at(const Vec2& position) const;

    /// Density degree at a warped radius [m] and an angle [rad]: 0 in EW, 1 in LW, linear between.
    double degree(double radius, double angle) const;

    const std::vector<GrowthRing>& rings() const { return rings_; }

    /// The rings' outer borders as far as they lie in the block, with a vertex about every pixel.
    std::vector<RingBorder> borders() const;

    double outermost() const { return far_; }  // distance from the pith to the block's farthest corner [m]

    /// Largest relative change of the warped radius' slope: below 1 rings cannot cross.
    static double steepness(const EndGrainOptions& options);

  private:
    struct Wave {
        double around;  // waves around the pith, a whole number
        double inward;  // change of phase with distance from the pith [rad/m]
        double phase;   // [rad]
    };
    struct Warp {
        double radius;  // [m]
        double slope;   // d radius / d distance
        double turn;    // d radius / (distance d angle)
    };
    Warp warp(double distance, double angle) const;
    double distance_of(double radius, double angle) const;
    void lay_rings();
    double onset_shift(std::size_t ring, double angle) const;

    EndGrainOptions options_;
    RandomField random_;
    double near_ = 0;  // distance from the pith to the nearest point of the block [m]
    double far_ = 0;
    std::array<Wave, 6> waves_{};
    std::vector<GrowthRing> rings_;
};

}  // namespace crampfit

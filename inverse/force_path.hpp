#pragma once

#include "datasets/scene.hpp"

#include <vector>

namespace crampfit {

/// Force over crack length, from instant to instant: it goes up where the crack stands, and falls or goes aside as it grows, so
/// that there may be many forces at one length. What a row of data is off it is the distance to its nearest point, each axis
/// divided by the noise of its column: orthogonal distance regression (Boggs, Byrd and Schnabel 1987).
class ForcePath {
  public:
    /// `lengths` [m] and `forces` [N], one an instant, at least one, all finite. Noise: one sigma [m], [N].
    ForcePath(const std::vector<double>& lengths, const std::vector<double>& forces, double length_noise, double force_noise);

    /// How far the path is from a row, in standard deviations: positive where the path is above it, or the crack shorter.
    double distance(double length, double force) const;

  private:
    Vec2 noise_;
    std::vector<Vec2> corners_;  // divided by it, no two neighbours at one place
};

}  // namespace crampfit

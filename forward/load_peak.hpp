#pragma once

#include <array>
#include <optional>

namespace crampfit {

/// What a crack needs to move on from a place.
struct NeededLoad {
    double length;     // of the crack [m]
    double time;       // at which the load has risen to it [s]
    double toughness;  // that it overcomes: the mean over the next advance [J/m^2]
};

/// Where between the middle two of four places the load that the crack needs is highest, if it is higher there than at both. The
/// energy that the next advance releases per square of the load is a difference of the potential at two crack lengths and goes
/// through the four places as a cubic; the load, which goes with the time, is the root of the toughness over it. Exact where all
/// goes linearly with the load and that energy is a cubic.
std::optional<NeededLoad> peak_between(const std::array<NeededLoad, 4>& places);

}  // namespace crampfit

#pragma once

#include "forward/energy_release.hpp"

namespace crampfit {

/// Which way a crack tip goes on: a unit vector.
Vec2 growth_direction(GrowthDirection criterion, const CrackTip& tip, const TipLoad& load);

} // namespace crampfit

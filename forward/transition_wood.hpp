#pragma once

#include "datasets/scene.hpp"

namespace crampfit {

/// Transition wood: `grade` of the way in density from `first` to `second`, with constants that follow the density
/// (DensityExponents). Where one of the two is orthotropic, isotropic wood counts as orthotropic wood with equal constants all
/// ways.
Material transition_wood(const Material& first, const Material& second, const DensityExponents& exponents, double grade);

}  // namespace crampfit

#pragma once

#include "imaging/border_line.hpp"
#include "imaging/growth_frame.hpp"
#include "imaging/orientation.hpp"

#include <vector>

namespace crampfit {

/// Turns directions to the ring borders, whose waves are finer than the window that gradients are gathered over: at a border its
/// own slope counts, by a window as wide as the picture's noise asks for; along a ray from one border to the next the turn goes
/// linearly, and outside it ceases over a ring. Rays are the field's normals without the rings' waves. `ring_width` [pixels].
void turn_to_borders(OrientationField& field, const std::vector<BorderLine>& borders, const GrowthFrame& frame,
                     double ring_width);

}  // namespace crampfit

#pragma once

#include "imaging/border_line.hpp"
#include "imaging/growth_frame.hpp"
#include "imaging/orientation.hpp"

#include <vector>

namespace crampfit {

/// Turns directions to the ring borders, whose waves are finer than the window that gradients are gathered over: at a border its
/// own slope counts, along the normal from one to the next the turn goes linearly, and outside it ceases over a ring.
/// `ring_width` [pixels].
void turn_to_borders(OrientationField& field, const std::vector<BorderLine>& borders, const GrowthFrame& frame,
                     double ring_width);

}  // namespace crampfit

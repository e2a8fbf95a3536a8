#pragma once

#include "datasets/record.hpp"
#include "forward/quasistatic.hpp"

#include <functional>

namespace crampfit {

inline constexpr const char* all_tips_left = "every growing crack tip has reached a free surface or another crack";

/// What a test sees of a crack's way through the specimen: under rising load the crack stands until the load is critical, then
/// moves on with it as long as that rises, and where it falls it jumps, at the same load, to where it has risen again. Fills the
/// series, the paths, the further cracks, the reactions, the crack-driving curve, and the status; frames are the caller's.
///
/// `materials` gives the toughness. Where another toughness has been traced on the same walk before, hardly anything is solved
/// for. `go_on` is asked between stations, with the time [s] and the tracked crack's length [m]; false interrupts.
Record trace(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk,
             const std::function<bool(double, double)>& go_on);

}  // namespace crampfit

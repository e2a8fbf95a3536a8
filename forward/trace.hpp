#pragma once

#include "datasets/record.hpp"
#include "forward/crack_driving.hpp"
#include "forward/plan.hpp"

namespace crampfit {

/// What a test sees of a crack's way through the specimen: under rising load the crack stands until the load is critical, then moves
/// on with it as long as that rises, and where it falls it jumps, at the same load, to where it has risen again. Fills the series,
/// the paths, the further cracks, the reactions, the crack-driving curve, and the status; frames are the caller's.
/// `materials` gives the toughness along the way. Takes no time beside a sweep.
Record trace(const Scene& scene, const Plan& plan, const CrackDriving& driving, const MaterialMap& materials);

} // namespace crampfit

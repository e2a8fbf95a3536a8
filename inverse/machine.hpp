#pragma once

#include "datasets/experiment.hpp"
#include "datasets/record.hpp"

namespace crampfit {

/// What a test on this machine would have recorded of the run: u + compliance F + displacement_offset, and F + force_offset.
/// Where the force falls faster than a soft machine lets go the recorded displacement stands still: the crack jumps on to where
/// the machine's displacement has been reached again. In equilibrium that is exact, as a crack that stands at a smaller
/// displacement of the machine stands at a smaller one of the specimen. The record must have a series; its tables of reactions
/// and further cracks are left out.
Record as_recorded(const Record& record, const Machine& machine);

}  // namespace crampfit

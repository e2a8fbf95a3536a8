#pragma once

#include "datasets/experiment.hpp"
#include "datasets/record.hpp"

#include <vector>

namespace crampfit {

/// What a test on this machine would have recorded of the run: u + compliance F + displacement_offset, and F + force_offset.
/// Where the force falls faster than a soft machine lets go the recorded displacement stands still: the crack jumps on to where
/// the machine's displacement has been reached again. In equilibrium that is exact, as a crack that stands at a smaller
/// displacement of the machine stands at a smaller one of the specimen. The record must have a series; its tables of reactions
/// and further cracks are left out.
Record as_recorded(const Record& record, const Machine& machine);

/// The run's own displacements where the recorded one first comes to these [m]; infinite where it does not. The record, which
/// must have a series, is that of the run, not yet seen through the machine.
std::vector<double> displacements_of_run(const Record& record, const Machine& machine, const std::vector<double>& recorded);

}  // namespace crampfit

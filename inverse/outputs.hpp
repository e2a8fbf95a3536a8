#pragma once

#include "datasets/experiment.hpp"
#include "datasets/record.hpp"

namespace crampfit {

/// What a run gives for an output, SI; not a number where it has no such thing: a displacement that it did not come to, an
/// arrest that there was not. The record must hold an instant, and finite numbers.
///
/// The initial stiffness is the slope of the line of least squares through the rows in which the crack stands where it began
/// and the force is below half its peak. An arrest is a stretch of at least a fiftieth of the record's displacement over which
/// the crack, having grown, grows at less than a tenth of its mean pace over the record.
double output_of(const Record& record, const StudyOutput& output);

}  // namespace crampfit

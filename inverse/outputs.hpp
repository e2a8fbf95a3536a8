#pragma once

#include "datasets/experiment.hpp"
#include "datasets/record.hpp"

namespace crampfit {

/// What a run gives for an output, SI; not a number where it has no such thing: a displacement that it did not come to, an
/// arrest that there was not. The record must hold an instant, and finite numbers.
///
/// The initial stiffness is the slope of the line of least squares through the rows in which the crack stands where it began,
/// from where the force begins over the first fiftieth of the way to its peak; in motion, where it swings, up to half its peak.
/// An arrest is where the crack, having grown, grows over the next fiftieth of the record's displacement by less than a tenth of
/// what its mean pace over the record would bring. Its length is that at the last such place, between rows too; its displacement
/// that at which the crack has grown by that tenth from there.
double output_of(const Record& record, const StudyOutput& output);

}  // namespace crampfit

#pragma once

#include "datasets/experiment.hpp"
#include "inverse/forward.hpp"

namespace crampfit {

/// The forward solver as a fit calls it: runs that differ from a recent one by toughness alone share its equilibria. How a
/// walk is modelled (linear or not) follows from the parameters' initial toughnesses, whichever run comes first. May be called from
/// several threads.
Forward forward_with_kept_walks(const Study& study);

/// Whether all runs of a study are other toughnesses on walks that are kept, and cost milliseconds.
bool runs_share_walks(const Study& study);

}  // namespace crampfit

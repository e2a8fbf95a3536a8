#pragma once

#include "datasets/experiment.hpp"
#include "inverse/forward.hpp"

#include <string>
#include <vector>

namespace crampfit {

/// The forward solver as a fit calls it: runs that differ from a recent one by toughness alone share its equilibria. `keys` are all
/// that the fit changes. May be called from several threads.
Forward forward_with_kept_walks(const std::vector<std::string>& keys);

/// Whether all runs of a study are other toughnesses on walks that are kept, and cost milliseconds.
bool runs_share_walks(const Study& study);

/// All keys that a study changes.
std::vector<std::string> keys_of(const Study& study);

}  // namespace crampfit

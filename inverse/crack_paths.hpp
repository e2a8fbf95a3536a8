#pragma once

#include "datasets/crack_paths.hpp"
#include "datasets/experiment.hpp"
#include "datasets/fit.hpp"

#include <atomic>

namespace crampfit {

/// Where the cracks of each experiment go in each model that was compared, or in the one that was fitted, at its best parameters,
/// beside what the experiment's photograph shows. Takes one simulation for each of them, on `threads` (0: one a core) all
/// together; one that fails or is stopped has a status and no path. Nothing is run, and none given, where no models were compared
/// and no experiment has a photograph. Pictures and specimen files must have been read. `fit` is a fit of this study.
std::vector<CrackPaths> crack_paths(const Study& study, const Fit& fit, int threads = 0, const std::atomic<bool>* stop = nullptr);

/// Fills in how far the photographed path is from the simulated ones: from places evenly spread along it to the nearest place of
/// a simulated crack. Only places count that a grown part of one passes by, so neither the crack that was there before, `initial`
/// [m], nor what lies beyond a tip: how far cracks have gone is another matter than which way.
void compare_paths(const std::vector<Vec2>& photographed, const std::vector<std::vector<Vec2>>& initial,
                   SimulatedPath& simulated);

}  // namespace crampfit

#pragma once

#include "datasets/record.hpp"
#include "datasets/scene.hpp"

#include <atomic>
#include <functional>

namespace crampfit {

struct Progress {
    double fraction = 0;    // of the way to the nearest stop condition, 0..1
    double time = 0;        // in the scene [s]
    double crack_length = 0;// [m]
    long step = 0;
};

struct SimulateOptions {
    std::function<void(const Progress&)> progress;     // called now and then; may be empty
    int threads = 1;                                   // that equilibrium is solved with; the bits are the same for any number
    const std::atomic<bool>* stop_requested = nullptr; // set from outside: the run ends with what it has
};

/// Runs one scene. A picture or specimen file must have been read into `scene.specimen.map` before.
/// Where the scene gives an error in place of a cell, its grid is chosen first (`choose_grid`), and the record's explanation says how.
/// Throws InputError when the scene asks for what no solver here does. A run that goes unstable is a status.
Record simulate(const Scene& scene, const SimulateOptions& options = {});

/// What will be modelled, by which solver, why, and what it will cost: what `crampfit explain` prints.
std::string explain(const Scene& scene);

} // namespace crampfit

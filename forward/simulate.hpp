#pragma once

#include "datasets/record.hpp"
#include "datasets/scene.hpp"

#include <atomic>
#include <functional>

namespace crampfit {

struct Progress {
    double fraction = 0;      // of the way to the nearest stop condition, 0..1
    double time = 0;          // in the scene [s]
    double crack_length = 0;  // [m]
    long step = 0;
};

struct SimulateOptions {
    std::function<void(const Progress&)> progress;      // called now and then; may be empty
    const std::atomic<bool>* stop_requested = nullptr;  // set from outside: the run ends with what it has
    int threads = 1;                                    // that share the work of a run; a fit may rather run scenes side by side
};

/// Runs one scene. The result does not depend on the number of threads. A picture or specimen file must have been read into
/// `scene.specimen.map` before. Where the scene gives an error in place of a cell, its grid is chosen first (`choose_grid`), and
/// the record's explanation says how. Throws InputError when the scene asks for what no solver here does. A run that goes
/// unstable is a status.
Record simulate(const Scene& scene, const SimulateOptions& options = {});

/// The largest ratio of kinetic to strain energy in the series, where the strain energy is a tenth of its largest value or more.
/// Loading counts as quasi-static up to a few percent (`quasistatic_share`).
double kinetic_share(const Record& record);
constexpr double quasistatic_share = 0.05;

/// What will be modelled, by which solver, why, and what it will cost: what `crampfit explain` prints.
std::string explain(const Scene& scene);

}  // namespace crampfit

#pragma once

#include "datasets/record.hpp"
#include "datasets/scene.hpp"

#include <atomic>
#include <functional>

namespace crampfit {

/// One simulation of one scene. `stop` is set when the user interrupts; it may be null. Called from several threads at
/// a time.
using Forward = std::function<Record(const Scene& scene, const std::atomic<bool>* stop)>;

}  // namespace crampfit

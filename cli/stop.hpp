#pragma once

#include <atomic>

namespace crampfit::cli {

/// From now on Ctrl-C (SIGINT) or SIGTERM asks the run to stop and save what it has; a second one ends the command at
/// once.
void stop_on_signals();

/// Set once the user has asked to stop.
const std::atomic<bool>& stop_requested();

}  // namespace crampfit::cli

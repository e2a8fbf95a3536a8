#pragma once

#include "forward/quasistatic.hpp"
#include "forward/simulate.hpp"

#include <mutex>

namespace crampfit {

/// A scene at equilibrium, kept for runs with other toughnesses: these share the way of the crack and all equilibria along it, and
/// take milliseconds where a first run takes seconds. The crack's path is the one that the first toughness gave.
class KeptWalk {
  public:
    /// Throws InputError as `simulate` does.
    explicit KeptWalk(const Scene& scene);

    /// False where toughness changes more than when the crack moves: in explicit dynamics, or with several growing tips.
    bool reusable() const { return reusable_; }

    /// Runs `scene`, which differs from the first one by toughness alone; no frames. One run at a time: others wait.
    Record run(const Scene& scene, const SimulateOptions& options);

  private:
    Scene scene_;
    MaterialMap materials_;
    Plan plan_;
    bool reusable_ = false;
    std::mutex mutex_;
    std::unique_ptr<Quasistatic> walk_;
};

} // namespace crampfit

#pragma once

#include "forward/quasistatic.hpp"
#include "forward/simulate.hpp"

#include <mutex>

namespace crampfit {

/// A scene at equilibrium, kept for runs with other toughnesses: these share the way of the crack and all equilibria along it,
/// and take milliseconds where a first run takes seconds. The crack's path is the one that the first toughness gave.
///
/// Runs with other moduli nearby share them too, to first order: every equilibrium moves by its derivative. Two such runs to
/// either side give the derivative of all that a record holds, on the path as it is.
class KeptWalk {
  public:
    /// `numbers`: keys of numbers of the materials, other than toughness, by which derivatives are wanted. Throws InputError as
    /// `simulate` does.
    /// Equations are solved by `threads` threads.
    explicit KeptWalk(const Scene& scene, const std::vector<std::string>& numbers = {}, int threads = 1);

    /// False where it is not reusable, or where bodies follow a force: derivatives are those on the way of the crack as it is.
    bool has_slopes() const { return reusable_ && !plan_.free_bodies; }

    /// False where toughness changes more than when the crack moves: in explicit dynamics, with several growing tips, or with
    /// friction or wood that remembers, where a state hangs on the way to it.
    bool reusable() const { return reusable_; }

    /// Whether states are found by themselves. Else each is found from those found before, and depends on them by what Newton's
    /// method leaves: so does what a run gives.
    bool linear() const { return plan_.linear; }

    /// Whether the wood's rotation is finite; else strain is small.
    bool rotates() const { return plan_.rotates; }

    /// Whether a second grid, with cells twice as wide, takes its share off (Quasistatic).
    bool extrapolates() const { return plan_.extrapolates; }

    /// Runs `scene`, which differs from the first one by toughness, and, to first order, by those numbers; no frames. A rough run
    /// makes do with the equilibria that are known, where it can. One run at a time: others wait.
    Record run(const Scene& scene, const SimulateOptions& options, bool rough = false);

  private:
    Scene scene_;
    MaterialMap materials_;
    std::optional<Discretisation> body_;  // for the first walk
    Plan plan_;
    std::vector<std::string> numbers_;
    int threads_ = 1;
    bool reusable_ = false;
    std::mutex mutex_;
    std::unique_ptr<Quasistatic> walk_;
};

}  // namespace crampfit

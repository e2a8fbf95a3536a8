#pragma once

#include "datasets/experiment.hpp"
#include "inverse/forward.hpp"

#include <Eigen/Core>

#include <memory>
#include <string>
#include <vector>

namespace crampfit {

/// The forward solver as a fit calls it: runs that differ from a recent one by toughness alone share its equilibria, unless the
/// crack turns by it (direction "energy release rate"). How a walk that they share is modelled (linear or not) follows from the
/// parameters' initial toughnesses, whichever run comes first. All may be called from several threads.
class KeptWalks {
  public:
    /// Each walk is solved with `threads` threads.
    explicit KeptWalks(const Study& study, int threads = 1);
    ~KeptWalks();

    /// The simulation itself, on a walk of its own where the scene has other moduli than any that is kept.
    Forward exact() const;

    /// The simulation for runs that are made side by side: on walks only where it does not matter which run comes first.
    Forward in_any_order() const;

    /// Whether runs on walks depend on the runs before, in their last digits.
    bool depend_on_order() const;

    /// The simulation near a point of the study, `values` of its parameters, on the walk of that point and the way that the crack
    /// goes there: exact for toughness, to first order for all other parameters, which takes milliseconds once that walk is
    /// there.
    Forward near(const std::vector<double>& values) const;

    /// The same from the equilibria that runs have left there, roughly where these lie apart: for a search, whose end `exact`
    /// confirms.
    Forward rough(const std::vector<double>& values) const;

    /// Puts off work on the walks of a point of the study until `catch_up` there: what another process has done before and need
    /// not be done again unless something goes on from these walks.
    void put_off(const std::vector<double>& values, std::function<void()> work) const;

    /// Does what was put off on the walks of a point, in order.
    void catch_up(const std::vector<double>& values) const;

    /// Whether all runs of the study are other toughnesses on walks that are kept, and cost milliseconds.
    bool only_toughness() const;

    /// Whether other toughnesses send a crack another way.
    bool turn_with_toughness() const;

    /// The parameters that turn a crack's way, but for one that gives all stress its unit and one that all toughness goes with.
    std::vector<Eigen::Index> turning() const;

    /// In which parameters runs near a point are exact [parameters].
    std::vector<bool> exact_near() const;

    /// Whether walks have derivatives by all other parameters.
    bool has_slopes() const;

    /// Whether those, and small differences of toughness, are derivatives of all that a run gives: not where the parameters turn
    /// the crack's way.
    bool has_exact_slopes() const;

    /// Whether all runs of the study are walks with other toughnesses or moduli, from equilibrium to equilibrium.
    bool at_equilibrium() const { return only_toughness() || has_slopes(); }

    /// Says where a run by itself with these values would take another kind of strain (plan) than the walks do; else empty.
    std::string other_strain(const std::vector<double>& values) const;

  private:
    class Store;
    std::shared_ptr<Store> store_;
};

}  // namespace crampfit

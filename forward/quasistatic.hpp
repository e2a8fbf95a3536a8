#pragma once

#include "forward/crack_driving.hpp"
#include "forward/equilibrium.hpp"

#include <deque>
#include <map>
#include <optional>
#include <string>

namespace crampfit {

/// Walks a crack through the specimen at equilibrium: from each place of its tip it finds the equilibria, and from the energy that
/// the next advance would release the load at which it moves on. Where that load falls the crack jumps, where it rises the crack
/// waits for it (crack-length control; what rising displacement makes of it is `trace`'s business).
class Quasistatic {
  public:
    /// With a `leader`, another walk in the same scene on another grid, takes the same way and knows the same times.
    Quasistatic(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body,
                const CrackDriving* leader = nullptr);

    /// Adds the next station, with what is needed to know when the crack moves on from it. False: the walk is over.
    bool step();

    /// The load has risen so far [s]: how long the crack has stood where it stands now.
    double time() const { return time_; }
    double crack_length() const;
    const CrackDriving& driving() const { return driving_; }
    CrackDriving take_driving() { return std::move(driving_); }
    bool finished() const { return finished_; }                // nothing can grow any more
    const std::string& failure() const { return failure_; }  // why the walk broke off; empty: it did not
    int equilibria() const { return equilibria_; }

  private:
    // A place of the crack whose equilibria can still be asked for.
    struct Live {
        Station station;
        std::optional<Equilibrium::Snapshot> snapshot;
        std::map<int, std::vector<Vec2>> displacement;  // by number of the time
        std::map<int, std::vector<Vec2>> guess;         // the same at the place before, handed on
        std::map<int, LoadState> states;
        bool left = false;                              // no tip can grow any more
    };

    void add_live();
    bool extend();
    bool know(Live& live, int number);
    bool know_linear(Live& live);
    void enter(const Live& live);
    LoadState load_state() const;
    bool take_ahead(Live& live, const Live& ahead);
    bool finish(Live& live, Live& ahead);
    bool follow(Live& live, Live& ahead);
    Vec2 next_tip(const Live& last, const TipLoad& load) const;
    void find_route(Station& station) const;
    LoadState nothing(double time) const;
    void choose_tip(Station& station) const;
    double time_of(int number) const { return number * time_step_; }

    const Scene& scene_;
    const Plan& plan_;
    const MaterialMap& materials_;
    Discretisation& body_;
    const CrackDriving* leader_;
    Equilibrium equilibrium_;
    CrackDriving driving_;
    std::deque<Live> live_;         // from the station that is next to be finished on
    const Live* entered_ = nullptr; // the one that the equilibrium stands at
    std::vector<std::pair<int, bool>> growing_;  // tips: crack, at its end
    double increment_ = 0;          // of the crack length between stations [m]
    std::size_t ahead_ = 0;         // stations that an advance spans
    double time_step_ = 0;          // between two times at which equilibria are known [s]
    double time_ = 0;               // [s]
    std::string failure_;
    bool finished_ = false;
    int equilibria_ = 0;
};

} // namespace crampfit

#pragma once

#include "forward/crack_driving.hpp"
#include "forward/equilibrium.hpp"
#include "forward/fine_tip.hpp"
#include "forward/job_queue.hpp"

#include <compare>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

namespace crampfit {

/// The way of the cracks through the specimen at equilibrium: stations a part of the `advance` apart, and for each of them
/// equilibria at some times of the loading, found when they are asked for and kept. Toughness has no part in them but for the way
/// that the crack took when it was first followed, so that other toughnesses find most of what they need here.
///
/// Where a single tip's next advance releases least, as in front of a boundary that it crosses, the load must be highest: there
/// stations stand closer, whatever the toughness; in scenes that are not linear only about sharp boundaries.
///
/// Of several tips the one moves whose next advance, the others standing, pays for itself at the least load; tips that nothing
/// tells apart, as in a symmetric specimen, move together. Which one that is depends on the toughness, and with it the way.
///
/// In a linear scene three states say all about a station. Else equilibria are known at even times, and between them by
/// interpolation.
///
/// Where the plan says so every state is found on a second grid too, with cells twice as wide, and a third of the difference is
/// taken off: errors go with the square of the cell (Richardson 1911). G and K at the tips stay those of the finer grid.
class Quasistatic {
  public:
    /// `scene`, `plan` and `materials` must outlive this; `body` is the specimen at rest, without cracks.
    /// `numbers`: keys of numbers of the materials by which derivatives are wanted.
    Quasistatic(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                const std::vector<std::string>& numbers = {}, int threads = 1);
    ~Quasistatic();

    /// From now on all states are as they would be with the numbers shifted, to first order; the crack's way stays. `by` is p_0
    /// ln(p / p_0) of each number.
    void shift(const std::vector<double>& by);

    /// From now on states that are not known need not be found where others of the same place are: they follow from these,
    /// roughly.
    void set_rough(bool rough);

    /// From now on asked before each equilibrium: where it says true no further one is found, as where there is none.
    void end_where(std::function<bool()> stopped);

    /// Waits for the derivatives that are being found, and gives back what only finds them, until equilibria are found again.
    void rest();

    /// Follows the cracks to a station, counted from 0, where it is not known yet. False where the way ends before: every growing
    /// tip has reached a free surface, or there is no equilibrium. Of several tips `critical` of the station before tells which
    /// one moves. `now` is how far the load has come [s].
    bool reach(std::size_t station, double now);

    /// The station, with all its states that have been asked for. It must have been reached.
    const Station& station(std::size_t number) const { return places_[way_[number]].station; }

    /// The load at which the crack moves on from a station. Where an equilibrium is missing that would tell, the time is that
    /// until which the crack stands for sure.
    struct Critical {
        double time = std::numeric_limits<double>::infinity();  // [s]; infinite: not before the end of the loading
        double toughness = 0;                                   // that it overcomes: the mean over the route [J/m^2]
    };

    /// When the crack moves on from a station if the wood is as tough as this. Where that was due before `now`, roughly when:
    /// from what is known already or, `closely`, from a state not long before.
    Critical critical(std::size_t station, const MaterialMap& materials, double now, bool closely = false);

    /// What a station is like at a time; at the last one that is known before it where an equilibrium is missing.
    LoadState at(std::size_t station, double time);

    /// Whether an equilibrium of a station is known at a time, or found.
    bool can_stand(std::size_t station, double time);

    /// The first time beyond this at which equilibria are known, not interpolated [s]; infinite: there is none.
    double next_time(double time) const;

    /// What the scene's probes read there then [readings] [m]; empty where there is no equilibrium.
    std::vector<Vec2> probes_at(std::size_t station, double time);

    const std::string& failure() const { return failure_; }  // why no equilibrium was found; empty: all were
    int equilibria() const { return equilibria_; }           // solved for so far, of the finer grid
    long points() const { return body_.points.count(); }

    /// Goes to the last equilibrium that it knows of the last station that has one, of a scene that is not linear; null: none.
    const Equilibrium* stand_at_last();
    const Discretisation& body() const { return body_; }
    const Boundary& boundary() const { return equilibrium_.boundary(); }

  private:
    struct Known {                       // an equilibrium of this grid
        int time;                        // its number
        std::vector<Vec2> displacement;  // [fields] [m]
        double potential;                // [J]
        double power;                    // [W]
        Equilibrium::Contacts contacts = {};
        Equilibrium::FreeBody free_body = {};  // where bodies rub
    };
    struct Way {                         // from one equilibrium to another
        int from;                        // the time of the one
        std::vector<Vec2> displacement;  // [fields] [m]
        std::vector<Vec2> moved;         // [drivers] of free bodies [m]
    };
    struct Slopes {  // of an equilibrium [numbers]
        std::vector<LoadState> states;
        std::vector<std::vector<Vec2>> probes;  // [readings] of the scene's [m]; empty: none
    };
    struct Sought {
        std::size_t job;
        std::shared_ptr<std::optional<Slopes>> found;  // when it is done; none: the tangent is not positive definite
    };
    struct Seen {  // boxes about the tips of a place
        std::vector<TipPlace> boxes;
        std::size_t ahead;  // that are the first of them: for the advance from there
        bool as_end;        // the others are for one that ends there
    };
    struct Missed {           // by the grid where the equilibrium stands
        MissedEnergy here;    // seen in the boxes for the advance from there
        MissedEnergy as_end;  // and in those for the advance that ends there
    };
    struct GrowingTip {
        int crack;
        bool at_end;
        double increment;   // of its crack's length between stations [m]
        std::size_t ahead;  // stations that an advance spans
    };
    struct Step {           // from one place to the next
        unsigned tips = 0;  // that go on, a bit each
        int quarters = 4;   // of their increment
        auto operator<=>(const Step&) const = default;
    };
    struct Place {  // of all tips: on the way, or tried
        Station station;
        int parent = -1;
        Step step;                 // from the parent
        unsigned inside = 0;       // growing tips that can go on from here
        unsigned tips = 0;         // those of the station's `moving`
        int further = -1;          // the place where they have gone an advance on
        std::map<Step, int> next;  // places that tips have gone on to from here
        std::optional<Equilibrium::Snapshot>
            snapshot;                // to come back to; in a linear scene with a single tip of the last places only
        std::map<int, Known> known;  // by number of the time
        std::vector<CrackFields::NewField> new_fields;  // that the growth from the place before has made
        std::map<int, LoadState> states;                // as they were found, whatever the shift
        std::map<int, Slopes> slopes;                   // their derivatives
        std::map<int, Sought> sought;                   // those that jobs find, or have found
        std::map<int, std::vector<Vec2>> probes;     // what they read, whatever the shift; in a linear scene of times 0 and last
        std::vector<std::optional<TipBoxes>> boxes;  // [growing] about the tips' next advance; none: nothing is missed
        std::map<int, std::size_t> failed;           // times without an equilibrium; how many states were known
        std::set<int> guessed;                       // times at which the station's state is no more than roughly known
    };

    struct Beside {  // where derivatives are found as the walk goes on
        explicit Beside(const Quasistatic& walk);
        void enter(const Place& place);

        Discretisation body;
        Equilibrium equilibrium;
        const Place* entered = nullptr;
    };

    Quasistatic(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                const std::vector<std::string>& numbers, int threads, const Quasistatic* leader);
    int add_place(int parent, Step step);
    int next(int number, Step step, double now);
    Vec2 next_tip(const GrowingTip& growing, const LoadState* state, int quarters) const;
    bool extend(double now);
    std::vector<int> closer_places(const std::array<int, 3>& about, double now);
    int place_between(int number, int quarters, double now);
    double released(int number, int time);
    double friction_correction(int number, int further, int time) const;
    bool follow_leader(std::size_t place);
    bool let_move(int number, unsigned tips, double now);
    void keep_only_from(int number);
    std::vector<unsigned> fronts(int number, const MaterialMap& materials, int time) const;
    double drive(int number, const GrowingTip& tip, int time) const;
    Critical critical_of_front(int number, const MaterialMap& materials, double now, double until, bool closely);
    int time_until(double now) const;
    bool fail();
    bool is_stopped() const { return stopped_ && stopped_(); }
    Quasistatic* coarse() const;
    bool know(std::size_t number, int time);
    bool know_exactly(std::size_t number, int time);
    bool guess(std::size_t number, int time);
    void forget_guesses();
    bool find(std::size_t number, int time);
    std::pair<bool, bool> on_both_grids(const std::function<bool()>& second, const std::function<bool()>& own);
    bool know_linear(std::size_t number);
    bool solve_for(std::size_t number, int time);
    std::optional<Way> way_to(int number, int time, const std::map<int, Known>& known) const;
    bool solve_predicted(std::size_t number, int time);
    Known known_here(int time) const;
    std::vector<Vec2> handed_on(int from, const std::vector<Vec2>& before, int to) const;
    bool solve_from(double potential, double power, double from, double time);
    bool know_ahead(std::size_t number, int time);
    void keep(std::size_t number, int time, LoadState state);
    void keep_probes(std::size_t number, int time);
    void keep_slopes(std::size_t number, int time, Slopes slopes);
    void take_off_grid_error(std::vector<Vec2>& probes, const std::vector<Vec2>& wide) const;
    bool know_slopes(std::size_t number, int time);
    void seek_slopes(std::size_t number, int time, Missed missed);
    bool goes_with_load(const Equilibrium& equilibrium, const std::vector<Vec2>& drivers) const;
    std::optional<Slopes> slopes_at(Equilibrium& equilibrium, const Discretisation& body, const Missed& missed) const;
    void add_slopes(const Equilibrium& equilibrium, const Missed& missed, const Equilibrium::Slopes& slope,
                    const std::vector<LoadState>& of_grid, std::vector<LoadState>& slopes) const;
    void show_shifted(std::size_t number, int time);
    void enter(const Place& place);
    std::vector<std::optional<TipBoxes>> boxes_ahead() const;
    int start_of_advance(int end) const;
    Seen boxes_about(std::size_t number) const;
    static Missed missed_in(const Seen& seen, FineTip& fine_tip, const Equilibrium& equilibrium, bool with_slopes);
    LoadState load_state(const Missed& missed) const;
    bool parted(std::size_t number) const;
    LoadState nothing(double time) const;
    double time_of(int number) const { return times_[number]; }
    int last_time_before(double time) const;

    const Scene& scene_;
    const Plan& plan_;
    const MaterialMap& materials_;
    const Quasistatic* leader_;
    Discretisation body_;
    Equilibrium equilibrium_;
    std::vector<MaterialSlope> numbers_;
    FineTip fine_tip_;
    std::vector<double> shift_;  // [numbers]; empty: none
    std::deque<Place> places_;   // parents first
    bool bodies_rub_;
    bool rough_ = false;
    const Place* entered_ = nullptr;  // the one that the equilibrium stands at
    std::vector<GrowingTip> growing_;
    std::vector<int> way_;              // [stations] places
    std::deque<int> coming_;            // that the way goes on through, as far as it is told
    int closer_ = 1;                    // so much closer may stations stand: 1, 2 or 4
    std::map<unsigned, double> tried_;  // by front: its critical time when it was tried last, times `drive` then
    std::vector<double> times_;         // at which equilibria are known [s]
    int last_time_ = 0;                 // number of the last of them
    std::function<bool()> stopped_;
    std::string failure_;
    int failed_time_ = 0;  // the last one without an equilibrium
    int equilibria_ = 0;
    Equilibrium::Outcome outcome_ = Equilibrium::Outcome::solved;  // of the last one

    struct Coarse;  // the second grid
    std::unique_ptr<Coarse> coarse_;
    std::unique_ptr<Beside> beside_;  // made and used by jobs alone; null: none has been added since the last rest
    JobQueue jobs_;
};

}  // namespace crampfit

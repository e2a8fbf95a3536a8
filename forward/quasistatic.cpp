#include "forward/quasistatic.hpp"

#include "datasets/error.hpp"
#include "forward/loading.hpp"
#include "forward/side_by_side.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <span>
#include <utility>

namespace crampfit {

namespace {

// Stations lie this part of a cell apart where no `advance` asks for less: the ties make the energy nearly linear in between.
constexpr double increment_in_cells = 0.5;

// An advance is taken in at least so many stations, and in as many as it has cells; with a single tip in a linear scene, where
// stations are cheap, in more, and with a single tip in more still about a narrow peak of the load that the crack needs. With
// two, latewood of three cells and 30 times as stiff puts fitted toughnesses off by 5 to 10 %, with four by 0.5
// (`scripts/virtual_wedges --scene opened --finer --seed 103`), and the peak of the wedge sample is 2.8 % low, with eight 0.2 %
// high.
constexpr int least_stations_in_advance = 2, least_stations_where_cheap = 4, least_stations_in_peak = 8;

// No specimen has more of them on a crack's way, whatever the advance.
constexpr double most_stations = 1e9;

// Into how many steps the loading of a scene that is not linear is divided.
constexpr int loading_steps = 32;

// The first of them is halved so often: what small loads do must not hang on how far the loading goes.
constexpr int early_halvings = 3;

// A loading step that does not converge is taken in so many parts at most.
constexpr int most_parts = 16;

// So many places back are asked what the load does there.
constexpr int farthest_back = 3;

// Part by which the change of the potential over a loading step may differ from the load's work by its ends (trapezoid rule).
constexpr double most_disagreement = 0.1;

// Part by which the potential may rise as a crack grows at the same time, where no body has come to press elsewhere, as its power
// would tell: where a crack turns sharply the grid's does (`HardPath.ASharpTurn*`, by 0.1 %).
constexpr double most_rise = 0.005, as_before = 0.01;

// At which equilibria are sought: in so many steps at least, none of which goes over a stop of something that moves. Right behind
// a stop comes a time of its own, as the power of the load jumps there [s]. The first step is halved `halvings` times.
std::vector<double> times_of_loading(const std::vector<double>& stops, double end, int steps, int halvings) {
    const double right_behind = 1e-9 * end;
    std::vector<double> times{0.0};
    const auto go_to = [&](double to) {
        const double from = times.back(), parts = std::max(1.0, std::ceil(steps * (to - from) / end - 1e-6));
        for (double k = 1.0; k < parts; ++k) times.push_back(from + k * ((to - from) / parts));
        times.push_back(to);
    };
    for (const double stop : stops) {
        if (stop >= end - right_behind) break;
        go_to(stop);
        times.push_back(stop + right_behind);
    }
    go_to(end);
    for (int k = 0; k < halvings; ++k) times.insert(times.begin() + 1, 0.5 * times[1]);
    return times;
}

Scene with_wide_cells(Scene scene) {
    scene.model.cell *= 2.0;
    return scene;
}

}  // namespace

struct Quasistatic::Coarse {
    Scene scene;
    MaterialMap materials;
    Quasistatic walk;
    bool side_by_side;  // with the finer grid's

    Coarse(const Scene& fine, const Plan& plan, const std::vector<std::string>& numbers, int threads, const Quasistatic& leader)
        : scene(with_wide_cells(fine)), materials(scene),
          walk(scene, plan, materials, Discretisation(scene, materials), numbers, threads, &leader), side_by_side(threads > 1) {}
};

Quasistatic::Quasistatic(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                         const std::vector<std::string>& numbers, int threads)
    : Quasistatic(scene, plan, materials, body, numbers, threads, nullptr) {
    if (plan.extrapolates) coarse_ = std::make_unique<Coarse>(scene, plan, numbers, threads, *this);
    if (plan.linear ? know_linear(0) : know(0, 0) && know(0, 1)) return;
    const bool is_loose =
        outcome_ == Equilibrium::Outcome::mechanism || (coarse() && coarse()->outcome_ == Equilibrium::Outcome::mechanism);
    if (is_loose && !plan.friction)  // which may hold a smaller load
        throw InputError(scene.file.string(), "edges", "too few",
                         "the specimen, or a piece that cracks cut off it, can move as a whole: nothing holds it");
    fail();
}

Quasistatic::Quasistatic(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                         const std::vector<std::string>& numbers, int threads, const Quasistatic* leader)
    : scene_(scene), plan_(plan), materials_(materials), leader_(leader), body_(body),
      equilibrium_(scene, plan, materials, body_, threads), fine_tip_(scene, plan, materials, body_, numbers_, threads > 1),
      bodies_rub_(std::ranges::any_of(scene.bodies, [](const Body& rigid) { return rigid.contact.coefficient > 0.0; })),
      jobs_(threads > 1) {
    numbers_ = MaterialSlope::of(scene, numbers, body_);
    if (numbers.empty()) equilibrium_.forget_yield_slopes();
    const double end = std::min(plan.end_time, plan.still_from);
    times_ = times_of_loading(travel_of(scene).stops, std::isfinite(end) && end > 0.0 ? end : 1.0,
                              plan.linear ? 2 : loading_steps, plan.linear ? 0 : early_halvings);
    last_time_ = static_cast<int>(times_.size()) - 1;
    const double cell = body_.layout.cell.minCoeff();
    const int least_stations = plan.linear && growing_tips(scene) == 1 ? least_stations_where_cheap : least_stations_in_advance;
    for (int k = 0; k < static_cast<int>(scene.cracks.size()); ++k) {
        const Crack& crack = scene.cracks[k];
        const double stations = std::max<double>(least_stations, std::ceil(crack.advance / cell - 1e-6));
        const std::size_t ahead = crack.advance > 0.0 ? static_cast<std::size_t>(std::min(stations, most_stations)) : 0;
        const double increment = ahead > 0 ? crack.advance / stations : increment_in_cells * cell;
        if (crack.grows == Growth::start || crack.grows == Growth::both) growing_.push_back({k, false, increment, ahead});
        if (crack.grows == Growth::end || crack.grows == Growth::both) growing_.push_back({k, true, increment, ahead});
    }
    if (leader) closer_ = leader->closer_;
    else if (growing_.size() == 1 && growing_[0].ahead > 0)
        while (closer_ < 4 && closer_ * static_cast<int>(growing_[0].ahead) < least_stations_in_peak) closer_ *= 2;
    way_.push_back(add_place(-1, {}));
    if (leader && plan.linear) know_linear(0);
}

Quasistatic::~Quasistatic() = default;

// The number of the last of the times that has come; of the end, beyond it.
int Quasistatic::last_time_before(double time) const {
    const auto beyond = std::ranges::upper_bound(times_, time);
    return std::max(0, static_cast<int>(beyond - times_.begin()) - 1);
}

double Quasistatic::next_time(double time) const {
    const auto beyond = std::ranges::upper_bound(times_, time);
    return beyond == times_.end() ? std::numeric_limits<double>::infinity() : *beyond;
}

Quasistatic* Quasistatic::coarse() const { return coarse_ ? &coarse_->walk : nullptr; }

void Quasistatic::end_where(std::function<bool()> stopped) {
    if (coarse_) coarse_->walk.stopped_ = stopped;
    stopped_ = std::move(stopped);
}

bool Quasistatic::fail() {
    failure_ = "no equilibrium was found";
    if (!plan_.linear && failed_time_ > 0) failure_ += fmt::format(" at {:.4g} s", time_of(failed_time_));
    if (plan_.friction && outcome_ == Equilibrium::Outcome::mechanism) failure_ += friction_may_slip;
    return false;
}

// Boxes about the tips whose next advance counts, as if they went straight on.
std::vector<std::optional<TipBoxes>> Quasistatic::boxes_ahead() const {
    std::vector<std::optional<TipBoxes>> boxes(growing_.size());
    if (plan_.remembers) return boxes;
    std::vector<TipWay> ways;
    for (const auto& [crack, at_end, increment, ahead] : growing_) {
        const CrackTip& tip = equilibrium_.cracks().lines[crack].tip(at_end);
        const double length = tip.inside ? static_cast<double>(std::max<std::size_t>(1, ahead)) * increment : 0.0;
        ways.push_back({crack, tip.position, tip.position + length * tip.direction});
    }
    for (std::size_t t = 0; t < growing_.size(); ++t)
        if (growing_[t].ahead > 0 && ways[t].from != ways[t].to) boxes[t] = fine_tip_.about(equilibrium_.cracks(), ways[t], ways);
    return boxes;
}

// The place whose next advance ends at this one; -1: none does.
int Quasistatic::start_of_advance(int end) const {
    const Step step = places_[end].step;
    int place = places_[end].parent;
    if (place < 0 || step.tips == 0) return -1;
    const auto go_back = [&] { place = place >= 0 && places_[place].step == Step{step.tips} ? places_[place].parent : -1; };
    for (std::size_t k = 1; place >= 0 && k < growing_[std::countr_zero(step.tips)].ahead; ++k) go_back();
    if (step.quarters == Step{}.quarters) return place;
    go_back();
    if (place < 0) return -1;
    const auto start = places_[place].next.find(step);
    return start == places_[place].next.end() ? -1 : start->second;
}

// Of a place where the equilibrium stands.
Quasistatic::Seen Quasistatic::boxes_about(std::size_t number) const {
    const std::vector<std::optional<TipBoxes>>& here = places_[number].boxes;
    Seen seen{{}, 0, false};
    const auto see = [&](std::size_t t, const std::optional<TipBoxes>& boxes) {
        if (boxes) seen.boxes.push_back({*boxes, growing_[t].crack, growing_[t].at_end});
    };
    for (std::size_t t = 0; t < here.size(); ++t) see(t, here[t]);
    seen.ahead = seen.boxes.size();
    const int start = start_of_advance(static_cast<int>(number));
    if (start < 0) return seen;
    const std::vector<std::optional<TipBoxes>>& as_end = places_[start].boxes;
    seen.as_end = !as_end.empty();
    for (std::size_t t = 0; t < as_end.size(); ++t) {
        // A tip that has turned out of the boxes is seen in its own.
        const CrackTip& tip = equilibrium_.cracks().lines[growing_[t].crack].tip(growing_[t].at_end);
        const bool out = as_end[t] && tip.inside && !as_end[t]->hold(tip.position, body_.layout.cell);
        see(t, out ? here[t] : as_end[t]);
    }
    return seen;
}

Quasistatic::Missed Quasistatic::missed_in(const Seen& seen, FineTip& fine_tip, const Equilibrium& equilibrium,
                                           bool with_slopes) {
    const std::vector<MissedEnergy> found = fine_tip.missed(seen.boxes, equilibrium, with_slopes);
    const auto sum = [](std::span<const MissedEnergy> some) {
        MissedEnergy all;
        for (const MissedEnergy& one : some) {
            all.energy += one.energy;
            if (one.by_number.empty()) continue;
            all.by_number.resize(one.by_number.size());
            all.by_displacement.resize(one.by_displacement.size(), Vec2::Zero());
            for (std::size_t n = 0; n < one.by_number.size(); ++n) all.by_number[n] += one.by_number[n];
            for (std::size_t f = 0; f < one.by_displacement.size(); ++f) all.by_displacement[f] += one.by_displacement[f];
        }
        return all;
    };
    const std::span<const MissedEnergy> all(found);
    const MissedEnergy here = sum(all.first(seen.ahead));
    return {here, seen.as_end ? sum(all.subspan(seen.ahead)) : here};
}

LoadState Quasistatic::load_state(const Missed& missed) const {
    LoadState state;
    state.time = equilibrium_.time();
    const double potential = equilibrium_.potential(), power = equilibrium_.power();
    const auto ratio = [&](const MissedEnergy& m) {  // force goes with energy
        return !equilibrium_.boundary().has_dead_load() && m.energy != 0.0 ? 1.0 + m.energy / potential : 1.0;
    };
    state.potential = potential + missed.here.energy;
    state.power = ratio(missed.here) * power;
    state.end_potential = potential + missed.as_end.energy;
    state.end_power = ratio(missed.as_end) * power;
    state.traction_work = equilibrium_.traction_work();
    state.dissipated = equilibrium_.dissipated();
    state.displacement = equilibrium_.measured_displacement(state.time);
    for (const Vec2& r : equilibrium_.reactions()) state.reactions.push_back(ratio(missed.here) * r);
    for (int k = 0; k < static_cast<int>(scene_.cracks.size()); ++k)
        for (const bool at_end : {false, true})
            state.tips.push_back(equilibrium_.cracks().lines[k].tip(at_end).inside && !leader_ ? equilibrium_.load_at(k, at_end)
                                                                                               : TipLoad{});
    return state;
}

// Whether cracks have left the specimen on their way, so that where no equilibrium is found its pieces fly apart.
bool Quasistatic::parted(std::size_t number) const { return places_[number].station.left && !growing_.empty(); }

// A specimen in pieces that nothing holds together carries nothing.
LoadState Quasistatic::nothing(double time) const {
    LoadState state;
    state.time = time;
    state.displacement = equilibrium_.measured_displacement(time);
    state.reactions.assign(equilibrium_.boundary().drivers(), Vec2::Zero());
    state.tips.resize(2 * scene_.cracks.size());
    return state;
}

// Keeps a state of a place, made better by the second grid's.
void Quasistatic::keep(std::size_t number, int time, LoadState state) {
    if (coarse_) extrapolate(state, coarse_->walk.places_[number].states.at(time));
    places_[number].states[time] = places_[number].station.states[time] = std::move(state);
}

// Solves for something on both grids; whether it succeeded on the second, and on this one.
std::pair<bool, bool> Quasistatic::on_both_grids(const std::function<bool()>& second, const std::function<bool()>& own) {
    if (!coarse_) return {true, own()};
    std::array<bool, 2> good{};
    do_side_by_side(coarse_->side_by_side, 2, [&](std::size_t k) { good[k] = k == 0 ? own() : second(); });
    return {good[1], good[0]};
}

// In a linear scene no load and full load say all; the state half way is between them.
bool Quasistatic::know_linear(std::size_t number) {
    const auto follow = [&] { return coarse_->walk.follow_leader(number); };
    const auto solve = [&](int time) {
        ++equilibria_;
        outcome_ = equilibrium_.solve(time_of(time));
        return outcome_ == Equilibrium::Outcome::solved;
    };
    if (!equilibrium_.boundary().has_dead_load()) {  // all goes with the load or its square
        const auto [second, good] = on_both_grids(follow, [&] { return solve(2); });
        if (!second) return false;
        if (!good && !parted(number)) return false;
        const Missed missed = good ? missed_in(boxes_about(number), fine_tip_, equilibrium_, !numbers_.empty()) : Missed{};
        const LoadState full = good ? load_state(missed) : nothing(time_of(2));
        if (good) keep_probes(number, 2);
        Slopes slopes{std::vector<LoadState>(numbers_.size(), nothing(0.0)), {}};
        if (good && !numbers_.empty()) {
            auto here = slopes_at(equilibrium_, body_, missed);
            if (!here) return false;
            slopes = std::move(*here);
        }
        for (const int time : {0, 1, 2}) {
            keep(number, time, scaled(full, 0.5 * time));
            Slopes at_time;
            for (const LoadState& slope : slopes.states) at_time.states.push_back(scaled(slope, 0.5 * time));
            if (time == 2) at_time.probes = std::move(slopes.probes);
            keep_slopes(number, time, std::move(at_time));
        }
        return true;
    }
    if (const auto [second, good] = on_both_grids(follow, [&] { return solve(0); }); !second || !good) return false;
    const std::vector<Vec2> unloaded = equilibrium_.displacements();
    const Equilibrium::Contacts before = equilibrium_.contacts();
    if (plan_.driven && !solve(2)) return false;
    const std::vector<Vec2> loaded = equilibrium_.displacements();
    Equilibrium::Contacts between = equilibrium_.contacts();
    const std::vector<Vec2> moved = between.moved;
    for (const int time : {0, 1, 2}) {
        std::vector<Vec2> u(unloaded.size());
        for (std::size_t f = 0; f < u.size(); ++f) u[f] = (1.0 - 0.5 * time) * unloaded[f] + 0.5 * time * loaded[f];
        for (std::size_t d = 0; d < moved.size(); ++d)
            between.moved[d] = (1.0 - 0.5 * time) * before.moved[d] + 0.5 * time * moved[d];
        equilibrium_.set_displacements(u, time_of(time), between);
        const Missed missed = missed_in(boxes_about(number), fine_tip_, equilibrium_, !numbers_.empty());
        keep(number, time, load_state(missed));
        if (time != 1) keep_probes(number, time);
        if (numbers_.empty()) continue;
        auto slopes = slopes_at(equilibrium_, body_, missed);
        if (!slopes) return false;
        keep_slopes(number, time, std::move(*slopes));
    }
    return true;
}

// Solves for a time from where the equilibrium stands. A body in contact may have several equilibria, some of them absurd: the
// one asked for is connected to where this starts. At a standing crack the potential grows by what the load's power adds up to,
// and when a crack has grown at the same time it falls.
bool Quasistatic::solve_from(double potential, double power, double from, double time) {
    ++equilibria_;
    outcome_ = equilibrium_.solve(time);
    if (outcome_ != Equilibrium::Outcome::solved) return false;
    if (!std::isfinite(potential)) return true;  // from the unloaded specimen, where a load acts from the start
    const double change = equilibrium_.potential() - potential;
    const double rounding = 1e-6 * std::abs(potential) + equilibrium_.negligible_work();
    // With friction the potential holds what has been dissipated, known to the trapezoid rule of a step.
    const bool presses_as_before = scene_.bodies.empty() || std::abs(equilibrium_.power() - power) <= as_before * std::abs(power);
    const double rise = plan_.friction ? most_disagreement : presses_as_before ? most_rise : 0.0;
    if (time == from) return change <= rise * std::abs(potential) + rounding;
    // What touches first may be far from a spring; energies of forces that count as none tell nothing.
    if (std::max(std::abs(power), std::abs(equilibrium_.power())) <= equilibrium_.negligible_power()) return true;
    const double added = 0.5 * (power + equilibrium_.power()) * (time - from);
    if (power == 0.0) return change <= (1.0 + most_disagreement) * added + rounding;  // what comes to touch on the way adds less
    const double most = most_disagreement * std::max(std::abs(change), std::abs(added)) + rounding;
    // Faces that are drawn apart give up what they have held by sticking or rubbing.
    const auto grips = [](const Crack& crack) { return crack.faces.kind != CrackFaces::Kind::frictionless; };
    const bool may_let_go = scene_.bodies.empty() && std::ranges::any_of(scene_.cracks, grips);
    return may_let_go ? change - added <= most : std::abs(change - added) <= most;
}

Quasistatic::Known Quasistatic::known_here(int time) const {
    return {time,
            equilibrium_.displacements(),
            equilibrium_.potential(),
            equilibrium_.power(),
            equilibrium_.contacts(),
            bodies_rub_ ? equilibrium_.free_body() : Equilibrium::FreeBody{}};
}

// A displacement of a place, on the fields of one that follows it.
std::vector<Vec2> Quasistatic::handed_on(int from, const std::vector<Vec2>& before, int to) const {
    if (to == from) return before;
    std::vector<Vec2> displacement = handed_on(from, before, places_[to].parent);
    for (const auto& [added, source] : places_[to].new_fields) displacement.push_back(displacement[source]);
    return displacement;
}

// From one time to another much changes about bodies that slide, but it changes alike at the places before, and at those beside
// it that the crack has been tried to go on to from there: what the nearest that knows both times has gone between them, on the
// fields of this place; where it begins is a time that `known` has.
std::optional<Quasistatic::Way> Quasistatic::way_to(int number, int time, const std::map<int, Known>& known) const {
    int place = -1, from = 0, before = number;
    const auto consider = [&](int other) {
        if (place >= 0 || !places_[other].known.count(time)) return;
        for (const auto& [t, state] : places_[other].known)
            if (t > 0 && t != time && known.count(t) && (place < 0 || std::abs(t - time) < std::abs(from - time)))
                place = other, from = t;
    };
    for (int back = 0; before >= 0 && back <= farthest_back; ++back, before = places_[before].parent) {
        consider(before);
        for (const auto& [step, beside] : places_[before].next) consider(beside);
        if (place >= 0) break;
    }
    if (place < 0) return std::nullopt;
    const Known& start = places_[place].known.at(from);
    const Known& end = places_[place].known.at(time);
    Way way{from, end.displacement, end.contacts.moved};
    for (std::size_t f = 0; f < way.displacement.size(); ++f) way.displacement[f] -= start.displacement[f];
    for (std::size_t d = 0; d < way.moved.size(); ++d) way.moved[d] -= start.contacts.moved[d];
    if (place != before) way.displacement.resize(way.displacement.size() - places_[place].new_fields.size());
    way.displacement = handed_on(before, way.displacement, number);
    return way;
}

// From a state of this place that is known as others have gone on from there.
bool Quasistatic::solve_predicted(std::size_t number, int time) {
    const std::map<int, Known>& known = places_[number].known;
    const auto way = plan_.friction ? std::nullopt : way_to(static_cast<int>(number), time, known);
    if (!way) return false;  // with friction a state hangs on the way to it
    const Known& from = known.at(way->from);
    std::vector<Vec2> predicted = from.displacement;
    for (std::size_t f = 0; f < predicted.size(); ++f) predicted[f] += way->displacement[f];
    Equilibrium::Contacts contacts = from.contacts;
    for (std::size_t d = 0; d < contacts.moved.size(); ++d) contacts.moved[d] += way->moved[d];
    equilibrium_.set_displacements(predicted, time_of(time), contacts);
    return solve_from(from.potential, from.power, time_of(from.time), time_of(time));
}

// Newton's method from the nearest equilibrium that is known: of this place, or handed on from the place before.
bool Quasistatic::solve_for(std::size_t number, int time) {
    Place& place = places_[number];
    enter(place);
    if (!place.known.count(time) && solve_predicted(number, time)) return true;
    const std::vector<Vec2> unloaded(equilibrium_.displacements().size(), Vec2::Zero());
    Known from{0, unloaded, std::numeric_limits<double>::infinity(), 0.0};
    int nearest = std::numeric_limits<int>::max();
    const auto consider = [&](const Known& known, bool before) {
        if (std::abs(known.time - time) >= nearest || (plan_.friction && known.time > time))
            return;  // friction: by loading alone
        nearest = std::abs(known.time - time);
        from = known;
        if (before) from.displacement = handed_on(place.parent, known.displacement, static_cast<int>(number));
    };
    for (const auto& [t, known] : place.known) consider(known, false);
    if (place.parent >= 0)
        for (const auto& [t, known] : places_[place.parent].known) consider(known, true);
    const int least_parts = std::max(1, std::abs(time - from.time));
    const auto time_at = [&](double share) {  // each time between is one of these
        const double at = std::lerp(from.time, time, share);
        const int before = std::min(static_cast<int>(at), last_time_ - 1);
        return std::lerp(time_of(before), time_of(before + 1), at - before);
    };
    for (int parts = least_parts; parts <= most_parts * least_parts; parts *= 2) {
        equilibrium_.set_displacements(from.displacement, time_of(from.time), from.contacts);
        bool good = true;
        if (from.time != time && !place.known.count(from.time) &&
            std::isfinite(from.potential)) {  // growth first, then more load
            good = solve_from(from.potential, from.power, time_of(from.time), time_of(from.time));
            if (good) {
                place.known[from.time] = from = known_here(from.time);
                if (solve_predicted(number, time)) return true;
                equilibrium_.set_displacements(from.displacement, time_of(from.time), from.contacts);
            }
        }
        double potential = from.potential;
        double power = from.power;
        for (int part = 1; part <= parts && good; ++part) {
            if (is_stopped()) return false;
            good = solve_from(potential, power, equilibrium_.time(), time_at(static_cast<double>(part) / parts));
            potential = equilibrium_.potential();
            power = equilibrium_.power();
        }
        if (good) return true;
        if (from.time == time) {  // not by growth at this load, then: by loading, from a lower one
            const auto lower = place.known.lower_bound(time);
            if (lower == place.known.begin()) return false;
            from = std::prev(lower)->second;
        }
    }
    return false;
}

// Knows the state of a place at a time, as the shift has it.
bool Quasistatic::know(std::size_t number, int time) {
    return places_[number].station.states.count(time) || (rough_ && guess(number, time)) || know_exactly(number, time);
}

bool Quasistatic::know_exactly(std::size_t number, int time) {
    if (!places_[number].states.count(time) && !find(number, time)) return false;
    places_[number].guessed.erase(time);
    return shift_.empty() || know_slopes(number, time);
}

// From the states of a place about a time; beyond them as the nearest one goes: its energy as a power of the time.
bool Quasistatic::guess(std::size_t number, int time) {
    Place& place = places_[number];
    const LoadState* before = nullptr;
    const LoadState* after = nullptr;
    for (const auto& [known, state] : place.states) {
        if (known == 0) continue;
        if (!place.station.states.count(known) && !know_slopes(number, known)) return false;
        const LoadState& shown = place.station.states.at(known);
        if (known <= time) before = &shown;
        else if (!after) after = &shown;
    }
    if (!before && !after) return false;
    if (place.station.states.count(time)) return true;
    const LoadState* nearest = before ? before : after;
    const LoadState found = before && after ? between(*before, *after, time_of(time)) : nearest->gone_on(time_of(time));
    place.station.states[time] = found;
    place.guessed.insert(time);
    return true;
}

void Quasistatic::set_rough(bool rough) {
    if (rough_ && !rough) forget_guesses();
    rough_ = rough;
}

void Quasistatic::forget_guesses() {
    for (Place& place : places_) {
        for (const int time : place.guessed) place.station.states.erase(time);
        place.guessed.clear();
        place.station.ahead.clear();
    }
}

// Finds the equilibrium of a place at a time.
bool Quasistatic::find(std::size_t number, int time) {
    if (is_stopped()) return false;
    Place& place = places_[number];
    std::size_t known = 0;  // states to begin from
    for (const Place& any : places_) known += any.known.size();
    if (const auto tried = place.failed.find(time); tried != place.failed.end() && tried->second == known) return false;
    const bool at_rest = time == 0 && !equilibrium_.boundary().has_dead_load();
    const auto [second, good] =
        on_both_grids([&] { return coarse_->walk.follow_leader(number) && coarse_->walk.know(number, time); },
                      [&] { return at_rest || solve_for(number, time); });
    if (!second || (!good && is_stopped())) return false;
    if (at_rest) {
        // Without load nothing has moved; what is held by bodies that do not press yet is in equilibrium all the same.
        place.known[0] = {0, std::vector<Vec2>(place.snapshot->displacement.size(), Vec2::Zero()), 0.0, 0.0};
        keep(number, 0, nothing(0.0));
        return true;
    }
    if (good) {
        if (!scene_.output.probes.places.empty()) equilibrium_.refine();
        place.known[time] = known_here(time);
        Missed missed = missed_in(boxes_about(number), fine_tip_, equilibrium_, !numbers_.empty());
        keep(number, time, load_state(missed));
        seek_slopes(number, time, std::move(missed));
        keep_probes(number, time);
        return true;
    }
    if (!parted(number)) {
        place.failed[time] = known;
        failed_time_ = time;
        return false;
    }
    keep(number, time, nothing(time_of(time)));
    return true;
}

const Equilibrium* Quasistatic::stand_at_last() {
    for (auto number = way_.rbegin(); number != way_.rend(); ++number) {
        const Place& place = places_[*number];
        if (place.known.empty() || place.known.rbegin()->first == 0) continue;
        const Known& last = place.known.rbegin()->second;
        enter(place);
        equilibrium_.set_displacements(last.displacement, time_of(last.time), last.contacts);
        return &equilibrium_;
    }
    return nullptr;
}

// What bodies that rub have dissipated hangs on the whole way to a state, and was another where the crack has been longer all
// along: with their grip as it is, an advance releases what they and the grips do on the wood's way from one state to the other,
// by forces that change evenly, less what that stores. In linear wood this is Betti's 1/2 (f1 u2 - f2 u1). Found: that less the
// difference of the potentials [J].
double Quasistatic::friction_correction(int number, int further, int time) const {
    const auto from = places_[number].known.find(time), to = places_[further].known.find(time);
    if (time == 0 || from == places_[number].known.end() || to == places_[further].known.end()) return 0.0;
    const Known &here = from->second, &there = to->second;
    std::vector<Vec2> before = here.displacement;
    int shared = number;  // the place that both come from
    for (int other = further; shared != other;) {
        if (other > shared) other = places_[other].parent;
        else before.resize(before.size() - places_[std::exchange(shared, places_[shared].parent)].new_fields.size());
    }
    const std::size_t fields = before.size();
    before = handed_on(shared, before, further);
    double work = 0.0;
    for (std::size_t f = 0; f < before.size(); ++f) {
        Vec2 force = 0.5 * there.free_body.external_forces[f];
        if (f < fields) force += 0.5 * here.free_body.external_forces[f];
        work += force.dot(there.displacement[f] - before[f]);
    }
    const double correction = work + here.free_body.energy - there.free_body.energy - (here.potential - there.potential);
    return coarse() ? correction + (correction - coarse()->friction_correction(number, further, time)) / 3.0 : correction;
}

// Knows a place, and the one an advance further, at a time.
bool Quasistatic::know_ahead(std::size_t number, int time) {
    if (!plan_.linear && !know(number, time)) return false;
    Place& place = places_[number];
    if (place.station.moving.empty() || place.station.moving.front().route.size() < 2) return true;
    if (!plan_.linear && !know(place.further, time)) return false;
    const LoadState& there = places_[place.further].station.states.at(time);
    place.station.ahead[time] = {there.end_potential, there.end_power};
    if (!bodies_rub_ || time == 0) return true;
    const LoadState& here = place.station.states.at(time);
    const double correction = friction_correction(static_cast<int>(number), place.further, time);
    const double released = here.potential - there.end_potential + correction;
    place.station.ahead[time] = {there.end_potential - correction, here.power - 2.0 * released / time_of(time)};
    return true;
}

bool Quasistatic::can_stand(std::size_t station, double time) {
    if (plan_.linear) return true;
    const int number = way_[station], low = std::min(last_time_before(time), last_time_ - 1);
    return know(number, low) && (time <= time_of(low) || know(number, low + 1));
}

LoadState Quasistatic::at(std::size_t station_number, double time) {
    const int number = way_[station_number];
    const Station& station = places_[number].station;
    if (!plan_.linear) {
        const int low = std::min(last_time_before(time), last_time_ - 1);
        const bool between = time > time_of(low);
        if (!can_stand(station_number, time)) fail();
        if (!station.states.count(low) || (between && !station.states.count(low + 1))) {
            const auto beyond = station.states.upper_bound(low);
            if (beyond != station.states.begin()) time = std::min(time, time_of(std::prev(beyond)->first));
        }
    }
    return station.states.empty() ? nothing(time) : station.at(time);
}

}  // namespace crampfit

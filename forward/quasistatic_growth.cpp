#include "forward/growth.hpp"
#include "forward/quasistatic.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

// The way of the cracks: which tips move on from a place, where to, and when. Each tip, or front of tips that are alike, is
// tried: it goes its own next advance while the others stand, and the one whose advance pays for itself at the least load moves.

namespace crampfit {

namespace {

constexpr double never = std::numeric_limits<double>::infinity();

// Tips whose G agrees to this part, with wood as tough ahead, move together: rounding and Newton's method leave less than that
// between the tips of a symmetric specimen, and no grid tells them apart.
constexpr double alike = 1e-4;

// A front is not tried where the load at which it would move, as it was when it was tried last and by how G at its tip has
// changed since, is this many times that of another.
constexpr double far_above = 1.5;

// G at the tip over toughness below which a crack is not about to move.
constexpr double far_below = 0.3;

// Of a single tip in a linear scene so many of the last places can be come back to: more than closer stations ask for.
constexpr std::size_t kept_places = 32;

// Second difference of the energy released over the least of three, above which stations stand closer: at an eighth of it a
// parabola has its least between them, and the load its peak half of that higher.
constexpr double narrow = 0.04;

// How far a tip has gone straight since the crack's last bend; infinite where there is none [m].
double leg(const CrackLine& line, bool at_end) {
    const std::size_t corners = line.points.size();
    if (corners < 3) return never;
    return (line.tip(at_end).position - (at_end ? line.points[corners - 2] : line.points[1])).norm();
}

bool is_narrow(double before, double least, double after) {
    return least > 0.0 && before > least && after > least && before - 2.0 * least + after > narrow * least;
}

}  // namespace

// The equilibrium stands at a new place of the cracks.
int Quasistatic::add_place(int parent, Step step) {
    Place& place = places_.emplace_back();
    place.parent = parent;
    place.step = step;
    Station& station = place.station;
    station.thickness = body_.layout.thickness;
    station.linear = plan_.linear;
    station.still_from = plan_.still_from;
    station.grows = !growing_.empty();
    for (const CrackLine& line : equilibrium_.cracks().lines) {
        station.tips.push_back({line.start.position, line.end.position});
        station.lengths.push_back(line.length);
    }
    for (std::size_t t = 0; t < growing_.size(); ++t)
        if (equilibrium_.cracks().lines[growing_[t].crack].tip(growing_[t].at_end).inside) place.inside |= 1u << t;
    station.left = place.inside == 0;
    place.boxes = boxes_ahead();
    if (!plan_.linear || growing_.size() > 1 || closer_ > 1) place.snapshot = equilibrium_.save();
    if (plan_.linear && growing_.size() == 1 && places_.size() > kept_places)
        places_[places_.size() - 1 - kept_places].snapshot.reset();
    entered_ = &place;
    return static_cast<int>(places_.size()) - 1;
}

void Quasistatic::enter(const Place& place) {
    if (entered_ == &place) return;
    equilibrium_.restore(*place.snapshot);
    entered_ = &place;
}

Vec2 Quasistatic::next_tip(const GrowingTip& growing, const LoadState* state, int quarters) const {
    if (leader_) return leader_->places_[places_.size()].station.tips[growing.crack][growing.at_end];
    const CrackLine& line = equilibrium_.cracks().lines[growing.crack];
    const CrackTip& tip = line.tip(growing.at_end);
    const GrowthDirection criterion = scene_.cracks[growing.crack].direction;
    const double way = 0.25 * quarters * growing.increment;
    const double cell = body_.layout.cell.maxCoeff();
    const TipLoad& load = state->tips[2 * growing.crack + growing.at_end];
    const bool may_turn = leg(line, growing.at_end) >= (least_leg_in_cells(line, growing.at_end) - 1e-6) * cell;
    return tip.position + way * growth_direction(criterion, tip, load, materials_, std::max(growing.increment, cell), may_turn);
}

// The number of the last time of the loading, with a load, that `now` has passed: what tells whether a place has been due before.
int Quasistatic::time_until(double now) const { return plan_.linear ? last_time_ : std::max(1, last_time_before(now)); }

// The place where tips have gone on by a step; -1 where there is no equilibrium.
int Quasistatic::next(int number, Step step, double now) {
    Place& from = places_[number];
    if (!leader_) step.tips &= from.inside;
    if (const auto known = from.next.find(step); known != from.next.end()) return known->second;
    const int time = time_until(now);
    if (!leader_ && !know_exactly(number, time)) return -1;
    enter(from);
    if (!leader_ && !plan_.linear)
        equilibrium_.set_displacements(from.known.at(time).displacement, time_of(time), from.known.at(time).contacts);
    std::vector<CrackFields::NewField> fields;
    for (std::size_t t = 0; t < growing_.size(); ++t) {
        if (!(step.tips >> t & 1u) || !equilibrium_.cracks().lines[growing_[t].crack].tip(growing_[t].at_end).inside) continue;
        const Vec2 to = next_tip(growing_[t], leader_ ? nullptr : &from.states.at(time), step.quarters);
        const auto grown = equilibrium_.grow(growing_[t].crack, growing_[t].at_end, to);
        fields.insert(fields.end(), grown.begin(), grown.end());
    }
    const int added = add_place(number, step);
    places_[added].new_fields = std::move(fields);
    const int found = plan_.linear && !know_linear(added) ? -1 : added;
    from.next[step] = found;  // the second grid must not be asked for the same place twice
    return found;
}

// On the coarse grid: the same places in the same order.
bool Quasistatic::follow_leader(std::size_t place) {
    while (places_.size() <= place) {
        if (places_.size() >= leader_->places_.size()) return false;
        const Place& led = leader_->places_[places_.size()];
        if (next(led.parent, led.step, 0.0) < 0) return false;
    }
    return !plan_.linear || !places_[place].states.empty();
}

// Lets these tips be the ones that move on from a place, and finds their routes. False where an equilibrium on the way is
// missing.
bool Quasistatic::let_move(int number, unsigned tips, double now) {
    Place& place = places_[number];
    if (place.tips == tips) return true;
    place.tips = tips;
    place.further = number;
    place.station.moving.clear();
    place.station.ahead.clear();
    std::size_t ahead = 0;
    for (std::size_t t = 0; t < growing_.size(); ++t) {
        if (!(tips >> t & 1u)) continue;
        const auto& [crack, at_end, increment, stations] = growing_[t];
        place.station.moving.push_back({crack, at_end, {place.station.tips[crack][at_end]}});
        ahead = stations;
    }
    for (std::size_t k = 0; k < ahead && (places_[place.further].inside & tips); ++k) {
        const int on = next(place.further, {tips}, now);
        if (on < 0) return false;
        place.further = on;
        for (auto& [crack, at_end, route] : place.station.moving) {
            const Vec2& tip = places_[on].station.tips[crack][at_end];
            if (tip != route.back()) route.push_back(tip);
        }
    }
    return true;
}

bool Quasistatic::reach(std::size_t station, double now) {
    while (way_.size() <= station) {
        if (places_[way_.back()].station.moving.empty()) return false;  // the way ends, or it is not known yet which tips move
        if (coming_.empty() && !extend(now)) return fail();
        way_.push_back(coming_.front());
        coming_.pop_front();
        if (plan_.linear && growing_.size() > 1) keep_only_from(way_.back());
    }
    if (growing_.size() == 1 && !places_[way_[station]].station.left && !let_move(way_[station], 1u, now)) fail();
    return true;
}

// Tells where the way goes on from its last place: an increment, or two with closer places between them where the second place is
// one of narrowly least energy released. At regular places only.
bool Quasistatic::extend(double now) {
    const int last = way_.back();
    const unsigned tips = places_[last].tips;
    const int on = next(last, {tips}, now);
    if (on < 0) return false;
    coming_ = {on};
    if (closer_ == 1 || places_[on].station.left || (!plan_.linear && !places_[on].boxes[0]) || !let_move(on, tips, now))
        return true;
    const int after = next(on, {tips}, now);
    if (after < 0 || places_[after].station.left || !let_move(after, tips, now) || places_[places_[after].further].station.left)
        return true;
    const std::vector<int> closer = closer_places({last, on, after}, now);
    if (!closer.empty()) coming_.assign(closer.begin(), closer.end());
    return true;
}

// The energy that a place's next advance releases; negative where it is not known [J]. Where scenes are not linear, from the
// nearest time that both its ends are known at, as its power says.
double Quasistatic::released(int number, int time) {
    const int further = places_[number].further;
    const std::map<int, LoadState>& from = places_[number].states;
    const std::map<int, LoadState>& to = places_[further].states;
    int nearest = 0;
    for (const auto& [t, state] : from)
        if (to.count(t) && std::abs(t - time) < std::abs(nearest - time)) nearest = t;
    if (plan_.linear || nearest == 0) {
        if (!know_exactly(number, time) || !know_exactly(further, time)) return -1.0;
        nearest = time;
    }
    const double energy = from.at(nearest).potential - to.at(nearest).end_potential +
                          (bodies_rub_ ? friction_correction(number, further, nearest) : 0.0);
    if (nearest == time || energy <= 0.0) return energy;
    const double power = bodies_rub_ ? 2.0 * energy / time_of(nearest) : from.at(nearest).power - to.at(nearest).end_power;
    return energy * std::pow(time_of(time) / time_of(nearest), power * time_of(nearest) / energy);
}

// Two stretches of the way from place to place, the first place left out, with closer places where the middle one is one of
// narrowly least energy released; else none. First half way to either side, then about the least of these.
std::vector<int> Quasistatic::closer_places(const std::array<int, 3>& about, double now) {
    int time = time_until(now);
    std::map<int, std::pair<int, double>> found;  // by quarters of an increment from the first: place, and energy released
    const auto add = [&](int quarters, int place) { found[quarters] = {place, place < 0 ? -1.0 : released(place, time)}; };
    const auto narrow_at = [&](int middle, int apart) {
        return is_narrow(found[middle - apart].second, found[middle].second, found[middle + apart].second);
    };
    for (int k = 0; k < 3; ++k) add(4 * k, about[k]);
    if (!plan_.linear && narrow_at(4, 4)) {  // states as the middle one moves on will be asked for again
        const std::string failure = failure_;
        const Critical due = critical_of_front(about[1], materials_, now, never, false);
        failure_ = failure;  // the crack may never come there: what is missing ends the way when it does
        if (std::isfinite(due.time)) time = time_until(due.time);
        for (int k = 0; k < 3; ++k) add(4 * k, about[k]);
    }
    int least = 4, apart = 4;
    for (; 4 / apart < closer_ && narrow_at(least, apart); apart /= 2) {
        for (const int side : {-apart / 2, apart / 2}) {
            const int quarters = least + side;
            add(quarters, place_between(about[quarters / 4], quarters % 4, now));
            if (found[quarters].second <= 0.0) return {};
        }
        for (const int quarters : {least - apart / 2, least + apart / 2})
            if (found[quarters].second < found[least].second) least = quarters;
    }
    std::vector<int> places;
    if (found.size() == about.size()) return places;
    for (const auto& [quarters, place] : found)
        if (quarters > 0 && (plan_.linear || quarters % 4 == 0 || std::abs(quarters - least) <= apart))
            places.push_back(place.first);
    return places;
}

// A place some quarters of an increment beyond a regular one, with what lies an advance ahead of it; -1 where there is no
// equilibrium.
int Quasistatic::place_between(int number, int quarters, double now) {
    const unsigned tips = places_[number].tips;
    const int between = next(number, {tips, quarters}, now);
    if (between < 0) return -1;
    const int further = next(places_[number].further, {tips, quarters}, now);
    if (further < 0) return -1;
    Place& place = places_[between];
    place.tips = tips;
    place.further = further;
    place.station.moving = places_[number].station.moving;
    for (auto& [crack, at_end, route] : place.station.moving) {
        route.front() = place.station.tips[crack][at_end];
        route.push_back(places_[further].station.tips[crack][at_end]);
    }
    return between;
}

// In a linear scene no one comes back to what does not lie ahead of a place.
void Quasistatic::keep_only_from(int number) {
    std::vector<bool> ahead(places_.size(), false);
    for (std::size_t k = 0; k < places_.size(); ++k) {
        ahead[k] = static_cast<int>(k) == number || (places_[k].parent >= 0 && ahead[places_[k].parent]);
        if (!ahead[k]) places_[k].snapshot.reset();
    }
    if (coarse()) coarse()->keep_only_from(number);
}

// How strongly a tip is loaded at a place, in what goes linearly with the load: sqrt(G) per time.
double Quasistatic::drive(int number, const GrowingTip& tip, int time) const {
    const LoadState& state = places_[number].station.states.at(time);
    return std::sqrt(std::max(0.0, state.tips[2 * tip.crack + tip.at_end].G)) / time;
}

// Tips that move together, each front as a set of bits: those that nothing tells apart.
std::vector<unsigned> Quasistatic::fronts(int number, const MaterialMap& materials, int time) const {
    const Place& place = places_[number];
    std::vector<unsigned> found;
    std::vector<std::pair<double, double>> first;  // of each front: drive and toughness
    for (std::size_t t = 0; t < growing_.size(); ++t) {
        if (!(place.inside >> t & 1u)) continue;
        const GrowingTip& tip = growing_[t];
        const CrackTip& at = place.snapshot->cracks.lines[tip.crack].tip(tip.at_end);
        const double reach = static_cast<double>(std::max<std::size_t>(1, tip.ahead)) * tip.increment;
        const double toughness = mean_toughness(materials, {at.position, at.position + reach * at.direction});
        const double load = drive(number, tip, time);
        std::size_t f = 0;
        const auto same = [&](std::size_t front) {
            const GrowingTip& other = growing_[std::countr_zero(found[front])];
            return other.ahead == tip.ahead && other.increment == tip.increment && load > 0.0 &&
                   std::abs(first[front].first - load) <= 0.5 * alike * load &&
                   std::abs(first[front].second - toughness) <= alike * toughness;
        };
        while (f < found.size() && !same(f)) ++f;
        if (f == found.size()) {
            found.push_back(0u);
            first.emplace_back(load, toughness);
        }
        found[f] |= 1u << t;
    }
    return found;
}

Quasistatic::Critical Quasistatic::critical(std::size_t number, const MaterialMap& materials, double now, bool closely) {
    if (!failure_.empty()) return {now};
    const int here = way_[number];
    if (places_[here].station.left || growing_.empty()) return {};
    if (growing_.size() == 1) return critical_of_front(here, materials, now, never, closely);
    const int time = time_until(now);
    if (!know(here, time)) {
        fail();
        return {now};
    }
    struct Front {
        unsigned tips;
        double drive, expected;
    };
    std::vector<Front> all;
    for (const unsigned tips : fronts(here, materials, time)) {
        const double load = drive(here, growing_[std::countr_zero(tips)], time);
        const auto tried = tried_.find(tips);
        all.push_back({tips, load, tried == tried_.end() ? 0.0 : load > 0.0 ? tried->second / load : never});
    }
    std::stable_sort(all.begin(), all.end(), [](const Front& a, const Front& b) { return a.expected < b.expected; });
    Critical first;
    unsigned moving = 0;
    for (const Front& front : all) {
        if (moving != 0 && front.expected > far_above * std::max(now, first.time)) continue;
        if (!let_move(here, front.tips, now)) fail();
        const Critical found = critical_of_front(here, materials, now, first.time, closely);
        if (!failure_.empty()) return {std::min(found.time, first.time)};
        if (std::isfinite(found.time)) tried_[front.tips] = found.time * front.drive;
        if (moving != 0 && found.time >= first.time) continue;
        first = found;
        moving = front.tips;
    }
    let_move(here, moving, now);
    return first;
}

// When the front that is set to move from a place does, if that is before `until`.
Quasistatic::Critical Quasistatic::critical_of_front(int number, const MaterialMap& materials, double now, double until,
                                                     bool closely) {
    const Station& station = places_[number].station;
    const double toughness = mean_toughness(materials, station.moving);
    const auto judge = [&]() -> Critical { return {station.critical_time(toughness, rough_), toughness}; };
    if (plan_.linear) {
        for (const int time : {0, 1, 2}) know_ahead(number, time);
        return judge();
    }
    int low = std::min(last_time_before(now), last_time_ - 1);
    int high = low + 1;
    const auto missing = [&]() -> Critical {
        fail();
        return {std::max(now, time_of(low))};
    };
    if (rough_) {
        bool some = false;
        for (const auto& [time, state] : places_[number].states)
            if (time > 0 && places_[places_[number].further].states.count(time)) some = know_ahead(number, time) || some;
        if (some) return judge();
    }
    // As long as G at the tip is this far below the toughness, what lies ahead is not asked for; were the next advance to release
    // more all the same, that shows later, and what is missing is found then.
    const auto far_from_critical = [&](int time) {
        if (!know(number, time)) return false;
        const MovingTip& tip = station.moving.front();
        return station.states.at(time).tips[2 * tip.crack + tip.at_end].G < far_below * toughness;
    };
    // What a crack runs through without more load has been due before, and one state says so: the last that is known, else a new
    // one.
    int known = low;
    const auto both_known = [&](int time) {
        return places_[number].states.count(time) && places_[places_[number].further].states.count(time);
    };
    while (known > 0 && !closely && growing_.size() == 1 && !both_known(known)) --known;
    for (const int time : {known, low}) {
        if (time == 0 || far_from_critical(time)) continue;
        if (!know_ahead(number, time)) return missing();
        if (const Critical found = judge(); found.time <= time_of(time)) return found;
    }
    while (high < last_time_ && time_of(high) < until && far_from_critical(high)) low = high++;
    while (true) {
        if (!know_ahead(number, low) || !know_ahead(number, high)) return missing();
        const Critical found = judge();
        if (!std::isfinite(found.time)) {
            if (high >= last_time_ || time_of(high) >= until) return found;
            low = high++;
            continue;
        }
        // Good where it lies between two states that stand next to each other, or where it has been due before.
        const int before = last_time_before(found.time);
        if (found.time <= now || before >= last_time_) return found;
        if (station.ahead_known(before) && station.ahead_known(before + 1)) return found;
        low = std::max(0, before);
        high = low + 1;
    }
}

}  // namespace crampfit

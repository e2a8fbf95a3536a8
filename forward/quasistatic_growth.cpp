#include "forward/growth.hpp"
#include "forward/quasistatic.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

// The way of the cracks: which tips move on from a place, where to, and when. Each tip, or front of tips that are alike, is tried:
// it goes its own next advance while the others stand, and the one whose advance pays for itself at the least load moves.

namespace crampfit {

namespace {

constexpr double never = std::numeric_limits<double>::infinity();

// Tips whose G agrees to this part, with wood as tough ahead, move together: rounding and Newton's method leave less than that between
// the tips of a symmetric specimen, and no grid tells them apart.
constexpr double alike = 1e-4;

// A front is not tried where the load at which it would move, as it was when it was tried last and by how G at its tip has changed
// since, is this many times that of another.
constexpr double far_above = 1.5;

// G at the tip over toughness below which a crack is not about to move.
constexpr double far_below = 0.3;

} // namespace

// The equilibrium stands at a new place of the cracks.
int Quasistatic::add_place(int parent, unsigned moved) {
    Place& place = places_.emplace_back();
    place.parent = parent;
    place.moved = moved;
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
    if (!plan_.linear || growing_.size() > 1) place.snapshot = equilibrium_.save();
    entered_ = &place;
    return static_cast<int>(places_.size()) - 1;
}

void Quasistatic::enter(const Place& place) {
    if (entered_ == &place) return;
    equilibrium_.restore(*place.snapshot);
    entered_ = &place;
}

Vec2 Quasistatic::next_tip(const GrowingTip& growing, const LoadState* state) const {
    if (leader_) return leader_->places_[places_.size()].station.tips[growing.crack][growing.at_end];
    const CrackTip& tip = equilibrium_.cracks().lines[growing.crack].tip(growing.at_end);
    const TipLoad& load = state->tips[2 * growing.crack + growing.at_end];
    const GrowthDirection criterion = scene_.cracks[growing.crack].direction;
    return tip.position + growing.increment * growth_direction(criterion, tip, load, materials_, growing.increment);
}

// The number of the last time of the loading, with a load, that `now` has passed: what tells whether a place has been due before.
int Quasistatic::time_until(double now) const {
    return plan_.linear ? last_time_ : std::clamp(static_cast<int>(now / time_step_), 1, last_time_);
}

// The place where these tips have gone on by an increment; -1 where there is no equilibrium.
int Quasistatic::next(int number, unsigned tips, double now) {
    Place& from = places_[number];
    if (!leader_) tips &= from.inside;
    if (const auto known = from.next.find(tips); known != from.next.end()) return known->second;
    const int time = time_until(now);
    if (!leader_ && !know_exactly(number, time)) return -1;
    enter(from);
    if (!leader_ && !plan_.linear) equilibrium_.set_displacements(from.known.at(time).displacement, time_of(time), from.known.at(time).contacts);
    std::vector<CrackFields::NewField> fields;
    for (std::size_t t = 0; t < growing_.size(); ++t) {
        if (!(tips >> t & 1u) || !equilibrium_.cracks().lines[growing_[t].crack].tip(growing_[t].at_end).inside) continue;
        const Vec2 to = next_tip(growing_[t], leader_ ? nullptr : &from.states.at(time));
        const auto grown = equilibrium_.grow(growing_[t].crack, growing_[t].at_end, to);
        fields.insert(fields.end(), grown.begin(), grown.end());
    }
    const int added = add_place(number, tips);
    places_[added].new_fields = std::move(fields);
    if (plan_.linear && !know_linear(added)) return -1;
    from.next[tips] = added;
    return added;
}

// On the coarse grid: the same places in the same order.
bool Quasistatic::follow_leader(std::size_t place) {
    while (places_.size() <= place) {
        if (places_.size() >= leader_->places_.size()) return false;
        const Place& led = leader_->places_[places_.size()];
        if (next(led.parent, led.moved, 0.0) < 0) return false;
    }
    return true;
}

// Lets these tips be the ones that move on from a place, and finds their routes. False where an equilibrium on the way is missing.
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
        const int on = next(place.further, tips, now);
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
        const Place& last = places_[way_.back()];
        if (last.station.moving.empty()) return false;  // the way ends, or it is not known yet which tips move
        const int on = next(way_.back(), last.tips, now);
        if (on < 0) return fail();
        way_.push_back(on);
        if (plan_.linear && growing_.size() > 1) keep_only_from(on);
    }
    if (growing_.size() == 1 && !places_[way_[station]].station.left && !let_move(way_[station], 1u, now)) fail();
    return true;
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
                   std::abs(first[front].first - load) <= 0.5 * alike * load && std::abs(first[front].second - toughness) <= alike * toughness;
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
    const int here = way_[number];
    if (places_[here].station.left || growing_.empty()) return {};
    if (growing_.size() == 1) return critical_of_front(here, materials, now, never, closely);
    const int time = time_until(now);
    if (!know(here, time)) {
        fail();
        return {};
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
        if (!failure_.empty()) return {};
        if (std::isfinite(found.time)) tried_[front.tips] = found.time * front.drive;
        if (moving != 0 && found.time >= first.time) continue;
        first = found;
        moving = front.tips;
    }
    let_move(here, moving, now);
    return first;
}

// When the front that is set to move from a place does, if that is before `until`.
Quasistatic::Critical Quasistatic::critical_of_front(int number, const MaterialMap& materials, double now, double until, bool closely) {
    const Station& station = places_[number].station;
    const double toughness = mean_toughness(materials, station.moving);
    const auto judge = [&]() -> Critical { return {station.critical_time(toughness, rough_), toughness}; };
    if (plan_.linear) {
        for (const int time : {0, 1, 2}) know_ahead(number, time);
        return judge();
    }
    const auto missing = [&]() -> Critical {
        fail();
        return {};
    };
    if (rough_) {
        bool some = false;
        for (const auto& [time, state] : places_[number].states)
            if (time > 0 && places_[places_[number].further].states.count(time)) some = know_ahead(number, time) || some;
        if (some) return judge();
    }
    int low = std::min(static_cast<int>(now / time_step_), last_time_ - 1);
    int high = low + 1;
    // As long as G at the tip is this far below the toughness, what lies ahead is not asked for; were the next advance to release
    // more all the same, that shows later, and what is missing is found then.
    const auto far_from_critical = [&](int time) {
        if (!know(number, time)) return false;
        const MovingTip& tip = station.moving.front();
        return station.states.at(time).tips[2 * tip.crack + tip.at_end].G < far_below * toughness;
    };
    // What a crack runs through without more load has been due before, and one state says so: the last that is known, else a new one.
    int known = low;
    const auto both_known = [&](int time) { return places_[number].states.count(time) && places_[places_[number].further].states.count(time); };
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
        const int before = static_cast<int>(found.time / time_step_);
        if (found.time <= now || before >= last_time_) return found;
        if (station.ahead_known(before) && station.ahead_known(before + 1)) return found;
        low = std::max(0, before);
        high = low + 1;
    }
}

} // namespace crampfit

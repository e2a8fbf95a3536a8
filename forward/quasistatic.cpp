#include "forward/quasistatic.hpp"

#include "datasets/error.hpp"
#include "forward/growth.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

namespace {

// Stations lie this part of a cell apart where no `advance` asks for less: the ties make the energy nearly linear in between.
constexpr double increment_in_cells = 0.5;

// An advance is taken in at least so many stations, and in as many as it has cells.
constexpr int least_stations_in_advance = 2;

// Into how many steps the loading of a scene that is not linear is divided.
constexpr int loading_steps = 32;

// A loading step that does not converge is taken in so many parts at most.
constexpr int most_parts = 16;

} // namespace

Quasistatic::Quasistatic(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body,
                         const CrackDriving* leader)
    : scene_(scene), plan_(plan), materials_(materials), body_(body), leader_(leader), equilibrium_(scene, plan, materials, body) {
    driving_.linear = plan.linear;
    driving_.still_from = plan.still_from;
    const double end = std::min(plan.end_time, plan.still_from);
    time_step_ = (std::isfinite(end) && end > 0.0 ? end : 1.0) / (plan.linear ? 2 : loading_steps);
    const double cell = body.layout.cell.minCoeff();
    increment_ = increment_in_cells * cell;
    for (int k = 0; k < static_cast<int>(scene.cracks.size()); ++k) {
        const Crack& crack = scene.cracks[k];
        if (crack.grows == Growth::start || crack.grows == Growth::both) growing_.emplace_back(k, false);
        if (crack.grows == Growth::end || crack.grows == Growth::both) growing_.emplace_back(k, true);
        if (crack.grows == Growth::none || crack.advance == 0.0) continue;
        ahead_ = std::max<std::size_t>(least_stations_in_advance, std::lround(std::ceil(crack.advance / cell - 1e-6)));
        increment_ = crack.advance / static_cast<double>(ahead_);
    }
    if (leader && !leader->stations.front().route.empty()) ahead_ = leader->stations.front().route.size() - 1;
    add_live();
}

// The equilibrium stands at a new place of the crack.
void Quasistatic::add_live() {
    Live live;
    Station& station = live.station;
    station.thickness = body_.layout.thickness;
    live.left = true;
    for (const CrackLine& line : equilibrium_.cracks().lines) {
        station.tips.push_back({line.start.position, line.end.position});
        station.lengths.push_back(line.length);
    }
    for (const auto& [crack, at_end] : growing_) {
        const CrackTip& tip = equilibrium_.cracks().lines[crack].tip(at_end);
        if (!tip.inside) continue;
        live.left = false;
        station.crack = crack;
        station.at_end = at_end;
    }
    station.split = live.left && !growing_.empty();
    if (!plan_.linear) live.snapshot = equilibrium_.save();
    live_.push_back(std::move(live));
    entered_ = &live_.back();
}

void Quasistatic::enter(const Live& live) {
    if (entered_ == &live) return;
    equilibrium_.restore(*live.snapshot);
    entered_ = &live;
}

LoadState Quasistatic::load_state() const {
    LoadState state;
    state.time = equilibrium_.time();
    state.potential = equilibrium_.potential();
    state.power = equilibrium_.power();
    state.traction_work = equilibrium_.traction_work();
    state.displacement = equilibrium_.measured_displacement(equilibrium_.time());
    state.reactions = equilibrium_.reactions();
    for (int k = 0; k < static_cast<int>(scene_.cracks.size()); ++k)
        for (const bool at_end : {false, true})
            state.tips.push_back(equilibrium_.cracks().lines[k].tip(at_end).inside ? equilibrium_.load_at(k, at_end) : TipLoad{});
    return state;
}

// In a linear scene no load and full load say all; the state half way is between them.
bool Quasistatic::know_linear(Live& live) {
    const auto solve = [&](double time) {
        ++equilibria_;
        return equilibrium_.solve(time) == Equilibrium::Outcome::solved;
    };
    if (equilibrium_.boundary().tractions.empty()) {  // all goes with the load or its square
        if (!solve(time_of(2))) return false;
        live.states[2] = load_state();
        for (const int number : {0, 1}) live.states[number] = scaled(live.states[2], 0.5 * number);
        return true;
    }
    if (!solve(0.0)) return false;
    const std::vector<Vec2> unloaded = equilibrium_.displacements();
    if (plan_.driven && !solve(time_of(2))) return false;
    const std::vector<Vec2> loaded = equilibrium_.displacements();
    for (int number = 0; number <= 2; ++number) {
        std::vector<Vec2> u(unloaded.size());
        for (std::size_t f = 0; f < u.size(); ++f) u[f] = (1.0 - 0.5 * number) * unloaded[f] + 0.5 * number * loaded[f];
        equilibrium_.set_displacements(u, time_of(number));
        live.states[number] = load_state();
    }
    return true;
}

// A specimen in pieces that nothing holds together carries nothing.
LoadState Quasistatic::nothing(double time) const {
    LoadState state;
    state.time = time;
    state.displacement = equilibrium_.measured_displacement(time);
    state.reactions.assign(equilibrium_.boundary().drivers(), Vec2::Zero());
    state.tips.resize(2 * scene_.cracks.size());
    return state;
}

// Finds the equilibrium of a place at a time, if it is not known.
bool Quasistatic::know(Live& live, int number) {
    if (live.states.count(number)) return true;
    enter(live);
    double from = time_of(number);
    if (const auto guess = live.guess.find(number); guess != live.guess.end()) {
        equilibrium_.set_displacements(guess->second, from);
    } else if (number > 0) {
        if (!know(live, number - 1)) return false;
        from = time_of(number - 1);
        equilibrium_.set_displacements(live.displacement.at(number - 1), from);
    } else {
        equilibrium_.set_displacements(std::vector<Vec2>(equilibrium_.displacements().size(), Vec2::Zero()), 0.0);
    }
    const std::vector<Vec2> start = equilibrium_.displacements();
    for (int parts = 1; parts <= most_parts; parts *= 2) {
        bool good = true;
        for (int part = 1; part <= parts && good; ++part) {
            ++equilibria_;
            good = equilibrium_.solve(std::lerp(from, time_of(number), static_cast<double>(part) / parts)) == Equilibrium::Outcome::solved;
        }
        if (good) {
            live.displacement[number] = equilibrium_.displacements();
            live.states[number] = load_state();
            return true;
        }
        equilibrium_.set_displacements(start, from);
    }
    if (!live.left) return false;
    live.displacement[number] = start;
    live.states[number] = nothing(time_of(number));
    return true;
}

Vec2 Quasistatic::next_tip(const Live& last, const TipLoad& load) const {
    const Station& station = last.station;
    if (leader_) {
        const std::size_t number = driving_.stations.size() + live_.size();
        const auto& stations = leader_->stations;
        if (number < stations.size()) return stations[number].tips[station.crack][station.at_end];
        return stations.back().route[number - stations.size() + 1];  // the advance from the last station
    }
    const CrackTip& tip = equilibrium_.cracks().lines[station.crack].tip(station.at_end);
    return tip.position + increment_ * growth_direction(scene_.cracks[station.crack].direction, tip, load);
}

// Grows the crack from the last place to the next one.
bool Quasistatic::extend() {
    Live& last = live_.back();
    if (last.left) return false;
    const Station& station = last.station;
    const LoadState* load = nullptr;
    if (plan_.linear) {
        load = &last.states.at(2);
    } else {
        const int number = static_cast<int>(std::ceil(time_ / time_step_));
        const int known = last.states.empty() ? std::max(1, number) : std::clamp(number, last.states.begin()->first, last.states.rbegin()->first);
        if (!know(last, known)) return false;
        enter(last);
        load = &last.states.at(known);
        equilibrium_.set_displacements(last.displacement.at(known), load->time);
    }
    const Vec2 to = next_tip(last, load->tips[2 * station.crack + station.at_end]);
    const auto fields = equilibrium_.grow(station.crack, station.at_end, to);
    std::map<int, std::vector<Vec2>> guess;
    for (auto& [number, displacement] : last.displacement) {
        guess[number] = displacement;
        for (const auto& [added, from] : fields) guess[number].push_back(guess[number][from]);
    }
    add_live();
    live_.back().guess = std::move(guess);
    if (plan_.linear) return know_linear(live_.back()) || live_.back().left;
    return true;
}

// Takes over what is known of a place and of the place an advance further, at the same times.
bool Quasistatic::take_ahead(Live& live, const Live& ahead) {
    Station& station = live.station;
    station.states.clear();
    station.ahead.clear();
    for (const auto& [number, state] : live.states) {
        if (ahead_ > 0 && station.crack >= 0) {
            const auto further = ahead.states.find(number);
            if (further == ahead.states.end()) continue;
            station.ahead.push_back({further->second.potential, further->second.power});
        }
        station.states.push_back(state);
    }
    return !station.states.empty();
}

// Of several tips the one moves that reaches its toughness first.
void Quasistatic::choose_tip(Station& station) const {
    double first = std::numeric_limits<double>::infinity();
    Station trial = station;
    for (const auto& [crack, at_end] : growing_) {
        trial.crack = crack;
        trial.at_end = at_end;
        const CrackTip& tip = equilibrium_.cracks().lines[crack].tip(at_end);
        if (!tip.inside) continue;
        const double time = driving_.critical_time(trial, materials_.at(tip.position).toughness);
        if (time >= first) continue;
        first = time;
        station.crack = crack;
        station.at_end = at_end;
    }
}

void Quasistatic::find_route(Station& station) const {
    if (station.crack < 0) return;
    station.route = {station.tips[station.crack][station.at_end]};
    for (std::size_t k = 1; k < live_.size() && ahead_ > 0; ++k) {
        const Vec2& tip = live_[k].station.tips[station.crack][station.at_end];
        if (tip != station.route.back()) station.route.push_back(tip);
    }
}

// Finds the equilibria that the leader has.
bool Quasistatic::follow(Live& live, Live& ahead) {
    const Station& example = leader_->stations[driving_.stations.size()];
    live.station.crack = example.crack;
    live.station.at_end = example.at_end;
    find_route(live.station);
    if (!plan_.linear) {
        for (const LoadState& state : example.states) {
            const int number = static_cast<int>(std::lround(state.time / time_step_));
            if (!know(live, number) || (&live != &ahead && !know(ahead, number))) return false;
        }
    }
    return take_ahead(live, ahead) && live.station.states.size() == example.states.size();
}

// Finds enough equilibria of a place to know when the crack moves on from it.
bool Quasistatic::finish(Live& live, Live& ahead) {
    if (leader_) return follow(live, ahead);
    Station& station = live.station;
    find_route(station);
    const auto judge = [&] {
        if (!take_ahead(live, ahead)) return std::numeric_limits<double>::infinity();
        if (growing_.size() > 1) choose_tip(station);
        if (station.crack < 0) return std::numeric_limits<double>::infinity();
        return driving_.critical_time(station, mean_toughness(materials_, station.route));
    };
    if (plan_.linear) {
        time_ = std::max(time_, judge());
        return true;
    }
    const int last = static_cast<int>(std::ceil(std::min(plan_.end_time, plan_.still_from) / time_step_ - 1e-9));
    int number = driving_.stations.empty() ? 0 : std::min(static_cast<int>(time_ / time_step_), last - 1);
    const auto know_both = [&](int n) { return know(live, n) && (&live == &ahead || know(ahead, n)); };
    if (!know_both(number)) return false;
    while (number < last) {
        if (!know_both(++number)) return false;
        const double time = judge();
        if (std::isfinite(time)) {
            time_ = std::max(time_, time);
            return true;
        }
    }
    time_ = std::numeric_limits<double>::infinity();
    return true;
}

bool Quasistatic::step() {
    if (finished_ || !failure_.empty()) return false;
    if (plan_.linear && live_.size() == 1 && live_.front().states.empty() && !know_linear(live_.front()))
        throw InputError(scene_.file.string(), "edges", "too few", "the specimen can move as a whole: nothing holds it");
    if (leader_ && driving_.stations.size() == leader_->stations.size()) return false;
    while (live_.size() <= ahead_ && !live_.back().left)
        if (!extend()) {
            failure_ = "no equilibrium was found";
            break;
        }
    Live& front = live_.front();
    Live& ahead = live_[std::min(ahead_, live_.size() - 1)];
    if (front.left) {
        // Split, or nothing grows: what holds it now?
        if (!plan_.linear) finish(front, front);
        if (front.states.empty())
            for (int number = 0; number <= 2; ++number) front.states[number] = nothing(time_of(number));
        take_ahead(front, front);
        driving_.stations.push_back(std::move(front.station));
        finished_ = true;
        return false;
    }
    if (!failure_.empty() || !finish(front, ahead)) {
        if (failure_.empty()) failure_ = "no equilibrium was found";
        if (driving_.stations.empty()) {  // not even the first: the unloaded specimen is all there is
            front.station.states = {nothing(0.0)};
            front.station.crack = -1;
            driving_.stations.push_back(std::move(front.station));
        }
        return false;
    }
    if (live_.size() == 1 && std::isfinite(time_) && !extend()) failure_ = "no equilibrium was found";
    driving_.stations.push_back(std::move(front.station));
    if (live_.size() == 1) return false;
    live_.pop_front();
    return std::isfinite(time_);
}

double Quasistatic::crack_length() const {
    if (driving_.stations.empty() || growing_.empty()) return 0.0;
    return driving_.stations.back().lengths[growing_[0].first];
}

} // namespace crampfit

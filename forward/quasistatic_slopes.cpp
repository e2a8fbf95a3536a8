#include "forward/geometry.hpp"
#include "forward/probes.hpp"
#include "forward/quasistatic.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

// What is kept of each equilibrium beside its state: what the scene's probes read there, and the derivatives of both by numbers
// of the materials, with which states are moved to first order.

namespace crampfit {

namespace {

// What one set of vectors times gives another.
std::optional<double> multiple(const std::vector<Vec2>& wanted, const std::vector<Vec2>& of) {
    double both = 0.0, square = 0.0, difference = 0.0;
    for (std::size_t k = 0; k < of.size(); ++k) {
        both += wanted[k].dot(of[k]);
        square += of[k].squaredNorm();
    }
    if (square == 0.0) return std::nullopt;
    for (std::size_t k = 0; k < of.size(); ++k) difference = std::max(difference, (wanted[k] - both / square * of[k]).norm());
    constexpr double rounding = 1e-12;
    if (difference > rounding * std::abs(both) / std::sqrt(square)) return std::nullopt;
    return both / square;
}

}  // namespace

Quasistatic::Beside::Beside(const Quasistatic& walk)
    : body(walk.scene_, walk.materials_), equilibrium(walk.scene_, walk.plan_, walk.materials_, body, 1, &walk.equilibrium_) {}

void Quasistatic::Beside::enter(const Place& place) {
    if (std::exchange(entered, &place) != &place) equilibrium.restore(*place.snapshot);
}

// Takes off a third of the difference to the second grid from what probes read. Not beside a crack, where the wide cells know
// next to nothing.
void Quasistatic::take_off_grid_error(std::vector<Vec2>& probes, const std::vector<Vec2>& wide) const {
    constexpr double beside = 2.0;  // [wide cells]
    const double reach = beside * coarse()->body_.layout.cell.maxCoeff();
    const Probes& asked = scene_.output.probes;
    const std::size_t group = asked.weights.size();
    for (std::size_t i = 0; i < probes.size() && !wide.empty(); ++i) {
        bool far = wide[i].allFinite();
        for (std::size_t k = i * group; k < (i + 1) * group && far; ++k)
            for (const CrackLine& line : equilibrium_.cracks().lines)
                far = far && distance_to(line.points, asked.places[k]) > reach;
        if (far) probes[i] += (probes[i] - wide[i]) / 3.0;
    }
}

// Keeps what the scene's probes read where the equilibrium stands.
void Quasistatic::keep_probes(std::size_t number, int time) {
    if (scene_.output.probes.places.empty()) return;
    std::vector<Vec2>& kept = places_[number].probes[time];
    kept = read_probes(scene_.output.probes, body_, equilibrium_.cracks(), {&equilibrium_.displacements()}).front();
    if (coarse()) take_off_grid_error(kept, coarse()->places_[number].probes[time]);
}

void Quasistatic::keep_slopes(std::size_t number, int time, Slopes slopes) {
    for (std::size_t n = 0; coarse() && n < slopes.states.size(); ++n) {
        const Slopes& wide = coarse()->places_[number].slopes.at(time);
        extrapolate(slopes.states[n], wide.states[n]);
        if (!slopes.probes.empty() && !wide.probes.empty()) take_off_grid_error(slopes.probes[n], wide.probes[n]);
    }
    places_[number].slopes[time] = std::move(slopes);
    if (!shift_.empty()) show_shifted(number, time);
}

// Whether all that lies before the equilibrium is a multiple of its motion with these drivers: where nothing else loads a linear
// scene.
bool Quasistatic::goes_with_load(const Equilibrium& equilibrium, const std::vector<Vec2>& drivers) const {
    const Boundary& boundary = equilibrium.boundary();
    bool goes = plan_.linear && !boundary.has_dead_load() && equilibrium.time() > 0.0;
    const double time = equilibrium.time();
    for (int d = 0; d < boundary.drivers() && goes; ++d) goes = boundary.travel(d, time) == time * drivers[d];
    return goes;
}

// Derivatives of the state where the equilibrium stands. What is prescribed has none.
std::optional<Quasistatic::Slopes> Quasistatic::slopes_at(Equilibrium& equilibrium, const Discretisation& body,
                                                          const Missed& missed) const {
    const Boundary& boundary = equilibrium.boundary();
    const Gauges gauges(scene_);
    std::vector<std::vector<Vec2>> drives(2, std::vector<Vec2>(boundary.drivers(), Vec2::Zero()));
    for (int d = 0; d < boundary.drivers(); ++d)
        if (equilibrium.time() <= boundary.travel_time(d)) drives[0][d] = boundary.velocity_of(d);
    drives[1][gauges.force] = gauges.force_direction;
    std::vector<Equilibrium::Motion> motions;
    if (goes_with_load(equilibrium, drives[0])) {
        motions.push_back({drives[0], equilibrium.displacements()});
        for (Vec2& u : motions[0].fields) u /= equilibrium.time();
        if (const auto factor = multiple(drives[1], drives[0])) {
            motions.push_back(motions[0]);
            for (std::vector<Vec2>* of : {&motions[1].drivers, &motions[1].fields})
                for (Vec2& m : *of) m *= *factor;
        }
    }
    if (motions.size() < drives.size()) {
        auto others = equilibrium.motions({drives.begin() + static_cast<std::ptrdiff_t>(motions.size()), drives.end()});
        if (others.empty()) return std::nullopt;
        std::move(others.begin(), others.end(), std::back_inserter(motions));
    }
    const auto pulled = boundary.load_to_move(gauges.displacement, gauges.displacement_direction, motions[0].fields.size());
    if (!pulled.empty()) motions.push_back(equilibrium.yield_to(pulled));
    const Equilibrium::Slopes slope = equilibrium.slopes(numbers_);
    std::vector<LoadState> found(numbers_.size());
    for (int n = 0; n < static_cast<int>(numbers_.size()); ++n) {
        found[n].potential = slope.potential[n];
        found[n].power = slope.along(motions[0], n);
        found[n].reactions.assign(boundary.drivers(), Vec2::Zero());
        found[n].reactions[gauges.force] = slope.along(motions[1], n) * gauges.force_direction;
        if (!pulled.empty()) found[n].displacement = -slope.along(motions[2], n);
        found[n].tips.resize(2 * scene_.cracks.size());
    }
    for (LoadState& of_number : found) {
        of_number.end_potential = of_number.potential;
        of_number.end_power = of_number.power;
    }
    const std::vector<LoadState> of_grid = found;
    add_slopes(equilibrium, missed, slope, of_grid, found);
    std::vector<std::vector<Vec2>> moved;
    Slopes all;
    if (!scene_.output.probes.places.empty()) {
        moved = equilibrium.displacement_slopes(slope);
        std::vector<const std::vector<Vec2>*> each;
        for (const std::vector<Vec2>& of_number : moved) each.push_back(&of_number);
        all.probes = read_probes(scene_.output.probes, body, equilibrium.cracks(), each);
    }
    // A tip's own G counts where that says when it moves.
    for (const GrowingTip& tip : growing_) {
        if (leader_ || tip.ahead > 0 || !equilibrium.cracks().lines[tip.crack].tip(tip.at_end).inside) continue;
        if (moved.empty()) moved = equilibrium.displacement_slopes(slope);
        for (std::size_t n = 0; n < numbers_.size(); ++n)
            found[n].tips[2 * tip.crack + tip.at_end].G = equilibrium.release_slope(tip.crack, tip.at_end, numbers_[n], moved[n]);
    }
    all.states = std::move(found);
    return all;
}

// Adds the derivatives of what the grid misses to its own.
void Quasistatic::add_slopes(const Equilibrium& equilibrium, const Missed& missed, const Equilibrium::Slopes& slope,
                             const std::vector<LoadState>& of_grid, std::vector<LoadState>& slopes) const {
    const Gauges gauges(scene_);
    const Vec2 direction = gauges.force_direction;
    const double potential = equilibrium.potential();
    std::vector<const MissedEnergy*> some;
    for (const MissedEnergy* of : {&missed.here, &missed.as_end})
        if (!of->by_number.empty()) some.push_back(of);
    Eigen::MatrixXd loads(slope.fields.rows(), some.size());
    for (std::size_t k = 0; k < some.size(); ++k)
        loads.col(k) = -Eigen::Map<const Eigen::VectorXd>(some[k]->by_displacement.data()->data(), loads.rows());
    const Eigen::MatrixXd change = slope.fields.transpose() * equilibrium.yields_to(loads);  // [numbers x some]
    for (std::size_t k = 0; k < some.size(); ++k) {
        const bool as_end = some[k] == &missed.as_end;
        const double ratio = 1.0 + some[k]->energy / potential;
        for (int n = 0; n < static_cast<int>(numbers_.size()); ++n) {
            const double more = some[k]->by_number[n] + change(n, k);
            (as_end ? slopes[n].end_potential : slopes[n].potential) += more;
            if (equilibrium.boundary().has_dead_load()) continue;
            const double ratio_slope = (more - some[k]->energy * of_grid[n].potential / potential) / potential;
            (as_end ? slopes[n].end_power : slopes[n].power) = ratio * of_grid[n].power + ratio_slope * equilibrium.power();
            if (!as_end)
                slopes[n].reactions[gauges.force] =
                    ratio * of_grid[n].reactions[gauges.force] +
                    ratio_slope * equilibrium.reactions()[gauges.force].dot(direction) * direction;
        }
    }
}

// Puts what the shift makes of a state in its place. To first order; as powers of the numbers, which is exact where all the wood
// becomes stiffer by the same factor, and where a value would change too much for that, linearly.
void Quasistatic::show_shifted(std::size_t number, int time) {
    constexpr double most = 2.0;  // change of the logarithm
    Place& place = places_[number];
    LoadState& state = place.station.states[time];
    state = place.states.at(time);
    const std::vector<LoadState>& slopes = place.slopes.at(time).states;
    const auto move = [&](double& value, auto slope_of) {
        double change = 0.0;
        for (std::size_t n = 0; n < shift_.size(); ++n) change += shift_[n] * slope_of(slopes[n]);
        if (change == 0.0) return;  // as of all bodies but the gauge's
        if (std::abs(change) <= most * std::abs(value)) value *= std::exp(value != 0.0 ? change / value : 0.0);
        else value += change;
    };
    move(state.potential, [](const LoadState& s) { return s.potential; });
    move(state.power, [](const LoadState& s) { return s.power; });
    move(state.end_potential, [](const LoadState& s) { return s.end_potential; });
    move(state.end_power, [](const LoadState& s) { return s.end_power; });
    move(state.displacement, [](const LoadState& s) { return s.displacement; });
    for (std::size_t d = 0; d < state.reactions.size(); ++d)
        for (int axis = 0; axis < 2; ++axis)
            move(state.reactions[d][axis], [&](const LoadState& s) { return s.reactions[d][axis]; });
    for (std::size_t k = 0; k < state.tips.size(); ++k) move(state.tips[k].G, [&](const LoadState& s) { return s.tips[k].G; });
}

void Quasistatic::shift(const std::vector<double>& by) {
    const std::vector<double> before = shift_;
    shift_ = std::any_of(by.begin(), by.end(), [](double d) { return d != 0.0; }) ? by : std::vector<double>{};
    if (shift_ == before) return;
    for (Place& place : places_) {
        if (shift_.empty()) place.station.states = place.states;
        else std::erase_if(place.station.states, [&](const auto& state) { return !place.slopes.count(state.first); });
        place.guessed.clear();
        place.station.ahead.clear();
    }
    if (shift_.empty()) return;
    for (std::size_t number = 0; number < places_.size(); ++number)
        for (const auto& [time, slopes] : places_[number].slopes) show_shifted(number, time);
}

// The derivatives of most equilibria will be asked for. So they are found as the walk goes on to the next ones, in the order in
// which these were found: the same bits in a thread of their own or not.
void Quasistatic::seek_slopes(std::size_t number, int time, Missed missed) {
    if (numbers_.empty()) return;
    Place& place = places_[number];
    const auto found = std::make_shared<std::optional<Slopes>>();
    const auto find = [this, &place = std::as_const(place), &known = place.known.at(time), missed = std::move(missed), found] {
        if (!beside_) beside_ = std::make_unique<Beside>(*this);
        beside_->enter(place);
        beside_->equilibrium.set_displacements(known.displacement, time_of(known.time), known.contacts);
        *found = slopes_at(beside_->equilibrium, beside_->body, missed);
    };
    place.sought[time] = {jobs_.add(find), found};
}

bool Quasistatic::know_slopes(std::size_t number, int time) {
    Place& place = places_[number];
    if (place.slopes.count(time)) return true;
    if (coarse() && !coarse()->know_slopes(number, time)) return false;
    Slopes slopes{std::vector<LoadState>(numbers_.size(), nothing(0.0)), {}};  // of what carries nothing
    if (const auto sought = place.sought.find(time); sought != place.sought.end()) {
        jobs_.wait_for(sought->second.job);
        if (!*sought->second.found) return false;
        slopes = std::move(**sought->second.found);
        place.sought.erase(sought);
    }
    keep_slopes(number, time, std::move(slopes));
    return true;
}

void Quasistatic::rest() {
    jobs_.wait_for_all();
    beside_.reset();
    if (coarse()) coarse()->rest();
}

std::vector<Vec2> Quasistatic::probes_at(std::size_t station_number, double time) {
    at(station_number, time);  // finds what lies about it
    const int number = way_[station_number];
    Place& place = places_[number];
    if (place.probes.empty()) return {};
    // Without an equilibrium before it nothing has moved when the load begins; a rough walk may know none after it.
    const double t = std::min(time, plan_.still_from);
    auto after = place.probes.lower_bound(plan_.linear ? last_time_ : std::min(last_time_before(t) + 1, last_time_));
    if (after == place.probes.end()) --after;
    const bool first = after == place.probes.begin();
    const double from = first ? 0.0 : time_of(std::prev(after)->first);
    const double share = (t - from) / (time_of(after->first) - from);
    std::vector<Vec2> found(after->second.size(), Vec2::Zero());
    const auto add = [&](const std::pair<const int, std::vector<Vec2>>& known, double weight) {
        for (std::size_t i = 0; i < found.size(); ++i) found[i] += weight * known.second[i];
        if (shift_.empty() || weight == 0.0 || !know_slopes(number, known.first)) return;
        const auto& slopes = place.slopes.at(known.first).probes;
        for (std::size_t n = 0; n < slopes.size(); ++n)
            for (std::size_t i = 0; i < found.size(); ++i) found[i] += weight * shift_[n] * slopes[n][i];
    };
    add(*after, share);
    if (!first) add(*std::prev(after), 1.0 - share);
    return found;
}

}  // namespace crampfit

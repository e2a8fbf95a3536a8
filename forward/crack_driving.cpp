#include "forward/crack_driving.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace crampfit {

namespace {

constexpr double never = std::numeric_limits<double>::infinity();

double length_of(const std::vector<Vec2>& route) {
    double length = 0.0;
    for (std::size_t k = 0; k + 1 < route.size(); ++k) length += (route[k + 1] - route[k]).norm();
    return length;
}

// Sums over states with weights, for all that a state holds; K and opening are linear in the load, G is quadratic like the
// energies.
LoadState weighted(const std::vector<const LoadState*>& states, const std::vector<double>& weights) {
    LoadState sum;
    sum.reactions.assign(states[0]->reactions.size(), Vec2::Zero());
    sum.tips.resize(states[0]->tips.size());
    for (std::size_t i = 0; i < states.size(); ++i) {
        const LoadState& s = *states[i];
        const double w = weights[i];
        sum.time += w * s.time;
        sum.potential += w * s.potential;
        sum.power += w * s.power;
        sum.traction_work += w * s.traction_work;
        sum.end_potential += w * s.end_potential;
        sum.end_power += w * s.end_power;
        sum.dissipated += w * s.dissipated;
        sum.displacement += w * s.displacement;
        for (std::size_t d = 0; d < sum.reactions.size(); ++d) sum.reactions[d] += w * s.reactions[d];
        for (std::size_t k = 0; k < sum.tips.size(); ++k) {
            sum.tips[k].G += w * s.tips[k].G;
            sum.tips[k].K_I += w * s.tips[k].K_I;
            sum.tips[k].K_II += w * s.tips[k].K_II;
            sum.tips[k].opening += w * s.tips[k].opening;
            sum.tips[k].toughness += w * s.tips[k].toughness;
        }
    }
    return sum;
}

// Least root at or after 0 of c0 + c1 t + c2 t^2 that has the value rising through 0; infinite: none.
double first_rise(double c0, double c1, double c2) {
    if (c0 >= 0.0) return 0.0;
    if (c2 == 0.0) return c1 > 0.0 ? -c0 / c1 : never;
    const double discriminant = c1 * c1 - 4.0 * c2 * c0;
    if (discriminant < 0.0) return never;
    const double root = std::sqrt(discriminant);
    const double t = c1 >= 0.0 ? -2.0 * c0 / (c1 + root) : (-c1 + root) / (2.0 * c2);
    return t >= 0.0 ? t : never;
}

// Value at a fraction of an interval of the cubic with these end values and slopes (times the interval).
double cubic(double from, double slope_from, double to, double slope_to, double s) {
    const double r = 1.0 - s;
    return from * (1.0 + 2.0 * s) * r * r + slope_from * s * r * r + to * s * s * (3.0 - 2.0 * s) - slope_to * s * s * r;
}

// What forces on their straight way between two states are multiplied by, at a fraction of it, to have done the work by which the
// potential differs: their power follows the parabola of that mean, or the nearest that does not turn on the way.
double bend(const LoadState& from, const LoadState& to, double s) {
    const double straight = std::lerp(from.power, to.power, s);
    if (straight == 0.0 || from.power * to.power < 0.0) return 1.0;
    const double rise = std::abs(to.power - from.power);
    const double lacks = (to.potential - from.potential) / (to.time - from.time) - 0.5 * (from.power + to.power);
    return 1.0 + std::clamp(6.0 * lacks, -rise, rise) * s * (1.0 - s) / straight;
}

}  // namespace

LoadState scaled(const LoadState& state, double factor) {
    LoadState at = state;
    at.time *= factor;
    at.potential *= factor * factor;
    at.end_potential *= factor * factor;
    at.power *= factor;
    at.end_power *= factor;
    at.traction_work *= factor;
    at.displacement *= factor;
    for (Vec2& r : at.reactions) r *= factor;
    for (TipLoad& tip : at.tips) {
        tip.G *= factor * factor;
        tip.K_I *= factor;
        tip.K_II *= factor;
        tip.opening *= factor;
    }
    return at;
}

LoadState between(const LoadState& from, const LoadState& to, double time) {
    const double span = to.time - from.time;
    const double s = (time - from.time) / span;
    LoadState found = weighted({&from, &to}, {1.0 - s, s});
    const double bent = bend(from, to, s);
    found.power *= bent;
    for (Vec2& r : found.reactions) r *= bent;
    found.potential = cubic(from.potential, span * from.power, to.potential, span * to.power, s);
    found.end_potential = cubic(from.end_potential, span * from.end_power, to.end_potential, span * to.end_power, s);
    for (std::size_t k = 0; k < found.tips.size(); ++k) {  // G as K^2
        const double root = std::lerp(std::sqrt(std::max(0.0, from.tips[k].G)), std::sqrt(std::max(0.0, to.tips[k].G)), s);
        found.tips[k].G = root * root;
    }
    return found;
}

double Station::route_length() const {
    double length = 0.0;
    for (const MovingTip& tip : moving) length += length_of(tip.route);
    return length;
}

double mean_toughness(const MaterialMap& materials, const std::vector<Vec2>& route) {
    constexpr int samples = 16;  // of each leg: a sharp boundary is seen to 1/32 of it
    if (route.size() == 1) return materials.at(route[0]).toughness;
    double sum = 0.0;
    double length = 0.0;
    for (std::size_t k = 0; k + 1 < route.size(); ++k) {
        const double leg = (route[k + 1] - route[k]).norm();
        for (int i = 0; i < samples; ++i)
            sum += leg / samples * materials.at(route[k] + (i + 0.5) / samples * (route[k + 1] - route[k])).toughness;
        length += leg;
    }
    return sum / length;
}

LoadState LoadState::gone_on(double to) const {
    const double ratio = to / time;
    const double exponent = potential > 0.0 ? std::clamp(power * time / potential, 1.0, 4.0) : 2.0;
    LoadState at = scaled(*this, std::pow(ratio, exponent - 1.0));
    at.time = to;
    at.potential = potential * std::pow(ratio, exponent);
    at.end_potential = end_potential * std::pow(ratio, exponent);
    at.displacement = displacement * ratio;
    for (std::size_t k = 0; k < tips.size(); ++k) at.tips[k].G = tips[k].G * std::pow(ratio, exponent);
    return at;
}

double mean_toughness(const MaterialMap& materials, const std::vector<MovingTip>& moving) {
    if (moving.size() == 1 || moving.front().route.size() == 1) return mean_toughness(materials, moving.front().route);
    double sum = 0.0;
    double length = 0.0;
    for (const MovingTip& tip : moving) {
        sum += length_of(tip.route) * mean_toughness(materials, tip.route);
        length += length_of(tip.route);
    }
    return sum / length;
}

void extrapolate(LoadState& fine, const LoadState& coarse) {
    constexpr double order = 2.0;
    const double share = 1.0 / (std::pow(2.0, order) - 1.0);
    const auto improve = [&](auto& value, const auto& other) { value += share * (value - other); };
    improve(fine.potential, coarse.potential);
    improve(fine.power, coarse.power);
    improve(fine.traction_work, coarse.traction_work);
    improve(fine.end_potential, coarse.end_potential);
    improve(fine.end_power, coarse.end_power);
    improve(fine.dissipated, coarse.dissipated);
    improve(fine.displacement, coarse.displacement);
    for (std::size_t d = 0; d < fine.reactions.size(); ++d) improve(fine.reactions[d], coarse.reactions[d]);
}

LoadState Station::at(double time) const {
    const double t = std::min(time, still_from);
    LoadState found;
    if (states.size() == 1) {
        found = states.begin()->second;
    } else if (linear) {
        std::vector<const LoadState*> nodes;
        std::vector<double> weights;
        for (const auto& [i, state] : states) {  // Lagrange's polynomial
            double w = 1.0;
            for (const auto& [j, other] : states)
                if (j != i) w *= (t - other.time) / (state.time - other.time);
            nodes.push_back(&state);
            weights.push_back(w);
        }
        found = weighted(nodes, weights);
    } else {
        auto next = std::next(states.begin());
        while (std::next(next) != states.end() && next->second.time < t) ++next;
        found = between(std::prev(next)->second, next->second, t);
    }
    found.time = time;
    if (time > still_from) found.power = 0.0;
    return found;
}

double Station::critical_time(double toughness, bool beyond) const {
    const std::size_t tip = 2 * moving.front().crack + moving.front().at_end;
    const bool finite_advance = route_length() > 0.0;
    const double needed = finite_advance ? toughness * route_length() * thickness : toughness;
    // Where what is released and what it costs are both known: what is left over [J, or J/m^2 for advance 0], and its slope.
    std::vector<double> time, excess, slope;
    for (const auto& [number, state] : states) {
        const auto further = ahead.find(number);
        if (finite_advance && further == ahead.end()) continue;
        time.push_back(state.time);
        excess.push_back((finite_advance ? state.potential - further->second[0] : state.tips[tip].G) - needed);
        slope.push_back(finite_advance ? state.power - further->second[1] : 0.0);
    }
    if (time.empty()) return never;
    // From a state on as a power of the time: the one that its slope says or, without, that of linear wood. Not what a second
    // state says, which is known or not as the way to here was.
    const auto power_law = [&](std::size_t start) {
        const double released = excess[start] + needed;
        const double power = finite_advance ? slope[start] * time[start] / released : 2.0;
        return time[start] * std::pow(needed / released, 1.0 / std::max(power, 0.5));
    };
    if (beyond && excess.back() < 0.0) {
        const double reached = excess.back() + needed > 0.0 ? power_law(time.size() - 1) : never;
        return reached <= still_from * (1.0 + 1e-12) ? reached : never;
    }
    if (time.size() == 1) return beyond || (excess[0] >= 0.0 && time[0] > 0.0) ? power_law(0) : excess[0] >= 0.0 ? 0.0 : never;
    double found = never;
    if (linear) {  // times 0, T/2, T
        const double T = time[2];
        const double c2 = 2.0 * (excess[0] - 2.0 * excess[1] + excess[2]) / (T * T);
        const double c1 = (excess[2] - excess[0]) / T - c2 * T;
        found = first_rise(excess[0], c1, c2);
    } else {
        std::size_t i = 1;
        while (i + 1 < time.size() && excess[i] < 0.0) ++i;
        if (excess[i] < 0.0) return never;
        const double span = time[i] - time[i - 1];
        if (excess[i - 1] >= 0.0) {
            // Below what is known: the energy released goes as a power of the time.
            if (time[i - 1] == 0.0) return 0.0;
            return power_law(i - 1);
        }
        double low = 0.0, high = 1.0;
        for (int k = 0; k < 60; ++k) {
            const double s = 0.5 * (low + high);
            double value = cubic(excess[i - 1], span * slope[i - 1], excess[i], span * slope[i], s);
            if (!finite_advance) {  // G by its roots, which go nearly linearly with the load
                const double root = std::lerp(std::sqrt(std::max(0.0, excess[i - 1] + needed)), std::sqrt(excess[i] + needed), s);
                value = root * root - needed;
            }
            (value < 0.0 ? low : high) = s;
        }
        found = time[i - 1] + high * span;
    }
    return found <= still_from * (1.0 + 1e-12) ? found : never;
}

double Station::share_of_critical(double toughness, double time) const {
    const std::size_t tip = 2 * moving.front().crack + moving.front().at_end;
    std::vector<double> times, shares;
    for (const auto& [number, state] : states) {
        const auto further = ahead.find(number);
        const double G = route_length() > 0.0 && further != ahead.end()
                             ? (state.potential - further->second[0]) / (route_length() * thickness)
                             : state.tips[tip].G;
        times.push_back(state.time);
        shares.push_back(std::sqrt(std::max(0.0, G) / toughness));
    }
    const double t = std::min(time, still_from);
    if (times.empty() || t <= times.front()) return times.empty() || times[0] == 0.0 ? 0.0 : shares[0] * t / times[0];
    const auto next = std::ranges::upper_bound(times, t) - times.begin();
    if (next == static_cast<std::ptrdiff_t>(times.size())) return shares.back();
    return std::lerp(shares[next - 1], shares[next], (t - times[next - 1]) / (times[next] - times[next - 1]));
}

}  // namespace crampfit

#include "forward/load_peak.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

// A cubic that falls further between two places than to this part of the energy at them says nothing any more: it is cut off.
constexpr double least_part = 0.5;

constexpr double rounding = 1e-9;  // of the load

constexpr int steps = 60;          // of the golden section: to rounding

} // namespace

std::optional<NeededLoad> peak_between(const std::array<NeededLoad, 4>& places) {
    const auto& [before, from, to, after] = places;
    std::array<double, 4> energy;  // released per square of the time
    for (std::size_t k = 0; k < 4; ++k) {
        const NeededLoad& place = places[k];
        if (!std::isfinite(place.time) || place.time <= 0.0) return std::nullopt;
        energy[k] = place.toughness / (place.time * place.time);
    }
    const auto energy_at = [&](double length) {
        double sum = 0.0;
        for (std::size_t k = 0; k < 4; ++k) {  // Lagrange's polynomial
            double weight = energy[k];
            for (std::size_t j = 0; j < 4; ++j)
                if (j != k) weight *= (length - places[j].length) / (places[k].length - places[j].length);
            sum += weight;
        }
        return sum;
    };
    const auto at = [&](double share) -> NeededLoad {
        const double length = std::lerp(from.length, to.length, share), toughness = std::lerp(from.toughness, to.toughness, share);
        const double least = least_part * std::min(energy[1], energy[2]);
        return {length, std::sqrt(toughness / std::max(least, energy_at(length))), toughness};
    };
    constexpr double golden = 0.6180339887498949;
    double low = 0.0, high = 1.0;
    for (int k = 0; k < steps; ++k) {
        const double left = high - golden * (high - low), right = low + golden * (high - low);
        if (at(left).time < at(right).time) low = left;
        else high = right;
    }
    const NeededLoad peak = at(0.5 * (low + high));
    if (peak.time <= std::max(from.time, to.time) * (1.0 + rounding)) return std::nullopt;
    return peak;
}

} // namespace crampfit

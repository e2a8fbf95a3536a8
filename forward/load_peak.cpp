#include "forward/load_peak.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

// A cubic that falls further between two places than to this part of the energy at them says nothing any more.
constexpr double least_part = 0.5;

}  // namespace

std::optional<NeededLoad> peak_between(const std::array<NeededLoad, 4>& places) {
    const NeededLoad &from = places[1], &to = places[2];
    Eigen::Vector4d energy;  // released per square of the time
    Eigen::Matrix4d powers;  // of the share of the way from the second place to the third
    for (int k = 0; k < 4; ++k) {
        const auto& [length, time, toughness] = places[k];
        if (!std::isfinite(time) || time <= 0.0) return std::nullopt;
        energy[k] = toughness / (time * time);
        const double share = (length - from.length) / (to.length - from.length);
        powers.row(k) << 1.0, share, share * share, share * share * share;
    }
    const Eigen::Vector4d cubic = powers.partialPivLu().solve(energy);
    const auto energy_at = [&](double s) { return cubic[0] + s * (cubic[1] + s * (cubic[2] + s * cubic[3])); };
    const auto toughness_at = [&](double s) { return std::lerp(from.toughness, to.toughness, s); };
    const auto rise = [&](double s) {  // of toughness over energy, times the energy squared
        return (to.toughness - from.toughness) * energy_at(s) -
               toughness_at(s) * (cubic[1] + s * (2.0 * cubic[2] + s * 3.0 * cubic[3]));
    };
    if (rise(0.0) <= 0.0 || rise(1.0) >= 0.0) return std::nullopt;
    double low = 0.0, high = 1.0;
    for (double middle = 0.5; low < middle && middle < high; middle = 0.5 * (low + high))
        (rise(middle) > 0.0 ? low : high) = middle;
    if (energy_at(high) < least_part * std::min(energy[1], energy[2])) return std::nullopt;
    return NeededLoad{std::lerp(from.length, to.length, high), std::sqrt(toughness_at(high) / energy_at(high)),
                      toughness_at(high)};
}

}  // namespace crampfit

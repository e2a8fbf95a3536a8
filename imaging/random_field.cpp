#include "imaging/random_field.hpp"

#include <cmath>
#include <numbers>

namespace crampfit {
namespace {

/// The output function of SplitMix64 (Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators").
std::uint64_t mix(std::uint64_t z) {
    z += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

double cubic_step(double t) { return t * t * (3 - 2 * t); }

// Variance that joining two unit normals with weights 1 - s and s leaves, averaged over t in 0..1 with s the cubic
// step: integral of (1 - s)^2 + s^2 = 1 - 2 (1/2 - 13/35) = 26/35.
constexpr double joined_variance = 26.0 / 35.0;

std::int64_t wrap(std::int64_t i, std::int64_t period) { return ((i % period) + period) % period; }

}  // namespace

double RandomField::uniform(std::uint64_t stream, std::uint64_t index) const {
    return static_cast<double>(mix(mix(mix(seed_) + stream) + index) >> 11) * 0x1.0p-53;
}

double RandomField::normal(std::uint64_t stream, std::uint64_t index) const {
    const double u = uniform(stream, 2 * index);
    const double v = uniform(stream, 2 * index + 1);
    return std::sqrt(-2 * std::log1p(-u)) * std::cos(2 * std::numbers::pi * v);
}

double RandomField::smooth(std::uint64_t stream, double x) const {
    const double cell = std::floor(x);
    const double s = cubic_step(x - cell);
    const auto i = static_cast<std::uint64_t>(static_cast<std::int64_t>(cell));
    return ((1 - s) * normal(stream, i) + s * normal(stream, i + 1)) / std::sqrt(joined_variance);
}

double RandomField::smooth(std::uint64_t stream, double x, double y, std::int64_t period) const {
    const double row = std::floor(y);
    const double s = cubic_step(y - row);
    // Each row of the lattice is a line of its own: its stream is drawn from the row's number.
    const auto line = [&](std::int64_t j) { return smooth(mix(stream) + static_cast<std::uint64_t>(wrap(j, period)), x); };
    const auto j = static_cast<std::int64_t>(row);
    return ((1 - s) * line(j) + s * line(j + 1)) / std::sqrt(joined_variance);
}

}  // namespace crampfit

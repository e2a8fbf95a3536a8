#pragma once

#include <cstdint>

namespace crampfit {

/// Random numbers that are the same on every machine and in any order of asking: each is a pure function of seed,
/// stream and index. The standard library's distributions are not used because their formulas differ between libraries.
class RandomField {
  public:
    explicit RandomField(std::uint64_t seed) : seed_(seed) {}

    /// Uniform in [0, 1): the upper 53 bits of the hash.
    double uniform(std::uint64_t stream, std::uint64_t index) const;

    /// Standard normal, by Box and Muller (1958): sqrt(-2 ln(1 - u)) cos(2 pi v) with u, v of indices 2 i and 2 i + 1.
    double normal(std::uint64_t stream, std::uint64_t index) const;

    /// Smooth noise along a line: standard normals at whole numbers, joined by cubic steps; mean 0, mean variance 1.
    double smooth(std::uint64_t stream, double x) const;

    /// Smooth noise in a plane that closes on itself in y after `period` whole steps; mean 0, mean variance 1.
    double smooth(std::uint64_t stream, double x, double y, std::int64_t period) const;

  private:
    std::uint64_t seed_;
};

}  // namespace crampfit

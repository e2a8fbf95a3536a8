#pragma once

#include "datasets/units.hpp"

#include <limits>

namespace crampfit {

/// What a number may be, in SI. The same rules hold for a file, for the command line and for a fit.
struct NumberRule {
    Dimension dimension;
    double low;
    double high;
    bool open;         // low and high themselves are not allowed
    const char* rule;  // in words

    bool allows(double value) const { return open ? value > low && value < high : value >= low && value <= high; }
};

namespace limits {
inline constexpr double infinity = std::numeric_limits<double>::infinity();

constexpr NumberRule positive(const Dimension& dimension) { return {dimension, 0, infinity, true, "must be greater than 0"}; }
constexpr NumberRule not_negative(const Dimension& dimension) {
    return {dimension, 0, std::numeric_limits<double>::max(), false, "must not be negative"};
}
constexpr NumberRule finite(const Dimension& dimension) { return {dimension, -infinity, infinity, true, "must be finite"}; }

inline constexpr NumberRule thickness = positive(dimension::length);
inline constexpr NumberRule cell = positive(dimension::length);
inline constexpr NumberRule asked_error = {dimension::number, 0, 1, true, "must be between 0 and 100 %"};
inline constexpr NumberRule size = positive(dimension::length);
inline constexpr NumberRule radius = positive(dimension::length);
inline constexpr NumberRule coordinate = finite(dimension::length);
inline constexpr NumberRule pixel = positive(dimension::length);
inline constexpr NumberRule rotation = finite(dimension::angle);
inline constexpr NumberRule period = positive(dimension::length);
inline constexpr NumberRule latewood_fraction{dimension::number, 0, 1, false, "must lie between 0 and 1"};
inline constexpr NumberRule transition = not_negative(dimension::length);
inline constexpr NumberRule youngs_modulus = positive(dimension::pressure);
inline constexpr NumberRule poisson_ratio{dimension::number, -1, 0.5, true, "must lie between -1 and 0.5, both excluded"};
inline constexpr NumberRule orthotropic_poisson_ratio = finite(dimension::number);  // see `broken_rule`
inline constexpr NumberRule relaxing_share{dimension::number, 0, 1, false, "must lie between 0 and 1"};
inline constexpr NumberRule relaxation_time = positive(dimension::time);
inline constexpr NumberRule yield_stress = positive(dimension::pressure);
inline constexpr NumberRule hardening = not_negative(dimension::pressure);
inline constexpr NumberRule plastic_strain = positive(dimension::number);
inline constexpr NumberRule density_exponent = positive(dimension::number);
inline constexpr NumberRule density = positive(dimension::density);
inline constexpr NumberRule toughness = positive(dimension::energy_release_rate);
inline constexpr NumberRule velocity = finite(dimension::velocity);
inline constexpr NumberRule traction = finite(dimension::pressure);
inline constexpr NumberRule force = finite(dimension::force);
inline constexpr NumberRule until = positive(dimension::time);
inline constexpr NumberRule friction = not_negative(dimension::number);
inline constexpr NumberRule bridging_stress = positive(dimension::pressure);
inline constexpr NumberRule bridging_opening = positive(dimension::length);
inline constexpr NumberRule advance = not_negative(dimension::length);
inline constexpr NumberRule share{dimension::number, 0, 1, false, "must lie between 0 and 1"};
inline constexpr NumberRule weight{dimension::number, 1e-9, 1e9, false, "must be greater than 0, from 1e-9 to 1e9"};
inline constexpr NumberRule compliance = not_negative(dimension::compliance);
inline constexpr NumberRule force_offset = finite(dimension::force);
inline constexpr NumberRule displacement_offset = finite(dimension::length);
inline constexpr NumberRule time_step = positive(dimension::time);
inline constexpr NumberRule damping = not_negative(dimension::rate);
}  // namespace limits

}  // namespace crampfit

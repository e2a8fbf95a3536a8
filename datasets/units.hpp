#pragma once

#include <string>
#include <string_view>

namespace crampfit {

/// Exponents of the base units. An angle counts as a base of its own, so that a bare number is no angle.
struct Dimension {
    double length = 0;  // m
    double mass = 0;    // kg
    double time = 0;    // s
    double angle = 0;   // rad
};

bool operator==(const Dimension& a, const Dimension& b);

namespace dimension {
inline constexpr Dimension number{};
inline constexpr Dimension length{1, 0, 0, 0};
inline constexpr Dimension time{0, 0, 1, 0};
inline constexpr Dimension angle{0, 0, 0, 1};
inline constexpr Dimension velocity{1, 0, -1, 0};
inline constexpr Dimension rate{0, 0, -1, 0};
inline constexpr Dimension force{1, 1, -2, 0};
inline constexpr Dimension compliance{0, -1, 2, 0};
inline constexpr Dimension pressure{-1, 1, -2, 0};
inline constexpr Dimension density{-3, 1, 0, 0};
inline constexpr Dimension energy_release_rate{0, 1, -2, 0};
inline constexpr Dimension stress_intensity{-0.5, 1, -2, 0};
}  // namespace dimension

/// A dimension in words, with an example where it is a common one: a pressure such as "40 MPa".
std::string describe(const Dimension& dimension);

struct Unit {
    double factor = 1;  // SI units in one of this unit
    Dimension dimension;
};

/// A value as it was written, with its unit.
struct Quantity {
    double value = 0;   // SI
    std::string unit;   // as written; empty: a pure number
    double factor = 1;  // SI units in one `unit`
    Dimension dimension;
};

/// The head of a column in a table: force [N].
struct ColumnHeader {
    std::string name;
    Unit unit;
};

/// Where a text stands, for the errors about it.
struct Place {
    std::string file;
    std::string key;
};

/// Understands m, g, s, N, Pa, J, W, Hz, rad with SI prefixes (p n u m c d h k M G T; also the Greek mu), min, h, deg,
/// % and 1, joined by *, / and spaces, with powers (^2, ^-1, ^0.5, ^(1/2)), brackets and sqrt(): "MPa sqrt(m)",
/// "g/cm^3". Throws InputError.
Unit parse_unit(std::string_view text, const Place& place);

/// A number and its unit, as in "40 MPa"; the unit may be absent for a pure number. Throws InputError, for an infinite
/// value too.
Quantity parse_quantity(std::string_view text, const Place& place);

/// The same in SI, with a check of the dimension: a unit that is missing or of another dimension is an InputError.
double parse_quantity(std::string_view text, const Dimension& expected, const Place& place);

/// The same check for a quantity that was parsed before; `text` is what stood there.
void check_dimension(const Quantity& quantity, const Dimension& expected, std::string_view text, const Place& place);

/// The head of a column, such as "force [N]". Throws InputError when name or unit is missing.
ColumnHeader parse_header(std::string_view text, const Place& place);

/// Text without the white space around it.
std::string trim(std::string_view text);

}  // namespace crampfit

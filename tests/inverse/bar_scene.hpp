#pragma once

#include "datasets/io.hpp"

namespace crampfit::testing {

/// A bar under tension, F = E w t u / L with w = t = 10 mm and L = 20 mm.
inline Scene bar_scene() {
    return parse_scene(R"(
[model]
plane = "stress"
thickness = "10 mm"
cell = "5 mm"
[specimen]
size = ["10 mm", "20 mm"]
material = "EW"
[materials]
EW = { kind = "isotropic", E = "400 MPa", nu = 0.0, density = "300 kg/m^3", toughness = "100 J/m^2" }
[[edges]]
name = "top"
side = "top"
velocity = ["0 m/s", "1 mm/min"]
[[edges]]
name = "bottom"
side = "bottom"
velocity = ["0 m/s", "0 m/s"]
[measure]
force = "top"
displacement = "top"
[stop]
displacement = "0.1 mm"
)",
                       "bar.toml");
}

/// Its modulus as a parameter.
inline Parameter bar_modulus() {
    Parameter parameter;
    parameter.name = "E";
    parameter.keys = {"materials.EW.E"};
    parameter.initial = 400e6;
    parameter.lower = 100e6;
    parameter.upper = 900e6;
    parameter.unit = "MPa";
    parameter.unit_factor = 1e6;
    return parameter;
}

}  // namespace crampfit::testing

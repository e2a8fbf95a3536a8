#pragma once

#include <string>

/// A block pulled apart, so coarse that a run takes a fraction of a second.
inline const std::string small_scene = R"(
title = "block under tension"

[model]
plane = "strain"
thickness = "10 mm"
cell = "0.5 mm"
points_per_cell = 4

[specimen]
size = ["10 mm", "10 mm"]
material = "EW"

[materials.EW]
kind = "isotropic"
E = "40 MPa"
nu = 0.33
density = "300 kg/m^3"
toughness = "100 J/m^2"

[[edges]]
name = "top"
side = "top"
velocity = ["0 m/s", "5 m/s"]

[[edges]]
name = "bottom"
side = "bottom"
velocity = ["0 m/s", "0 m/s"]

[[cracks]]
points = [["10 mm", "5 mm"], ["7.5 mm", "5 mm"]]
grows = "end"
advance = "0 mm"

[measure]
force = "top"
displacement = "top"

[solver]
kind = "explicit"

[stop]
displacement = "0.1 mm"
)";

/// The same, pulled so slowly and so long that it would run for hours.
inline const std::string endless_scene = [] {
    std::string scene = small_scene;
    const auto replace = [&](const std::string& from, const std::string& to) {
        scene.replace(scene.find(from), from.size(), to);
    };
    replace("\"5 m/s\"", "\"1 um/s\"");
    replace("displacement = \"0.1 mm\"", "time = \"1000 s\"");
    return scene;
}();

/// The small scene at equilibrium: pulled slowly, by an advance of two cells. Within the bounds of the study it is linear: what a
/// run gives does not depend on which runs came before.
inline std::string slow_scene() {
    std::string scene = small_scene;
    const auto replace = [&](const std::string& from, const std::string& to) {
        scene.replace(scene.find(from), from.size(), to);
    };
    replace("\"5 m/s\"", "\"1 mm/min\"");
    replace("advance = \"0 mm\"", "advance = \"1 mm\"\ndirection = \"straight\"");
    replace("kind = \"explicit\"", "kind = \"quasistatic\"");
    replace("displacement = \"0.1 mm\"", "displacement = \"1 mm\"");
    return scene;
}

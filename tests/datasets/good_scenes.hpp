#pragma once

#include <string>

/// Scenes that are right in every respect; between them they use every key.

inline const std::string ring_scene = R"(title = "TR+ crack under tension"

[model]
plane = "strain"
thickness = "10 mm"
cell = "0.1 mm"
points_per_cell = 9

[specimen]
size = ["10 mm", "20 mm"]
cutouts = [ { polygon = [["4 mm", "20 mm"], ["6 mm", "20 mm"], ["5 mm", "17 mm"]] },
            { circle = { centre = ["5 mm", "2 mm"], radius = "1 mm" } } ]
rings = { pith = ["-20 mm", "5 mm"], period = "2.2 mm", latewood_fraction = 0.25, transition = "0.3 mm" }

[materials.EW]
kind = "isotropic"
E = "40 MPa"
nu = 0.33
density = "300 kg/m^3"
toughness = "100 J/m^2"

[materials.LW]
E = "1200 MPa"
nu = 0.3
density = "900 kg/m^3"
toughness = "0.3 kJ/m^2"

[[edges]]
name = "grip"
side = "top"
range = ["4 mm", "6 mm"]
velocity = ["free", "5 m/s"]
until = "1 ms"

[[edges]]
side = "left"
range = ["4 mm", "16 mm"]
traction = ["0 MPa", "1 MPa"]

[[bodies]]
name = "left wheel"
circle = { centre = ["4 mm", "21 mm"], radius = "1 mm" }
contact = { friction = 0.3 }
velocity = ["0 m/s", "-1 mm/min"]
until = "2 ms"

[[bodies]]
polygon = [["4 mm", "-1 mm"], ["6 mm", "-1 mm"], ["5 mm", "0 mm"]]
contact = "bonded"
velocity = ["0 m/s", "0 m/s"]

[[cracks]]
points = [["10 mm", "5 mm"], ["7.5 mm", "5 mm"]]
grows = "end"
criterion = "energy release rate"
advance = "0.1 mm"
direction = "hoop stress"
faces = { friction = 0.2 }

[[cracks]]
points = [["1 mm", "10 mm"], ["2 mm", "10 mm"], ["3 mm", "11 mm"]]
faces = "stick"

[measure]
force = "left wheel"
displacement = "grip"

[solver]
kind = "explicit"
shape_function = "gimp"
damping = "2e4 1/s"

[stop]
displacement = "0.5 mm"
crack_length = "8 mm"
time = "1 ms"

[output]
frames = 50
samples = 400
)";

/// Needs the files block.png and angles.png beside it.
inline const std::string picture_scene = R"([model]
plane = "stress"
thickness = "10 mm"
cell = "0.1 mm"

[specimen]
size = ["10 mm", "10 mm"]
image = "block.png"
pixel = "25 um"
offset = ["-1 mm", "2 mm"]
rotation = "30 deg"
classes = [ { material = "EW", gray = [128, 255] }, { material = "LW", gray = [0, 100] } ]
between = "graded"
orientation = "angles.png"

[materials]
EW = { E = "40 MPa", nu = 0.33, density = "300 kg/m^3", toughness = "100 J/m^2" }
LW = { E = "1200 MPa", nu = 0.33, density = "900 kg/m^3", toughness = "300 J/m^2" }

[[edges]]
side = "bottom"
velocity = ["0 m/s", "0 m/s"]

[[edges]]
side = "top"
velocity = ["0 m/s", "5 m/s"]

[stop]
time = "1 ms"
)";

inline const std::string plain_scene = R"([model]
plane = "stress"
thickness = "10 mm"
cell = "0.1 mm"

[specimen]
size = ["10 mm", "10 mm"]
material = "EW"

[materials.EW]
E = "40 MPa"
nu = 0.33
density = "300 kg/m^3"
toughness = "100 J/m^2"

[[edges]]
side = "bottom"
velocity = ["0 m/s", "0 m/s"]

[[edges]]
side = "top"
traction = ["0 MPa", "1 MPa"]

[stop]
time = "1 ms"
)";

/// Orthotropic transition wood between two woods, in plane strain.
inline const std::string orthotropic_scene = R"([model]
plane = "strain"
thickness = "10 mm"
cell = "0.1 mm"

[specimen]
size = ["10 mm", "10 mm"]
rings = { pith = ["-20 mm", "5 mm"], period = "2.2 mm", latewood_fraction = 0.25, transition = "0.3 mm" }
density_exponents = { E_T = 2.5, toughness = 1.5 }

[materials.EW]
kind = "orthotropic"
E_R = "800 MPa"
E_T = "400 MPa"
G_RT = "40 MPa"
nu_RT = 0.45
E_L = "11 GPa"
nu_LR = 0.4
nu_LT = 0.45
density = "300 kg/m^3"
toughness = "100 J/m^2"

[materials.LW]
E = "1200 MPa"
nu = 0.3
density = "900 kg/m^3"
toughness = "300 J/m^2"

[[edges]]
side = "top"
traction = ["0 MPa", "1 MPa"]

[stop]
time = "1 ms"
)";

inline const std::string remembering_scene = R"([model]
plane = "stress"
thickness = "10 mm"
cell = "0.2 mm"

[specimen]
size = ["10 mm", "10 mm"]
rings = { pith = ["-20 mm", "5 mm"], period = "2.2 mm", latewood_fraction = 0.25, transition = "0 mm" }

[materials.EW]
kind = "viscoelastic"
E = "40 MPa"
nu = 0.33
prony = [ { g = 0.2, tau = "1 s" }, { g = 0.3, k = 0.1, tau = "2 min" } ]
density = "300 kg/m^3"
toughness = "100 J/m^2"

[materials.LW]
kind = "plastic"
E = "1200 MPa"
nu = 0.3
yield_stress = "2 MPa"
hardening = "5 MPa"
saturation_stress = "3 MPa"
saturation_strain = 0.02
density = "900 kg/m^3"
toughness = "300 J/m^2"

[[edges]]
side = "top"
traction = ["0 MPa", "1 MPa"]

[solver]
time_step = "2 s"

[stop]
time = "1 min"
)";

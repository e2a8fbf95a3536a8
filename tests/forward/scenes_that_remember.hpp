#pragma once

#include "tests/forward/scenes.hpp"

#include <cmath>

namespace crampfit::test {

/// With k = g Poisson's ratio stays what it is, so that a bar's E relaxes as G does.
inline Material relaxing(double share, double tau) {
    Material wood = earlywood();
    wood.viscoelastic = Viscoelasticity{{{share, share, tau}}};
    return wood;
}

inline Material flowing(double yield_stress, double hardening) {
    Material wood = earlywood();
    wood.plastic = Plasticity{yield_stress, hardening};
    return wood;
}

/// A bar 4 x 2 mm and 1 m thick along x, free to contract, pulled at its right end.
inline Scene bar(const Material& wood, PlaneCondition plane, const Edge& load) {
    Scene scene = at_rest({4e-3, 2e-3}, 1e-3);
    scene.model.plane = plane;
    scene.materials["EW"] = wood;
    scene.edges = {without(moving("left", Side::left, {0.0, 0.0}), 1), without(moving("bottom", Side::bottom, {0.0, 0.0}), 0),
                   load};
    scene.measure = {load.name, load.name};
    return scene;
}

inline Edge pull(double speed, double until) {
    Edge edge = without(moving("right", Side::right, {speed, 0.0}), 1);
    edge.until = until;
    return edge;
}

inline double bar_modulus(PlaneCondition plane) { return 40e6 / (plane == PlaneCondition::strain ? 1 - 0.33 * 0.33 : 1.0); }

/// Strain under a constant stress over that at once.
inline double creep(double share, double tau, double time) {
    return 1 + share / (1 - share) * -std::expm1(-(1 - share) * time / tau);
}

}  // namespace crampfit::test

#pragma once

#include "tests/forward/cracked_plates.hpp"

#include <gtest/gtest.h>

namespace crampfit::test {

/// A strip between grips whose growth rings lie across the crack's way (REFERENCES: laminated strip).
struct LaminatedStrip {
    double cell = 0.2e-3;    // [m]
    double lift = 0.0;       // of the crack above the strip's middle, in cells
    double contrast = 30.0;  // E of latewood over that of earlywood
    double period = 2e-3;    // of the rings, a quarter latewood [m]
    double length = 24e-3;   // of the strip [m]
    double start = 10e-3;    // crack length before the ring that it crosses, whole rings [m]
};

/// What a crack gives off over one whole ring, over the energy that was stored in a ring far ahead, less one: by the change of
/// the potential, by G at each half cell, and by K.
struct RingMeans {
    double potential, G, K;
};

inline RingMeans over_one_ring(const LaminatedStrip& strip) {
    const double half_height = 3e-3;
    Scene scene = at_rest({strip.length, 2 * half_height}, strip.cell);
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(-1000.0, half_height), strip.period, 0.25, 0.0};
    scene.materials["LW"] = {strip.contrast * 40e6, 0.33, 900.0, 100.0};
    scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.measure = {"top", "top"};
    const AtRest whole(scene);
    double ahead = 0.0;  // stored in the ring in the middle [J/m]
    for (int p = 0; p < whole.body.points.count(); ++p) {
        if (std::abs(whole.body.points.position[p].x() - 0.5 * strip.length) > 0.5 * strip.period) continue;
        const Mat2 gradient = gradient_at(whole.body, p, whole.equilibrium.displacements());
        ahead += whole.body.points.volume[p] * elastic_state(gradient, whole.body.points.stiffness_of(p), false).energy;
    }
    const double y = half_height + strip.lift * strip.cell;
    Crack crack;
    crack.points = {Vec2(0.0, y), Vec2(strip.start, y)};
    scene.cracks = {crack};
    AtRest run(scene);
    const double before = run.equilibrium.potential();
    const int steps = static_cast<int>(std::lround(2 * strip.period / strip.cell));
    double G = 0.0, K = 0.0;
    for (int i = 0; i < steps; ++i) {  // tips in the middle of each step
        const Vec2 tip(strip.start + (i + 0.5) * strip.period / steps, y);
        run.equilibrium.grow(0, true, tip);
        EXPECT_EQ(run.equilibrium.solve(1.0), Equilibrium::Outcome::solved);
        const TipLoad load = run.load();
        G += load.G * strip.period / steps;
        K += (load.K_I * load.K_I + load.K_II * load.K_II) / run.materials.at(tip).plane_modulus() * strip.period / steps;
    }
    run.equilibrium.grow(0, true, Vec2(strip.start + strip.period, y));
    EXPECT_EQ(run.equilibrium.solve(1.0), Equilibrium::Outcome::solved);
    return {(before - run.equilibrium.potential()) / ahead - 1, G / ahead - 1, K / ahead - 1};
}

}  // namespace crampfit::test

#pragma once

#include "benchmarks/reference_scenes.hpp"
#include "forward/equilibrium.hpp"
#include "forward/explicit.hpp"
#include "forward/simulate.hpp"

#include <cmath>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

namespace crampfit::test {

using namespace crampfit::reference;

inline Material earlywood() { return {40e6, 0.33, 300.0, 100.0}; }

/// Everything that a run needs, kept together so that a test can step through it.
struct Trial {
    explicit Trial(const Scene& s)
        : scene(s), materials(scene), body(scene, materials), plan(make_plan(scene, materials, body)),
          solver(scene, plan, materials, body) {}

    void until(double time) {
        while (solver.time() < time) solver.step();
    }

    Scene scene;
    MaterialMap materials;
    Discretisation body;
    Plan plan;
    ExplicitSolver solver;
};

/// The same for equilibrium. `rotates` overrules the plan: closed forms are those of small strain.
struct StaticTrial {
    explicit StaticTrial(const Scene& s, std::optional<bool> rotates = {})
        : scene(s), materials(scene), body(scene, materials), plan(overruled(make_plan(scene, materials, body), rotates)),
          equilibrium(scene, plan, materials, body) {}

    bool solve(double time) { return equilibrium.solve(time) == Equilibrium::Outcome::solved; }

    Scene scene;
    MaterialMap materials;
    Discretisation body;
    Plan plan;
    Equilibrium equilibrium;

  private:
    static Plan overruled(Plan plan, std::optional<bool> rotates) {
        plan.rotates = rotates.value_or(plan.rotates);
        return plan;
    }
};

/// What a body puts on the specimen [N].
inline Vec2 push_of(const StaticTrial& run, int body) {
    return run.equilibrium.reactions()[run.equilibrium.boundary().first_body() + body];
}

/// The scene at equilibrium instead of in damped motion.
inline Scene at_equilibrium(Scene scene) {
    scene.solver.kind = SolverKind::quasistatic;
    scene.solver.damping = 0.0;
    return scene;
}

/// The scene in motion, whatever the load's speed.
inline Scene at_motion(Scene scene) {
    scene.solver.kind = SolverKind::explicit_dynamics;
    return scene;
}

/// The ring specimen of the finite-element reference: 10 x 10 mm, pulled by 0.1 mm, edge crack of length a from the right. The
/// latewood is made so heavy that both woods have the same wave speed: equilibrium does not feel it, and is reached sooner.
inline Scene ring_specimen(double crack_length, double cell, bool rings = true) {
    Scene scene = block({10e-3, 10e-3}, cell);
    if (rings) {
        scene.specimen.material.clear();
        scene.specimen.rings = Rings{Vec2(-20e-3, 5e-3), 2.2e-3, 0.25, 0.0};
        scene.materials["LW"] = {1200e6, 0.33, 9000.0, 100.0};
    }
    scene.edges = {moving("top", Side::top, {0.0, 1.0}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.edges[0].until = 1e-4;
    Crack crack;
    crack.points = {Vec2(10e-3, 5e-3), Vec2(10e-3 - crack_length, 5e-3)};
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.solver.damping = 4e4;
    scene.stop.time = 6e-4;  // vibration has died out to 1e-5 by then
    return scene;
}

inline Mat2 turn(double angle) {
    Mat2 R;
    R << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
    return R;
}

/// A cracked block of earlywood, or of rings whose boundaries cross many cells.
inline Scene cracked_block(bool rings) {
    Scene scene = rings ? ring_specimen(3e-3, 1e-3) : block({6e-3, 6e-3}, 1e-3);
    if (rings) scene.specimen.rings->pith = {-6e-3, -3e-3};
    Crack crack;
    crack.points = {Vec2(0, 3.3e-3), Vec2(2.6e-3, 3.1e-3)};
    scene.cracks = {crack};
    return scene;
}

inline std::vector<Vec2> random_displacement(int fields) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> in(-0.2e-3, 0.2e-3);
    std::vector<Vec2> displacement(fields);
    for (Vec2& u : displacement) u = Vec2(in(random), in(random));
    return displacement;
}

}  // namespace crampfit::test

#pragma once

#include "forward/equilibrium.hpp"
#include "tests/forward/scenes.hpp"

namespace crampfit::test {

/// A scene at rest under its full load.
struct AtRest {
    explicit AtRest(const Scene& s)
        : scene(s), materials(scene), body(scene, materials), plan(make_plan(scene, materials, body)),
          equilibrium(scene, small_rotation(plan), materials, body), outcome(equilibrium.solve(1.0)) {}

    TipLoad load(bool at_end = true) const { return equilibrium.load_at(0, at_end); }
    bool solved() const { return outcome == Equilibrium::Outcome::solved; }

    Scene scene;
    MaterialMap materials;
    Discretisation body;
    Plan plan;
    Equilibrium equilibrium;
    Equilibrium::Outcome outcome;

  private:
    // The closed forms are those of small strain, whatever the displacement comes to.
    static const Plan& small_rotation(Plan& plan) {
        plan.rotates = false;
        return plan;
    }
};

}  // namespace crampfit::test

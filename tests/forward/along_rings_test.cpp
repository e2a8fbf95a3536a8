// Which way a crack along the rings is turned: off latewood, by its K_II and by the energy that short branches release.
#include "forward/growth.hpp"
#include "tests/forward/cracked_plates.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace crampfit::test {
namespace {

constexpr double period = 2.2e-3, latewood_fraction = 0.25;  // of the rings; they lie level
constexpr double half_height = 2.5 * period;                 // [m]

// A strip between grips, five rings high, with a crack from the left this far above the lower border of the middle ring [m];
// earlywood below, latewood above (1 - 0.25) 2.2 mm. The crack's tip then goes on along a branch, if any.
struct AlongRings {
    explicit AlongRings(double height, double cell = 0.1e-3) : run(scene(height, cell)) { EXPECT_TRUE(run.solved()); }

    double released_by(double angle, double length) {
        const double before = run.equilibrium.potential();
        const Vec2 tip = run.equilibrium.cracks().lines[0].end.position;
        run.equilibrium.grow(0, true, tip + length * Vec2(std::cos(angle), std::sin(angle)));
        EXPECT_EQ(run.equilibrium.solve(1.0), Equilibrium::Outcome::solved);
        return (before - run.equilibrium.potential()) / length;
    }

    static Scene scene(double height, double cell) {
        Scene scene = at_rest({16e-3, 2 * half_height}, cell);
        scene.specimen.material.clear();
        scene.specimen.rings = Rings{Vec2(8e-3, -period * 1e6), period, latewood_fraction, 0.0};
        scene.materials["LW"] = {1200e6, 0.33, 750.0, 100.0};
        scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.measure = {"top", "top"};
        Crack crack;
        crack.points = {Vec2(0.0, 2 * period + height), Vec2(6e-3, 2 * period + height)};
        scene.cracks = {crack};
        return scene;
    }

    AtRest run;
};

TEST(VerificationAlongRings, ACrackInEarlywoodIsTurnedOffLatewood) {
    // Said twice: by K_II, and by the energy that a branch of four cells releases either way.
    const double middle = 0.5 * (1.0 - latewood_fraction) * period, branch = 0.4e-3, angle = 15.0 * degree;
    for (const double off : {-0.5e-3, -0.3e-3, 0.3e-3, 0.5e-3}) {
        const TipLoad load = AlongRings(middle + off).run.load();
        const double up = AlongRings(middle + off).released_by(angle, branch),
                     down = AlongRings(middle + off).released_by(-angle, branch);
        const Vec2 branch_up = branch_intensities(angle, load.K_I, load.K_II),
                   branch_down = branch_intensities(-angle, load.K_I, load.K_II);
        std::printf(
            "%+.1f mm off the middle of earlywood: K_II / K_I %+.3f; branch up over branch down: %.3f by energy, %.3f by K\n",
            1e3 * off, load.K_II / load.K_I, up / down, branch_up.squaredNorm() / branch_down.squaredNorm());
        EXPECT_GT(load.K_II * off, 0.0);  // K_II > 0 turns down
        EXPECT_GT((down - up) * off, 0.0);
    }
}

TEST(VerificationAlongRings, ACrackInLatewoodIsTurnedOutOfIt) {
    const double middle = (1.0 - 0.5 * latewood_fraction) * period, branch = 0.2e-3, angle = 15.0 * degree;
    for (const double off : {-0.15e-3, 0.15e-3}) {
        const TipLoad load = AlongRings(middle + off, 0.05e-3).run.load();
        const double up = AlongRings(middle + off, 0.05e-3).released_by(angle, branch),
                     down = AlongRings(middle + off, 0.05e-3).released_by(-angle, branch);
        std::printf("%+.2f mm off the middle of latewood: K_II / K_I %+.3f; branch up over branch down: %.3f by energy\n",
                    1e3 * off, load.K_II / load.K_I, up / down);
        EXPECT_LT(load.K_II * off, 0.0);
        EXPECT_GT((up - down) * off, 0.0);
    }
}

}  // namespace
}  // namespace crampfit::test

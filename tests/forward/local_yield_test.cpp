// Wheels of some cells across, under which the wood yields as on cells a quarter as wide: against Hertz, a finer grid and central
// differences.
#include "forward/local_yield.hpp"

#include "datasets/io.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>

namespace crampfit::test {
namespace {

// A wheel of 0.5 mm radius comes down on 3 x 3 mm, held from below, at 1 m/s.
Scene rolled(double cell, double where) {
    Scene scene = block({3e-3, 3e-3}, cell);
    scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
    Body wheel;
    wheel.name = "wheel";
    wheel.shape = Circle{Vec2(where, 3.5e-3), 0.5e-3};
    wheel.velocity = {0.0, -1.0};
    scene.bodies = {wheel};
    scene.measure = {"wheel", "wheel"};
    scene.solver.kind = SolverKind::quasistatic;
    scene.solver.strain = StrainMeasure::small;
    scene.stop.time = 0.1e-3;
    return scene;
}

// The same on sharp bands: latewood from 1.45 to 2 mm, from the middle of a cell of 0.1 mm to a line of the grid.
Scene rolled_over_latewood(double cell, double where) {
    Scene scene = rolled(cell, where);
    scene.materials["LW"] = {1200e6, 0.33, 750.0, 100.0};
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(-20e-3, 2e-3), 2.2e-3, 0.25, 0.0};
    return scene;
}

double force(const Scene& scene, double travel) {
    StaticTrial trial(scene);
    EXPECT_TRUE(trial.solve(travel));
    return -trial.equilibrium.reactions().back().y();
}

TEST(VerificationLocalYield, WoodYieldsAsHertzHasItWithinACell) {
    // The approach d of a cylinder goes with the load P as d / P = (C - ln P) / (pi E*), with C of the block's shape (Johnson
    // 1985, 5.6: ln a, with a^2 = 4 P R / (pi E*)). A surface that bends at nodes knows nothing of a where that is less than a
    // cell; here it is 0.5 to 1 of one.
    const double cell = 0.1e-3, modulus = 40e6 / (1 - 0.33 * 0.33);
    for (const double place : {0.0, 0.25, 0.5}) {
        const Scene scene = rolled(cell, 1.5e-3 + place * cell);
        const double low = 0.012e-3, high = 0.04e-3;
        const double at_low = force(scene, low), at_high = force(scene, high);
        const double half_width = std::sqrt(4 * at_high * 0.5e-3 / (std::numbers::pi * modulus));
        const double slope = (low / at_low - high / at_high) / std::log(at_high / at_low) * std::numbers::pi * modulus;
        std::printf("wheel at %.2f of a cell, half width to %.2f cells: d(d / P) / d ln P %+.3f of Hertz's\n", place,
                    half_width / cell, slope);
        EXPECT_NEAR(slope, 1.0, 0.1);
    }
}

TEST(VerificationLocalYield, OverAnEdgeOfLatewood) {
    // Against cells of 0.025 mm, a twentieth of the wheel's radius, of which it feels none.
    double worst = 0;
    for (double where = 1.2e-3; where < 1.75e-3; where += 0.25e-3) {
        const double travel = 0.03e-3;
        const double fine = force(rolled_over_latewood(0.025e-3, where), travel);
        const double error = force(rolled_over_latewood(0.1e-3, where), travel) / fine - 1;
        std::printf("wheel at %.2f mm, latewood from 1.45 to 2 mm: force %+.2f %%\n", 1e3 * where, 100 * error);
        worst = std::max(worst, std::abs(error));
    }
    EXPECT_LT(worst, 0.05);
}

// All lengths so much larger, but for the thickness, and the specimen so much wider: then the force is as much larger, and hangs
// on no last digits. Of a specimen that is wider by 1e-8 it changes by about that. With these factors rounding lets a length come
// out less than the whole number of facets or cells that it is.
TEST(VerificationLocalYield, TheForceHangsOnNoLastDigits) {
    const auto pushed = [](double larger, double wider) {
        Scene scene = rolled(larger * 0.1e-3, 0.0);
        scene.specimen.size = larger * Vec2((1 + wider) * 3e-3, 3e-3);
        scene.bodies[0].shape = Circle{larger * Vec2(1.37e-3, 3.5e-3), larger * 0.5e-3};
        scene.stop.time = larger * 0.1e-3;
        return force(scene, larger * 0.04e-3) / larger;
    };
    const double as_is = pushed(1.0, 0.0);
    for (const auto& [larger, wider] : {std::pair{1.0, 1e-8}, {1.0, -1e-8}, {1.07, 0.0}, {1.2, 0.0}, {0.71, 0.0}, {1.32, 0.0}}) {
        const double off = pushed(larger, wider) / as_is - 1;
        std::printf("%.2f times as large, wider by %+.0e: force off by %+.1e\n", larger, wider, off);
        EXPECT_LT(std::abs(off), 1e-6);
    }
}

TEST(GradientLocalYield, OfEnergyAndForce) {
    // Of energy and force at the wheel, by all numbers of woods and of the transition between them; central differences.
    Scene scene = rolled_over_latewood(0.2e-3, 1.4e-3);
    scene.specimen.rings->transition = 0.3e-3;
    scene.specimen.density_exponents.E = 2.0;
    const double travel = 0.05e-3, step = 1e-4;
    const auto at = [&](const std::string& key, double change) {
        Scene other = scene;
        if (!key.empty()) set_number(other, key, get_number(scene, key) * (1.0 + change));
        return other;
    };
    struct Found {
        double energy, force;
    };
    const auto solved = [&](StaticTrial& trial) -> Found {
        EXPECT_TRUE(trial.solve(0.5 * travel) && trial.solve(travel));
        trial.equilibrium.refine();
        return {trial.equilibrium.potential(), -trial.equilibrium.reactions().back().y()};
    };
    StaticTrial trial(scene);
    solved(trial);
    std::vector<Vec2> drivers(trial.equilibrium.boundary().drivers(), Vec2::Zero());
    drivers.back() = {0.0, -1.0};
    const auto motions = trial.equilibrium.motions({drivers});
    ASSERT_EQ(motions.size(), 1u);
    std::vector<std::string> keys{"materials.EW.E", "materials.LW.E", "materials.EW.nu", "materials.LW.nu",
                                  "specimen.density_exponents.E"};
    const std::vector<MaterialSlope> numbers = MaterialSlope::of(scene, keys, trial.body);
    const Equilibrium::Slopes slopes = trial.equilibrium.slopes(numbers);
    for (int n = 0; n < static_cast<int>(keys.size()); ++n) {
        StaticTrial more(at(keys[n], step)), less(at(keys[n], -step));
        const Found high = solved(more), low = solved(less);
        const double span = 2 * step * get_number(scene, keys[n]);
        const double energy = (high.energy - low.energy) / span, push = (high.force - low.force) / span;
        const double along = slopes.along(motions[0], n);
        std::printf("%s: energy %.3e, force %.3e off\n", keys[n].c_str(), slopes.potential[n] / energy - 1, along / push - 1);
        EXPECT_NEAR(slopes.potential[n], energy, 1e-6 * std::abs(energy));
        EXPECT_NEAR(along, push, 1e-5 * std::abs(push));
    }
}

}  // namespace
}  // namespace crampfit::test

// G of a tip close to a sharp boundary between two woods.
#include "tests/forward/cracked_plates.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace crampfit::test {
namespace {

// 5 x 5 mm, pulled; the crack runs at half height from the left, where the wood has this stiffness, and ends a distance before
// other wood, which fills the right half.
double release_rate(double here, double beyond, double distance, double cell, PlaneCondition plane) {
    Scene scene = at_rest({5e-3, 5e-3}, cell);
    scene.model.plane = plane;
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(-1000.0 + 2.5e-3, 2.5e-3), 2000.0, 0.5, 0.0};
    scene.materials["EW"].youngs_modulus = here;
    scene.materials["LW"] = scene.materials["EW"];
    scene.materials["LW"].youngs_modulus = beyond;
    scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, -1e-5})};
    Crack crack;
    crack.points = {Vec2(0.0, 2.5e-3), Vec2(2.5e-3 - distance, 2.5e-3)};
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    const AtRest run(scene);
    EXPECT_TRUE(run.solved());
    return run.load().G;
}

TEST(VerificationBoundary, GFallsTowardStifferWoodAsTheSingularitySays) {
    // G ~ d^m, m from the exponents of Zak and Williams 1963 (REFERENCES: tip near a boundary; nu = 0.33), which hold for d much
    // smaller than the crack: here a sixtieth to a fortieth of it.
    struct Exact {
        double ratio, stress, strain;
    };
    for (const auto& [ratio, stress, strain] : {Exact{3, 0.216, 0.188}, {15, 0.412, 0.332}, {30, 0.449, 0.357}}) {
        for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
            const double exact = plane == PlaneCondition::strain ? strain : stress, h = 25e-6;
            const auto at = [&](double cells) { return release_rate(40e6, ratio * 40e6, cells * h, h, plane); };
            const double slope = std::log(at(2.5) / at(1.5)) / std::log(2.5 / 1.5);
            std::printf("toward wood %2.0f times as stiff, plane %s: %.3f from 1.5 to 2.5 cells, exact %.3f\n", ratio,
                        plane == PlaneCondition::strain ? "strain" : "stress", slope, exact);
            EXPECT_NEAR(slope, exact, 0.04);
        }
    }
}

TEST(VerificationBoundary, GBesideABoundaryDoesNotDependOnTheGrid) {
    // In front of softer wood the exponents' slope, -0.70, is reached only at 1e-4 of the crack's length: what is left of the
    // difference goes with (d / a)^0.43. So the grid is held against one of cells half as wide.
    for (const bool stiffer : {true, false}) {
        double worst = 0.0;
        std::printf("G toward wood 30 times as %s, against cells half as wide:", stiffer ? "stiff" : "soft");
        for (const double cells : {2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0}) {
            const double h = 0.1e-3, here = stiffer ? 40e6 : 1200e6, beyond = stiffer ? 1200e6 : 40e6;
            const auto with_cells = [&](double cell) {
                return release_rate(here, beyond, cells * h, cell, PlaneCondition::strain);
            };
            const double off = with_cells(h) / with_cells(0.5 * h) - 1;
            std::printf(" %+.2f %%", 100 * off);
            worst = std::max(worst, std::abs(off));
        }
        std::printf(" at 2 to 6 cells\n");
        EXPECT_LT(worst, 0.005);
    }
}

}  // namespace
}  // namespace crampfit::test

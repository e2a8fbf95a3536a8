// Tip near a boundary between two woods, crack across it: G goes as a power of the distance, toward and away from the stiffer one.
#include "tests/forward/cracked_plates.hpp"
#include "tests/forward/hard_cases.hpp"

#include <fmt/format.h>

namespace crampfit::test {
namespace {

// Two blocks joined at x = wide, the left one with an edge crack that ends `distance` before the joint, pulled up and down.
double rate_before_boundary(double cell, double left, double right, double distance, double wide) {
    Scene scene = at_rest({2 * wide, 2 * wide}, cell);
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(-1000.0, wide), 2 * wide, 0.5, 0.0};  // earlywood on the left, latewood on the right
    scene.materials["EW"].youngs_modulus = left;
    scene.materials["LW"] = {right, 0.33, 900.0, 100.0};
    scene.edges = {pulled("top", Side::top, {0.0, 1e3}), pulled("bottom", Side::bottom, {0.0, -1e3}),
                   held_at("hinge", Side::right, wide, cell, 0.0, 0.0), held_at("slide", Side::right, wide + 2 * cell, cell, 0.0, std::nullopt)};
    scene.measure = {"top", "top"};
    Crack crack;
    crack.points = {Vec2(0.0, wide), Vec2(wide - distance, wide)};
    scene.cracks = {crack};
    const AtRest run(scene);
    EXPECT_TRUE(run.solved());
    return run.load().G;
}

// REFERENCES: slopes of log G against log distance for E ratio, from Zak and Williams's exponents, plane strain, nu = 0.33.
struct Slope { double ratio, toward_latewood, toward_earlywood; };

TEST(SlowHardSlopes, TowardAndAwayFromLatewood) {
    const double wide = 10e-3, cell = wide / 120;
    for (const Slope& exact : {Slope{3, 0.188, -0.240}, {15, 0.332, -0.587}, {30, 0.357, -0.699}}) {
        for (const bool toward_latewood : {true, false}) {
            const double left = toward_latewood ? 40e6 : exact.ratio * 40e6, right = toward_latewood ? exact.ratio * 40e6 : 40e6;
            std::vector<double> G;
            const std::vector<double> cells{4, 5, 6, 8, 10, 12};
            for (const double d : cells) G.push_back(rate_before_boundary(cell, left, right, d * cell, wide));
            for (std::size_t i = 0; i < cells.size(); ++i) std::printf("   %.0f cells: G %.6e, local slope %.3f\n", cells[i], G[i], i ? std::log(G[i] / G[i - 1]) / std::log(cells[i] / cells[i - 1]) : 0.0);
            const double slope = std::log(G.back() / G.front()) / std::log(cells.back() / cells.front());
            hard_case(fmt::format("tip in {} near {}, ratio {:.0f}", toward_latewood ? "earlywood" : "latewood", toward_latewood ? "latewood" : "earlywood", exact.ratio),
                      "exact slope of log G against log distance", slope - (toward_latewood ? exact.toward_latewood : exact.toward_earlywood), 0.04);
        }
    }
}

} // namespace
} // namespace crampfit::test

// Cracks that run askew to the grid, in a square that is drawn apart evenly on all sides: the load that carries one on.
#include "forward/quasistatic.hpp"
#include "tests/forward/scenes.hpp"

#include <Eigen/QR>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace crampfit::test {
namespace {

constexpr double cell = 0.2e-3;

Scene drawn_evenly(double degrees, double speed) {
    Scene scene = block({10e-3, 10e-3}, cell);
    scene.edges = {without(moving("top", Side::top, {0.0, speed}), 0), without(moving("bottom", Side::bottom, {0.0, -speed}), 0),
                   without(moving("left", Side::left, {-speed, 0.0}), 1), without(moving("right", Side::right, {speed, 0.0}), 1)};
    const Vec2 middle(5.037e-3, 5.021e-3), along(std::cos(degrees * degree), std::sin(degrees * degree));
    Crack crack;
    crack.points = {middle - 2e-3 * along, middle + 2e-3 * along};
    crack.grows = Growth::end;
    crack.direction = GrowthDirection::straight;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.stop.displacement = 0.3e-3;
    scene.stop.crack_length = 6e-3;
    return scene;
}

// Over two cells' `advance`: the displacement at which the crack moves on goes smoothly with its length, here by a parabola.
TEST(VerificationAskew, LoadAtEquilibriumHardlyHangsOnThePlaceInACell) {
    for (const double degrees : {0.0, 10.0, 20.0, 30.0, 40.0, 45.0}) {
        for (const bool extrapolate : {false, true}) {
            Scene scene = at_equilibrium(drawn_evenly(degrees, 1e-5));
            scene.cracks[0].advance = 2 * cell;
            scene.solver.extrapolate = extrapolate;
            const Record record = simulate(scene);
            const auto rows = static_cast<Eigen::Index>(record.driving.size());
            ASSERT_GT(rows, 10);
            Eigen::MatrixXd powers(rows, 3);
            Eigen::VectorXd needed(rows);
            for (Eigen::Index i = 0; i < rows; ++i) {
                const CriticalLoad& row = record.driving[static_cast<std::size_t>(i)];
                const double grown = row.crack_length / 4e-3 - 1.0;
                powers.row(i) << 1.0, grown, grown * grown;
                needed[i] = row.displacement;
            }
            const Eigen::VectorXd fitted = powers * powers.householderQr().solve(needed);
            const Eigen::VectorXd off = needed.cwiseQuotient(fitted).array() - 1.0;
            std::printf("at %2.0f degrees, %s: load off by %+.1f to %+.1f %%\n", degrees, extrapolate ? "two grids" : "one grid",
                        100 * off.minCoeff(), 100 * off.maxCoeff());
            EXPECT_LT(off.cwiseAbs().maxCoeff(), 0.04);
        }
    }
}

// In motion, `advance` 0: a tip passes the places that give up least energy when the load is up to a tenth higher.
TEST(VerificationAskew, InMotionACrackIsHardlyHeldBack) {
    double along_grid = 0.0;
    for (const double degrees : {0.0, 15.0, 30.0, 45.0}) {
        const Record record = simulate(at_motion(drawn_evenly(degrees, 0.1)));
        const auto row = std::ranges::find_if(record.series, [](const Instant& i) { return i.crack_length > 4.8e-3; });
        ASSERT_NE(row, record.series.end());
        if (degrees == 0.0) along_grid = row->displacement;
        std::printf("at %2.0f degrees: has run 0.8 mm when drawn apart by %.4f mm, %+.1f %%\n", degrees, 1e3 * row->displacement,
                    100 * (row->displacement / along_grid - 1));
        EXPECT_NEAR(row->displacement, along_grid, 0.12 * along_grid);
    }
}

}  // namespace
}  // namespace crampfit::test

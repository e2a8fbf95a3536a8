// Cracks that run askew to the grid, in a square that is drawn apart evenly on all sides: the load that carries one on. And
// cracks along the grid anywhere between its points.
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
    for (const double degrees : {0.0, 2.0, 5.0, 10.0, 20.0, 30.0, 40.0, 45.0}) {
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

TEST(UnitSliver, IsThePartOfABoxBeyondALine) {
    const Box box{{1.0, 2.0}, {3.0, 5.0}};
    const Piece triangle = left_part(box, {3.0, 3.5}, {2.0, 2.0});  // with legs of 1 and 1.5, in the lower right corner
    EXPECT_NEAR(triangle.area + left_part(box, {2.0, 2.0}, {3.0, 3.5}).area, 6.0, 1e-14);
    EXPECT_NEAR(triangle.area, 0.75, 1e-14);
    EXPECT_NEAR(triangle.middle.x(), 3.0 - 1.0 / 3.0, 1e-14);
    EXPECT_NEAR(triangle.middle.y(), 2.0 + 0.5, 1e-14);
    EXPECT_NEAR(triangle.moments.x(), 1.0 / 18.0, 1e-14);
    EXPECT_NEAR(triangle.moments.y(), 1.5 * 1.5 / 18.0, 1e-14);
    EXPECT_EQ(left_part(box, {0.0, 0.0}, {0.0, 1.0}).area, 0.0);
    EXPECT_FALSE(part_within({0.0, 0.0}, {0.0, 9.0}, box));
    EXPECT_NEAR((*part_within({0.0, 3.0}, {4.0, 3.0}, box))[0], 0.25, 1e-15);
}

// What lies on either side of a crack through the specimen, points and slivers together, with its middle.
TEST(UnitSliver, EachSideHasItsWood) {
    for (const double rise : {0.0, 0.31e-3, 2.7e-3, 6e-3}) {
        Scene scene = at_equilibrium(block({10e-3, 10e-3}, cell));
        scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
        Crack crack;
        const double low = 2.043e-3, high = low + rise;
        crack.points = {Vec2(0.0, low), Vec2(10e-3, high)};
        scene.cracks = {crack};
        scene.stop.time = 1.0;
        const StaticTrial run(scene, false);
        const Points& points = run.body.points;
        double area = 0.0, moment = 0.0;
        const auto add = [&](double share, const Vec2& x, int p, bool is_above) {
            if (is_above) return;
            area += share * points.volume[p];
            moment += share * points.volume[p] * x.y();
        };
        const auto is_above = [&](const Vec2& x) { return run.equilibrium.cracks().is_left(0, x); };
        for (int p = 0; p < points.count(); ++p) add(1.0, points.position[p], p, is_above(points.position[p]));
        ASSERT_FALSE(run.body.slivers.empty());
        for (const Sliver& sliver : run.body.slivers) {
            add(-sliver.share, sliver.position, sliver.point, is_above(points.position[sliver.point]));
            add(sliver.share, sliver.position, sliver.point, is_above(sliver.position));
        }
        const double exact = 10e-3 * 0.5 * (low + high), exact_moment = 10e-3 * (low * low + low * high + high * high) / 6;
        std::printf("rise %.2f mm: area off by %+.3f %%, first moment by %+.3f %%\n", 1e3 * rise, 100 * (area / exact - 1),
                    100 * (moment / exact_moment - 1));
        // Less than 2 % of a domain is not cut off.
        EXPECT_NEAR(area, exact, 1e-3 * exact);
        EXPECT_NEAR(moment, exact_moment, 1e-3 * exact_moment);
    }
}

// Cells of two woods, 1 : 30, that a crack cuts, with one point each and with four: the cell's energy is never less than nothing.
TEST(UnitSliver, APartOfTheOnlyPointOfACellIsItsMeanWood) {
    for (int k = 0; k < 9; ++k) {
        std::array<Instant, 2> ends;
        for (const int points : {1, 4}) {
            Scene scene = at_equilibrium(block({8e-3, 8e-3}, 0.5e-3));
            scene.model.points_per_cell = points;
            scene.specimen.rings = Rings{Vec2(-20e-3, 4e-3), 2.2e-3, 0.25, 0.0};
            scene.specimen.material.clear();
            scene.materials["EW"] = {40e6, 0.33, 300.0, 100.0};
            scene.materials["LW"] = {1200e6, 0.33, 750.0, 150.0};
            scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
            Crack crack;
            const double middle = 3.8e-3 + k * 0.075e-3;
            crack.points = {Vec2(2.6e-3, middle - 0.43e-3), Vec2(5.4e-3, middle + 0.43e-3)};
            scene.cracks = {crack};
            scene.measure = {"top", "top"};
            scene.stop.time = 1.0;
            ends[points == 4] = simulate(scene).series.back();
        }
        std::printf("at %.3f mm: force %.3f, %.3f N, K_I %.0f, %.0f\n", 3.8 + k * 0.075, ends[0].force, ends[1].force,
                    ends[0].K_I, ends[1].K_I);
        EXPECT_NEAR(ends[0].force, ends[1].force, 0.003 * ends[1].force);
        EXPECT_NEAR(ends[0].K_I, ends[1].K_I, 0.5 * ends[1].K_I);  // a band of latewood is a cell wide
    }
}

// Of a crack that parts a thin arm, wherever it lies between points: a cubic takes the arm's bending.
TEST(VerificationAskew, AnArmIsAsThickAsDrawn) {
    constexpr int places = 25;
    Eigen::MatrixXd powers(places, 4);
    Eigen::VectorXd logarithm(places);
    for (int k = 0; k < places; ++k) {
        const double y = 2e-3 + 2 * cell * k / (places - 1);
        Scene scene = at_equilibrium(block({16e-3, 10e-3}, cell));
        Edge arm = without(moving("arm", Side::bottom, {0.0, -1e-5}), 0);
        arm.range = {{0.0, 2e-3}};
        scene.edges = {arm, moving("top", Side::top, {0.0, 0.0})};
        Crack crack;
        crack.points = {Vec2(0.0, y), Vec2(6.03e-3, y)};
        scene.cracks = {crack};
        scene.measure = {"arm", "arm"};
        scene.stop.time = 1.0;
        StaticTrial run(scene, false);
        ASSERT_TRUE(run.solve(1.0));
        const double at = 2.0 * k / (places - 1) - 1.0;
        powers.row(k) << 1.0, at, at * at, at * at * at;
        logarithm[k] = std::log(std::abs(run.equilibrium.reactions()[0].y()));
    }
    const Eigen::VectorXd off = logarithm - powers * powers.householderQr().solve(logarithm);
    std::printf("arm of ten cells: force off by %+.2f to %+.2f %% as its crack goes through two cells\n", 100 * off.minCoeff(),
                100 * off.maxCoeff());
    EXPECT_LT(off.cwiseAbs().maxCoeff(), 0.005);
}

// Each of two cracks, far from each other, cuts the wood as it would alone: a block and its half up to the plane of symmetry.
TEST(VerificationAskew, TwoArmsAreAsThickAsOne) {
    const auto pull = [](const char* name, Side side, double speed) {
        Edge arm = without(moving(name, side, {0.0, speed}), 0);
        arm.range = {{0.0, 2e-3}};
        return arm;
    };
    const auto force = [](Scene scene) {
        scene.edges.push_back(without(moving("right", Side::right, {0.0, 0.0}), 1));
        scene.measure = {"arm", "arm"};
        scene.stop.time = 1.0;
        StaticTrial run(scene, false);
        EXPECT_TRUE(run.solve(1.0));
        return run.equilibrium.reactions()[0].y();
    };
    for (const double y : {2.03e-3, 2.07e-3, 2.12e-3, 2.18e-3}) {
        for (const double rise : {0.0, 0.1e-3}) {
            Scene half = at_equilibrium(block({16e-3, 10e-3}, cell)), whole = at_equilibrium(block({16e-3, 20e-3}, cell));
            Crack lower, upper;
            lower.points = {Vec2(0.0, y), Vec2(6.03e-3, y + rise)};
            upper.points = {Vec2(0.0, 20e-3 - y), Vec2(6.03e-3, 20e-3 - y - rise)};
            half.cracks = {lower};
            whole.cracks = {lower, upper};
            half.edges = {pull("arm", Side::bottom, -1e-5), without(moving("middle", Side::top, {0.0, 0.0}), 0)};
            whole.edges = {pull("arm", Side::bottom, -1e-5), pull("other", Side::top, 1e-5)};
            EXPECT_NEAR(force(whole) / force(half), 1.0, 1e-6) << y << ' ' << rise;
        }
    }
}

// In motion, `advance` 0: energy is balanced over three cells, as places in a cell give it up by fits and starts.
TEST(VerificationAskew, InMotionACrackIsHardlyHeldBack) {
    double along_grid = 0.0;
    for (const double degrees : {0.0, 15.0, 30.0, 45.0}) {
        const Record record = simulate(at_motion(drawn_evenly(degrees, 0.1)));
        const auto row = std::ranges::find_if(record.series, [](const Instant& i) { return i.crack_length > 4.8e-3; });
        ASSERT_NE(row, record.series.end());
        if (degrees == 0.0) along_grid = row->displacement;
        std::printf("at %2.0f degrees: has run 0.8 mm when drawn apart by %.4f mm, %+.1f %%\n", degrees, 1e3 * row->displacement,
                    100 * (row->displacement / along_grid - 1));
        EXPECT_NEAR(row->displacement, along_grid, 0.04 * along_grid);
    }
}

// Sheared as well as opened (K_II 0.73 and 1.41 K_I), a tip waited until G was 1.2 to 1.4 times the toughness, on any grid. The
// crack is drawn so slowly that it runs at rest: then equilibrium says when it has gone half a millimetre and how hard that was.
TEST(VerificationAskew, InMotionShearDoesNotHoldACrackBack) {
    for (const double slope : {15.0, 30.0}) {
        for (const double h : {0.5e-3, 0.25e-3}) {
            if (slope < 20.0 && h < 0.4e-3) continue;  // by hand within 0.7 %, 11 s
            Scene scene = block({14e-3, 11e-3}, h);
            scene.materials["EW"] = {60e6, 0.3, 300.0, 100.0};
            const double speed = 0.05 / std::sqrt(2.0);
            scene.edges = {moving("top", Side::top, {speed, speed}), moving("bottom", Side::bottom, {0.0, 0.0})};
            Crack crack;
            crack.points = {Vec2(0.0, 5.1e-3), Vec2(4.3e-3, 5.1e-3 + 4.3e-3 * std::tan(slope * degree))};
            crack.grows = Growth::end;
            crack.direction = GrowthDirection::straight;
            scene.cracks = {crack};
            scene.measure = {"top", "top"};
            scene.stop.displacement = 0.45e-3;
            scene.stop.crack_length = 4.3e-3 / std::cos(slope * degree) + 1e-3;
            Scene damped = at_motion(scene);
            damped.solver.damping = 1e4;
            const auto when = [&](const Record& record) {
                const double length = scene.stop.crack_length.value() - 0.5e-3;
                const auto row = std::ranges::find_if(record.series, [&](const Instant& i) { return i.crack_length > length; });
                return row == record.series.end() ? 0.0 : row->displacement;
            };
            const auto peak = [](const Record& record) {
                return std::ranges::max_element(record.series, {}, &Instant::force)->force;
            };
            const Record motion = simulate(damped), rest = simulate(at_equilibrium(scene));
            const double later = when(motion) / when(rest) - 1, harder = peak(motion) / peak(rest) - 1;
            const Instant& end = motion.series.back();
            const double taken =
                end.fracture_energy / (100.0 * scene.model.thickness * (end.crack_length - motion.series.front().crack_length));
            std::printf("slope %.0f degrees, cells of %.2f mm: in motion half a millimetre of growth comes %+.1f %% later, peak "
                        "%+.1f %%, energy taken up %.3f of the toughness\n",
                        slope, 1e3 * h, 100 * later, 100 * harder, taken);
            EXPECT_LT(std::abs(later), 0.05);
            EXPECT_LT(std::abs(harder), 0.05);
            EXPECT_NEAR(taken, 1.0, 0.1);  // over two cells, from between pairs to between pairs
        }
    }
}

}  // namespace
}  // namespace crampfit::test

// Crack faces that press, stick and rub at equilibrium.
#include "tests/forward/scenes.hpp"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <tuple>
#include <utility>
#include <vector>

namespace crampfit::test {
namespace {

// Stiffness of a block that a crack goes into from the right, against that of a whole one, when it is moved so [m].
Vec2 stiffness_of_cracked(Vec2 moved, CrackFaces::Kind faces, double y) {
    Vec2 force[2];
    for (const bool cracked : {false, true}) {
        Scene scene = at_equilibrium(block({10e-3, 10e-3}, 1e-3));
        scene.edges = {moving("top", Side::top, moved), moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.measure = {"top", "top"};
        scene.stop.time = 1.0;
        Crack crack;
        crack.points = {Vec2(10e-3, y), Vec2(5e-3, y)};
        crack.faces.kind = faces;
        if (cracked) scene.cracks = {crack};
        StaticTrial run(scene);
        EXPECT_TRUE(run.solve(1.0));
        force[cracked] = run.equilibrium.reactions()[0];
    }
    return force[1].cwiseQuotient(force[0]);
}

TEST(UnitCrackFaces, PressedTogetherCarryAsAWholeBlock) {
    // Faces yield like a hundredth of a cell, 1e-3 of the block's ten cells, and over half its width only.
    for (const double y : {5e-3, 5.3e-3, 5.5e-3}) {
        const double pressed = stiffness_of_cracked({0.0, -1e-4}, CrackFaces::Kind::frictionless, y).y();
        const double opened = stiffness_of_cracked({0.0, 1e-4}, CrackFaces::Kind::frictionless, y).y();
        std::printf("crack at y = %.1f mm: pressed %.5f of a whole block's force, pulled %.3f\n", 1e3 * y, pressed, opened);
        EXPECT_NEAR(pressed, 1.0, 1e-3);
        EXPECT_LT(opened, 0.9);
    }
}

// Pressed along its normal a crack that ends in a band of latewood releases nothing, but for what the woods shear each other.
TEST(UnitCrackFaces, ThatPressBesideOtherWoodReleaseNothing) {
    double largest = 0.0;
    for (const auto kind : {CrackFaces::Kind::frictionless, CrackFaces::Kind::stick})
        for (const double tip : {6.2e-3, 7.2e-3, 7.4e-3}) {
            Scene scene = at_equilibrium(block({10e-3, 8e-3}, 0.25e-3));
            scene.specimen.material.clear();
            scene.specimen.rings = Rings{Vec2(-1.0, 4e-3), 4e-3, 0.3, 0.0};  // latewood from 6.8 to 8 mm
            scene.materials["LW"] = {1200e6, 0.33, 750.0, 100.0};
            scene.edges = {moving("top", Side::top, {0.0, -1e-3}), moving("bottom", Side::bottom, {0.0, 0.0})};
            scene.measure = {"top", "top"};
            scene.stop = {.displacement = 0.2e-3, .crack_length = {}, .time = {}};
            Crack crack;
            crack.points = {Vec2(3e-3, 4e-3), Vec2(tip, 4e-3)};
            crack.faces.kind = kind;
            scene.cracks = {crack};
            largest = std::max(largest, simulate(scene).series.back().G);
        }
    std::printf("pressed crack that ends beside or in latewood: G up to %.3f J/m^2\n", largest);
    EXPECT_LT(largest, 1.0);
}

TEST(UnitCrackFaces, ThatStickCarryShearWhilePressed) {
    for (const double y : {5e-3, 5.5e-3}) {
        const Vec2 moved(0.2e-4, -1e-4);
        const double sticks = stiffness_of_cracked(moved, CrackFaces::Kind::stick, y).x();
        const double slides = stiffness_of_cracked(moved, CrackFaces::Kind::frictionless, y).x();
        std::printf("pressed and sheared, y = %.1f mm: shear force of stuck faces %.5f of a whole block's, of free ones %.3f\n",
                    1e3 * y, sticks, slides);
        EXPECT_NEAR(sticks, 1.0, 2e-3);
        EXPECT_LT(slides, 0.95);
    }
}

TEST(VerificationCrackFaces, MayPartUnderALoadThatStaysAndAnotherThatGoes) {
    // A traction closes an edge crack, and the other half of the side is drawn up: what that does is stored, and at a time the
    // same whenever the run ends.
    double before = 0.0;
    for (const double end : {0.3, 1.0}) {
        Scene scene = at_equilibrium(block({20e-3, 20e-3}, 1e-3));
        Edge pressed = moving("pressed", Side::top, {});
        pressed.velocity = {};
        pressed.traction = Vec2(0.0, -0.5e6);
        pressed.range = {{0.0, 10e-3}};
        Edge drawn = moving("drawn", Side::top, {0.0, 1e-3});
        drawn.range = {{10e-3, 20e-3}};
        scene.edges = {pressed, drawn, moving("bottom", Side::bottom, {0.0, 0.0})};
        Crack crack;
        crack.points = {Vec2(0.0, 10e-3), Vec2(8e-3, 10e-3)};
        scene.cracks = {crack};
        scene.measure = {"drawn", "drawn"};
        scene.solver.strain = StrainMeasure::small;
        scene.stop.time = end;
        scene.output.samples = 60;
        const Record record = simulate(scene);
        const auto row = std::ranges::min_element(record.series, {}, [](const Instant& r) { return std::abs(r.time - 0.2); });
        std::printf("until %.1f s: G %.3f J/m^2 at %.2f s, work %.5f mJ, strain energy %.5f mJ\n", end, row->G, row->time,
                    1e3 * row->external_work, 1e3 * row->strain_energy);
        EXPECT_NEAR(row->strain_energy, row->external_work, 1e-3 * row->external_work);
        EXPECT_NEAR(row->G, before > 0.0 ? before : row->G, 0.01 * row->G);
        before = row->G;
    }
}

TEST(UnitCrackFaces, ThatHaveStuckLetGoWhereTheyAreDrawnApart) {
    // Pressed and sheared, then drawn apart: what they held by sticking is released.
    double G[2];
    for (const auto kind : {CrackFaces::Kind::stick, CrackFaces::Kind::frictionless}) {
        Scene scene = at_equilibrium(block({10e-3, 10e-3}, 0.5e-3));
        scene.edges = {moving("top", Side::top, {0.05e-3, -0.1e-3}), moving("bottom", Side::bottom, {0.0, -0.05e-3})};
        scene.edges[0].until = 1.0;
        scene.edges[1].until = 4.0;
        Crack crack;
        crack.points = {Vec2(3e-3, 5e-3), Vec2(7e-3, 5e-3)};
        crack.faces.kind = kind;
        scene.cracks = {crack};
        scene.measure = {"top", "top"};
        scene.stop.time = 4.0;
        scene.output.samples = 50;
        const Record record = simulate(scene);
        ASSERT_EQ(record.status, RunStatus::finished) << record.message;
        G[kind == CrackFaces::Kind::stick] = record.series.back().G;
    }
    EXPECT_GT(G[0], 0.0);
    EXPECT_NEAR(G[1], G[0], 1e-3 * G[0]);
}

// A block with a crack whose faces have gone through each other here and past each other everywhere, turned as a whole.
struct TurnedBlock {
    TurnedBlock(CrackFaces::Kind faces, double angle, double far = 0.02e-3, double modulus = 40e6)
        : run(scene_with(faces, modulus), true) {
        for (const Vec2& u : random_displacement(run.equilibrium.cracks().fields())) {
            const Vec2 x = run.body.layout.node_position(run.equilibrium.cracks().node_of_field[displacement.size()]);
            displacement.push_back(turn(angle) * (x + far / 0.2e-3 * u) - x);
        }
        Equilibrium::Contacts contacts = run.equilibrium.contacts();
        for (std::size_t k = 0; k < run.equilibrium.cracks().pairs.size(); ++k)
            contacts.faces.push_back(
                {static_cast<int>(k), 1e-6 * static_cast<double>(k % 3)});  // springs of friction that have stretched
        run.equilibrium.set_displacements(displacement, 0.0, contacts);
    }
    static Scene scene_with(CrackFaces::Kind faces, double modulus) {
        Scene scene = at_equilibrium(cracked_block(false));
        scene.materials["EW"].youngs_modulus = modulus;
        scene.cracks[0].faces.kind = faces;
        if (faces == CrackFaces::Kind::friction) scene.cracks[0].faces.coefficient = 0.4;
        scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.measure = {"bottom", "bottom"};
        scene.stop.time = 1.0;
        return scene;
    }
    const std::vector<Vec2>& forces_at(const std::vector<Vec2>& places) {
        run.equilibrium.set_displacements(places, 0.0);
        return run.equilibrium.out_of_balance_forces();
    }

    StaticTrial run;
    std::vector<Vec2> displacement;
};

TEST(UnitCrackFaces, PressAndRubAlongNormalsThatTurn) {
    for (const CrackFaces::Kind faces : {CrackFaces::Kind::frictionless, CrackFaces::Kind::stick, CrackFaces::Kind::friction}) {
        const TurnedBlock upright(faces, 0.0);
        for (const double angle : {0.5, 1.6, 3.1}) {
            const TurnedBlock turned(faces, angle);
            double off = 0, largest = 0;
            for (std::size_t f = 0; f < upright.displacement.size(); ++f) {
                const Vec2 force = upright.run.equilibrium.out_of_balance_forces()[f];
                largest = std::max(largest, force.norm());
                off = std::max(off, (turned.run.equilibrium.out_of_balance_forces()[f] - turn(angle) * force).norm());
            }
            const double potential = turned.run.equilibrium.potential() / upright.run.equilibrium.potential() - 1;
            std::printf("faces %d turned by %.1f: forces off by %.1e, potential by %+.1e\n", static_cast<int>(faces), angle,
                        off / largest, potential);
            EXPECT_LT(off, 1e-10 * largest);
            EXPECT_NEAR(potential, 0.0, 1e-10);
        }
    }
}

TEST(UnitCrackFaces, ThatTurnPullAsTheirPotentialAndYieldAsTheirForces) {
    // By central differences of the potential, of the forces, and of both by the modulus.
    const double far = 2e-6;  // farther, they are so pressed that the equilibrium would not be stable
    TurnedBlock block(CrackFaces::Kind::frictionless, 0.7, far);
    Equilibrium& equilibrium = block.run.equilibrium;
    const auto is_held = [&](std::size_t f) {
        return block.run.body.layout.node_position(equilibrium.cracks().node_of_field[f]).y() == 0.0;
    };
    const std::vector<Vec2> forces = equilibrium.out_of_balance_forces();
    const auto numbers = MaterialSlope::of(block.run.scene, {"materials.EW.E"}, block.run.body);
    const Equilibrium::Slopes slopes = equilibrium.slopes(numbers);
    ASSERT_FALSE(equilibrium.motions({std::vector<Vec2>(equilibrium.boundary().drivers(), Vec2::Zero())}).empty());
    Eigen::MatrixXd load = Eigen::VectorXd::Random(2 * static_cast<Eigen::Index>(forces.size()));
    const Eigen::VectorXd yield = equilibrium.yields_to(load);

    double largest = 0, off_potential = 0;
    for (std::size_t f = 0; f < forces.size(); ++f)
        for (int axis = 0; axis < 2; ++axis) {
            if (is_held(f)) continue;
            std::array<double, 2> potential;
            for (const int side : {0, 1}) {
                std::vector<Vec2> moved = block.displacement;
                moved[f][axis] += (side - 0.5) * 2e-9;
                block.forces_at(moved);
                potential[side] = equilibrium.potential();
            }
            largest = std::max(largest, std::abs(forces[f][axis]));
            off_potential = std::max(off_potential, std::abs((potential[1] - potential[0]) / 2e-9 + forces[f][axis]));
        }
    std::array<std::vector<Vec2>, 2> along;
    const double step = 1e-8 / yield.lpNorm<Eigen::Infinity>();
    for (const int side : {0, 1}) {
        std::vector<Vec2> moved = block.displacement;
        for (std::size_t f = 0; f < moved.size(); ++f) moved[f] += (side - 0.5) * 2 * step * yield.segment<2>(2 * f);
        along[side] = block.forces_at(moved);
    }
    double off_tangent = 0;
    for (std::size_t f = 0; f < forces.size(); ++f)
        if (!is_held(f) && forces[f] != Vec2::Zero())
            off_tangent =
                std::max(off_tangent, ((along[1][f] - along[0][f]) / (2 * step) + load.col(0).segment<2>(2 * f)).norm());

    const double less = 40e6 * (1 - 1e-4), more = 40e6 * (1 + 1e-4);
    const TurnedBlock soft(CrackFaces::Kind::frictionless, 0.7, far, less), stiff(CrackFaces::Kind::frictionless, 0.7, far, more);
    const double by_modulus =
        (stiff.run.equilibrium.potential() - soft.run.equilibrium.potential()) / (more - less) / slopes.potential[0] - 1;
    double off_forces = 0, largest_slope = 0;
    for (std::size_t f = 0; f < forces.size(); ++f) {
        const Vec2 slope =
            (stiff.run.equilibrium.out_of_balance_forces()[f] - soft.run.equilibrium.out_of_balance_forces()[f]) / (more - less);
        largest_slope = std::max(largest_slope, slope.norm());
        off_forces = std::max(off_forces, (slope + slopes.fields.col(0).segment<2>(2 * f)).norm());
    }
    std::printf("faces that turn: forces off by %.1e of the potential's slope, tangent by %.1e; by the modulus %+.1e, %.1e\n",
                off_potential / largest, off_tangent, by_modulus, off_forces / largest_slope);
    EXPECT_LT(off_potential, 1e-6 * largest);
    EXPECT_LT(off_tangent, 1e-6);
    EXPECT_NEAR(by_modulus, 0.0, 1e-8);
    EXPECT_LT(off_forces, 1e-8 * largest_slope);
}

TEST(VerificationCrackFaces, HoldATurnedBlockAsTheyHoldItUpright) {
    // Corners go straight to where a block is pressed and sheared, and turned by an angle as well.
    const double wide = 10e-3;
    for (const CrackFaces::Kind faces : {CrackFaces::Kind::frictionless, CrackFaces::Kind::stick}) {
        const auto pressed = [&](double angle) {
            Scene scene = at_equilibrium(block({wide, wide}, 1e-3));
            Crack crack;
            crack.points = {Vec2(0.0, 5.1e-3), Vec2(6.2e-3, 5.4e-3)};
            crack.faces.kind = faces;
            scene.cracks = {crack};
            const Mat2 R = turn(angle);
            for (const auto& [name, side, x, moved] :
                 {std::tuple{"origin", Side::bottom, 0.0, Vec2(0.0, 0.0)},
                  std::tuple{"right", Side::bottom, wide, Vec2(0.0, 0.0)}, std::tuple{"top", Side::top, 0.0, Vec2(0.4e-3, -1e-3)},
                  std::tuple{"end", Side::top, wide, Vec2(0.4e-3, -1e-3)}}) {
                const Vec2 place(x, side == Side::top ? wide : 0.0);
                scene.edges.push_back(moving(name, side, R * (place + moved) - place));
                scene.edges.back().range = {{x, x}};
            }
            scene.measure = {"top", "top"};
            scene.stop.time = 1.0;
            StaticTrial run(scene, true);
            for (int k = 1; k <= 16; ++k) EXPECT_TRUE(run.solve(k / 16.0)) << k;
            return std::pair<Vec2, double>(R.transpose() * run.equilibrium.reactions()[2], run.equilibrium.potential());
        };
        const auto [force, potential] = pressed(0.0);
        for (const double angle : {0.4, 0.9}) {
            const auto [turned, of_turned] = pressed(angle);
            std::printf("faces %d, turned by %.1f: force at a corner off by %.1e, potential by %+.1e\n", static_cast<int>(faces),
                        angle, (turned - force).norm() / force.norm(), of_turned / potential - 1);
            EXPECT_LT((turned - force).norm(), 1e-6 * force.norm());
            EXPECT_NEAR(of_turned, potential, 1e-6 * potential);
        }
    }
}

}  // namespace
}  // namespace crampfit::test

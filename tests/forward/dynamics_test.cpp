// Waves, energy, contact: what a run does in motion.
#include "datasets/error.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace crampfit::test {
namespace {

TEST(VerificationWave, StressBehindAPlaneWave) {
    // A side that starts to move at v sends a plane wave: stress = rho c v behind it (c the pressure-wave speed).
    Scene scene = block({50e-3, 1e-3}, 0.25e-3);
    const double v = 0.1;
    scene.edges = {moving("right", Side::right, {v, 0.0}), moving("top", Side::top, {0.0, 0.0}),
                   moving("bottom", Side::bottom, {0.0, 0.0})};
    for (Edge& edge : scene.edges)
        if (edge.side != Side::right) edge.velocity[0].reset();
    scene.measure = {"right", "right"};
    const double M = 40e6 * 0.67 / (1.33 * 0.34);  // E (1 - nu) / ((1 + nu) (1 - 2 nu))
    const double c = std::sqrt(M / 300.0);
    scene.stop.time = 30e-3 / c;
    const Record record = simulate(scene);
    double mean = 0;
    int count = 0;
    for (const Instant& row : record.series) {
        if (row.time < 0.3 * *scene.stop.time) continue;
        mean += row.force;
        ++count;
    }
    mean /= count;
    EXPECT_NEAR(mean, 300.0 * c * v * 1e-3, 0.01 * 300.0 * c * v * 1e-3);  // dispersion rings about the mean
}

TEST(VerificationWave, ArrivesWhenItShould) {
    Scene scene = block({50e-3, 1e-3}, 0.25e-3);
    scene.edges = {moving("right", Side::right, {0.1, 0.0}), moving("left", Side::left, {0.0, 0.0})};
    scene.materials["EW"].poisson_ratio = 0.0;
    scene.measure = {"left", "right"};
    const double c = std::sqrt(40e6 / 300.0);
    scene.stop.time = 80e-3 / c;
    const Record record = simulate(scene);
    const double full = 2 * 300.0 * c * 0.1 * 1e-3;  // a held end doubles the stress
    double arrival = 0;
    for (const Instant& row : record.series)
        if (arrival == 0 && row.force > 0.5 * full) arrival = row.time;
    EXPECT_NEAR(arrival, 50e-3 / c, 0.02 * 50e-3 / c);  // the front spreads over a few of the 200 cells
}

TEST(UnitEnergy, BooksCloseWithoutGrowth) {
    Scene scene = ring_specimen(3e-3, 0.2e-3);
    scene.solver.damping = 0;
    scene.stop.time = 2e-4;
    EXPECT_LT(simulate(scene).worst_energy_imbalance, 0.01);
}

TEST(UnitKineticShare, TellsBlowsFromSlowLoading) {
    // The damped specimen's force rises over ten transits of a wave; a blow shares its energy evenly behind the first front.
    Scene slow = ring_specimen(3e-3, 0.5e-3, false);
    slow.edges[0].velocity[1] = 0.02;
    slow.edges[0].until = 5e-3;
    slow.stop.time = 5e-3;
    EXPECT_LT(kinetic_share(simulate(slow)), quasistatic_share);
    Scene blow = block({50e-3, 1e-3}, 0.5e-3);
    blow.edges = {without(moving("right", Side::right, {1.0, 0.0}), 1)};
    blow.measure = {"right", "right"};
    blow.materials["EW"].poisson_ratio = 0.0;
    blow.stop.time = 40e-3 / std::sqrt(40e6 / 300.0);
    EXPECT_NEAR(kinetic_share(simulate(blow)), 1.0, 0.2);
}

TEST(UnitRotation, TurnsWithoutStress) {
    for (const double angle : {0.1, 1.0, 3.0}) {
        Mat2 turn;
        turn << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
        const PointState state = elastic_state(turn - Mat2::Identity(), layered({5e7, 2e7}).stiffness(), true);
        EXPECT_LT(state.stress.norm(), 1e-6);
    }
}

// Two wheels on the flanks of a V notch with slope 2, as in the wedge test, that go down by a part of a cell.
Scene wheels_on_flanks(double cell) {
    Scene scene = block({6e-3, 6e-3}, cell);
    scene.specimen.cutouts = {Polygon{{Vec2(1.5e-3, 6e-3), Vec2(4.5e-3, 6e-3), Vec2(3e-3, 3e-3)}}};
    scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
    for (const double side : {-1.0, 1.0}) {
        Body wheel;
        wheel.name = side < 0 ? "left" : "right";
        const Vec2 on_flank(3e-3 + side * 1e-3, 5e-3), inward = Vec2(-side * 2.0, 1.0).normalized();
        wheel.shape = Circle{on_flank + 1e-3 * inward, 1e-3};
        wheel.velocity = {0.0, -0.2};
        wheel.until = 1e-4;
        scene.bodies.push_back(wheel);
    }
    scene.measure = {"left", "left"};
    scene.solver.damping = 4e4;
    scene.stop.time = 4e-4;
    return scene;
}

// Across a wheel: 20 cells, and finer grids.
void check_wheels_on_flanks(std::initializer_list<double> cells_across) {
    for (const double across : cells_across) {
        const Record record = simulate(wheels_on_flanks(2e-3 / across));
        for (const int wheel : {1, 2}) {
            const Vec2 force = record.reactions[wheel].force.back();
            const double ratio = std::abs(force.x() / force.y());
            std::printf("wheel %2.0f cells across on a flank of slope 2: force ratio %.3f\n", across, ratio);
            EXPECT_NEAR(ratio, 2.0, 0.03 * 2.0);
            EXPECT_LT(force.y(), 0.0);
        }
    }
}

TEST(VerificationWedge, WheelTwentyCellsAcross) { check_wheels_on_flanks({20.0}); }

TEST(SlowVerificationWedge, WheelFortyAndSixtyCellsAcross) { check_wheels_on_flanks({40.0, 60.0}); }

// The same as they go down by 0.1 mm, which turns the flanks.
Scene wedge(double cell) {
    Scene scene = block({10e-3, 10e-3}, cell);
    scene.specimen.cutouts = {Polygon{{Vec2(3.5e-3, 10e-3), Vec2(6.5e-3, 10e-3), Vec2(5e-3, 7e-3)}}};
    scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
    for (const double side : {-1.0, 1.0}) {
        Body wheel;
        wheel.name = side < 0 ? "left" : "right";
        wheel.shape = Circle{Vec2(5e-3 + side * 0.5528e-3, 9.2236e-3), 0.5e-3};
        wheel.velocity = {0.0, -1.0};
        wheel.until = 1e-4;
        scene.bodies.push_back(wheel);
    }
    scene.measure = {"left", "left"};
    scene.solver.damping = 4e4;
    scene.stop.time = 6e-4;
    return scene;
}

TEST(VerificationWedge, ForceStandsNormalToTheFlank) {
    // Without friction the force on a flank of slope 2 is normal to it: twice as much aside as down (REFERENCES: wedge statics).
    for (const double cell : {0.2e-3, 0.1e-3}) {
        const Record record = simulate(wedge(cell));
        const Vec2 force = record.reactions[1].force.back();
        std::printf("wheel %2.0f cells across on a flank of slope 2: force ratio %.3f\n", 1e-3 / cell,
                    std::abs(force.x() / force.y()));
        // 0.1 mm of travel turns the flank by about a hundredth.
        EXPECT_NEAR(std::abs(force.x() / force.y()), 2.0, 0.15);
        EXPECT_LT(force.y(), 0.0);
        EXPECT_LT(force.x(), 0.0);
    }
}

TEST(UnitContact, NeverPulls) {
    Scene scene = wedge(0.2e-3);
    for (Body& wheel : scene.bodies) wheel.velocity = {0.0, 1.0};
    const Record record = simulate(scene);
    for (const Vec2& force : record.reactions[1].force) EXPECT_LT(force.norm(), 1e-6 * 40e6 * 1e-3);
}

TEST(UnitContact, ABodyInsideTheSpecimenIsRefused) {
    Scene scene = wedge(0.2e-3);
    scene.bodies[0].shape = Circle{Vec2(2e-3, 5e-3), 0.5e-3};
    try {
        simulate(scene);
        FAIL() << "accepted";
    } catch (const InputError& error) {
        EXPECT_EQ(error.key, "bodies.left");
    }
}

TEST(UnitPlan, RefusesWhatItCannotDo) {
    const auto refused = [](auto change, const std::string& key) {
        Scene scene = ring_specimen(3e-3, 0.5e-3);
        change(scene);
        try {
            simulate(scene);
            ADD_FAILURE() << "accepted " << key;
        } catch (const InputError& error) {
            EXPECT_EQ(error.key, key);
            EXPECT_EQ(error.file, "test.toml");
        }
    };
    refused([](Scene& s) { s.solver.kind = SolverKind::quasistatic; }, "solver.damping");
    refused(
        [](Scene& s) {
            s = at_equilibrium(s);
            s.solver.shape_function = ShapeFunction::bspline2;
        },
        "solver.shape_function");
    refused([](Scene& s) { s.edges[0].range = {{2.1e-3, 2.2e-3}}; }, "edges.top.range");
    refused([](Scene& s) { s.model.cell = 1e-23; }, "model.cell");
    const auto crack = [](Scene& s, const Vec2& from, const Vec2& to) {
        Crack drawn;
        drawn.points = {from, to};
        drawn.grows = Growth::end;
        s.cracks = {drawn};
    };
    refused([&](Scene& s) { crack(s, {3e-3, 5e-3}, {0.0, 5e-3}); }, "cracks.0.grows");         // to the side, away from the wood
    refused([&](Scene& s) { crack(s, {0.0, 0.05e-3}, {3e-3, 0.05e-3}); }, "cracks.0.points");  // no point lies below it
}

// What wide cells do not see beside a crack, they cannot tell of the grid's error.
TEST(UnitPlan, ACrackBesideAGripIsForOneGrid) {
    for (const auto& [height, both] : {std::pair{0.1e-3, false}, std::pair{0.2e-3, true}}) {
        Scene scene = at_equilibrium(block({10e-3, 10e-3}, 0.25e-3));
        Crack crack;
        crack.points = {Vec2(0.0, height), Vec2(3e-3, height)};
        crack.grows = Growth::end;
        crack.advance = 0.5e-3;
        scene.cracks = {crack};
        scene.edges = {moving("top", Side::top, {0.0, 1e-3}), moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.measure = {"top", "top"};
        scene.stop.displacement = 1e-3;
        const MaterialMap materials(scene);
        const Discretisation body(scene, materials);
        EXPECT_EQ(make_plan(scene, materials, body).extrapolates, both) << height;
    }
}

// A slot of two cells that wide ones lie half in would be none on these, and their force nothing to go by.
TEST(UnitPlan, AVoidThatWideCellsBridgeIsForOneGrid) {
    double force[2];
    for (const bool aligned : {false, true}) {
        Scene scene = at_equilibrium(block({10e-3, 10e-3}, 0.25e-3));
        const double low = aligned ? 5e-3 : 5.25e-3, high = low + 0.5e-3;
        scene.specimen.cutouts = {Polygon{{Vec2(-1e-3, low), Vec2(5e-3, low), Vec2(5e-3, high), Vec2(-1e-3, high)}}};
        scene.edges = {moving("top", Side::top, {0.0, 1e-3}), moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.measure = {"top", "top"};
        scene.stop.displacement = 1e-4;
        const MaterialMap materials(scene);
        EXPECT_EQ(make_plan(scene, materials, Discretisation(scene, materials)).extrapolates, aligned);
        force[aligned] = simulate(scene).series.back().force;
    }
    EXPECT_NEAR(force[0] / force[1], 1.0, 0.03);
}

// Wide cells of which hardly a node lies on a short stretch would not hold it, or not right.
TEST(UnitPlan, AStretchBetweenNodesOfWideCellsIsForOneGrid) {
    for (const auto& [from, to] : {std::pair{5.2e-3, 5.45e-3}, std::pair{4.9e-3, 5.15e-3}, std::pair{4.9e-3, 5.6e-3}}) {
        const bool both = to > 5.5e-3;  // the next node
        Scene scene = at_equilibrium(block({10e-3, 10e-3}, 0.25e-3));
        scene.edges = {moving("top", Side::top, {0.0, 1e-3}), moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.edges[1].range = {from, to};
        scene.measure = {"top", "top"};
        scene.stop.displacement = 1e-3;
        const MaterialMap materials(scene);
        const Discretisation body(scene, materials);
        EXPECT_EQ(make_plan(scene, materials, body).extrapolates, both) << from;
        EXPECT_NO_THROW(simulate(scene));
    }
}

}  // namespace
}  // namespace crampfit::test

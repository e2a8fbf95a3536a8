// Energy release rate at rest against exact values, and against the change of energy with crack length. At equilibrium; the
// explicit solver, damped to rest, has one check of each kind.
#include "benchmarks/reference_problems.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>

namespace crampfit::test {
namespace {

// G at the end of the first crack when the load has come to its end, by either solver.
double rate_at_rest(const Scene& scene, bool explicitly) {
    if (explicitly) {
        Trial run(scene);
        run.until(*scene.stop.time);
        return run.solver.load_at(0, true).G;
    }
    StaticTrial run(at_equilibrium(scene), false);
    EXPECT_TRUE(run.solve(*scene.stop.time));
    return run.equilibrium.load_at(0, true).G;
}

// J of a centre crack of half length a in a plate of half width 4 a and half height 12 a under tension, over the exact G, less 1.
// `shift` moves each tip out and `lift` moves the crack up, both in cells.
double centre_crack_error(double cells, double shift = 0.0, double lift = 0.0, bool explicitly = false) {
    const double a = 10e-3;
    const double h = a / cells;
    const double stress = 1e5;
    Scene scene = block({8 * a, 24 * a}, h);
    // The load is in balance. What keeps the plate in its place feels nothing.
    Edge left = moving("left", Side::left, {0.0, 0.0}), right = without(moving("right", Side::right, {0.0, 0.0}), 0);
    left.range = right.range = {{12 * a - 0.5 * h, 12 * a + 0.5 * h}};
    scene.edges = {pulled("top", Side::top, {0.0, stress}), pulled("bottom", Side::bottom, {0.0, -stress}), left, right};
    Crack crack;
    crack.points = {Vec2(3 * a - shift * h, 12 * a + lift * h), Vec2(5 * a + shift * h, 12 * a + lift * h)};
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.solver.damping = 1.5e3;
    scene.stop.time = 16e-3;
    // Tada's factor, good to 0.1 % (REFERENCES: centre crack).
    const double r = (1.0 + shift / cells) / 4.0;
    const double F = (1 - .025 * r * r + .06 * r * r * r * r) / std::sqrt(std::cos(std::numbers::pi * r / 2));
    const double K_squared = stress * stress * std::numbers::pi * 4 * a * r * F * F;
    const double G = K_squared * (1 - 0.33 * 0.33) / 40e6;
    return rate_at_rest(scene, explicitly) / G - 1.0;
}

void check_centre_crack(double cells, double bar, bool explicitly = false) {
    const double error = centre_crack_error(cells, 0.0, 0.0, explicitly);
    std::printf("centre crack, %2.0f cells per half crack%s: J off by %+.2f %%\n", cells, explicitly ? ", explicit" : "",
                100 * error);
    EXPECT_LT(std::abs(error), bar) << cells << " cells";
}

TEST(VerificationCentreCrack, JConvergesToTheExactValue) {
    // Asked of a well resolved crack. The ties take the first-order error out, so that a few cells are enough.
    for (const auto& [cells, bar] : {std::pair{5.0, 0.04}, {10.0, 0.02}, {20.0, 0.01}}) check_centre_crack(cells, bar);
}

TEST(SlowVerificationCentreCrack, JAtFortyCells) { check_centre_crack(40.0, 0.005); }

TEST(VerificationCentreCrack, ExplicitAtFiveCells) { check_centre_crack(5.0, 0.04, true); }

// Loaded slowly in motion, on the square that `crampfit bench` cuts out of an infinite plate (Westergaard 1939).
void check_slowly_loaded(double cells, double bar) {
    const Problem plate = problems().front();
    const Record record = simulate(in_damped_motion(plate.scene(cells, 4), plate.slowest));
    const double error = plate.ratio(record) - 1.0;
    std::printf("centre crack loaded slowly, %2.0f cells per half crack: J off by %+.2f %%, %ld points, %.2f s\n", cells,
                100 * error, record.points, record.seconds);
    EXPECT_LT(std::abs(error), bar) << cells << " cells";
}

TEST(VerificationCentreCrack, LoadedSlowly) {
    for (const auto& [cells, bar] : {std::pair{5.0, 0.04}, {10.0, 0.02}}) check_slowly_loaded(cells, bar);
}

TEST(SlowVerificationCentreCrack, LoadedSlowlyOnFinerGrids) {
    for (const auto& [cells, bar] : {std::pair{20.0, 0.01}, {40.0, 0.005}}) check_slowly_loaded(cells, bar);
}

TEST(VerificationCentreCrack, JDoesNotDependOnWhereInACellTheTipLies) {
    for (const double lift : {0.0, 0.5}) {
        for (const double shift : {0.0, 0.25, 0.5, 0.75}) {
            const double error = centre_crack_error(10.0, shift, lift);
            std::printf("centre crack, tip %.2f of a cell along, %.2f up: J off by %+.2f %%\n", shift, lift, 100 * error);
            EXPECT_LT(std::abs(error), 0.02) << shift << " " << lift;
        }
    }
}

TEST(VerificationStrip, GIsTheEnergyFarAhead) {
    // Strip of half height 5 mm between grips: G = Es eps^2 h whatever the crack length (REFERENCES: strip). Both plane states.
    // Ten cells to a half height; the ends, three heights away, change it by some 2e-3.
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        for (const bool explicitly : {false, true}) {
            if (explicitly && plane == PlaneCondition::stress) continue;
            Scene scene = block({60e-3, 10e-3}, 0.5e-3);
            scene.model.plane = plane;
            scene.edges = {moving("top", Side::top, {0.0, 1.0}), moving("bottom", Side::bottom, {0.0, 0.0})};
            scene.edges[0].until = 1e-4;
            Crack crack;
            crack.points = {Vec2(0, 5e-3), Vec2(30e-3, 5e-3)};
            scene.cracks = {crack};
            scene.measure = {"top", "top"};
            scene.solver.damping = 4e4;
            scene.stop.time = 2e-3;
            const double E = 40e6, nu = 0.33, strain = 0.01;
            const double modulus = plane == PlaneCondition::strain ? E * (1 - nu) / ((1 + nu) * (1 - 2 * nu)) : E / (1 - nu * nu);
            const double error = rate_at_rest(scene, explicitly) / (modulus * strain * strain * 5e-3) - 1;
            std::printf("strip, plane %s%s: G off by %+.2f %%\n", plane == PlaneCondition::strain ? "strain" : "stress",
                        explicitly ? ", explicit" : "", 100 * error);
            EXPECT_LT(std::abs(error), 0.02);
        }
    }
}

// J at a crack length against the change of potential energy, at held edges, over half a cell to either side.
double against_energy(double crack_length, double cell, bool rings, bool explicitly) {
    double energy[2];
    double J = 0;
    for (int side = 0; side < 3; ++side) {
        const Scene scene = ring_specimen(crack_length + (side - 1) * 0.5 * cell, cell, rings);
        if (side == 1) {
            J = rate_at_rest(scene, explicitly);
        } else if (explicitly) {
            Trial run(scene);
            run.until(*scene.stop.time);
            energy[side / 2] = run.solver.energies().strain;
        } else {
            StaticTrial run(at_equilibrium(scene));
            EXPECT_TRUE(run.solve(*scene.stop.time));
            energy[side / 2] = run.equilibrium.potential();
        }
    }
    return J / ((energy[0] - energy[1]) / cell) - 1.0;
}

TEST(VerificationEnergy, JIsTheChangeOfEnergyInOneWood) {
    for (const bool explicitly : {false, true}) {
        const double error = against_energy(5e-3, 0.2e-3, false, explicitly);
        std::printf("J against change of energy, one wood%s: %+.2f %%\n", explicitly ? ", explicit" : "", 100 * error);
        EXPECT_LT(std::abs(error), 0.01);
    }
}

TEST(VerificationEnergy, JIsTheChangeOfEnergyAmongRings) {
    for (const double a : {2.5e-3, 3.0e-3, 7.0e-3}) {  // five cells and more from a boundary
        const double error = against_energy(a, 0.1e-3, true, false);
        std::printf("J against change of energy, rings, a = %.1f mm: %+.2f %%\n", 1e3 * a, 100 * error);
        EXPECT_LT(std::abs(error), 0.01) << a;
    }
}

// A tip midway in 2 mm of transition wood, across which the modulus grows thirtyfold, on ways along the grid and askew to it.
// What the grid blurs about the tip goes with the modulus there: ties hold as much, and J takes it off.
TEST(VerificationEnergy, JIsTheChangeOfEnergyInTransitionWood) {
    const auto at_tip = [](double x, double slope, double cell) {
        Scene scene = block({16e-3, 8e-3}, cell);
        scene.specimen.material.clear();
        scene.specimen.rings = Rings{Vec2(-1.0, 4e-3), 8e-3, 0.3, 2e-3};  // from 3.6 to 5.6 mm
        scene.materials["LW"] = {1200e6, 0.33, 750.0, 100.0};
        scene.edges = {moving("top", Side::top, {0.0, 1.0}), moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.measure = {"top", "top"};
        scene.stop.time = 1e-4;
        Crack crack;
        crack.points = {Vec2(0.0, 4e-3 - slope * x), Vec2(x, 4e-3)};
        scene.cracks = {crack};
        return at_equilibrium(scene);
    };
    const auto energy = [&](double x) {
        StaticTrial run(at_tip(x, 0.0, 0.0625e-3));
        EXPECT_TRUE(run.solve(1e-4));
        return run.equilibrium.potential() / run.scene.model.thickness;
    };
    const double middle = 4.625e-3, way = 0.0625e-3;
    const double released = (energy(middle - way) - energy(middle + way)) / (2 * way);
    for (const auto& [cell, bar] : {std::pair{0.25e-3, 0.03}, {0.125e-3, 0.02}, {0.0625e-3, 0.01}}) {
        const double error = rate_at_rest(at_tip(middle, 0.0, cell), false) / released - 1;
        std::printf("J in 2 mm of transition wood, cells of %.4f mm: %+.1f %% of the change of energy\n", 1e3 * cell,
                    100 * error);
        EXPECT_LT(std::abs(error), bar);
    }
    StaticTrial run(at_tip(middle, 0.0, 0.25e-3));
    EXPECT_TRUE(run.solve(1e-4));
    const TipLoad load = run.equilibrium.load_at(0, true);
    const LocalWood wood = run.materials.average(Vec2(middle, 4e-3), 0.5 * run.body.layout.point_size());
    EXPECT_NEAR(load.K_I * load.K_I, load.G * wood.plane_modulus(), 0.01 * load.K_I * load.K_I);
    double rate[2];
    for (const int fine : {0, 1}) rate[fine] = rate_at_rest(at_tip(4.6e-3, 0.15, fine ? 0.0625e-3 : 0.25e-3), false);
    std::printf("the same askew, cells of 0.25 mm: %+.1f %% of J on cells of 0.0625 mm\n", 100 * (rate[0] / rate[1] - 1));
    EXPECT_NEAR(rate[0], rate[1], 0.03 * rate[1]);
}

// What an edge crack of 8 mm, and a part of a cell, in a square of 16 mm holds between grips that let it go aside: its energy per
// thickness [J/m], and its energy release rate.
double energy_of_edge_crack(double cell, double nu, const Vec2& tip, double* rate = nullptr) {
    Scene scene = block({16e-3, 16e-3}, cell);
    scene.materials["EW"].poisson_ratio = nu;
    scene.edges = {without(moving("top", Side::top, {0.0, 1e-3}), 0), without(moving("bottom", Side::bottom, {0.0, 0.0}), 0),
                   without(moving("right", Side::right, {0.0, 0.0}), 1)};
    scene.edges[2].range = {{0.0, 1e-5}};
    Crack crack;
    crack.points = {Vec2(0.0, tip.y()), tip};
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.stop.time = 0.1;
    StaticTrial run(at_equilibrium(scene), false);
    EXPECT_TRUE(run.solve(*scene.stop.time));
    if (rate) *rate = run.equilibrium.load_at(0, true).G;
    return run.equilibrium.potential() / scene.model.thickness;
}

TEST(VerificationEnergy, TheCrackOfAGridIsAsLongAsDrawn) {
    // Of the energy's error the part that goes with the first power of the cell is G times how much longer the grid's crack is.
    // The energy of a perfect grid is that of two finer ones with that part taken off.
    constexpr double h = 0.5e-3;
    for (const double nu : {0.0, 0.33, 0.45})
        for (const double lift : {0.0, 0.5}) {
            double longest = -1.0, shortest = 1.0;
            for (const double shift : {0.0, 0.25, 0.5, 0.75}) {
                const Vec2 tip(8e-3 + shift * h, 8e-3 + lift * h);
                double G = 0.0;
                const double exact = 2.0 * energy_of_edge_crack(h / 4, nu, tip, &G) - energy_of_edge_crack(h / 2, nu, tip);
                const double longer = (exact - energy_of_edge_crack(h, nu, tip)) / (G * h);
                longest = std::max(longest, longer);
                shortest = std::min(shortest, longer);
            }
            std::printf("nu = %.2f, crack %.1f cells above a line of the grid: %+.3f to %+.3f cells longer than drawn\n", nu,
                        lift, shortest, longest);
            // One twentieth of a cell is 0.5 % of the length of a crack of ten cells.
            EXPECT_LT(std::max(longest, -shortest), 0.05) << nu << " " << lift;
        }
}

TEST(VerificationNotch, ACrackFromItsRootIsAsOneFromItsMouth) {
    // A narrow notch, half as wide as a fifth of its depth, lies in the shadow of its crack: force and G are those of an edge
    // crack as long as both.
    for (const double cell : {0.4e-3, 0.2e-3}) {
        const auto last = [&](double from, bool notched) {
            Scene scene = at_equilibrium(block({20e-3, 20e-3}, cell));
            if (notched) scene.specimen.cutouts = {Polygon{{{0.0, 9.1e-3}, {5.3e-3, 10.1e-3}, {0.0, 11.1e-3}}}};
            Crack crack;
            crack.points = {Vec2(from, 10.1e-3), Vec2(7.2e-3, 10.1e-3)};
            scene.cracks = {crack};
            scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
            scene.measure = {"top", "top"};
            scene.stop.displacement = 0.1e-3;
            return simulate(scene).series.back();
        };
        const Instant plain = last(0.0, false);
        for (const double from : {0.0, 5.2e-3, 5.3e-3}) {
            const Instant notched = last(from, true);
            std::printf("cells of %.1f mm, crack from %.1f mm: force %+.2f %%, G %+.2f %% off that without the notch\n",
                        1e3 * cell, 1e3 * from, 100 * (notched.force / plain.force - 1), 100 * (notched.G / plain.G - 1));
            EXPECT_NEAR(notched.force, plain.force, 0.002 * plain.force);
            EXPECT_NEAR(notched.G, plain.G, 0.005 * plain.G);
        }
    }
}

TEST(UnitCrackFaces, TouchButDoNotPassInMotion) {
    // Pressed together, a cracked block is as stiff as a whole one; faces overlap by what their penalty yields.
    double force[2];
    for (const bool cracked : {false, true}) {
        Scene scene = block({10e-3, 10e-3}, 1e-3);
        scene.edges = {moving("top", Side::top, {0.0, -0.1}), moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.edges[0].until = 1e-3;
        scene.measure = {"top", "top"};
        scene.solver.damping = 4e4;
        scene.stop.time = 3e-3;
        Crack crack;
        crack.points = {Vec2(10e-3, 5e-3), Vec2(5e-3, 5e-3)};
        if (cracked) scene.cracks = {crack};
        force[cracked] = simulate(scene).series.back().force;
    }
    EXPECT_NEAR(force[1], force[0], 1e-3 * force[0]);
}

}  // namespace
}  // namespace crampfit::test

// Free motion against exact solutions: bars, standing waves, disks that meet.
#include "datasets/error.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>

namespace crampfit::test {
namespace {

using std::numbers::pi;

/// How a scene is solved, for tables.
struct Way {
    const char* name;
    ShapeFunction shape = ShapeFunction::automatic;
    VelocityUpdate update = VelocityUpdate::automatic;
    int order = 2;
    double pic_share = 0.0;
    StressUpdate stress = StressUpdate::last;

    Scene of(Scene scene) const {
        scene.solver.shape_function = shape;
        scene.solver.velocity_update = update;
        scene.solver.order = order;
        scene.solver.pic_share = pic_share;
        scene.solver.stress_update = stress;
        return scene;
    }
};

/// A run from given displacements and velocities, in finite rotation or small strain whatever the plan would choose.
struct FreeRun {
    FreeRun(const Scene& s, bool rotates, int threads = 1)
        : scene(s), materials(scene), body(scene, materials), plan(turned(make_plan(scene, materials, body), rotates)),
          solver(scene, plan, materials, body, threads) {}

    static Plan turned(Plan plan, bool rotates) {
        plan.rotates = rotates;
        return plan;
    }

    Scene scene;
    MaterialMap materials;
    Discretisation body;
    Plan plan;
    ExplicitSolver solver;
};

// ---- REFERENCES: bar vibration. E = 100, rho = 1, L = 25, 50 cells, held at its left end; mode 1: w = c pi / (2 L) = 0.62832.

constexpr double bar_length = 25.0, bar_speed = 10.0, bar_period = 10.0;

Scene bar() {
    Scene scene = block({bar_length, 0.5}, 0.5);
    scene.materials["EW"] = {100.0, 0.0, 1.0, 100.0};
    // On rollers: a slender bar that is pressed this hard would buckle.
    scene.edges = {without(moving("left", Side::left, {0.0, 0.0}), 1), without(moving("top", Side::top, {0.0, 0.0}), 0),
                   without(moving("bottom", Side::bottom, {0.0, 0.0}), 0)};
    scene.measure = {"left", "left"};
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.stop.time = 20 * bar_period;
    return scene;
}

struct Vibration {
    double period;     // relative error
    double drift;      // of the energy over the run, relative
    double swing;      // largest difference of the energy from its start, relative
    double amplitude;  // of the end [m]
};

/// Biot strain's stress is linear in the stretch, so that the exact solution holds at any amplitude: v = v0 sin(pi X / 2 L) cos(w
/// t).
Vibration vibrate(const Way& way, double v0, int periods) {
    FreeRun run(way.of(bar()), true);
    run.solver.start([](const Vec2&) { return Vec2::Zero(); },
                     [&](const Vec2& x) { return Vec2(v0 * std::sin(pi * x.x() / (2 * bar_length)), 0.0); });
    int end = 0;
    for (int n = 0; n < run.body.layout.nodes(); ++n)
        if (run.body.layout.node_position(n).x() > run.body.layout.node_position(end).x()) end = n;
    const auto energy = [&] {
        const EnergyBooks books = run.solver.energies();
        return books.strain + books.kinetic;
    };
    run.solver.step();  // energies are those of the last forces
    const double at_start = energy();
    Vibration result{0.0, 0.0, 0.0, 0.0};
    int crossings = 0;
    double last_crossing = 0.0, before = 0.0;
    while (crossings < periods) {
        const double time = run.solver.time();
        run.solver.step();
        const double now = run.solver.displacements()[end].x();
        if (before < 0.0 && now >= 0.0) {
            last_crossing = time + (run.solver.time() - time) * before / (before - now);
            ++crossings;
        }
        before = now;
        result.amplitude = std::max(result.amplitude, std::abs(now));
        result.swing = std::max(result.swing, std::abs(energy() / at_start - 1));
    }
    result.drift = energy() / at_start - 1;
    result.period = last_crossing / (periods * bar_period) - 1;
    return result;
}

void print(const Way& way, const Vibration& v) {
    std::printf("  %-28s period %+.5f %%, energy %+.6f %% (at most %.6f %% on the way), end moves %.2f cells\n", way.name,
                100 * v.period, 100 * v.drift, 100 * v.swing, v.amplitude / 0.5);
}

const Way plain{"auto"};
const Way splines{"bspline2", ShapeFunction::bspline2};

TEST(VerificationBar, PeriodAndEnergyOverTwentyPeriods) {
    std::printf("bar of 50 cells, mode 1, 20 periods (bar: 0.012 %%; 0.0002 %%)\n");
    for (const Way& way : {plain, Way{"linear", ShapeFunction::linear}, Way{"cpdi", ShapeFunction::cpdi}, splines}) {
        const Vibration v = vibrate(way, 0.1, 20);
        print(way, v);
        EXPECT_LT(std::abs(v.period), 1.2e-4) << way.name;
        EXPECT_LT(std::abs(v.drift), 2e-6) << way.name;
    }
}

TEST(VerificationBar, VibratingOverManyCells) {
    // The end moves by six cells either way; in the undeformed specimen no point leaves its cell.
    std::printf("bar of 50 cells that vibrates hard, 20 periods (bar: 0.02 %%; 0.002 %%)\n");
    for (const Way& way : {plain, splines}) {
        const Vibration v = vibrate(way, 2.0, 20);
        print(way, v);
        EXPECT_GT(v.amplitude, 6 * 0.5) << way.name;
        EXPECT_LT(std::abs(v.period), 2e-4) << way.name;
        EXPECT_LT(std::abs(v.drift), 2e-5) << way.name;
    }
}

TEST(VerificationBar, EachUpdate) {
    // Lumped mass lowers frequencies by (k h)^2 / 24 with hats, (k h)^2 / 8 with B-splines; what points hand back, A = 1 - 13/96
    // (k h)^2 with hats and two points a cell, adds half of that with FLIP and XPIC; FMPM's extrapolation takes that back from m
    // = 2 on.
    const double kh = pi / 100;
    std::printf("bar of 50 cells, 5 periods\n");
    const Way ways[] = {
        {"stress first", ShapeFunction::automatic, VelocityUpdate::automatic, 2, 0.0, StressUpdate::first},
        {"stress average", ShapeFunction::automatic, VelocityUpdate::automatic, 2, 0.0, StressUpdate::average},
        {"flip", ShapeFunction::automatic, VelocityUpdate::flip},
        {"flip, stress first", ShapeFunction::automatic, VelocityUpdate::flip, 2, 0.0, StressUpdate::first},
        {"flip, stress average", ShapeFunction::automatic, VelocityUpdate::flip, 2, 0.0, StressUpdate::average},
        {"flip, 1 % pic", ShapeFunction::automatic, VelocityUpdate::flip, 2, 0.01},
        {"pic", ShapeFunction::automatic, VelocityUpdate::pic},
        {"xpic(1)", ShapeFunction::automatic, VelocityUpdate::xpic, 1},
        {"xpic(2)", ShapeFunction::automatic, VelocityUpdate::xpic, 2},
        {"xpic(5)", ShapeFunction::automatic, VelocityUpdate::xpic, 5},
        {"fmpm(1)", ShapeFunction::automatic, VelocityUpdate::fmpm, 1},
        {"fmpm(2)", ShapeFunction::automatic, VelocityUpdate::fmpm, 2},
        {"fmpm(4)", ShapeFunction::automatic, VelocityUpdate::fmpm, 4},
        {"bspline2, flip", ShapeFunction::bspline2, VelocityUpdate::flip},
        {"bspline2, xpic(2)", ShapeFunction::bspline2, VelocityUpdate::xpic, 2},
        {"bspline2, fmpm(2)", ShapeFunction::bspline2, VelocityUpdate::fmpm, 2},
    };
    std::map<std::string, Vibration> found;
    for (const Way& way : ways) {
        const Vibration v = found[way.name] = vibrate(way, 0.1, 5);
        print(way, v);
        EXPECT_LT(v.drift, 1e-5) << way.name;  // no update makes energy
        EXPECT_LT(std::abs(v.period), kh * kh / 4) << way.name;
    }
    EXPECT_LT(found["pic"].drift, 10 * found["xpic(2)"].drift);
    EXPECT_EQ(found["pic"].drift, found["fmpm(1)"].drift);
    EXPECT_GT(found["xpic(5)"].drift, found["xpic(2)"].drift);
    EXPECT_LT(std::abs(found["flip"].drift), 1e-7);
    EXPECT_LT(std::abs(found["fmpm(4)"].drift), 1e-7);
}

// ---- A standing wave along both axes in a unit square on rollers: u_i = A sin(2 pi X_i) cos(w t), w = 2 pi c, c^2 = C_xx / rho.
// An axis is not felt by the other, as du_x/dX depends on X alone: exact at any amplitude with Biot's strain (no rotation),
// without body forces.

double wave_error(const Way& way, int cells) {
    constexpr double A = 0.05, E = 1.0, nu = 0.3;
    Scene scene = block({1.0, 1.0}, 1.0 / cells);
    scene.materials["EW"] = {E, nu, 1.0, 100.0};
    for (const Side side : {Side::left, Side::right, Side::bottom, Side::top}) {
        const bool upright = side == Side::left || side == Side::right;
        scene.edges.push_back(without(moving("side " + std::to_string(scene.edges.size()), side, {0.0, 0.0}), upright ? 1 : 0));
    }
    scene.measure = {"side 0", "side 0"};
    scene.solver.kind = SolverKind::explicit_dynamics;
    const double w = 2 * pi * std::sqrt(E * (1 - nu) / ((1 + nu) * (1 - 2 * nu)));
    scene.stop.time = 1.3 * 2 * pi / w;
    FreeRun run(way.of(scene), true);
    const auto wave = [&](const Vec2& x) { return Vec2(A * std::sin(2 * pi * x.x()), A * std::sin(2 * pi * x.y())); };
    run.solver.start(wave, [](const Vec2&) { return Vec2::Zero(); });
    while (run.solver.time() < *scene.stop.time) run.solver.step();
    double sum = 0.0;
    for (int p = 0; p < run.body.points.count(); ++p) {
        const Vec2 exact = wave(run.body.points.position[p]) * std::cos(w * run.solver.time());
        sum += (value_at(run.body, p, run.solver.displacements()) - exact).squaredNorm();
    }
    return std::sqrt(sum / run.body.points.count()) / A;
}

TEST(VerificationStandingWave, ConvergesWithTheSecondOrder) {
    // Strain up to 31 %. Asked for: 1.5 with GIMP, 1.9 with B-splines.
    const std::pair<Way, double> ways[] = {{plain, 1.9},
                                           {splines, 1.9},
                                           {{"flip", ShapeFunction::automatic, VelocityUpdate::flip}, 1.5},
                                           {{"fmpm(2)", ShapeFunction::automatic, VelocityUpdate::fmpm, 2}, 1.5}};
    for (const auto& [way, least] : ways) {
        std::printf("  %-10s", way.name);
        double before = 0.0, order = 0.0;
        for (const int cells : {8, 16, 32, 64}) {
            const double error = wave_error(way, cells);
            order = before > 0.0 ? std::log2(before / error) : 0.0;
            std::printf("  %d cells %.2e (order %.2f)", cells, error, order);
            before = error;
        }
        std::printf("\n");
        EXPECT_GT(order, least) << way.name;
    }
}

// ---- REFERENCES: two-disk impact. Published without what surrounds them; here 20 mm across, 25 mm between centres, head on,
// each at half of 1 % of the wave speed, plane strain.

Scene two_disks() {
    Scene scene = block({50e-3, 24e-3}, 0.5e-3);
    scene.materials["EW"] = {1e9, 0.33, 1500.0, 100.0};
    const double wave = std::sqrt(1e9 * 0.67 / (1.33 * 0.34) / 1500.0);
    scene.specimen.parts = {{Circle{{11.75e-3, 12e-3}, 10e-3}, {0.005 * wave, 0.0}},
                            {Circle{{38.25e-3, 12e-3}, 10e-3}, {-0.005 * wave, 0.0}}};
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.stop.time = 1.2e-3;
    scene.output.samples = 400;
    return scene;
}

void expect_bounce(const std::vector<Way>& ways, double most_lost) {
    for (const Way& way : ways) {
        const Record record = simulate(way.of(two_disks()));
        ASSERT_EQ(record.status, RunStatus::finished) << record.message;
        const Instant &first = record.series.front(), &last = record.series.back();
        double least = first.kinetic_energy;
        for (const Instant& row : record.series) least = std::min(least, row.kinetic_energy);
        const double lost = 1 - (last.kinetic_energy + last.strain_energy) / first.kinetic_energy;
        std::printf("two disks, %-10s energy lost %.4f %%, kinetic back %.2f %%, least %.2f %%, books %.4f %%, %.2f s\n",
                    way.name, 100 * lost, 100 * last.kinetic_energy / first.kinetic_energy, 100 * least / first.kinetic_energy,
                    100 * record.worst_energy_imbalance, record.seconds);
        EXPECT_LT(least, 0.2 * first.kinetic_energy);  // they did meet
        EXPECT_LT(lost, most_lost) << way.name;
        EXPECT_LT(record.worst_energy_imbalance, 0.01) << way.name;
    }
}

TEST(VerificationDisks, GiveBackTheEnergyOfTheirImpact) { expect_bounce({plain, splines}, 0.0186); }

TEST(SlowDisks, LoseLittleWhenVelocitiesGoThroughThePoints) {
    expect_bounce({{"flip", ShapeFunction::automatic, VelocityUpdate::flip},
                   {"fmpm(4)", ShapeFunction::automatic, VelocityUpdate::fmpm, 4}},
                  0.0186);
    // A filter that takes (1 - A)^2 of the velocities each of 4000 steps misses the bar for the best published, as FLIP there
    // does (3.23 %).
    expect_bounce({{"xpic(2)", ShapeFunction::automatic, VelocityUpdate::xpic, 2}}, 0.0323);
}

TEST(UnitParts, KeepTheirMomentumWhenTheyMeet) {
    // Off centre, one at rest: they turn one another.
    Scene scene = two_disks();
    scene.model.cell = 1e-3;
    scene.specimen.parts[0] = {Circle{{11.5e-3, 10.5e-3}, 8e-3}, {15.0, 2.0}};
    scene.specimen.parts[1] = {
        Polygon{{Vec2(25.5e-3, 5.5e-3), Vec2(40.5e-3, 6.5e-3), Vec2(38.5e-3, 20.5e-3), Vec2(27.5e-3, 18.5e-3)}}, {0.0, 0.0}};
    FreeRun run(scene, true);
    const auto momenta = [&] {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();  // x, y, and about the origin
        const std::vector<double> mass = field_masses(run.body, run.solver.cracks().fields());
        for (std::size_t n = 0; n < mass.size(); ++n) {
            const Vec2 x = run.body.layout.node_position(static_cast<int>(n)) + run.solver.displacements()[n];
            const Vec2 p = mass[n] * run.solver.velocities()[n];
            sum += Eigen::Vector3d(p.x(), p.y(), cross(x, p));
        }
        return sum;
    };
    const Eigen::Vector3d before = momenta();
    for (int k = 0; k < 2000; ++k) run.solver.step();
    const Eigen::Vector3d change = momenta() - before;
    const double part = run.solver.energies().kinetic / (run.solver.energies().kinetic + run.solver.energies().strain);
    std::printf("momentum changes by %.1e, %.1e, about the origin %.1e of what there is; %.1f %% of the energy is kinetic\n",
                change.x() / before.x(), change.y() / before.x(), change.z() / before.z(), 100 * part);
    EXPECT_LT(std::abs(change.x() / before.x()), 1e-12);
    EXPECT_LT(std::abs(change.y() / before.x()), 1e-12);
    EXPECT_LT(std::abs(change.z() / before.z()), 1e-3);  // velocities stand half a step behind places
    const Vec2 hit = run.solver.velocities()[run.body.points.node[run.body.points.count() - 1][0]];
    EXPECT_GT(hit.norm(), 1.0);
}

TEST(UnitParts, TooCloseToOneAnotherAreRefused) {
    Scene scene = two_disks();
    scene.specimen.parts[1].shape = Circle{{32e-3, 12e-3}, 10e-3};
    try {
        simulate(scene);
        FAIL() << "accepted";
    } catch (const InputError& error) {
        EXPECT_EQ(error.key, "specimen.parts");
    }
}

// ---- threads

TEST(UnitThreads, ComeToTheSameBits) {
    for (const ShapeFunction shape : {ShapeFunction::gimp, ShapeFunction::bspline2}) {
        for (const VelocityUpdate update : {VelocityUpdate::automatic, VelocityUpdate::xpic}) {
            Scene scene = ring_specimen(3e-3, 0.1e-3);
            scene.cracks[0].grows = Growth::end;
            scene.materials["EW"].toughness = scene.materials["LW"].toughness = 1e-3;
            scene.solver.shape_function = shape;
            scene.solver.velocity_update = update;
            std::vector<Vec2> first;
            for (const int threads : {1, 2, 4, 8}) {
                FreeRun run(scene, true, threads);
                for (int k = 0; k < 60; ++k) {
                    if (k % 2 == 0) run.solver.grow_cracks();
                    run.solver.step();
                }
                ASSERT_TRUE(run.solver.is_finite());
                if (threads == 1) first = run.solver.displacements();
                EXPECT_TRUE(first == run.solver.displacements()) << threads << " threads";
            }
            EXPECT_GT(first.size(), 101u * 101u);  // the crack did split nodes
        }
    }
}

}  // namespace
}  // namespace crampfit::test

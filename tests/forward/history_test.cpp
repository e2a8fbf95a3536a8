// Specimens of wood that remembers, in both solvers, against closed forms.
#include "tests/forward/scenes_that_remember.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdio>
#include <numbers>

namespace crampfit::test {
namespace {

using std::numbers::pi;

void expect_dissipation_rises(const Record& record) {
    double before = 0.0;
    for (const Instant& row : record.series) {
        const double taken = row.external_work - row.strain_energy - row.kinetic_energy;
        EXPECT_GE(taken, before - 1e-6 * row.external_work);
        before = std::max(before, taken);
    }
}

// Pulled for 0.1 s, then held: F = E' A e/T int of the series. The recursion is exact for such a strain, at any step.
TEST(VerificationHistory, RelaxationOfABar) {
    const double share = 0.6, tau = 0.7, ramp = 0.1, strain = 0.005;
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        Scene scene = bar(relaxing(share, tau), plane, pull(strain * 4e-3 / ramp, ramp));
        scene.stop.time = 5.0;
        const Record record = simulate(scene);
        ASSERT_EQ(record.status, RunStatus::finished) << record.message;
        const auto integral = [&](double t) { return t - share * (t + tau * std::expm1(-t / tau)); };
        double worst = 0.0;
        for (const Instant& row : record.series) {
            const double exact =
                bar_modulus(plane) * 2e-3 * strain / ramp * (integral(row.time) - integral(std::max(0.0, row.time - ramp)));
            worst = std::max(worst, std::abs(row.force - exact) / (bar_modulus(plane) * 2e-3 * strain));
        }
        std::printf("relaxation: %zu rows, worst force off by %.1e; books off by %.1e\n", record.series.size(), worst,
                    record.worst_energy_imbalance);
        EXPECT_LT(worst, 1e-7);  // what Newton's method leaves
        EXPECT_LT(record.worst_energy_imbalance, 5e-3);
        expect_dissipation_rises(record);
    }
}

// Under a load from the start on: u = sigma L / E' (1 + g / (1 - g) (1 - exp(-(1 - g) t / tau))), and the error goes with the
// square of the step.
TEST(VerificationHistory, CreepOfABar) {
    const double share = 0.6, tau = 0.7, stress = 0.1e6;
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        Scene scene = bar(relaxing(share, tau), plane, pulled("right", Side::right, {stress, 0.0}));
        scene.stop.time = 2.8;
        const auto worst = [&](const Record& record) {
            double most = 0.0;
            for (const Instant& row : record.series)
                most = std::max(most,
                                std::abs(row.displacement / (stress * 4e-3 / bar_modulus(plane)) - creep(share, tau, row.time)));
            return most;
        };
        const Record automatic = simulate(scene);
        std::array<double, 3> error;
        for (int k = 0; k < 3; ++k) {
            scene.solver.time_step = 0.2 / (1 << k);
            error[k] = worst(simulate(scene));
        }
        std::printf("creep: %zu rows, off by %.1e; even steps of 0.2 s and halves: %.1e %.1e %.1e; books off by %.1e\n",
                    automatic.series.size(), worst(automatic), error[0], error[1], error[2], automatic.worst_energy_imbalance);
        EXPECT_LT(worst(automatic), 5e-4);
        EXPECT_GT(std::log2(error[0] / error[1]), 1.9);
        EXPECT_GT(std::log2(error[1] / error[2]), 1.9);
        EXPECT_LT(automatic.worst_energy_imbalance, 1e-3);
        expect_dissipation_rises(automatic);
    }
}

// The same two in motion, slow against the waves and damped.
TEST(VerificationHistory, RelaxationAndCreepInMotion) {
    const double share = 0.6, tau = 2e-3;
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        const double ramp = 0.5e-3, strain = 0.005;
        Scene scene = at_motion(bar(relaxing(share, tau), plane, pull(strain * 4e-3 / ramp, ramp)));
        scene.stop.time = 8e-3;
        scene.solver.damping = 2e4;
        const Record held = simulate(scene);
        const auto integral = [&](double t) { return t - share * (t + tau * std::expm1(-t / tau)); };
        double relaxation = 0.0, creeping = 0.0;
        for (const Instant& row : held.series) {
            if (row.time < 2 * ramp) continue;
            const double middle = row.time - 0.5 * 8e-3 / 1000;  // a row's force is the mean since the row before
            const double exact = bar_modulus(plane) * 2e-3 * strain / ramp * (integral(middle) - integral(middle - ramp));
            relaxation = std::max(relaxation, std::abs(row.force / exact - 1));
        }
        scene.edges[2] = pulled("right", Side::right, {0.1e6, 0.0});
        scene.solver.damping = 8e4;
        scene.model.cell = 0.5e-3;
        const Record loaded = simulate(scene);
        for (const Instant& row : loaded.series)
            if (row.time > tau)
                creeping = std::max(
                    creeping, std::abs(row.displacement / (0.1e6 * 4e-3 / bar_modulus(plane)) / creep(share, tau, row.time) - 1));
        std::printf("in motion: relaxation off by %.1e, creep by %.1e; books off by %.1e, %.1e\n", relaxation, creeping,
                    held.worst_energy_imbalance, loaded.worst_energy_imbalance);
        EXPECT_LT(relaxation, 2e-3);
        EXPECT_LT(creeping, 5e-3);
        EXPECT_LT(held.worst_energy_imbalance, 5e-3);
        EXPECT_LT(loaded.worst_energy_imbalance,
                  1e-2);  // half a step's damping of the wave that the sudden load sends; elastic wood has it too
        expect_dissipation_rises(held);
    }
}

// A wheel that follows a force sinks as it would into elastic wood of E over the creep function, as long as what it touches grows
// (Lee and Radok 1960; Poisson's ratio stays what it is).
TEST(VerificationHistory, WheelSinksIn) {
    const double share = 0.6, tau = 0.7;
    std::array<double, 2> worst{};
    for (const int fineness : {0, 1}) {
        Scene scene = at_rest({4e-3, 2e-3}, 0.25e-3 / (1 << fineness));
        scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
        Body wheel;
        wheel.name = "wheel";
        wheel.shape = Circle{Vec2(2e-3, 4e-3), 2e-3};
        wheel.free = {false, true};
        wheel.force = {0.0, -2e3};
        scene.bodies = {wheel};
        scene.measure = {"wheel", "wheel"};
        scene.solver.extrapolate = false;
        for (const double time : {0.2, 3.0}) {
            scene.stop.time = time;
            scene.materials["EW"] = relaxing(share, tau);
            const Record creeping = simulate(scene);
            scene.materials["EW"] = earlywood();
            scene.materials["EW"].youngs_modulus /= creep(share, tau, time);
            const Record elastic = simulate(scene);
            ASSERT_EQ(creeping.status, RunStatus::finished) << creeping.message;
            worst[fineness] =
                std::max(worst[fineness], std::abs(creeping.series.back().displacement / elastic.series.back().displacement - 1));
            EXPECT_LT(creeping.worst_energy_imbalance, 1e-3);
        }
    }
    std::printf("wheel: depth off by %.1e, with cells half as wide by %.1e\n", worst[0], worst[1]);
    // Springs on the outline are as stiff as the wood at once, and those of the softer wood softer: their depth goes with the
    // cell.
    EXPECT_LT(worst[0], 0.01);
    EXPECT_LT(worst[1], 0.6 * worst[0]);
}

// Free vibration dies out as s of rho s^2 + k^2 E'(s) = 0 has it, E'(s) = E' (1 - g / (1 + s tau)): loss angle and stiffness in
// one.
TEST(VerificationHistory, VibrationDiesOut) {
    const double share = 0.1, L = 25e-3;
    const double M = 40e6 * 0.67 / (1.33 * 0.34), k = pi / (2 * L);  // sides on rollers: plane waves
    const double omega = k * std::sqrt(M / 300.0), tau = 1.0 / omega;
    Scene scene = block({L, 0.5e-3}, 0.5e-3);
    scene.materials["EW"] = relaxing(share, tau);
    scene.edges = {without(moving("left", Side::left, {0.0, 0.0}), 1), without(moving("top", Side::top, {0.0, 0.0}), 0),
                   without(moving("bottom", Side::bottom, {0.0, 0.0}), 0)};
    scene.measure = {"left", "left"};
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.stop.time = 1.0;
    std::complex<double> s(0.0, omega);
    for (int n = 0; n < 50; ++n) {
        s = std::sqrt(-omega * omega * (1.0 - share / (1.0 + s * tau)));
        if (s.imag() < 0) s = -s;
    }
    // As the mode itself goes, the springs of the Maxwell elements would have to start strained; from rest they follow in tau, so
    // that amplitude and phase are compared over later periods.
    Trial run(scene);
    const double v0 = 1e-3;
    run.solver.start([](const Vec2&) { return Vec2::Zero(); },
                     [&](const Vec2& x) { return Vec2(v0 * std::sin(k * x.x()), 0.0); });
    const int end = run.body.layout.nodes_x() - 1;
    std::vector<double> crossing, peak;
    double before = 0.0, most = 0.0;
    const double period = 2 * pi / s.imag();
    while (run.solver.time() < 8.2 * period) {
        run.solver.step();
        const double here = run.solver.displacements()[end].x();
        most = std::max(most, here);
        if (before > 0 && here <= 0) {
            crossing.push_back(run.solver.time() - run.plan.time_step * here / (here - before));
            peak.push_back(most);
            most = 0.0;
        }
        before = here;
    }
    ASSERT_GE(crossing.size(), 8U);
    const double measured = (crossing[7] - crossing[3]) / 4;
    const double decrement = std::log(peak[3] / peak[7]) / 4;
    std::printf("vibration: period off by %.1e, decrement %.5f (exact %.5f)\n", measured / period - 1, decrement,
                -s.real() * period);
    EXPECT_NEAR(measured / period, 1.0, 3e-4);
    EXPECT_NEAR(decrement / (-s.real() * period), 1.0, 3e-3);
    const EnergyBooks books = run.solver.energies();
    EXPECT_NEAR((books.strain + books.kinetic + books.damped) / books.work, 1.0, 1e-3);
}

// Loading, unloading and again: time runs back for that, which rate-independent wood does not mind.
TEST(VerificationHistory, PlasticBar) {
    const double Y = 0.4e6, H = 8e6, E = 40e6, last = 0.03;
    const double tangent = E * H / (E + H);
    Scene scene = bar(flowing(Y, H), PlaneCondition::stress, pull(last * 4e-3, 1.0));
    StaticTrial run(scene);
    double worst = 0.0;
    const auto stress = [&](double strain) {
        EXPECT_TRUE(run.solve(strain / last));
        return run.equilibrium.reactions()[2].x() / 2e-3;
    };
    const auto virgin = [&](double e) { return std::min(E * e, Y + tangent * (e - Y / E)); };
    for (const double e : {0.005, 0.01, 0.012, 0.02}) worst = std::max(worst, std::abs(stress(e) - virgin(e)));
    for (const double e : {0.015, 0.008, 0.02}) worst = std::max(worst, std::abs(stress(e) - (virgin(0.02) - E * (0.02 - e))));
    for (const double e : {0.025, 0.03}) worst = std::max(worst, std::abs(stress(e) - virgin(e)));
    std::printf("plastic bar: stress off by %.1e of the yield stress\n", worst / Y);
    EXPECT_LT(worst, 1e-6 * Y);
    const double a = 0.03 - virgin(0.03) / E;
    EXPECT_NEAR(run.equilibrium.history()->dissipated(), (Y * a + 0.5 * H * a * a) * 8e-6, 1e-5 * Y * a * 8e-6);
    // In motion.
    scene = at_motion(scene);
    scene.edges[2] = pull(last * 4e-3 / 4e-3, 4e-3);
    scene.stop.time = 4e-3;
    scene.solver.damping = 4e4;
    const Record record = simulate(scene);
    double off = 0.0;
    for (const Instant& row : record.series)
        if (row.displacement > 0.01 * 4e-3)
            off = std::max(off, std::abs(row.force / 2e-3 - virgin((row.displacement - 0.5 * last * 4e-6) / 4e-3)));
    std::printf("plastic bar in motion: stress off by %.1e of the yield stress; books off by %.1e\n", off / Y,
                record.worst_energy_imbalance);
    EXPECT_LT(off, 0.02 * Y);  // what vibration and damping leave
    EXPECT_LT(record.worst_energy_imbalance, 1e-3);
    expect_dissipation_rises(record);
}

// A block of perfectly plastic wood in plane strain carries 2 / sqrt(3) Y (Hill 1950, ch. 2), in either solver.
TEST(VerificationHistory, BlockInPlaneStrainCarriesItsLimit) {
    const double Y = 0.4e6;
    Scene scene = bar(flowing(Y, 0.0), PlaneCondition::strain, pull(-0.05 * 4e-3, 1.0));
    const Record record = simulate(scene);
    ASSERT_EQ(record.status, RunStatus::finished) << record.message;
    const double limit = 2 / std::sqrt(3.0) * Y * 2e-3;
    std::printf("limit load off by %.1e; books off by %.1e\n", record.series.back().force / limit - 1,
                record.worst_energy_imbalance);
    EXPECT_NEAR(record.series.back().force, limit, 1e-3 * limit);
    EXPECT_LT(record.worst_energy_imbalance, 5e-3);
    scene = at_motion(scene);
    scene.edges[2] = pull(-0.05 * 4e-3 / 4e-3, 4e-3);
    scene.stop.time = 4e-3;
    scene.solver.damping = 4e4;
    const Record moving = simulate(scene);
    std::printf("in motion off by %.1e; books off by %.1e\n", moving.series.back().force / limit - 1,
                moving.worst_energy_imbalance);
    EXPECT_NEAR(moving.series.back().force, limit, 0.02 * limit);
}

// Between rollers, an elastic layer on one that relaxes, the boundary within a cell: two in series, a standard solid again.
TEST(VerificationHistory, LayersThatShareACellActInSeries) {
    const double M1 = 1200e6 * 0.67 / (1.33 * 0.34), M2 = 40e6 * 0.67 / (1.33 * 0.34);
    const double G2 = 40e6 / 2.66, share = 0.6, tau = 0.5, height = 4e-3, h2 = 2.3125e-3, h1 = height - h2, ramp = 1e-4,
                 stretch = 4e-6;
    Scene scene = at_rest({2e-3, height}, 1e-3);
    scene.specimen.material.clear();
    // LW from y = h2 on, the pith so far away that the boundary is straight.
    scene.specimen.rings = Rings{Vec2(1e-3, -1000.0), 1000.0 + height, h1 / (1000.0 + height), 0.0};
    Material wood = earlywood();
    wood.viscoelastic = Viscoelasticity{{{share, 0.0, tau}}};
    scene.materials["EW"] = wood;
    scene.materials["LW"] = {1200e6, 0.33, 300.0, 100.0};
    Edge top = without(moving("top", Side::top, {0.0, stretch / ramp}), 0);
    top.until = ramp;
    scene.edges = {without(moving("left", Side::left, {0.0, 0.0}), 1), without(moving("right", Side::right, {0.0, 0.0}), 1),
                   without(moving("bottom", Side::bottom, {0.0, 0.0}), 0), top};
    scene.measure = {"top", "top"};
    scene.stop.time = 3.0;
    const Record record = simulate(scene);
    ASSERT_EQ(record.status, RunStatus::finished) << record.message;
    EXPECT_NE(record.explanation.find("in 6 of 8 cells"), std::string::npos) << record.explanation;
    const double r = share * 4.0 / 3.0 * G2 / M2;  // of M2 relaxes
    const double at_once = 2e-3 / (h1 / M1 + h2 / M2), at_last = 2e-3 / (h1 / M1 + h2 / (M2 * (1 - r)));
    const double relaxation = tau / (1 - r) * at_last / at_once;
    double worst = 0.0;
    for (const Instant& row : record.series) {
        if (row.time < ramp) continue;
        const double exact = stretch * (at_last + (at_once - at_last) * std::exp(-(row.time - 0.5 * ramp) / relaxation));
        worst = std::max(worst, std::abs(row.force / exact - 1));
    }
    std::printf("layers in series: force off by %.1e\n", worst);
    EXPECT_LT(worst, 2e-4);  // of steps in time; the boundary lies where a cell's sixteen samples see it exactly
    EXPECT_LT(record.worst_energy_imbalance, 5e-3);
}

// Between bonded grips the strain differs from place to place; with the consistent tangent a step takes few factorisations, each
// iteration about doubling the digits.
TEST(VerificationHistory, NewtonIsQuick) {
    Scene scene = at_rest({10e-3, 5e-3}, 0.5e-3);
    scene.materials["EW"] = flowing(0.4e6, 1e6);
    scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0}), moving("top", Side::top, {0.3e-3, -0.3e-3})};
    scene.measure = {"top", "top"};
    for (const bool rotates : {false, true}) {
        StaticTrial run(scene, rotates);
        int most = 0;
        for (int k = 1; k <= 20; ++k) {
            const int before = run.equilibrium.factorisations();
            ASSERT_TRUE(run.solve(0.05 * k));
            most = std::max(most, run.equilibrium.factorisations() - before);
        }
        std::printf("%s: at most %d factorisations in a step, %d in all 20\n", rotates ? "finite rotation" : "small strain", most,
                    run.equilibrium.factorisations());
        EXPECT_LE(most, 7);
    }
}

// A square of plastic wood with a slanted crack, pulled, as a turn or a mirror shows it: the force [N].
double pull_on_a_cracked_square(const Mat2& image, double yield_stress) {
    const double side = 10e-3, cell = 0.5e-3;
    const auto seen = [&](const Vec2& x) -> Vec2 {
        return image * (x.array() - 0.5 * side).matrix() + Vec2::Constant(0.5 * side);
    };
    Scene scene = at_rest({side, side}, cell);
    scene.materials["EW"] = flowing(yield_stress, 1e6);
    const Vec2 up = image * Vec2(0, 1);
    const auto side_to = [](const Vec2& normal) {
        if (std::abs(normal.x()) > 0.5) return normal.x() > 0 ? Side::right : Side::left;
        return normal.y() > 0 ? Side::top : Side::bottom;
    };
    scene.edges = {moving("grip", side_to(up), 0.2e-3 * up), moving("hold", side_to(-up), Vec2::Zero())};
    Crack crack;
    crack.points = {seen({5.385e-3, 4.577e-3}), seen({3.176e-3, 7.109e-3})};
    scene.cracks = {crack};
    scene.measure = {"grip", "grip"};
    StaticTrial run(scene, false);
    for (int k = 1; k <= 5; ++k) {
        EXPECT_TRUE(run.solve(0.2 * k));
        run.equilibrium.refine();
    }
    return run.equilibrium.reactions().front().dot(up);
}

// A crack leaves points of a cell on one side that are neighbours in one image and are not in another: they share their
// dilatation all the same. The images differ by rounding; force tolerances are relative to forces that are in balance to 1e-10.
TEST(VerificationHistory, ACrackInPlasticWoodIsTheSameMirroredAndTurned) {
    for (const double yield_stress : {1e10, 0.4e6}) {
        const double force = pull_on_a_cracked_square(Mat2::Identity(), yield_stress);
        for (const Mat2& image : {Mat2{{-1, 0}, {0, 1}}, Mat2{{1, 0}, {0, -1}}, Mat2{{0, -1}, {1, 0}}}) {
            const double off = pull_on_a_cracked_square(image, yield_stress) / force - 1;
            std::printf("yield stress %.1e Pa: force %.6g N, off by %+.1e\n", yield_stress, force, off);
            EXPECT_LT(std::abs(off), 1e-9);
        }
    }
}

// The tangent of cells that remember, layered ones and some that a crack cuts among them, against differences of their forces;
// and no force from turning.
TEST(GradientHistory, TangentAndTurningOfCells) {
    for (const Material& wood : {flowing(0.4e6, 1e6), relaxing(0.6, 0.5)})
        for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
            Scene scene = ring_specimen(3e-3, 0.8e-3);
            scene.cracks[0].points = {Vec2(2.1e-3, 3.3e-3), Vec2(6.7e-3, 8.1e-3)};
            scene.model.plane = plane;
            scene.materials["EW"] = wood;
            const StaticTrial run(at_equilibrium(scene));
            const Discretisation& body = run.body;
            const CrackFields& cracks = run.equilibrium.cracks();
            History history(run.materials, body, plane);
            const InternalForce internal(body, run.materials, true, &history);
            const int fields = cracks.fields();
            const auto forces = [&](const std::vector<Vec2>& u) {
                std::vector<Vec2> force(fields, Vec2::Zero());
                internal.add_with_energy(u, force);
                return force;
            };
            const auto place = [&](int f) { return body.layout.node_position(cracks.node_of_field[f]); };
            std::vector<Vec2> u(fields);
            for (int f = 0; f < fields; ++f) {
                const Vec2 x = place(f);
                u[f] = {0.06 * x.y() + 2.0 * x.x() * x.y(), 0.03 * x.y() - 3.0 * x.x() * x.x()};
            }
            history.go_to(0.3);
            const std::vector<Vec2> strained = forces(u);
            history.settle();
            // Turned by 90 degrees as a whole.
            history.go_to(0.3);
            Mat2 turn;
            turn << 0, -1, 1, 0;
            std::vector<Vec2> turned(fields);
            for (int f = 0; f < fields; ++f) turned[f] = turn * (place(f) + u[f]) - place(f);
            const std::vector<Vec2> after = forces(turned);
            double largest = 0.0, off = 0.0;
            for (int f = 0; f < fields; ++f) {
                largest = std::max(largest, strained[f].norm());
                off = std::max(off, (after[f] - turn * strained[f]).norm());
            }
            EXPECT_LT(off, 1e-9 * largest);
            // Further strain.
            history.go_to(0.7);
            for (Vec2& moved : u) moved *= 1.4;
            std::vector<Vec2> way(fields), more = u, less = u, slope(fields, Vec2::Zero());
            const double h = 1e-9;
            for (int f = 0; f < fields; ++f) {
                way[f] = {std::sin(7.0 * f), std::cos(11.0 * f)};
                more[f] += h * way[f];
                less[f] -= h * way[f];
            }
            forces(u);
            const auto take = [&](std::span<const int> of, const Eigen::Matrix<double, 8, 8>& tangent) {
                Eigen::Matrix<double, 8, 1> step;
                for (int k = 0; k < 4; ++k) step.segment<2>(2 * k) = way[of[k]];
                const Eigen::Matrix<double, 8, 1> change = tangent * step;
                for (int k = 0; k < 4; ++k) slope[of[k]] -= change.segment<2>(2 * k);
            };
            for (int c = 0; c < body.layout.cells(); ++c)
                for_groups(body.points, c, [&](const PointGroup& group) {
                    take(body.points.node[group.point[0]], internal.tangent(group, u, true));
                });
            for (const InternalForce::Alone& alone : internal.alone()) {
                Eigen::Matrix<double, 2, 8> apart;
                for (int k = 0; k < 4; ++k) apart.block<2, 2>(0, 2 * k) = crosswise_sign[k] * Mat2::Identity();
                take(alone.node, alone.stiffness * apart.transpose() * apart);
            }
            const std::vector<Vec2> above = forces(more), below = forces(less);
            double worst = 0.0, steepest = 0.0;
            for (int f = 0; f < fields; ++f) {
                steepest = std::max(steepest, slope[f].norm());
                worst = std::max(worst, ((above[f] - below[f]) / (2 * h) - slope[f]).norm());
            }
            worst /= steepest;
            std::printf("tangent off by %.1e\n", worst);
            EXPECT_LT(worst, 1e-6);
        }
}

// Layers that all flow at the same shear stress, without hardening, slide along their boundary: any way to share the slip is as
// good.
TEST(UnitHistory, LayersMayAllFlow) {
    Scene scene = ring_specimen(3e-3, 0.8e-3);
    scene.materials["EW"] = flowing(0.4e6, 0.0);
    scene.materials["LW"].plastic = Plasticity{0.4e6, 0.0};
    const MaterialMap materials(scene);
    const Discretisation body(scene, materials);
    History history(materials, body, scene.model.plane);
    for (int c = 0; c < body.layout.cells(); ++c) {
        const Vec2 n = body.wood_of_cell(materials, c).elasticity.normal;
        const Eigen::Vector3d slip(-n.x() * n.y(), n.x() * n.y(), n.x() * n.x() - n.y() * n.y());  // along the layers
        for (int k = 1; k <= 10; ++k) {
            history.go_to(0.1 * k);
            const PlaneResponse found = history.respond(body.points.first_of_cell[c], 0.01 * k * slip);
            ASSERT_TRUE(found.stress.allFinite() && found.tangent.allFinite());
            if (k > 8) {
                EXPECT_NEAR(found.stress.dot(slip), 0.4e6 / std::sqrt(3.0), 1.0);
            }
        }
    }
}

// At once the layers of a cell are as stiff as elastic wood is on average (Backus), and elastic cells have no history.
TEST(UnitHistory, LayersAreElasticAtOnce) {
    Scene scene = ring_specimen(3e-3, 0.25e-3);
    scene.materials["EW"] = relaxing(0.6, 0.5);
    const MaterialMap materials(scene);
    const Discretisation body(scene, materials);
    History history(materials, body, scene.model.plane);
    history.go_to(0.0);
    int remembering = 0;
    for (int c = 0; c < body.layout.cells(); ++c) {
        const bool has_earlywood =
            materials.shares(body.layout.cell_corner(c) + 0.5 * body.layout.cell, 0.5 * body.layout.cell)[0] > 0.0;
        EXPECT_EQ(history.is_in(c), has_earlywood);
        if (!history.is_in(c)) continue;
        ++remembering;
        const int p = body.points.first_of_cell[c];
        const Eigen::Matrix3d C = body.points.stiffness_of(p);
        const Eigen::Vector3d strain(0.01, -0.02, 0.03);
        const PlaneResponse found = history.respond(p, strain);
        EXPECT_LT((found.stress - C * strain).norm(), 1e-9 * C.norm() * strain.norm());
        EXPECT_LT((found.tangent - C).norm(), 1e-9 * C.norm());
    }
    EXPECT_GT(remembering, 0);
    EXPECT_LT(remembering, body.layout.cells());
}

// Of perfectly plastic wood between rough platens, no wider than high, the limit is the same (Hill 1950, ch. 9): it is reached
// only where points may flow without a change of volume, and else the load rises without end. The platens' corners leave an error
// of first order.
TEST(VerificationHistory, RoughBlockComesToItsLimit) {
    for (const double cell : {0.5e-3, 0.25e-3}) {
        Scene scene = at_rest({4e-3, 4e-3}, cell);
        scene.materials["EW"] = flowing(0.4e6, 0.0);
        scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0}), moving("top", Side::top, {0.0, -0.2e-3})};
        scene.measure = {"top", "top"};
        StaticTrial run(scene, false);
        double before = 0.0, after = 0.0;
        for (int k = 1; k <= 50; ++k) {
            ASSERT_TRUE(run.solve(0.02 * k));
            if (k == 40) before = -run.equilibrium.reactions()[1].y();
        }
        after = -run.equilibrium.reactions()[1].y();
        const double limit = 2 / std::sqrt(3.0) * 0.4e6 * 4e-3;
        std::printf("rough block, cell %g mm: limit off by %.1e, rises by %.1e over the last fifth\n", cell * 1e3,
                    after / limit - 1, after / before - 1);
        EXPECT_NEAR(after, limit, 0.05 * cell / 0.5e-3 * limit);
        EXPECT_LT(after / before - 1, 2e-3);
    }
}

// A cantilever of perfectly plastic wood comes to its plastic moment Y h^2 / 4 (2 / sqrt(3) of it in plane strain) at the grip,
// which keeps the wood beside it from flowing, so that the hinge lies some part of the height away from it.
TEST(VerificationHistory, CantileverComesToItsPlasticMoment) {
    const double L = 40e-3, h = 4e-3, Y = 0.4e6;
    for (const PlaneCondition plane : {PlaneCondition::stress, PlaneCondition::strain}) {
        Scene scene = at_rest({L, h}, 0.5e-3);
        scene.model.plane = plane;
        scene.materials["EW"] = flowing(Y, 0.0);
        scene.edges = {moving("left", Side::left, {0.0, 0.0}), without(moving("right", Side::right, {0.0, -6e-3}), 0)};
        scene.measure = {"right", "right"};
        StaticTrial run(scene, false);
        for (int k = 1; k <= 30; ++k) ASSERT_TRUE(run.solve(k / 30.0));
        const double moment = Y * h * h / 4 * (plane == PlaneCondition::strain ? 2 / std::sqrt(3.0) : 1.0);
        const double found = -run.equilibrium.reactions()[1].y() * L;
        std::printf("cantilever: moment at the grip %.4f of the plastic one\n", found / moment);
        EXPECT_NEAR(found / moment, 1.0, 0.5 * h / L);
    }
}

// Wood that cannot flow yet, or relaxes too slowly to be seen, is elastic wood, a crack included.
TEST(VerificationHistory, ComesToElasticWood) {
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        Scene scene = at_equilibrium(ring_specimen(3e-3, 0.5e-3));
        // Bands of one cell: elastic cells of two woods know where each lies.
        scene.specimen.rings = Rings{Vec2(-1000.0, 5e-3), 2e-3, 0.25, 0.0};
        scene.model.plane = plane;
        scene.edges[0].velocity[1] = 1e-4;
        scene.edges[0].until = 1.0;
        scene.stop.time = 1.0;
        scene.solver.extrapolate = false;
        const double elastic = simulate(scene).series.back().force;
        for (const Material& wood : {flowing(1e12, 0.0), relaxing(0.5, 1e9)}) {
            Scene other = scene;
            other.materials["EW"] = wood;
            other.solver.time_step = 0.25;
            const Record record = simulate(other);
            ASSERT_EQ(record.status, RunStatus::finished);
            // Cells that remember do not bend as freely as elastic ones; in plane strain those of plastic wood have one
            // dilatation each. Both make another error of the grid.
            const bool other_dilatation = wood.plastic && plane == PlaneCondition::strain;
            EXPECT_NEAR(record.series.back().force, elastic, (other_dilatation ? 1e-2 : 1e-3) * elastic);
            EXPECT_TRUE(std::isnan(record.series.back().G));  // not known in wood that remembers
        }
    }
}

// What stands for a tip, or for the end of a held stretch, within a cell relaxes as the wood does: with k = g all forces are
// those of elastic wood times the same function of time, wherever in a cell it lies.
TEST(VerificationHistory, TipsAndEndsWithinACellRelaxAsTheWood) {
    const double share = 0.95, tau = 1.0, ramp = 0.1, end = 20.0;
    const auto integral = [&](double t) { return t - share * (t + tau * std::expm1(-t / tau)); };
    const double left = (integral(end) - integral(end - ramp)) / ramp;
    const auto force_of = [&](const Material& wood, double tip, double stretch) {
        Scene scene = at_equilibrium(block({10e-3, 5e-3}, 0.5e-3));
        scene.materials["EW"] = wood;
        scene.edges = {moving("top", Side::top, {0.0, 1e-7}), moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.edges[0].until = ramp;
        if (stretch > 0.0) scene.edges[0].range = {{0.0, stretch}};
        if (tip > 0.0) {
            Crack crack;
            crack.points = {Vec2(0.0, 2.5e-3), Vec2(tip, 2.5e-3)};
            scene.cracks = {crack};
        }
        scene.measure = {"top", "top"};
        scene.stop.time = end;
        const Record record = simulate(scene);
        EXPECT_EQ(record.status, RunStatus::finished) << record.message;
        EXPECT_LT(record.worst_energy_imbalance, 0.01);
        return record.series.back().force;
    };
    for (const auto& [tip, stretch] : {std::pair{4e-3, 0.0},
                                       {4.1e-3, 0.0},
                                       {4.2e-3, 0.0},
                                       {4.3e-3, 0.0},
                                       {4.4e-3, 0.0},
                                       std::pair{0.0, 5e-3},
                                       {0.0, 5.15e-3},
                                       {0.0, 5.3e-3}}) {
        const double off =
            force_of(relaxing(share, tau), tip, stretch) / (left * force_of(relaxing(1e-9, 1e6), tip, stretch)) - 1;
        std::printf("%s at %.2f mm: relaxed force off by %+.2f %%\n", tip > 0.0 ? "tip" : "end of a stretch",
                    1e3 * (tip + stretch), 100 * off);
        EXPECT_LT(std::abs(off), 0.005);
    }
}

// Wood that relaxes within the run, but not while a tip passes a cell: a crack in motion takes up the toughness, later than in
// elastic wood, and the books close. Where nothing relaxes it is elastic wood.
TEST(VerificationHistory, CrackRunsThroughViscoelasticWood) {
    Scene scene = block({10e-3, 10e-3}, 0.4e-3);
    scene.edges = {moving("top", Side::top, {0.0, 1.0}), moving("bottom", Side::bottom, {0.0, 0.0})};
    Crack crack;
    crack.points = {Vec2(0, 5e-3), Vec2(2.5e-3, 5e-3)};
    crack.grows = Growth::end;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.solver.damping = 1e4;
    scene.stop.displacement = 0.25e-3;
    const auto first_growth = [](const Record& record) {
        return std::find_if(record.series.begin(), record.series.end(),
                            [&](const Instant& row) { return row.crack_length > 2.6e-3; })
            ->displacement;
    };
    const Record elastic = simulate(scene);
    scene.materials["EW"] = relaxing(1e-9, 1e6);
    const Record hardly = simulate(scene);
    scene.materials["EW"] = relaxing(0.5, 1e6);
    const Record slow = simulate(scene);
    EXPECT_NEAR(slow.series.back().crack_length, hardly.series.back().crack_length, 1e-6 * 5e-3);
    EXPECT_NEAR(slow.series.back().external_work, hardly.series.back().external_work, 1e-6 * hardly.series.back().external_work);
    // Cells that remember do not bend as freely as elastic ones, with 25 of them along a side.
    EXPECT_NEAR(slow.series.back().crack_length, elastic.series.back().crack_length, 0.05 * 5e-3);
    EXPECT_NEAR(slow.series.back().external_work, elastic.series.back().external_work,
                0.005 * elastic.series.back().external_work);
    scene.materials["EW"] = relaxing(0.5, 1e-3);
    const Record relaxed = simulate(scene);
    std::printf("first growth at %.4f mm in elastic wood, %.4f mm in viscoelastic; books off by %.1e\n",
                first_growth(elastic) * 1e3, first_growth(relaxed) * 1e3, relaxed.worst_energy_imbalance);
    EXPECT_GT(first_growth(relaxed), 1.005 * first_growth(elastic));
    EXPECT_LT(relaxed.worst_energy_imbalance, 0.01);
    const Instant& last = relaxed.series.back();
    EXPECT_NEAR(last.fracture_energy, 100.0 * (last.crack_length - 2.5e-3), 0.02 * last.fracture_energy);
    EXPECT_TRUE(std::isnan(last.G));
}

TEST(UnitHistory, SameBitsOnAnyNumberOfThreads) {
    for (const bool moves : {false, true}) {
        Scene scene = ring_specimen(3e-3, 0.2e-3);
        scene.materials["EW"] = flowing(0.1e6, 1e6);
        scene.stop.time = moves ? 1e-5 : 5e-5;
        if (!moves) {
            scene = at_equilibrium(scene);
            scene.solver.time_step = 2.5e-5;
        }
        const Record one = simulate(scene);
        const Record three = simulate(scene, {{}, nullptr, 3});
        ASSERT_EQ(one.series.size(), three.series.size());
        for (std::size_t k = 0; k < one.series.size(); ++k) {
            EXPECT_EQ(one.series[k].force, three.series[k].force);
            EXPECT_EQ(one.series[k].strain_energy, three.series[k].strain_energy);
        }
    }
}

}  // namespace
}  // namespace crampfit::test

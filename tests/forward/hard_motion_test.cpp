// Hard cases in motion: many turns, many steps, steps near the limit, impact, woods that hardly go together.
#include "tests/forward/hard_cases.hpp"
#include "tests/forward/scenes.hpp"

#include <fmt/format.h>

#include <numbers>

namespace crampfit::test {
namespace {

using std::numbers::pi;

// A square of earlywood, 10 x 10 mm, that nothing holds unless a test adds an edge.
Scene loose_square(double cell) {
    Scene scene = block({10e-3, 10e-3}, cell);
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.stop.time = 1.0;
    return scene;
}

/// A run that may overrule the plan.
struct Motion {
    Motion(const Scene& s, bool rotates, double step_over_limit = 0.0)
        : scene(s), materials(scene), body(scene, materials), plan(make_plan(scene, materials, body)) {
        plan.rotates = rotates;
        if (step_over_limit > 0.0) plan.time_step *= step_over_limit / 0.95;  // the plan's own part of the limit
        solver.emplace(scene, plan, materials, body);
    }
    double energy() const { return solver->energies().strain + solver->energies().kinetic; }
    void steps(int count) {
        for (int k = 0; k < count; ++k) solver->step();
    }

    Scene scene;
    MaterialMap materials;
    Discretisation body;
    Plan plan;
    std::optional<ExplicitSolver> solver;
};

TEST(HardTurning, ByNinetyDegreesAndByTenTurns) {
    for (const ShapeFunction shape : {ShapeFunction::gimp, ShapeFunction::bspline2}) {
        Scene scene = loose_square(1e-3);
        scene.solver.shape_function = shape;
        Motion run(scene, true);
        const Vec2 middle(5e-3, 5e-3);
        const double rate = 2 * pi * 400.0;  // [rad/s]; the corners move at 18 m/s
        run.solver->start([](const Vec2&) { return Vec2::Zero(); },
                          [&](const Vec2& x) { return Vec2(rate * left_of(x - middle)); });
        run.steps(1);
        const double at_start = run.energy();
        // The mean of the gradient over the square: how far it has turned, and how much it is stretched.
        const auto mean = [&] {
            Mat2 sum = Mat2::Zero();
            for (int p = 0; p < run.body.points.count(); ++p) sum += gradient_at(run.body, p, run.solver->displacements());
            return Polar(sum / run.body.points.count());
        };
        const char* name = shape == ShapeFunction::gimp ? "square that turns 400 times a second" : "the same, B-splines";
        double angle = 0.0, last = 0.0;
        // What turning really strains: rho w^2 r^2 / E at most, r to the corners, and as much again as it swings about that.
        const double centrifugal = 300.0 * rate * rate * 50e-6 / 40e6;
        bool quarter = false;
        while (angle < 20 * pi) {
            run.steps(1);
            const Mat2 turn = mean().turn;
            const double now = std::atan2(turn(1, 0), turn(0, 0));
            angle += std::remainder(now - last, 2 * pi);
            last = now;
            if (quarter || angle < 0.5 * pi) continue;
            quarter = true;
            hard_case(fmt::format("{}, 90 degrees", name), "energy kept", run.energy() / at_start - 1, 1e-4);
            hard_case(fmt::format("{}, 90 degrees", name), "stretch below the centrifugal bound",
                      (mean().stretch - Mat2::Identity()).norm(), centrifugal);
        }
        const double lasted = run.solver->time();
        hard_case(fmt::format("{}, 10 turns", name), "energy kept", run.energy() / at_start - 1, 1e-4);
        hard_case(fmt::format("{}, 10 turns", name), "stretch below the centrifugal bound",
                  (mean().stretch - Mat2::Identity()).norm(), centrifugal);
        hard_case(fmt::format("{}, 10 turns", name), "time of ten turns, longer by no more than the stretch",
                  lasted * rate / (20 * pi) - 1, 2 * centrifugal);
    }
}

// A square with a crack that is thrown together and sheared, so that its faces press, rub and part again; all of it turned by an
// angle to begin with.
struct Clashed {
    std::vector<Vec2> place;  // of the points, turned back [m]
    double G = 0.0;           // [J/m^2]
};

Clashed clash(const CrackFaces& faces, double angle, int steps, Growth grows) {
    Scene scene = loose_square(0.5e-3);
    Crack crack;
    crack.points = {Vec2(0.0, 5.1e-3), Vec2(6.2e-3, 5.4e-3)};
    crack.grows = grows;
    crack.direction = GrowthDirection::normal_to_opening;
    crack.faces = faces;
    scene.cracks = {crack};
    Motion run(scene, true);
    const Mat2 turn{{std::cos(angle), -std::sin(angle)}, {std::sin(angle), std::cos(angle)}};
    const Vec2 middle(5e-3, 5e-3);
    run.solver->start([&](const Vec2& x) { return Vec2(turn * (x - middle) - (x - middle)); },
                      [&](const Vec2& x) {
                          const double up = x.y() > 5.1e-3 + 0.3 / 6.2 * x.x() ? 1.0 : -1.0;
                          return Vec2(turn * Vec2(6.0 * up, -8.0 * up));
                      });
    Clashed clashed;
    for (int k = 0; k < steps; ++k) {
        run.solver->grow_cracks();
        run.steps(1);
    }
    clashed.G = run.solver->load_at(0, true).G;
    for (int p = 0; p < run.body.points.count(); ++p)
        clashed.place.push_back(turn.transpose() *
                                (run.body.points.position[p] + value_at(run.body, p, run.solver->displacements()) - middle));
    return clashed;
}

TEST(HardTurning, CracksThatCloseInATurnedSpecimen) {
    CrackFaces smooth, rough, sticking, bridged;
    rough.kind = CrackFaces::Kind::friction;
    rough.coefficient = 0.4;
    sticking.kind = CrackFaces::Kind::stick;
    bridged.bridging = Bridging{.stress = 0.1e6, .opening = 0.1e-3, .on_all_faces = true};
    const struct {
        const char* name;
        CrackFaces faces;
        int steps = 400;
        Growth grows = Growth::none;
    } cases[] = {{"smooth", smooth},
                 {"rough", rough},
                 {"sticking", sticking},
                 {"bridged", bridged},
                 {"smooth", smooth, 200, Growth::end}};  // later it runs out, with a snap that makes much of rounding
    for (const auto& [name, faces, steps, grows] : cases) {
        const Clashed upright = clash(faces, 0.0, steps, grows);
        for (const double angle : {30.0, 90.0, 135.0, 180.0}) {
            const Clashed turned = clash(faces, angle * pi / 180, steps, grows);
            double most = 0.0;
            for (std::size_t p = 0; p < turned.place.size(); ++p)
                most = std::max(most, (turned.place[p] - upright.place[p]).norm());
            const std::string what = fmt::format("{} crack with {} faces that close, at {:.0f} degrees",
                                                 grows == Growth::none ? "standing" : "growing", name, angle);
            hard_case(what, "places over the side, off those of the square upright", most / 10e-3, 1e-9);
            hard_case(what, "G, off that of the square upright", turned.G / upright.G - 1, 1e-9);
        }
    }
}

TEST(SlowHardRest, MillionStepsUnderLoad) {
    // Under a pull that has long been taken up: neither creep nor drift.
    Scene scene = loose_square(2.5e-3);
    scene.edges = {moving("floor", Side::bottom, {0.0, 0.0}), pulled("top", Side::top, {0.0, 1e5})};
    scene.measure = {"top", "top"};
    scene.solver.damping = 4e4;
    Motion run(scene, true);
    run.steps(100000);
    const std::vector<Vec2> then = run.solver->displacements();
    const EnergyBooks before = run.solver->energies();
    run.steps(1000000);
    const EnergyBooks after = run.solver->energies();
    double largest = 0.0, crept = 0.0;
    for (std::size_t n = 0; n < then.size(); ++n) {
        largest = std::max(largest, then[n].norm());
        crept = std::max(crept, (run.solver->displacements()[n] - then[n]).norm());
    }
    hard_case("a million steps at rest under load", "creep over the displacement", crept / largest, 1e-12);
    hard_case("a million steps at rest under load", "change of the strain energy", after.strain / before.strain - 1, 1e-12);
    hard_case("a million steps at rest under load", "work by then is strain energy and what damping took",
              (after.work - after.strain - after.damped) / after.work, 1e-4);
}

TEST(SlowHardRest, MillionStepsOfVibration) {
    Scene scene = loose_square(2.5e-3);
    scene.edges = {moving("floor", Side::bottom, {0.0, 0.0})};
    scene.measure = {"floor", "floor"};
    for (const bool rotates : {false, true}) {
        Motion run(scene, rotates);
        run.solver->start([](const Vec2&) { return Vec2::Zero(); }, [](const Vec2& x) { return Vec2(0.1 * x.y() / 10e-3, 0.0); });
        run.steps(1);
        const double at_start = run.energy();
        run.steps(1000000);
        hard_case(rotates ? "a million steps of vibration, finite rotation" : "a million steps of vibration", "energy kept",
                  run.energy() / at_start - 1, 1e-6);
    }
}

TEST(HardStep, NearTheLimit) {
    // Every frequency of the grid is excited; past the limit the highest would grow without bound within some hundred steps.
    for (const ShapeFunction shape : {ShapeFunction::gimp, ShapeFunction::bspline2}) {
        Scene scene = loose_square(1e-3);
        scene.solver.shape_function = shape;
        scene.specimen.cutouts = {Circle{{4e-3, 6e-3}, 1.7e-3}};
        Motion run(scene, false, 0.99);
        unsigned state = 1;
        const auto random = [&] {
            state = 1664525u * state + 1013904223u;
            return state / 4294967296.0 - 0.5;
        };
        run.solver->start([](const Vec2&) { return Vec2::Zero(); }, [&](const Vec2&) { return Vec2(random(), random()); });
        run.steps(1);
        const double at_start = run.energy();
        run.steps(20000);
        hard_case(shape == ShapeFunction::gimp ? "0.99 of the time step's limit, 20000 steps" : "the same, B-splines",
                  "energy kept", run.energy() / at_start - 1, 1e-9);
    }
}

TEST(SlowHardCrossing, HundredThousandSteps) {
    // The bar of REFERENCES so hard that its end crosses a dozen cells each way, for 10^5 steps.
    Scene scene = block({25.0, 0.5}, 0.5);
    scene.materials["EW"] = {100.0, 0.0, 1.0, 100.0};
    scene.edges = {without(moving("left", Side::left, {0.0, 0.0}), 1), without(moving("top", Side::top, {0.0, 0.0}), 0),
                   without(moving("bottom", Side::bottom, {0.0, 0.0}), 0)};
    scene.measure = {"left", "left"};
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.stop.time = 1.0;
    Motion run(scene, true);
    run.solver->start([](const Vec2&) { return Vec2::Zero(); },
                      [](const Vec2& x) { return Vec2(4.0 * std::sin(pi * x.x() / 50.0), 0.0); });
    run.steps(1);
    const double at_start = run.energy();
    double most = 0.0;
    for (int k = 0; k < 100; ++k) {
        run.steps(1000);
        for (const Vec2& u : run.solver->displacements()) most = std::max(most, u.x());
    }
    std::printf("   the bar's end moves by up to %.1f cells\n", most / 0.5);
    EXPECT_GT(most, 12 * 0.5);
    hard_case("a point that crosses cells for 100000 steps", "energy kept", run.energy() / at_start - 1, 1e-6);
}

// A tip that turns by two thirds of a right angle at once has less of the way past a pair than before.
TEST(HardTurning, ATipTurnsAwayFromPairsThatItHasBegunToFree) {
    Scene scene = at_motion(block({11.34e-3, 10.96e-3}, 0.226e-3));
    scene.model.thickness = 5e-3;
    scene.edges = {moving("top", Side::top, {0.3, 1.0}), moving("bottom", Side::bottom, {0.0, 0.0})};
    Crack crack;
    crack.points = {Vec2(3.781e-3, 7.95e-3), Vec2(5.105e-3, 5.479e-3)};
    crack.grows = Growth::start;
    crack.faces.kind = CrackFaces::Kind::stick;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.stop.displacement = 0.5e-3;
    const Record record = simulate(scene);
    std::printf("crack of %.2f to %.2f mm: %s\n", 1e3 * record.series.front().crack_length,
                1e3 * record.series.back().crack_length, record.message.c_str());
    EXPECT_NE(record.status, RunStatus::unstable) << record.message;
    EXPECT_GT(record.series.back().crack_length, record.series.front().crack_length);
    EXPECT_LT(record.worst_energy_imbalance, 0.01);
}

TEST(HardImpact, AtTwentyMetresASecond) {
    // Behind a plane wave, stress = rho c v (Biot's strain without rotation: at any amplitude); here 5 % of strain at one blow.
    Scene scene = block({50e-3, 1e-3}, 0.25e-3);
    scene.edges = {without(moving("right", Side::right, {20.0, 0.0}), 1), without(moving("top", Side::top, {0.0, 0.0}), 0),
                   without(moving("bottom", Side::bottom, {0.0, 0.0}), 0)};
    scene.measure = {"right", "right"};
    const double c = std::sqrt(40e6 * 0.67 / (1.33 * 0.34) / 300.0);
    scene.stop.time = 40e-3 / c;
    const Record record = simulate(scene);
    double sum = 0.0;
    int count = 0;
    for (const Instant& row : record.series)
        if (row.time > 0.3 * *scene.stop.time) {
            sum += row.force;
            ++count;
        }
    const double exact = 300.0 * c * 20.0 * 1e-3 * scene.model.thickness;
    hard_case("impact at 20 m/s", "mean force behind the front is rho c v A", sum / count / exact - 1, 0.005);
    hard_case("impact at 20 m/s", "energy books", record.worst_energy_imbalance, 0.01);
}

TEST(HardContrast, WaveComesOutOfWoodAThousandTimesStiffer) {
    // A plane wave in latewood meets earlywood a thousandth as stiff, which then moves at 2 Z / (Z + Z_earlywood) times the speed
    // of the wood behind the wave, Z = rho c (Graff 1975, chapter 2). The rings' pith is so far away that the boundary is
    // straight.
    const double length = 50e-3, v = 1.0;
    Scene scene = block({length, 1e-3}, 0.25e-3);
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(-50.0 - 0.5 * length, 0.0), length, 0.5, 0.0};
    scene.materials["EW"] = {40e6, 0.0, 300.0, 100.0};
    scene.materials["LW"] = {40e9, 0.0, 300.0, 100.0};
    scene.edges = {without(moving("left", Side::left, {v, 0.0}), 1)};
    scene.measure = {"left", "left"};
    const double slow = std::sqrt(40e6 / 300.0), fast = std::sqrt(40e9 / 300.0), way = 0.5 * length / fast;
    scene.stop.time = 2.8 * way;  // the wave is back after three ways
    Motion run(scene, false);
    double sum = 0.0;
    int count = 0;
    while (run.solver->time() < *scene.stop.time) {
        run.steps(1);
        if (run.solver->time() < 1.4 * way) continue;
        for (int n = 0; n < run.body.layout.nodes(); ++n)
            if (std::abs(run.body.layout.node_position(n).x() - 0.5 * length) < 1e-6) {
                sum += run.solver->velocities()[n].x();
                ++count;
            }
    }
    const double exact = 2 * fast / (fast + slow) * v;
    hard_case("contrast 1000 in motion", "speed of the boundary behind a plane wave", sum / count / exact - 1, 0.01);
    const EnergyBooks books = run.solver->energies();
    hard_case("contrast 1000 in motion", "energy books", (books.work - books.strain - books.kinetic) / books.work, 0.01);
}

}  // namespace
}  // namespace crampfit::test

// In motion: energy books where a scene makes them hard, and forces and rows as they should be.
#include "datasets/error.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

namespace crampfit::test {
namespace {

constexpr double closed = 0.01;  // energy books, of the largest energy: as asked of every scene

// A bar along x of E = 40 MPa without Poisson's effect, 300 kg/m^3.
Scene bar(double length, double cell) {
    Scene scene = block({length, 2e-3}, cell);
    scene.model.plane = PlaneCondition::stress;
    scene.materials["EW"].poisson_ratio = 0.0;
    return scene;
}
const double bar_wave = std::sqrt(40e6 / 300.0);  // [m/s]

// A crack that is torn from the left side across, 20 J/m^2.
Scene torn(StressUpdate stresses) {
    Scene scene = block({10e-3, 12e-3}, 0.25e-3);
    scene.materials["EW"].toughness = 20.0;
    scene.edges = {moving("top", Side::top, {0.5, 1.0}), moving("bottom", Side::bottom, {0.0, 0.0})};
    Crack crack;
    crack.points = {Vec2(0, 6.1e-3), Vec2(3e-3, 6.1e-3)};
    crack.grows = Growth::end;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.solver.stress_update = stresses;
    scene.stop.time = 0.3e-3;
    return scene;
}

TEST(VerificationBooks, CloseForEachStressUpdateAsACrackGrows) {
    for (const StressUpdate stresses : {StressUpdate::first, StressUpdate::average, StressUpdate::last}) {
        const Record record = simulate(torn(stresses));
        std::printf("stresses updated %s: books %.4f, crack %.2f mm\n",
                    stresses == StressUpdate::first  ? "first"
                    : stresses == StressUpdate::last ? "last"
                                                     : "on average",
                    record.worst_energy_imbalance, 1e3 * record.series.back().crack_length);
        EXPECT_GT(record.series.back().crack_length, 8e-3);
        EXPECT_LT(record.worst_energy_imbalance, closed);
    }
}

// A wave of pressure goes through a closed crack as through whole wood, and the faces take nothing.
TEST(VerificationBooks, CloseAcrossAClosedCrackForEachVelocityUpdate) {
    for (const auto& [update, order] : {std::pair{VelocityUpdate::automatic, 1},
                                        {VelocityUpdate::fmpm, 2},
                                        {VelocityUpdate::fmpm, 4},
                                        {VelocityUpdate::pic, 1}}) {
        Scene scene = bar(40e-3, 0.5e-3);
        scene.edges = {without(moving("left", Side::left, {0.1, 0.0}), 1), without(moving("right", Side::right, {0.0, 0.0}), 1)};
        Crack crack;
        crack.points = {Vec2(20.1e-3, 0), Vec2(20.1e-3, 2e-3)};
        scene.cracks = {crack};
        scene.measure = {"right", "left"};
        scene.solver.velocity_update = update;
        scene.solver.order = order;
        scene.stop.time = 80e-3 / bar_wave;
        const Record record = simulate(scene);
        double mean = 0.0;
        int count = 0;
        for (const Instant& row : record.series)
            if (row.time > 50e-3 / bar_wave) mean += row.force, ++count;
        const double expected = -2.0 * 300.0 * bar_wave * 0.1 * 2e-3;
        std::printf("closed crack, update %d, order %d: books %.4f, force behind the wave %.3f of a bar's\n",
                    static_cast<int>(update), order, record.worst_energy_imbalance, mean / count / std::abs(expected));
        EXPECT_NEAR(std::abs(mean / count), std::abs(expected), 0.02 * std::abs(expected));
        EXPECT_LT(record.worst_energy_imbalance, closed);
    }
}

// A plate pressed slowly on a block: what its work has become is in the columns, contact's springs included.
TEST(VerificationBooks, ColumnsHoldTheWorkOfAPressingBody) {
    Scene scene = block({10e-3, 10e-3}, 1e-3);
    scene.edges = {without(moving("bottom", Side::bottom, {0.0, 0.0}), 0)};
    Body plate;
    plate.name = "plate";
    plate.shape = Polygon{{Vec2(-2e-3, 10e-3), Vec2(12e-3, 10e-3), Vec2(12e-3, 12e-3), Vec2(-2e-3, 12e-3)}};
    plate.velocity = {0.0, -0.05};
    scene.bodies = {plate};
    scene.measure = {"plate", "plate"};
    scene.stop.displacement = 0.1e-3;
    const Record record = simulate(at_motion(scene));
    const Instant& end = record.series.back();
    std::printf("plate on a block: %.4f of the work in the columns\n",
                (end.strain_energy + end.kinetic_energy + end.fracture_energy) / end.external_work);
    EXPECT_NEAR((end.strain_energy + end.kinetic_energy + end.fracture_energy) / end.external_work, 1.0, closed);
}

TEST(VerificationBooks, ALoadThatStaysWasLaidOnSlowly) {
    // Clapeyron (1833): it does half of what it would do from the first at its full size.
    Scene scene = at_equilibrium(block({10e-3, 10e-3}, 1e-3));
    scene.edges = {pulled("top", Side::top, {0.0, 1e5}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.measure = {"top", "top"};
    scene.stop.time = 1.0;
    const auto end = simulate(scene).series.back();
    EXPECT_GT(end.strain_energy, 0.0);
    EXPECT_NEAR(end.external_work, end.strain_energy, 1e-9 * end.strain_energy);
}

// Two cracks that start in a hole and leave the specimen: the tips take up the toughness times their way.
TEST(VerificationBooks, CracksOutOfAHolePayForTheirWay) {
    Scene scene = block({10e-3, 10e-3}, 0.25e-3);
    scene.materials["EW"].toughness = 20.0;
    scene.specimen.cutouts = {Circle{Vec2(5e-3, 5e-3), 1e-3}};
    scene.edges = {moving("top", Side::top, {0.0, 1.0}), moving("bottom", Side::bottom, {0.0, 0.0})};
    double drawn = 0.0;
    for (const double side : {1.0, -1.0}) {
        Crack crack;
        crack.points = {Vec2(5e-3 + side * 0.5e-3, 5.1e-3), Vec2(5e-3 + side * 1.6e-3, 5.1e-3)};
        crack.grows = Growth::end;
        crack.direction = GrowthDirection::straight;
        scene.cracks.push_back(crack);
        drawn += 1.6e-3;
    }
    scene.measure = {"top", "top"};
    scene.stop.time = 0.3e-3;
    const Record record = simulate(scene);
    const double spent = record.series.back().fracture_energy / (20.0 * (10e-3 - drawn));
    std::printf("cracks out of a hole: fracture energy %.3f of toughness times area, books %.4f\n", spent,
                record.worst_energy_imbalance);
    EXPECT_EQ(record.status, RunStatus::split);
    EXPECT_NEAR(spent, 1.0, 0.05);  // a tip that waves hold back takes up more
    EXPECT_LT(record.worst_energy_imbalance, closed);
}

// Edge cracks askew to the grid that turn as soon as they grow, by up to 70 degrees: what the turn does to the pairs that the tip
// is passing is neither gained nor lost.
TEST(VerificationBooks, ATipThatTurnsPaysForItsWay) {
    double least = 2.0, most = 0.0;
    for (const double angle : {-70.0, -60.0, -44.0, -30.0, 30.0}) {
        for (const double shear : {0.0, 1.0}) {
            Scene scene = block({7e-3, 7e-3}, 0.25e-3);
            scene.materials["EW"].toughness = 100.0;
            scene.edges = {moving("top", Side::top, {2.0 * shear, 2.0}), moving("bottom", Side::bottom, {0.0, 0.0})};
            Crack crack;
            crack.points = {Vec2(0.0, 3.6e-3), Vec2(2e-3 * std::cos(angle * degree), 3.6e-3 + 2e-3 * std::sin(angle * degree))};
            crack.grows = Growth::end;
            crack.direction = GrowthDirection::hoop_stress;
            scene.cracks = {crack};
            scene.measure = {"top", "top"};
            scene.stop.displacement = 0.4e-3;
            const Record record = simulate(scene);
            const Instant& end = record.series.back();
            const double way = end.crack_length - 2e-3;
            const double spent = end.fracture_energy / (100.0 * scene.model.thickness * way);
            std::printf("crack at %+.0f degrees, shear %.0f: %.2f mm, fracture energy %.3f of toughness times area\n", angle,
                        shear, 1e3 * way, spent);
            least = std::min(least, spent);
            most = std::max(most, spent);
            EXPECT_GT(way, 1e-3);
        }
    }
    EXPECT_GT(least, 0.99);
    EXPECT_LT(most, 1.06);  // a tip that waves hold back takes up more
}

// Two equal squares whose corners lie on one line: nothing before they touch, then they change their velocities.
TEST(VerificationBooks, PartsOfOneHeightMeetWhereTheyMeet) {
    constexpr double speed = 0.4, gap = 0.5e-3, side = 10e-3;
    Scene scene = block({40e-3, 14e-3}, 0.5e-3);
    const auto square = [](double x) {
        return Polygon{{Vec2(x, 2e-3), Vec2(x + side, 2e-3), Vec2(x + side, 2e-3 + side), Vec2(x, 2e-3 + side)}};
    };
    scene.specimen.parts = {Part{square(2e-3), Vec2(speed, 0.0)}, Part{square(12e-3 + gap), Vec2::Zero()}};
    scene.stop.time = gap / speed;
    Trial run(scene);
    const double start = run.solver.energies().kinetic;
    run.until(0.9 * gap / speed);
    EXPECT_NEAR(run.solver.energies().kinetic, start, 1e-9 * start);
    run.until(gap / speed + 4.0 * side / bar_wave);
    const EnergyBooks books = run.solver.energies();
    std::printf("squares of one height: %.3f of the energy after the impact\n", (books.kinetic + books.strain) / start);
    EXPECT_NEAR((books.kinetic + books.strain + books.contact) / start, 1.0, closed);
}

// A rigid punch at v against a bar's end: stress = rho c v, however fast it comes.
TEST(VerificationBooks, AFastBodyIsMetInTime) {
    for (const double v : {5.0, 25.0}) {
        Scene scene = bar(20e-3, 0.25e-3);
        scene.edges = {without(moving("left", Side::left, {0.0, 0.0}), 1)};
        const double x = 20.52e-3;
        Body punch;
        punch.name = "punch";
        punch.shape = Polygon{{Vec2(x, -1e-3), Vec2(x + 4e-3, -1e-3), Vec2(x + 4e-3, 3e-3), Vec2(x, 3e-3)}};
        punch.velocity = {-v, 0.0};
        scene.bodies = {punch};
        scene.measure = {"punch", "punch"};
        scene.solver.strain = StrainMeasure::small;
        const double touch = 0.52e-3 / v;
        scene.stop.time = touch + 14e-3 / bar_wave;
        scene.output.samples = 200;
        const Record record = simulate(scene);
        double mean = 0.0;
        int count = 0;
        for (const Instant& row : record.series)
            if (row.time > touch + 4e-3 / bar_wave) mean += row.force, ++count;
        const double expected = 300.0 * bar_wave * v * 2e-3;
        std::printf("punch at %.0f m/s: force %.3f of rho c v, books %.4f\n", v, mean / count / expected,
                    record.worst_energy_imbalance);
        EXPECT_NEAR(mean / count, expected, 0.03 * expected);
        EXPECT_LT(record.worst_energy_imbalance, closed);
    }
}

// G of a tip that runs does not hang on how fast the specimen goes as a whole.
TEST(VerificationBooks, GDoesNotHangOnTheFrame) {
    const auto rates = [](double speed) {
        Scene scene = torn(StressUpdate::last);
        for (Edge& edge : scene.edges) edge.velocity[0] = *edge.velocity[0] + speed;
        scene.specimen.parts = {Part{Polygon{{Vec2(0, 0), Vec2(10e-3, 0), Vec2(10e-3, 12e-3), Vec2(0, 12e-3)}}, Vec2(speed, 0)}};
        return simulate(scene);
    };
    const Record rest = rates(0.0), moving = rates(13.0);
    ASSERT_EQ(rest.series.size(), moving.series.size());
    double most = 0.0, off = 0.0;
    for (std::size_t i = 0; i < rest.series.size(); ++i) {
        most = std::max(most, rest.series[i].G);
        off = std::max(off, std::abs(moving.series[i].G - rest.series[i].G));
    }
    std::printf("G in a frame at 13 m/s: off by %.1e of the largest\n", off / most);
    EXPECT_LT(off, 1e-6 * most);
}

// Rows hold the force of their own displacement: a bar drawn slowly follows E A / L at ten rows as at a thousand.
TEST(VerificationRows, ForceBelongsToItsDisplacement) {
    Scene scene = bar(10e-3, 0.5e-3);
    scene.edges = {without(moving("right", Side::right, {0.01, 0.0}), 1), without(moving("left", Side::left, {0.0, 0.0}), 1)};
    scene.measure = {"right", "right"};
    scene.solver.damping = 2e4;
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.stop.displacement = 0.1e-3;
    scene.output.samples = 10;
    const Record record = simulate(scene);
    for (std::size_t i = 2; i + 1 < record.series.size(); ++i) {
        const double exact = 40e6 * 2e-3 / 10e-3 * record.series[i].displacement;
        EXPECT_NEAR(record.series[i].force, exact, 0.005 * exact) << i;
    }
}

// A time that only guards does not thin the rows out.
TEST(UnitRows, AGuardingTimeCostsNone) {
    Scene scene = at_motion(torn(StressUpdate::last));
    scene.stop.crack_length = 8e-3;
    std::size_t rows[2];
    for (const int k : {0, 1}) {
        scene.stop.time = k == 0 ? 0.3e-3 : 1.0;
        rows[k] = simulate(scene).series.size();
    }
    EXPECT_EQ(rows[0], rows[1]);
    EXPECT_GT(rows[0], 100u);
}

TEST(UnitPlan, RunsThatNeverEndAreRefused) {
    Scene scene = bar(10e-3, 0.5e-3);
    scene.edges = {without(moving("right", Side::right, {1.0, 0.0}), 1), without(moving("left", Side::left, {0.0, 0.0}), 1)};
    scene.measure = {"right", "right"};
    scene.stop.displacement = 0.1e-3;
    EXPECT_NO_THROW(explain(scene));
    scene.edges[0].until = 0.05e-3;
    EXPECT_THROW(explain(scene), InputError);
    scene.edges[0].until.reset();
    scene.measure.displacement = "left";
    EXPECT_THROW(explain(scene), InputError);
    scene.stop.time = 1e-3;
    EXPECT_NO_THROW(explain(scene));
    scene.edges.push_back(without(moving("again", Side::right, {-1.0, 0.0}), 1));  // holds nothing
    EXPECT_THROW(simulate(scene), InputError);
}

// An edge that stops on the way to the displacement at which the run would end: time ends it.
TEST(UnitPlan, AnEdgeThatStopsEndsNoRunByItsDisplacement) {
    Scene scene = bar(10e-3, 0.5e-3);
    scene.edges = {moving("right", Side::right, {0.05, 0.0}), moving("left", Side::left, {0.0, 0.0})};
    scene.edges[0].until = 1e-3;
    scene.measure = {"right", "right"};
    scene.stop.displacement = 0.1e-3;
    scene.stop.time = 3e-3;
    for (const SolverKind kind : {SolverKind::quasistatic, SolverKind::explicit_dynamics}) {
        scene.solver.kind = kind;
        const Instant last = simulate(scene).series.back();
        EXPECT_NEAR(last.time, 3e-3, 1e-6);
        EXPECT_NEAR(last.displacement, 0.05e-3, 1e-12);
    }
}

TEST(UnitRecord, SaysThatACrackGrowsAlongsideAHeldSide) {
    for (const double height : {0.15e-3, 0.35e-3}) {   // less than a cell of 0.2 mm, and more
        for (const double grown : {0.1e-3, 0.5e-3}) {  // what is drawn there does not count
            const double drawn = 3e-3;
            Scene scene = at_equilibrium(block({6e-3, 4e-3}, 0.2e-3));
            scene.edges = {moving("grip", Side::top, {0.0, 1e-5}), moving("bed", Side::bottom, {0.0, 0.0})};
            Crack crack;
            crack.points = {Vec2(0.0, height), Vec2(drawn, height)};
            crack.grows = Growth::end;
            crack.direction = GrowthDirection::straight;
            scene.cracks = {crack};
            scene.measure = {"grip", "grip"};
            scene.stop.crack_length = drawn + grown;
            const std::string message = simulate(scene).message;
            EXPECT_EQ(message.find("within a cell of edge \"bed\"") != std::string::npos, height < 0.2e-3 && grown > 0.2e-3)
                << message;
        }
    }
}

// A cantilever that a traction bends far: small strain, which nothing prescribed speaks against, is told of; finite rotation is
// not.
TEST(UnitRecord, SaysThatWoodHasTurnedFarForSmallStrain) {
    Scene scene = bar(20e-3, 0.5e-3);
    Edge end = pulled("right", Side::right, {0.0, 20e3});
    scene.edges = {moving("left", Side::left, {0.0, 0.0}), end};
    scene.measure = {"left", "right"};
    scene.stop.time = 5e-3;
    for (const SolverKind kind : {SolverKind::explicit_dynamics, SolverKind::quasistatic}) {
        scene.solver.kind = kind;
        scene.solver.strain = StrainMeasure::automatic;
        EXPECT_NE(simulate(scene).message.find("a tenth of the wood has turned"), std::string::npos);
        scene.solver.strain = StrainMeasure::finite_rotation;
        EXPECT_EQ(simulate(scene).message.find("turned"), std::string::npos);
    }
}

// A wheel's force rises otherwise than its way: the work is that of all equilibria, not of the rows (8.8 % too much by one row).
TEST(VerificationBooks, OfAWheelAtEquilibriumWithHardlyARow) {
    for (const int samples : {1, 4, 1000}) {
        Scene scene = at_equilibrium(block({20e-3, 10e-3}, 0.5e-3));
        Body wheel;
        wheel.name = "wheel";
        wheel.shape = Circle{Vec2(10.1e-3, 14e-3), 4e-3};
        wheel.velocity = {0.0, -1e-3 / 60};
        scene.bodies = {wheel};
        scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.measure = {"wheel", "wheel"};
        scene.stop.displacement = 0.5e-3;
        scene.output.samples = samples;
        const Instant last = simulate(scene).series.back();
        std::printf("%d rows: work over strain energy %+.5f %%\n", samples, 100 * (last.external_work / last.strain_energy - 1));
        EXPECT_NEAR(last.external_work / last.strain_energy, 1.0, 1e-3);
    }
}

// At equilibrium: the work of an edge that stops is what the specimen keeps.
TEST(VerificationBooks, AnEdgeThatStopsHasDoneItsWork) {
    Scene scene = at_rest({10e-3, 12e-3}, 0.5e-3);
    scene.edges = {moving("top", Side::top, {0.0, 0.05}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.edges[0].until = 1.03e-3;
    scene.measure = {"top", "top"};
    scene.stop.time = 3e-3;
    const Record record = simulate(scene);
    const Instant& last = record.series.back();
    EXPECT_GT(last.strain_energy, 0.0);
    EXPECT_NEAR(last.external_work, last.strain_energy, 1e-9 * last.strain_energy);
    EXPECT_LT(record.worst_energy_imbalance, 1e-9);
}

// The same where closed faces rub: what they have not taken is kept, and the hold asks for no further equilibria.
TEST(VerificationBooks, AnEdgeThatStopsOverFacesThatRub) {
    Scene scene = at_rest({10e-3, 12e-3}, 0.5e-3);
    scene.edges = {moving("top", Side::top, {0.0, -0.05}), moving("bottom", Side::bottom, {0.0, 0.0})};
    Crack crack;
    crack.points = {Vec2(3e-3, 4e-3), Vec2(7e-3, 8e-3)};
    crack.faces.kind = CrackFaces::Kind::friction;
    crack.faces.coefficient = 0.3;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.stop.time = 1e-3;
    const Record loaded = simulate(scene);
    scene.edges[0].until = 1e-3;
    scene.stop.time = 3e-3;
    const Record held = simulate(scene);
    EXPECT_EQ(held.status, RunStatus::finished);
    EXPECT_LE(held.steps, loaded.steps);
    EXPECT_NEAR(held.series.back().force, loaded.series.back().force, 1e-9 * std::abs(loaded.series.back().force));
    EXPECT_NEAR(held.series.back().external_work, loaded.series.back().external_work, 1e-3 * loaded.series.back().external_work);
}

// What drag takes on faces that are pressed together is that of how they go, not of how they would go alone.
TEST(VerificationBooks, DragOnClosedFaces) {
    Scene scene = block({11e-3, 13e-3}, 0.5e-3);
    scene.edges = {moving("top", Side::top, {0.0, -0.4}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.edges[0].until = 0.5e-3;
    Crack crack;
    crack.points = {Vec2(0.0, 6.53e-3), Vec2(11e-3, 6.53e-3)};
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.solver.damping = 2e4;
    scene.stop.time = 2e-3;
    const Record record = simulate(scene);
    std::printf("drag on closed faces: books %.5f\n", record.worst_energy_imbalance);
    EXPECT_LT(record.worst_energy_imbalance, 1e-3);
}

// Facets of a block that shoots through between rough plates come and go from step to step.
TEST(VerificationBooks, FrictionThatBeginsAndEndsWithinSteps) {
    Scene scene = block({60e-3, 10e-3}, 0.5e-3);
    Part part;
    part.shape = Polygon{{{10e-3, 2.5e-3}, {25e-3, 2.5e-3}, {25e-3, 7.5e-3}, {10e-3, 7.5e-3}}};
    part.velocity = {20.0, 0.0};
    scene.specimen.parts = {part};
    const auto plate = [](const char* name, double low, double high, double down) {
        Body body;
        body.name = name;
        body.shape = Polygon{{{-50e-3, low}, {150e-3, low}, {150e-3, high}, {-50e-3, high}}};
        body.velocity = Vec2(0.0, -down);
        body.contact = {Contact::Kind::friction, 0.4};
        return body;
    };
    scene.bodies = {plate("low", -2e-3, 2.5e-3, 0.0), plate("top", 7.5e-3, 12e-3, 0.01)};
    scene.measure = {"top", "top"};
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.stop.time = 3e-3;
    const Record record = simulate(scene);
    std::printf("a block between rough plates: books %.4f\n", record.worst_energy_imbalance);
    EXPECT_LT(record.worst_energy_imbalance, closed);
}

// Points that an outline leaves little of may be alone on their nodes.
TEST(VerificationBooks, TrimmedPointsOfSmallDomainsStayCalm) {
    for (const int points : {4, 9, 16, 25}) {
        for (const double past : {0.01e-3, 0.02e-3, 0.03e-3, 0.04e-3}) {
            Scene scene = block({6e-3, 6e-3}, 0.4e-3);
            scene.model.points_per_cell = points;
            const double edge = 4.8e-3 + past;
            scene.specimen.cutouts = {Polygon{{{edge, 0}, {6e-3, 0}, {6e-3, 6e-3}, {0, 6e-3}, {0, edge}, {edge, edge}}}};
            scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0}), without(moving("left", Side::left, {0.1, 0.0}), 1)};
            scene.measure = {"bottom", "left"};
            scene.solver.kind = SolverKind::explicit_dynamics;
            scene.stop.time = 0.5e-3;
            const Record record = simulate(scene);
            EXPECT_EQ(record.status, RunStatus::finished) << points << " " << past;
            EXPECT_LT(record.worst_energy_imbalance, closed) << points << " " << past;
        }
    }
}

}  // namespace
}  // namespace crampfit::test

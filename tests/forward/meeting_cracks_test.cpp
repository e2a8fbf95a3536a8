// Cracks that meet edges, holes, corners and each other: what is cut free carries nothing, and what is left carries as if it were
// alone.
#include "forward/cracks.hpp"
#include "forward/simulate.hpp"
#include "tests/forward/cracked_plates.hpp"
#include "tests/forward/hard_cases.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

namespace crampfit::test {
namespace {

constexpr double mm_per_minute = 1e-3 / 60.0;

Crack line(Vec2 from, Vec2 to, Growth grows = Growth::none) {
    Crack crack;
    crack.points = {1e-3 * from, 1e-3 * to};
    crack.grows = grows;
    crack.direction = GrowthDirection::straight;
    crack.advance = grows == Growth::none ? 0.0 : 2e-3;
    return crack;
}

// 20 x 20 mm, drawn apart by its upper and lower side.
Scene square(std::vector<Crack> cracks) {
    Scene scene = at_equilibrium(block({20e-3, 20e-3}, 1e-3));
    scene.materials["EW"].toughness = 0.1;
    scene.edges = {moving("top", Side::top, {0.0, mm_per_minute}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.cracks = std::move(cracks);
    scene.measure = {"top", "top"};
    scene.stop.displacement = 3e-3;
    return scene;
}

double stiffness_at_the_end(const Record& record) { return record.series.back().force / record.series.back().displacement; }

// All tips have left what still carries load, and the run has gone on to its stop.
bool carried_on(const Record& record, const Scene& scene) {
    return record.status == RunStatus::finished && record.message.find("every growing crack tip") != std::string::npos &&
           std::abs(record.series.back().displacement / *scene.stop.displacement - 1) < 0.01;
}

// The same without the lower left block that the cracks cut free.
double stiffness_without_the_block(std::optional<std::pair<double, double>> held) {
    Scene scene = square({});
    scene.specimen.cutouts = {Polygon{{{-1e-3, -1e-3}, {8e-3, -1e-3}, {8e-3, 10e-3}, {-1e-3, 10e-3}}}};
    scene.edges[1].range = held;
    scene.stop.displacement = 1e-5;
    return stiffness_at_the_end(simulate(scene));
}

TEST(HardMeeting, ACrackThatRunsIntoAnotherCutsABlockFree) {
    for (const bool held : {true, false}) {
        const std::optional<std::pair<double, double>> range = held ? std::nullopt : std::optional(std::pair{7.9e-3, 20e-3});
        const double exact = stiffness_without_the_block(range);
        for (const double lift : {0.0, 1e-6, 0.4}) {  // of the crack that grows [mm]; on a grid line and off it
            if (lift == 0.4 && !held) continue;
            Scene scene = square({line({0, 10 + lift}, {4, 10 + lift}, Growth::end), line({8, 0}, {8, 13})});
            scene.edges[1].range = range;
            const Record record = simulate(scene);
            const std::string name = fmt::format("T-junction, {} mm off a grid line, block {}", lift, held ? "held" : "loose");
            EXPECT_TRUE(carried_on(record, scene)) << record.message;
            EXPECT_NEAR(record.series.back().tip.x(), 8e-3, 1e-9);
            // What the block leaves has a slit of 3 mm above it, which a cutout of the block has not.
            Scene alone = scene;
            alone.cracks = {line({8, 10 + lift}, {8, 13})};
            alone.specimen.cutouts = {
                Polygon{{{-1e-3, -1e-3}, {8e-3, -1e-3}, {8e-3, (10 + lift) * 1e-3}, {-1e-3, (10 + lift) * 1e-3}}}};
            alone.edges[1].range = {{7.9e-3, 20e-3}};
            alone.stop.displacement = 1e-5;
            const double left = stiffness_at_the_end(simulate(alone));
            hard_case(name, "carries as the specimen without the block, with a slit", stiffness_at_the_end(record) / left - 1,
                      lift == 0.4 ? 1e-3 : 1e-6);
            EXPECT_LT(stiffness_at_the_end(record), exact);
        }
    }
}

// The two cut points off from a node together that neither has cut off alone.
TEST(HardMeeting, TwoEdgeCracksConverge) {
    Scene scene = at_equilibrium(block({6.16e-3, 8.36e-3}, 0.22e-3));
    scene.specimen.cutouts = {Circle{{0.53e-3, 3.6e-3}, 0.68e-3}};
    scene.edges = {moving("top", Side::top, {3e-6, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.cracks = {line({0, 6.143}, {2.105, 5.457}, Growth::end), line({0, 5.419}, {2.179, 5.419}, Growth::end)};
    for (Crack& crack : scene.cracks) {
        crack.advance = 0.5e-3;
        crack.direction = GrowthDirection::normal_to_opening;
    }
    scene.measure = {"top", "top"};
    scene.stop.displacement = 0.3344e-3;
    const Record record = simulate(scene);
    std::printf("%s\n", record.message.c_str());
    EXPECT_GT(record.series.back().fracture_energy, 0.0);  // one of them runs, the other may stand
    for (const Instant& row : record.series) EXPECT_TRUE(std::isfinite(row.force));
}

// Up to four cracks anywhere, inside and at the edges, drawn apart and sheared.
std::vector<Scene> cracks_at_random(int count) {
    std::mt19937 random(7);
    const auto between = [&](double low, double high) { return low + (high - low) * 0x1p-32 * static_cast<double>(random()); };
    std::vector<Scene> scenes;
    while (static_cast<int>(scenes.size()) < count) {
        Scene scene = square({});
        scene.materials["EW"].toughness = 100.0;
        scene.edges[0].velocity[0] = between(-1.0, 1.0) * mm_per_minute;
        const int cracks = 1 + static_cast<int>(between(0.0, 4.0));
        for (int k = 0; k < cracks; ++k) {
            const bool at_edge = between(0.0, 1.0) < 0.6, left = between(0.0, 1.0) < 0.5;
            const double angle = between(-0.8, 0.8), length = between(2.5, 9.0);
            const Vec2 from(at_edge ? left ? 0.0 : 20.0 : between(2.0, 16.0), between(4.0, 16.0));
            const Vec2 way((at_edge && !left ? -1.0 : 1.0) * std::cos(angle), std::sin(angle));
            const Vec2 to = from + length * way;
            Crack crack =
                line(from, {std::clamp(to.x(), 1.5, 18.5), std::clamp(to.y(), 1.5, 18.5)}, at_edge ? Growth::end : Growth::both);
            crack.direction = between(0.0, 1.0) < 0.5 ? GrowthDirection::normal_to_opening : GrowthDirection::hoop_stress;
            scene.cracks.push_back(crack);
        }
        scenes.push_back(scene);
    }
    return scenes;
}

// Pressed together or drawn apart, with faces that rub: Newton's method alone lost 32 of the first 40 that are pressed.
TEST(HardMeeting, CracksAtRandomThatRubEndWell) {
    constexpr int runs = 6;
    for (const double way : {-1.0, 1.0}) {
        int lost = 0;
        for (Scene scene : cracks_at_random(runs)) {
            scene.edges[0].velocity[1] = way * mm_per_minute;
            for (Crack& crack : scene.cracks) {
                crack.faces.kind = CrackFaces::Kind::friction;
                crack.faces.coefficient = 0.3;
            }
            lost += simulate(scene).status == RunStatus::unstable;
        }
        hard_case(fmt::format("one to four cracks that rub, 6 scenes {}", way < 0.0 ? "pressed" : "drawn apart"),
                  "each ends by itself", static_cast<double>(lost) / runs, 0.0, way < 0.0 ? 0.0 : 1.0 / runs);  // one misses it
    }
}

// Where faces that stick have slid past each other before they meet nothing holds but that they slide there: of 60 scenes 23
// were lost without.
TEST(HardMeeting, CracksAtRandomThatStickEndWell) {
    constexpr int runs = 60;
    int lost = 0;
    for (Scene scene : cracks_at_random(runs)) {
        for (Crack& crack : scene.cracks) crack.faces.kind = CrackFaces::Kind::stick;
        lost += simulate(scene).status == RunStatus::unstable;
    }
    hard_case("one to four cracks that stick, 60 scenes", "each ends by itself", static_cast<double>(lost) / runs, 0.0);
}

TEST(HardMeeting, CracksAtRandomEndWell) {
    constexpr int runs = 60;
    int lost = 0;
    for (const Scene& scene : cracks_at_random(runs)) {
        const Record record = simulate(scene);
        lost += record.status == RunStatus::unstable;
        for (const Instant& row : record.series) EXPECT_GE(row.strain_energy, -1e-12);
    }
    hard_case("one to four cracks at random, 60 scenes", "each ends by itself", static_cast<double>(lost) / runs, 0.0);
}

// In motion, where they run into each other, turn and branch off, and what they cut off flies about.
TEST(HardMeeting, CracksAtRandomKeepTheirBooks) {
    constexpr int runs = 40;
    double worst = 0.0;
    for (Scene scene : cracks_at_random(runs)) {
        scene.solver.kind = SolverKind::explicit_dynamics;
        for (std::optional<double>& v : scene.edges[0].velocity) *v *= 5.0 / mm_per_minute;
        for (Crack& crack : scene.cracks) crack.advance = 0.0;
        scene.stop.displacement = 1.5e-3;
        worst = std::max(worst, simulate(scene).worst_energy_imbalance);
    }
    hard_case("one to four cracks at random in motion, 40 scenes", "energy books close", worst, 0.01);
}

TEST(HardMeeting, TwoEdgeCracksMeetHeadOn) {
    for (const double shift : {0.0, 0.37}) {
        for (const double right : {14.0, 15.5}) {
            const Record record = simulate(square(
                {line({0, 10 + shift}, {6, 10 + shift}, Growth::end), line({20, 10 + shift}, {right, 10 + shift}, Growth::end)}));
            EXPECT_EQ(record.status, RunStatus::split) << record.message;
            const Instant& end = record.series.back();
            const double grown = end.crack_length + record.cracks[0].length.back();
            const std::string name =
                fmt::format("edge cracks head on, {:.2f} mm off a grid line, ligament {:.1f} mm", shift, right - 6);
            hard_case(name, "together as long as the specimen is wide", grown / 20e-3 - 1, 1e-9);
            hard_case(name, "nothing is carried", end.force, 1e-9);
            hard_case(name, "toughness times new face is spent", end.fracture_energy / (0.1 * (right - 6) * 1e-3) - 1, 1e-6);
        }
    }
}

TEST(HardMeeting, ACrackThatPartsTheSpecimenEndsTheRun) {
    // The other one stands in a piece that nothing pulls any more.
    const Record record = simulate(square({line({0, 6}, {9, 6}, Growth::end), line({20, 14}, {16, 14}, Growth::end)}));
    std::printf("two edge cracks of 9 and 4 mm: %s, %s; %.1f and %.1f mm\n", name(record.status), record.message.c_str(),
                1e3 * record.series.back().crack_length, 1e3 * record.cracks[0].length.back());
    EXPECT_EQ(record.status, RunStatus::split);
    EXPECT_NEAR(record.series.back().crack_length, 20e-3, 1e-9);
    EXPECT_LT(record.cracks[0].length.back(), 10e-3);
    EXPECT_NEAR(record.series.back().force, 0.0, 1e-9);
}

TEST(HardMeeting, CracksThatPassEachOtherCurveIn) {
    // En passant, 2.4 cells apart: both grow, the ligament goes, the specimen parts.
    Scene scene = square({line({0, 8.8}, {7, 8.8}, Growth::end), line({20, 11.2}, {13, 11.2}, Growth::end)});
    for (Crack& crack : scene.cracks) crack.direction = GrowthDirection::hoop_stress;
    scene.stop.displacement = 2e-3;
    const Record record = simulate(scene);
    const double end = record.series.back().force;
    double most = 0.0;
    for (const Instant& row : record.series) most = std::max(most, row.force);
    std::printf("en passant: %s, lengths %.2f and %.2f mm, force at the end %.2e of the peak, %ld equilibria\n",
                name(record.status), 1e3 * record.series.back().crack_length, 1e3 * record.cracks[0].length.back(), end / most,
                record.steps);
    EXPECT_NE(record.status, RunStatus::unstable) << record.message;
    EXPECT_LT(end, 0.02 * most);
    for (const Instant& row : record.series) EXPECT_GE(row.strain_energy, -1e-12);
}

TEST(HardMeeting, CrossesThatCutAPlateInFourCarryNothing) {
    for (const double angle : {0.0, 31.0}) {
        const Vec2 along(std::cos(angle * degree), std::sin(angle * degree)), across(-along.y(), along.x());
        const Vec2 centre(10.3, 9.8);
        const Record record =
            simulate(square({line(centre - 40 * along, centre + 40 * along), line(centre - 40 * across, centre + 40 * across)}));
        hard_case(fmt::format("cracks through a plate that cross, {:.0f} deg", angle), "nothing is carried",
                  record.series.back().force, 1e-9);
    }
}

TEST(HardMeeting, APlateCutInTwoBeforehandCarriesPressureAlone) {
    Scene whole = square({}), cut = square({line({-1, 9.8}, {21, 9.8})});
    hard_case("plate cut in two, drawn apart", "nothing is carried", simulate(cut).series.back().force, 1e-9);
    for (Scene* scene : {&whole, &cut}) scene->edges[0] = moving("top", Side::top, {0.0, -mm_per_minute});
    const Record pressed = simulate(cut);
    EXPECT_EQ(pressed.status, RunStatus::finished) << pressed.message;
    hard_case("plate cut in two, pressed together", "carries as a whole one",
              stiffness_at_the_end(pressed) / stiffness_at_the_end(simulate(whole)) - 1, 1e-3);
}

TEST(HardMeeting, WhatFindsNoEquilibriumIsNotSaidToCarryNothing) {
    // A wheel that goes on by more than the specimen is high. What there was until then is kept, and nothing is made up beyond
    // it.
    Scene scene = square({line({-1, 9.8}, {10, 9.8})});
    scene.edges[0].range = {{0.0, 4e-3}};
    scene.edges[0].velocity[1] = 0.0;
    Body wheel;
    wheel.name = "wheel";
    wheel.shape = Circle{{10e-3, 21e-3}, 1e-3};
    wheel.velocity = {0.0, -mm_per_minute};
    scene.bodies = {wheel};
    scene.measure = {"wheel", "wheel"};
    scene.stop.displacement = 22e-3;
    const double step = 22e-3 / mm_per_minute / 32;
    for (const Growth grows : {Growth::none, Growth::end}) {
        scene.cracks[0].grows = grows;
        for (auto& [name, material] : scene.materials) material.toughness = 1e9;
        const Record record = simulate(scene);
        EXPECT_EQ(record.status, RunStatus::unstable);
        double missing = 0.0;
        ASSERT_EQ(std::sscanf(record.message.c_str(), "no equilibrium was found at %lf s", &missing), 1) << record.message;
        std::printf("no equilibrium at %.1f s; %zu rows until %.1f s\n", missing, record.series.size(),
                    record.series.back().time);
        EXPECT_GT(missing, step);
        EXPECT_NEAR(record.series.back().time, missing - step, 1e-3 * missing);
    }
}

TEST(HardMeeting, AClosedCrackAcrossAnotherChangesNothing) {
    // Pressed together along its own line of symmetry it carries all that the wood carried.
    for (const double offset : {0.0, 0.5}) {
        SlantedCrack plate;
        plate.remote << -3e5, 0, 0, 1e5;
        plate.offset = {offset, offset};
        Scene scene = slanted_crack(plate);
        const Vec2 centre = 0.5 * (scene.cracks[0].points[0] + scene.cracks[0].points[1]);
        Crack closed;
        closed.points = {centre - Vec2(0, 8e-3), centre + Vec2(0, 8e-3)};
        scene.cracks.push_back(closed);
        const AtRest run(scene);
        ASSERT_TRUE(run.solved());
        const double exact = 1e5 * 1e5 * std::numbers::pi * 10e-3 / plane_modulus();
        hard_case(fmt::format("a closed crack across a Griffith crack, {:.1f} cells off a node", offset), "exact G",
                  run.load().G / exact - 1, 0.02);
    }
}

TEST(HardMeeting, ACrackLeavesThroughACorner) {
    for (const double off : {0.0, 0.2}) {
        Scene scene = square({line({0, 0 + off}, {8, 8 + off}, Growth::end)});
        scene.edges = {moving("top", Side::top, {-mm_per_minute, mm_per_minute}), moving("right", Side::right, {0.0, 0.0})};
        scene.edges[0].range = {{0.0, 15e-3}};
        scene.edges[1].range = {{0.0, 15e-3}};
        scene.measure = {"top", "top"};
        const Record record = simulate(scene);
        const std::string name = fmt::format("a diagonal crack, {:.1f} mm off the corner", off);
        EXPECT_EQ(record.status, RunStatus::split) << record.message;
        hard_case(name, "nothing is carried", record.series.back().force, 1e-9);
        hard_case(name, "it ends at the corner", record.series.back().crack_length / ((20 - off) * std::sqrt(2.0) * 1e-3) - 1,
                  1e-6);
    }
}

TEST(HardMeeting, ACrackThatEndsAtAHoleCutsNothingBehindIt) {
    for (const double radius : {3.0, 0.8}) {
        Scene scene = square({line({0, 10}, {10 - radius, 10})});
        scene.stop.displacement = 1e-5;
        scene.specimen.cutouts = {Circle{{10e-3, 10e-3}, radius * 1e-3}};
        const double touches = stiffness_at_the_end(simulate(scene));
        scene.cracks = {line({0, 10}, {10.2 - radius, 10})};
        const double reaches_in = stiffness_at_the_end(simulate(scene));
        scene.stop.displacement = 3e-3;
        scene.cracks = {line({0, 10}, {8 - radius, 10}, Growth::end)};
        const Record grown = simulate(scene);
        EXPECT_TRUE(carried_on(grown, scene)) << grown.message;
        const std::string name = fmt::format("a crack into a hole of {:.1f} mm radius", radius);
        hard_case(name, "as stiff as with a crack that ends a hair inside it", touches / reaches_in - 1, 1e-3);
        hard_case(name, "grown there as when it was there from the start", stiffness_at_the_end(grown) / touches - 1, 1e-3);
        Scene whole = square({});
        whole.stop.displacement = 1e-5;
        // Wood behind the hole holds: a crack through it all would leave nothing.
        EXPECT_GT(touches, 0.2 * stiffness_at_the_end(simulate(whole)));
    }
}

TEST(HardMeeting, InMotionToo) {
    // A crack that runs into a hole leaves the wood behind it; one that goes through leaves nothing.
    for (const bool hole : {true, false}) {
        Scene scene = at_motion(square({line({0, 10}, {5, 10}, Growth::end)}));
        if (hole) scene.specimen.cutouts = {Circle{{10e-3, 10e-3}, 2e-3}};
        scene.materials["EW"].toughness = 1.0;
        scene.edges[0].velocity[1] = 1.0;
        scene.stop.displacement = 1e-3;
        scene.cracks[0].direction = GrowthDirection::straight;
        const Record record = simulate(scene);
        std::printf("in motion %s: ends at %.3f mm with a crack of %.1f mm, %s: %s\n", hole ? "into a hole" : "through",
                    1e3 * record.series.back().displacement, 1e3 * record.series.back().crack_length, name(record.status),
                    record.message.c_str());
        EXPECT_NEAR(record.series.back().crack_length, hole ? 8e-3 : 20e-3, 0.5e-3);
        if (hole) EXPECT_TRUE(carried_on(record, scene));
        else EXPECT_EQ(record.status, RunStatus::split);
    }
}

// Far above its root a sharp notch is still narrower than the cells that its flanks lie in.
TEST(HardMeeting, ACrackFromANotchKeepsTheFlanksApart) {
    for (const double middle : {5e-3, 5.03e-3}) {
        Scene scene = at_equilibrium(block({10e-3, 10e-3}, 0.25e-3));
        scene.specimen.cutouts = {Polygon{{Vec2(middle - 1.5e-3, 10e-3), Vec2(middle + 1.5e-3, 10e-3), Vec2(middle, 7e-3)}}};
        Crack crack;
        crack.points = {Vec2(middle, 7e-3), Vec2(middle, 5.9e-3)};
        scene.cracks = {crack};
        const MaterialMap materials(scene);
        Discretisation body(scene, materials);
        const CrackFields cracks(scene, body, materials, 0.02);
        std::vector<std::array<int, 2>> points_on_side(cracks.fields(), {0, 0});
        for (int p = 0; p < body.points.count(); ++p)
            if (body.points.position[p].y() > 6.5e-3)
                for (const int field : body.points.node[p]) ++points_on_side[field][body.points.position[p].x() > middle];
        int joined = 0;
        for (const auto& [left, right] : points_on_side) joined += left > 0 && right > 0;
        std::printf("notch at %.2f mm: %d fields join its flanks\n", middle * 1e3, joined);
        EXPECT_EQ(joined, 0);
    }
}

}  // namespace
}  // namespace crampfit::test

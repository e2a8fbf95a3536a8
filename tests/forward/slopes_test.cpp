// Derivatives of what a record shows by the numbers of the materials, against central differences of whole runs.
#include "datasets/io.hpp"
#include "forward/kept_walk.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace crampfit::test {
namespace {

const std::vector<std::string> numbers{"materials.EW.E", "materials.LW.E", "materials.EW.nu", "materials.LW.nu"};

// A crack that runs straight across rings with transition wood. Straight: derivatives are those on the path as it is.
Scene across_rings(double cell) {
    Scene scene = ring_specimen(2.5e-3, cell);
    scene.specimen.rings->transition = 0.3e-3;
    scene.materials["LW"].density = 750.0;
    scene.solver = {};
    scene.solver.kind = SolverKind::quasistatic;
    scene.stop = {};
    scene.stop.displacement = 1e-3;
    scene.edges[0] = moving("top", Side::top, {0.0, 1e-3 / 60.0});
    scene.cracks[0].grows = Growth::end;
    scene.cracks[0].advance = 2.0 * cell;
    scene.cracks[0].direction = GrowthDirection::straight;
    scene.output.frames = 0;
    return scene;
}

// Wheels in a notch, a pin below: contact and finite rotation.
Scene wedge_across_rings(double cell) {
    Scene scene = across_rings(cell);
    scene.specimen.rings->pith = {5e-3, 30e-3};
    scene.specimen.cutouts = {Polygon{{{3.5e-3, 10e-3}, {6.5e-3, 10e-3}, {5e-3, 7e-3}}}};
    scene.edges.clear();
    const auto body = [](const char* name, Vec2 centre, double radius, Contact::Kind contact, Vec2 velocity) {
        Body made;
        made.name = name;
        made.shape = Circle{centre, radius};
        made.contact.kind = contact;
        made.velocity = velocity;
        return made;
    };
    // The pin holds four nodes of 0.4 mm cells. With six, at 0.5 mm, a derivative is 1.8e-3 off at the load's peak, whatever the
    // step.
    const Vec2 down(0.0, -1e-3 / 60.0);
    scene.bodies = {body("left", {4.4472e-3, 9.2236e-3}, 0.5e-3, Contact::Kind::frictionless, down),
                    body("right", {5.5528e-3, 9.2236e-3}, 0.5e-3, Contact::Kind::frictionless, down),
                    body("pin", {5e-3, 0.0}, 0.4e-3, Contact::Kind::bonded, Vec2::Zero())};
    scene.cracks[0].points = {{5e-3, 7e-3}, {5e-3, 5.9e-3}};
    scene.measure = {"pin", "left"};
    scene.stop.displacement = 0.8e-3;
    scene.output.samples = 58;  // few rows: no corner of the curve passes one within the step
    return scene;
}

struct Errors {
    double force = 0, length = 0, displacement = 0;  // largest, of the largest derivative
};

// Row by row: force, crack length and displacement as functions of the logarithm of a number.
Errors against_differences(const Scene& scene, KeptWalk& walk, const std::string& key, double step) {
    const double value = get_number(scene, key);
    const auto at = [&](double change) {
        Scene other = scene;
        set_number(other, key, value * (1.0 + change));
        return other;
    };
    constexpr double small = 1e-6;
    const Record more = walk.run(at(small), {}), less = walk.run(at(-small), {});
    const Record far_more = KeptWalk(at(step)).run(at(step), {}), far_less = KeptWalk(at(-step)).run(at(-step), {});
    EXPECT_EQ(more.series.size(), far_more.series.size()) << "an event lies between: choose another scene";
    EXPECT_EQ(less.series.size(), far_less.series.size());
    const auto error = [&](auto column) {
        double worst = 0, largest = 0;
        const std::size_t rows =
            std::min({more.series.size(), less.series.size(), far_more.series.size(), far_less.series.size()});
        for (std::size_t i = 0; i < rows; ++i) {
            const double slope = (column(more.series[i]) - column(less.series[i])) / (2.0 * small);
            const double difference = (column(far_more.series[i]) - column(far_less.series[i])) / (2.0 * step);
            worst = std::max(worst, std::abs(slope - difference));
            largest = std::max(largest, std::abs(difference));
        }
        EXPECT_GT(largest, 0.0) << key;
        return worst / largest;
    };
    return {error([](const Instant& row) { return row.force; }), error([](const Instant& row) { return row.crack_length; }),
            error([](const Instant& row) { return row.displacement; })};
}

void check(const char* name, const Scene& scene, double step, double tolerance,
           const std::vector<std::string>& toughness = {"materials.EW.toughness", "materials.LW.toughness"}) {
    KeptWalk walk(scene, numbers);
    ASSERT_TRUE(walk.has_slopes());
    walk.run(scene, {});
    std::vector<std::string> keys = numbers;
    keys.insert(keys.end(), toughness.begin(), toughness.end());
    for (const std::string& key : keys) {
        const Errors errors = against_differences(scene, walk, key, step);
        std::printf("%s, %s: force %.1e, crack length %.1e, displacement %.1e\n", name, key.c_str(), errors.force, errors.length,
                    errors.displacement);
        EXPECT_LT(errors.force, tolerance) << key;
        EXPECT_LT(errors.length, tolerance) << key;
        EXPECT_LT(errors.displacement, tolerance) << key;
    }
}

TEST(GradientRecord, AcrossRings) {
    // Central differences with a step of 1e-4 are off by some 1e-8.
    check("linear", across_rings(0.4e-3), 1e-4, 1e-5);
}

TEST(GradientRecord, BetweenGripsThatEndInWood) {
    Scene scene = across_rings(0.4e-3);
    for (Edge& edge : scene.edges) edge.range = {{1.1e-3, 9.1e-3}};
    check("grips that end in wood", scene, 1e-4, 1e-5);
}

TEST(GradientRecord, AtASlantedTipNearASharpBoundary) {
    // Wherever the crack enters the boxes of finer cells about its tip: now and then it leaves wood on the held outline that is
    // held on one side of it alone.
    Scene scene = across_rings(0.4e-3);
    scene.specimen.rings->transition = 0.0;
    scene.stop.displacement = 1e-5;  // it stands
    scene.output.samples = 1;
    for (int k = 0; k < 24; ++k) {
        scene.cracks[0].points = {{10e-3, 5.1e-3}, {7.3e-3, 5.1e-3 + k * 0.05e-3}};
        const auto force = [&](double change, KeptWalk* walk) {
            Scene other = scene;
            set_number(other, "materials.EW.E", get_number(scene, "materials.EW.E") * (1.0 + change));
            return (walk ? walk->run(other, {}) : KeptWalk(other).run(other, {})).series.back().force;
        };
        KeptWalk walk(scene, {"materials.EW.E"});
        walk.run(scene, {});
        const double slope = (force(1e-6, &walk) - force(-1e-6, &walk)) / 2e-6;
        const double difference = (force(1e-4, nullptr) - force(-1e-4, nullptr)) / 2e-4;
        std::printf("slant %.2f mm: force by E of EW off by %+.1e\n", k * 0.05, slope / difference - 1);
        EXPECT_NEAR(slope, difference, 1e-6 * difference) << k;
    }
}

TEST(GradientRecord, WhereTheTipsOwnGSaysWhenItMoves) {
    // Advance 0: G at the tip, by J in wood that is the same all about it and near boundaries by K.
    for (const double transition : {0.3e-3, 0.0}) {
        Scene scene = across_rings(transition > 0.0 ? 0.4e-3 : 0.5e-3);
        scene.cracks[0].advance = 0.0;
        scene.specimen.rings->transition = transition;
        scene.output.samples = 97;  // no corner of the curve passes a row within the step
        // The crack runs through latewood without more load: its toughness changes nothing.
        check(transition > 0.0 ? "advance 0" : "advance 0, sharp boundaries", scene, 1e-4, 1e-5, {"materials.EW.toughness"});
    }
}

// Force at a displacement, between rows on a straight line; where the crack jumps there, before that or after it.
double force_at(const Record& record, double displacement, bool after) {
    const auto& rows = record.series;
    std::size_t i = 1;
    while (i + 1 < rows.size() && (after ? rows[i].displacement <= displacement : rows[i].displacement < displacement)) ++i;
    const Instant &a = rows[i - 1], &b = rows[i];
    return std::lerp(a.force, b.force, (displacement - a.displacement) / (b.displacement - a.displacement));
}

TEST(GradientRecord, OneSidedWhereTheCrackJumps) {
    // At the very displacement of a jump a number that delays it tells the slope of the force before the jump, one that hastens
    // it the slope after it: the first by one-sided differences of the walk, the second by those of whole runs, (4 f(s) - f(2 s)
    // - 3 f(0)) / 2 s.
    for (const double advance : {0.8e-3, 0.0}) {
        Scene scene = across_rings(0.4e-3);
        scene.cracks[0].advance = advance;
        scene.specimen.rings->pith.x() -= 0.05e-3;  // of no number two derivatives take each other off
        KeptWalk walk(scene, numbers);
        const Record base = walk.run(scene, {});
        std::size_t jump = 1;
        while (jump < base.series.size() && base.series[jump].crack_length - base.series[jump - 1].crack_length < 0.5e-3) ++jump;
        ASSERT_LT(jump, base.series.size());
        const double there = base.series[jump - 1].displacement;
        for (const std::string& key :
             {std::string("materials.EW.E"), std::string("materials.EW.nu"), std::string("materials.EW.toughness")}) {
            for (const double side : {1.0, -1.0}) {  // of the number
                const auto at = [&](double change) {
                    Scene other = scene;
                    set_number(other, key, get_number(scene, key) * (1.0 + side * change));
                    return other;
                };
                constexpr double small = 1e-7, step = 1e-4;
                const Record near = walk.run(at(small), {});
                const double moved = near.series[jump - 1].displacement;
                const bool after = moved < there;
                if (after && jump + 1 == base.series.size()) continue;  // it goes right through
                const double here = base.series[after ? jump : jump - 1].force;
                const double slope = (force_at(near, there, after) - here) / small;
                const auto whole = [&](double change) {
                    return force_at(KeptWalk(at(change)).run(at(change), {}), there, after);
                };
                const double difference = (4.0 * whole(step) - whole(2.0 * step) - 3.0 * here) / (2.0 * step);
                std::printf("jump at %.4f mm, advance %.1f mm, %s %s: force %s it goes by %.6f N, by differences %.6f N\n",
                            1e3 * there, 1e3 * advance, key.c_str(), side > 0 ? "more" : "less", after ? "after" : "before",
                            slope, difference);
                EXPECT_NEAR(slope, difference, 1e-5 * std::abs(difference)) << key;
            }
        }
    }
}

TEST(GradientRecord, OfAWedgeTest) {
    // Newton's method leaves up to 1e-8 of the largest force out of balance, which the differences of whole runs make 2e-5 of a
    // derivative, and 1e-7 makes 2e-3. A wider step would take corners of the curve past the times of the rows.
    check("wedge", wedge_across_rings(0.4e-3), 1e-4, 1e-4);
}

TEST(GradientRecord, OfAWedgeBetweenTheFacesOfACrack) {
    Scene scene = wedge_across_rings(0.4e-3);
    scene.bodies[0].shape = Polygon{{{3.2e-3, 12e-3}, {5e-3, 7.05e-3}, {6.8e-3, 12e-3}}};
    scene.bodies.erase(scene.bodies.begin() + 1);
    scene.cracks[0].points[1] = {5e-3, 4.9e-3};
    scene.stop.displacement = 1.6e-3;
    check("wedge in a crack", scene, 1e-4, 1e-4);
}

TEST(SystemWalk, ThreadsChangeNoBit) {
    // Derivatives are found beside the walk; those found later, after a rest, too.
    const Scene scene = wedge_across_rings(0.4e-3);
    Scene other = scene;
    set_number(other, "materials.LW.E", 1.02 * get_number(scene, "materials.LW.E"));
    set_number(other, "materials.EW.toughness", 1.5 * get_number(scene, "materials.EW.toughness"));
    KeptWalk alone(scene, numbers, 1), with_others(scene, numbers, 2);
    const auto check_run = [&](const Scene& moved, bool rough) {
        const Record a = alone.run(moved, {}, rough), b = with_others.run(moved, {}, rough);
        ASSERT_EQ(a.series.size(), b.series.size());
        for (std::size_t i = 0; i < a.series.size(); ++i) {
            EXPECT_EQ(a.series[i].force, b.series[i].force) << i;
            EXPECT_EQ(a.series[i].crack_length, b.series[i].crack_length) << i;
            EXPECT_EQ(a.series[i].displacement, b.series[i].displacement) << i;
        }
    };
    check_run(scene, false);
    for (const bool rough : {true, false}) check_run(other, rough);
}

// Displacements in the wood, on either side of the crack and ahead of it.
void check_probes(const char* name, Scene scene, double step, double tolerance, const std::vector<std::string>& keys) {
    scene.output.probes = {{{1e-3, 7e-3}, {1.3e-3, 3.1e-3}, {4e-3, 8e-3}, {6e-3, 2e-3}, {8.9e-3, 5.2e-3}}, {}, true};
    for (const double share : {0.2, 0.7, 0.95}) scene.output.probes.instants.push_back(share * *scene.stop.displacement);
    KeptWalk walk(scene, numbers);
    ASSERT_TRUE(walk.has_slopes());
    const Record start = walk.run(scene, {});
    ASSERT_EQ(start.probes.size(), 3u);
    EXPECT_GT((start.probes.back().cracks[0].back() - scene.cracks[0].points.back()).norm(), 1e-3) << "it has grown";
    for (const std::string& key : keys) {
        const auto at = [&](double change) {
            Scene other = scene;
            set_number(other, key, get_number(scene, key) * (1.0 + change));
            return other;
        };
        constexpr double small = 1e-6;
        const Record more = walk.run(at(small), {}), less = walk.run(at(-small), {});
        const Record far_more = KeptWalk(at(step)).run(at(step), {}), far_less = KeptWalk(at(-step)).run(at(-step), {});
        double worst = 0, largest = 0;
        for (std::size_t k = 0; k < scene.output.probes.instants.size(); ++k)
            for (std::size_t i = 0; i < scene.output.probes.places.size(); ++i) {
                const Vec2 slope = (more.probes[k].moved[i] - less.probes[k].moved[i]) / (2.0 * small);
                const Vec2 difference = (far_more.probes[k].moved[i] - far_less.probes[k].moved[i]) / (2.0 * step);
                worst = std::max(worst, (slope - difference).norm());
                largest = std::max(largest, difference.norm());
            }
        std::printf("%s, probes by %s: %.1e of %.2e m\n", name, key.c_str(), worst / largest, largest);
        EXPECT_LT(worst, tolerance * largest) << key;
    }
}

TEST(GradientRecord, ProbesMoveWithTheNumbers) {
    std::vector<std::string> keys = numbers;
    keys.insert(keys.end(), {"materials.EW.toughness", "materials.LW.toughness"});
    check_probes("linear", across_rings(0.4e-3), 1e-4, 1e-5, keys);
    check_probes("wedge", wedge_across_rings(0.5e-3), 5e-4, 1e-5, keys);
}

TEST(GradientRecord, TractionMovesItsEdge) {
    Scene scene = across_rings(0.4e-3);
    scene.cracks[0].grows = Growth::none;
    scene.stop = {};
    scene.stop.time = 1.0;
    scene.edges[0] = pulled("top", Side::top, {0.0, 0.1e6});
    KeptWalk walk(scene, numbers);
    for (const std::string& key : numbers) {
        const double value = get_number(scene, key);
        const auto displacement = [&](KeptWalk& on, double change) {
            Scene other = scene;
            set_number(other, key, value * (1.0 + change));
            return on.run(other, {}).series.back().displacement;
        };
        const auto anew = [&](double change) {
            Scene other = scene;
            set_number(other, key, value * (1.0 + change));
            KeptWalk own(other);
            return displacement(own, change);
        };
        const double slope = (displacement(walk, 1e-6) - displacement(walk, -1e-6)) / 2e-6;
        const double difference = (anew(1e-4) - anew(-1e-4)) / 2e-4;
        std::printf("traction, %s: %.6e m, by differences %.6e m\n", key.c_str(), slope, difference);
        EXPECT_NEAR(slope, difference, 1e-5 * std::abs(difference)) << key;
    }
}

}  // namespace
}  // namespace crampfit::test

// Several growing tips at equilibrium: which one moves, and when.
#include "forward/kept_walk.hpp"
#include "forward/quasistatic.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace crampfit::test {
namespace {

constexpr double mm_per_minute = 1e-3 / 60.0;

// A plate 40 mm wide and 120 mm high whose ends are drawn apart and free to contract.
Scene drawn_plate(double cell) {
    Scene scene = at_equilibrium(block({40e-3, 120e-3}, cell));
    scene.materials["EW"].toughness = 1.0;
    scene.edges = {without(moving("top", Side::top, {0.0, mm_per_minute}), 0),
                   without(moving("bottom", Side::bottom, {0.0, 0.0}), 0),
                   held_at("hinge", Side::bottom, 20e-3, cell, 0.0, std::nullopt)};
    scene.measure = {"top", "top"};
    scene.stop.displacement = 5e-3;
    return scene;
}

Crack grown(Vec2 from, Vec2 to, Growth grows, double advance) {
    Crack crack;
    crack.points = {from, to};
    crack.grows = grows;
    crack.direction = GrowthDirection::straight;
    crack.advance = advance;
    return crack;
}

// ---- a centre crack whose both ends grow

Scene centre_crack(double cell, double advance) {
    Scene scene = drawn_plate(cell);
    scene.cracks = {grown({14e-3, 60e-3}, {26e-3, 60e-3}, Growth::both, advance)};
    scene.stop.crack_length = 24e-3;
    return scene;
}

// Compliance per thickness of the plate with a crack of half length a: that of the plate and what G = P^2 / 2 dC/dA adds, K = s
// sqrt(pi a) F (REFERENCES: centre crack; Tada) [m^2/N].
double compliance(double a) {
    const double b = 20e-3, modulus = plane_modulus();
    constexpr int steps = 2000;
    double sum = 120e-3 / (modulus * 2 * b);
    for (int k = 0; k < steps; ++k) {
        const double x = (k + 0.5) / steps * a, r = x / b;
        const double F = (1 - 0.025 * r * r + 0.06 * std::pow(r, 4)) / std::sqrt(std::cos(0.5 * std::numbers::pi * r));
        sum += 2.0 * std::numbers::pi * x * F * F / (4 * b * b * modulus) * 2.0 * a / steps;  // dA = 2 da
    }
    return sum;
}

TEST(VerificationTips, BothEndsOfACentreCrackGrowByTheExactEnergy) {
    for (const double advance : {0.0, 2e-3}) {
        const Record record = simulate(centre_crack(1e-3, advance));
        ASSERT_FALSE(record.driving.empty());
        double worst = 0.0, uneven = 0.0;
        for (const CriticalLoad& place : record.driving) {
            const double a = 0.5 * place.crack_length;
            if (2 * a > 24e-3) continue;
            // At fixed ends the next advance of both tips releases u^2 / 2 (1 / C(a) - 1 / C(a + advance)).
            const double small = advance > 0.0 ? advance : 1e-6;
            const double released = 0.5 * (1 / compliance(a) - 1 / compliance(a + small));
            const double exact = std::sqrt(2 * small * 1.0 / released) / compliance(a);  // force
            worst = std::max(worst, std::abs(place.force / exact - 1));
        }
        for (const auto& tip : record.paths[0]) uneven = std::max(uneven, std::abs(tip.y() - 60e-3));
        const double off = record.paths[0].front().x() + record.paths[0].back().x() - 40e-3;
        std::printf(
            "centre crack, both ends, advance %.0f mm: critical force within %.2f %% of the exact energy's over a/b 0.3 to 0.6; "
            "ends at %.4f and %.4f mm, %ld equilibria, %.2f s\n",
            1e3 * advance, 100 * worst, 1e3 * record.paths[0].front().x(), 1e3 * record.paths[0].back().x(), record.steps,
            record.seconds);
        EXPECT_LT(worst, 0.01);  // six cells per half crack at first; the formula is good to 0.1 %
        EXPECT_LT(std::abs(off), 1e-9);
        EXPECT_EQ(uneven, 0.0);
        EXPECT_EQ(record.status, RunStatus::finished);
        EXPECT_NEAR(record.series.back().crack_length, 24e-3, 1e-8);
        EXPECT_NEAR(record.series.back().fracture_energy, 12e-3 * 1.0, 1e-8);
    }
}

// ---- two edge cracks that face each other

Scene edge_cracks(double left, double right, double advance) {
    Scene scene = drawn_plate(1e-3);
    scene.cracks = {grown({0.0, 60e-3}, {left, 60e-3}, Growth::end, advance),
                    grown({40e-3, 60e-3}, {40e-3 - right, 60e-3}, Growth::end, advance)};
    scene.stop.crack_length = 20e-3;
    return scene;
}

void expect_the_same(const Record& record, const Record& alone, const char* what) {
    ASSERT_EQ(record.series.size(), alone.series.size()) << what;
    double worst = 0.0, force = 0.0;
    for (const Instant& row : alone.series) force = std::max(force, std::abs(row.force));
    for (std::size_t i = 0; i < alone.series.size(); ++i) {
        const Instant &a = record.series[i], &b = alone.series[i];
        worst = std::max({worst, std::abs(a.crack_length - b.crack_length) / 20e-3, std::abs(a.force - b.force) / force,
                          std::abs(a.displacement - b.displacement) / 5e-3});
    }
    std::printf("%s: off the run in which only one may grow by %.1e, %ld equilibria against %ld, %.2f s against %.2f s\n", what,
                worst, record.steps, alone.steps, record.seconds, alone.seconds);
    EXPECT_LT(worst, 1e-9);
    for (const double length : record.cracks[0].length) EXPECT_EQ(length, record.cracks[0].length[0]);
}

TEST(VerificationTips, TheLongerOfTwoEdgeCracksGrowsAsIfItWereAlone) {
    for (const double advance : {0.0, 2e-3}) {
        Scene scene = edge_cracks(9e-3, 8e-3, advance);
        const Record record = simulate(scene);
        scene.cracks[1].grows = Growth::none;
        expect_the_same(record, simulate(scene), "two edge cracks, 9 and 8 mm");
    }
}

TEST(VerificationTips, TheBrittlerOfTwoEqualEdgeCracksGrowsAsIfItWereAlone) {
    Scene scene = edge_cracks(8e-3, 8e-3, 2e-3);
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(-1000.0 + 20e-3, 60e-3), 2000.0, 0.5, 0.0};  // other wood right of the middle
    scene.materials["LW"] = scene.materials["EW"];
    scene.materials["LW"].toughness = 1.2;
    const Record record = simulate(scene);
    scene.cracks[1].grows = Growth::none;
    expect_the_same(record, simulate(scene), "two edge cracks of 8 mm, one in wood a fifth tougher");
}

TEST(VerificationTips, TwoEqualEdgeCracksGrowTogether) {
    Scene scene = edge_cracks(8e-3, 8e-3, 2e-3);
    scene.stop.crack_length = 15e-3;
    const Record record = simulate(scene);
    double uneven = 0.0;
    for (std::size_t i = 0; i < record.series.size(); ++i)
        uneven = std::max(uneven, std::abs(record.series[i].crack_length - record.cracks[0].length[i]));
    std::printf("two edge cracks of 8 mm: as long as each other to %.1e mm, %ld equilibria, %.2f s\n", 1e3 * uneven, record.steps,
                record.seconds);
    EXPECT_LT(uneven, 1e-9);
    EXPECT_NEAR(record.series.back().crack_length, 15e-3, 1e-8);
    EXPECT_NEAR(record.series.back().fracture_energy, 14e-3, 1e-8);
    EXPECT_FALSE(KeptWalk(scene).reusable());
    EXPECT_NE(explain(scene).find("2 tips compete"), std::string::npos);
}

}  // namespace
}  // namespace crampfit::test

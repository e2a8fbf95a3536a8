// Stretches of a side that end in wood, wherever that is in a cell.
#include "datasets/error.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace crampfit::test {
namespace {

constexpr double speed = 1e-3 / 60.0;

// Lower and left side are planes of symmetry, the lower one where it is held: right of a crack that ends at `tip`.
Scene upper_half(double tip, double cell) {
    Scene scene = at_equilibrium(block({10e-3, 10e-3}, cell));
    Edge top = moving("top", Side::top, {0.0, speed}), bottom = moving("bottom", Side::bottom, {0.0, 0.0});
    Edge left = moving("left", Side::left, {0.0, 0.0});
    top.velocity[0] = bottom.velocity[0] = left.velocity[1] = std::nullopt;
    bottom.range = {{tip, 10e-3}};
    scene.edges = {top, bottom, left};
    scene.measure = {"top", "top"};
    scene.stop.displacement = 0.1e-3;
    return scene;
}

// The same with the lower half and the crack.
Scene both_halves(double tip, double cell) {
    Scene scene = upper_half(tip, cell);
    scene.specimen.size.y() = 20e-3;
    scene.edges[1].range.reset();
    Crack crack;
    crack.points = {Vec2(0.0, 10e-3), Vec2(tip, 10e-3)};
    scene.cracks = {crack};
    scene.stop.displacement = 0.2e-3;
    return scene;
}

double force(const Scene& scene) { return simulate(scene).series.back().force; }

TEST(VerificationHeldStretch, IsHalfACrackWhereverInACellItEnds) {
    double worst = 0.0;
    for (int k = 0; k <= 10; ++k) {
        const double tip = 4e-3 + 0.05e-3 * k;
        worst = std::max(worst, std::abs(force(upper_half(tip, 0.5e-3)) / force(both_halves(tip, 0.5e-3)) - 1));
    }
    std::printf("force of a half whose lower side is free for 4 to 4.5 mm, against the whole with a crack: within %.1e\n", worst);
    EXPECT_LT(worst, 1e-9);
}

TEST(VerificationHeldStretch, EndsAtACracksMouth) {
    // Two arms drawn apart, each by a stretch of the side up to the crack between them, as by one that ends a cell short of it.
    const auto arms_of = [](double mouth, double gap, bool both) {
        Scene scene = block({20e-3, 10e-3}, 0.5e-3);
        Crack crack;
        crack.points = {Vec2(20e-3, mouth), Vec2(10e-3, mouth)};
        scene.cracks = {crack};
        Edge upper = moving("upper", Side::right, {0.0, speed}), lower = moving("lower", Side::right, {0.0, 0.0});
        upper.velocity[0] = lower.velocity[0] = std::nullopt;
        upper.range = {{mouth + gap, 10e-3}};
        lower.range = {{0.0, mouth - gap}};
        scene.edges = {upper, moving("left", Side::left, {0.0, 0.0})};
        if (both) scene.edges.push_back(lower);
        scene.measure = {"upper", "upper"};
        scene.stop.displacement = 0.05e-3;
        return scene;
    };
    const auto arms = [&](double mouth, double gap, bool both) { return force(at_equilibrium(arms_of(mouth, gap, both))); };
    for (const bool both : {true, false}) {
        for (const double mouth : {5e-3, 5.2e-3, 5.3e-3}) {
            const double off = arms(mouth, 0.0, both) / arms(mouth, 0.5e-3, both) - 1;
            std::printf("%s at a mouth at %.1f mm: force within %.1e of that a cell beside it\n", both ? "both arms" : "one arm",
                        1e3 * mouth, std::abs(off));
            EXPECT_LT(std::abs(off), 0.005);
        }
    }
    // Plates glued on the ends of the arms, as stretches of the side that hold them along both axes; plates that end off the
    // grid's lines hold as if they did on the nearest one.
    for (const double mouth : {5e-3, 5.2e-3, 5.3e-3}) {
        Scene held = at_equilibrium(arms_of(mouth, 0.0, true));
        for (const std::size_t e : {0u, 2u}) held.edges[e].velocity[0] = 0.0;
        Scene glued = held;
        glued.edges = {held.edges[1]};
        for (const std::size_t e : {0u, 2u}) {
            Body plate;
            const auto [low, high] = *held.edges[e].range;
            plate.name = held.edges[e].name;
            plate.shape = Polygon{{{20e-3, low}, {22e-3, low}, {22e-3, high}, {20e-3, high}}};
            plate.contact.kind = Contact::Kind::bonded;
            plate.velocity = {0.0, *held.edges[e].velocity[1]};
            glued.bodies.push_back(plate);
        }
        const double off = force(glued) / force(held) - 1;
        std::printf("plates on both arms, mouth at %.1f mm: force within %.1e of that of stretches\n", 1e3 * mouth,
                    std::abs(off));
        EXPECT_LT(std::abs(off), mouth == 5e-3 ? 1e-9 : 0.02);
    }
    // In motion a stretch ends at a node, so that what ends just beside the mouth holds half a cell less of an arm.
    const auto moving_arms = [&](double gap) {
        Scene scene = at_motion(arms_of(5e-3, gap, true));
        scene.edges[0].velocity[1] = 0.05;
        const Record record = simulate(scene);
        double sum = 0.0;
        for (const auto& row : record.series) sum += row.force;
        return sum / static_cast<double>(record.series.size());
    };
    const double off = moving_arms(0.0) / moving_arms(0.01e-3) - 1;
    std::printf("both arms in motion, mean force: %+.1f %% off that just beside the mouth\n", 100 * off);
    EXPECT_LT(std::abs(off), 0.1);
}

TEST(VerificationTraction, OnOneArmEndsAtACracksMouth) {
    // A long strip split at one end, one arm drawn out along itself: the energy of beams under a force and its moment about the
    // middle of the whole, on either side of the tip.
    constexpr double height = 10e-3, stress = 0.1e6;
    const auto rate = [&](double mouth, bool upper, double cell) {
        Scene scene = block({60e-3, height}, cell);
        Crack crack;
        crack.points = {Vec2(60e-3, mouth), Vec2(30e-3, mouth)};
        scene.cracks = {crack};
        Edge pull = moving("pull", Side::right, {0.0, 0.0});
        pull.traction = Vec2(stress, 0.0);
        pull.range = upper ? std::pair{mouth, height} : std::pair{0.0, mouth};
        scene.edges = {pull, moving("left", Side::left, {0.0, 0.0})};
        scene.measure = {"pull", "pull"};
        scene.stop.time = 1.0;
        return simulate(at_equilibrium(scene)).series.back().G;
    };
    const double plane_modulus = earlywood().youngs_modulus / (1.0 - earlywood().poisson_ratio * earlywood().poisson_ratio);
    for (const double cell : {1e-3, 0.5e-3}) {
        double least = 1.0, most = -1.0;
        for (int k = 0; k <= 10; ++k) {
            for (const bool upper : {true, false}) {
                const double mouth = 4.5e-3 + 0.1 * k * cell;
                const double arm = upper ? height - mouth : mouth, off = 0.5 * (height - arm);
                const double force = stress * arm;
                const double exact =
                    0.5 * force * force / plane_modulus * (1.0 / arm - 1.0 / height - 12.0 * off * off / std::pow(height, 3));
                const double error = rate(mouth, upper, cell) / exact - 1;
                least = std::min(least, error);
                most = std::max(most, error);
            }
        }
        std::printf("one arm of 4.5 to 5.5 mm drawn out, cells of %.1f mm: G %+.2f to %+.2f %% off beams\n", 1e3 * cell,
                    100 * least, 100 * most);
        EXPECT_LT(std::max(-least, most), 0.01);
    }
}

TEST(VerificationHeldStretch, IsHalfACrackWhereItTurnsFar) {
    const auto far = [](Scene scene) {
        scene.stop.displacement = 20 * *scene.stop.displacement;
        return simulate(scene);
    };
    const Record half = far(upper_half(4.1e-3, 0.5e-3)), whole = far(both_halves(4.1e-3, 0.5e-3));
    const double off = half.series.back().force / whole.series.back().force - 1;
    std::printf("drawn out by a fifth: within %.1e; energy books within %.1e\n", std::abs(off), half.worst_energy_imbalance);
    EXPECT_LT(std::abs(off), 1e-6);
    EXPECT_LT(half.worst_energy_imbalance, 1e-3);
}

// Held across and along, on which its end is not quite a crack's: against cells of an eighth.
TEST(VerificationHeldStretch, OfAClampConverges) {
    const auto clamped = [](double cell) {
        Scene scene = upper_half(4e-3, cell);
        scene.edges[1].velocity[0] = 0.0;
        scene.solver.extrapolate = false;
        return force(scene);
    };
    const double exact = clamped(0.0625e-3);
    for (const auto& [cell, bar] : {std::pair{0.5e-3, 0.003}, {0.25e-3, 0.0015}}) {
        const double off = clamped(cell) / exact - 1;
        std::printf("clamp on %.2f mm cells: %+.2f %%\n", 1e3 * cell, 100 * off);
        EXPECT_LT(std::abs(off), bar);
    }
}

// A short clamp is one on the second grid, too, whose cells are twice as wide.
TEST(VerificationHeldStretch, OfAShortClampConverges) {
    const auto clamped = [](double length, double cell) {
        Scene scene = upper_half(10e-3 - length, cell);
        scene.edges[1].velocity[0] = 0.0;
        return force(scene);
    };
    for (const double length : {1.3e-3, 1.8e-3, 2.4e-3, 3.1e-3, 3.7e-3}) {
        const double off = clamped(length, 0.5e-3) / clamped(length, 0.125e-3) - 1;
        std::printf("clamp of %.1f cells: %+.2f %%\n", length / 0.5e-3, 100 * off);
        EXPECT_LT(std::abs(off), 0.012);
    }
}

// Grips whose faces lie on lines of the grid are a shorter specimen's edges.
TEST(VerificationHeldStretch, GripsOnGridLinesAreEdges) {
    Scene held = upper_half(4e-3, 0.5e-3);
    held.edges = {moving("top", Side::top, {0.0, speed}), moving("bottom", Side::bottom, {0.0, 0.0})};
    Scene gripped = held;
    gripped.specimen.size.y() = 14e-3;
    gripped.edges.clear();
    const auto grip = [](const char* name, double low, Vec2 velocity) {
        Body made;
        made.name = name;
        made.shape = Polygon{{{-1e-3, low}, {11e-3, low}, {11e-3, low + 3e-3}, {-1e-3, low + 3e-3}}};
        made.contact.kind = Contact::Kind::bonded;
        made.velocity = velocity;
        return made;
    };
    for (const double off : {-0.2e-3, 0.0, 0.2e-3}) {  // the nearest line of the grid holds
        gripped.bodies = {grip("top", 12e-3 + off, {0.0, speed}), grip("bottom", -1e-3 + off, {0.0, 0.0})};
        EXPECT_NEAR(force(gripped) / force(held), 1.0, 1e-9) << off;
    }
}

// What does not touch the wood does not hold it, however near.
TEST(UnitHeldStretch, AGripBesideTheWoodHoldsNothing) {
    Scene scene = upper_half(4e-3, 0.5e-3);
    Body plate;
    plate.name = "plate";
    plate.contact.kind = Contact::Kind::bonded;
    plate.shape = Polygon{{{-1e-3, 10.1e-3}, {11e-3, 10.1e-3}, {11e-3, 12e-3}, {-1e-3, 12e-3}}};
    scene.bodies = {plate};
    EXPECT_THROW(simulate(scene), InputError);
}

TEST(UnitHeldStretch, NextToAnotherOneHoldsOn) {
    // Two clamps side by side that go the same way are one.
    Scene scene = at_equilibrium(block({10e-3, 10e-3}, 0.5e-3));
    scene.edges = {moving("top", Side::top, {0.0, speed}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.measure = {"top", "top"};
    scene.stop.displacement = 0.1e-3;
    const double exact = force(scene);
    Edge right = moving("right of it", Side::bottom, {0.0, 0.0});
    scene.edges[1].range = {{0.0, 5.1e-3}};
    right.range = {{5.1e-3, 10e-3}};
    scene.edges.push_back(right);
    EXPECT_NEAR(force(scene), exact, 1e-9 * exact);
}

TEST(UnitHeldStretch, TractionActsOnAllOfIt) {
    Scene scene = at_equilibrium(block({10e-3, 10e-3}, 1e-3));
    Edge top{"top", Side::top, {}, {}, {}, {}};
    top.traction = Vec2(0.0, 1e4);
    scene.edges = {top, moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.measure = {"bottom", "top"};
    scene.stop.time = 1.0;
    for (const auto& [from, to] : {std::pair{0.0, 10e-3}, {2.03e-3, 7.41e-3}, {3.1e-3, 3.2e-3}}) {
        scene.edges[0].range = {{from, to}};
        const Record record = simulate(scene);
        const double load = 1e4 * (to - from) * scene.model.thickness;
        EXPECT_NEAR(record.reactions[1].force.back().y(), -load, 1e-7 * load) << from;
    }
}

}  // namespace
}  // namespace crampfit::test

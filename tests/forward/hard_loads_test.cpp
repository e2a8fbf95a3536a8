// Hard cases of loading: wheels on corners and smaller than a cell, specimens that nothing holds, toughness out of all
// proportion.
#include "datasets/error.hpp"
#include "forward/simulate.hpp"
#include "tests/forward/cracked_plates.hpp"
#include "tests/forward/hard_cases.hpp"

#include <fmt/format.h>

namespace crampfit::test {
namespace {

Body wheel(std::string name, Vec2 centre, double radius, Vec2 velocity) {
    Body body;
    body.name = std::move(name);
    body.shape = Circle{centre, radius};
    body.velocity = velocity;
    return body;
}

// Slope of the potential with time over the power of what prescribes motion, less one: they are the same at equilibrium. By
// central differences over a hundredth of the travel.
double slope_against_power(StaticTrial& run, double time) {
    double potential[2];
    for (const int side : {0, 1}) {
        EXPECT_TRUE(run.solve(time * (1 + 0.01 * (side - 0.5))));
        potential[side] = run.equilibrium.potential();
    }
    EXPECT_TRUE(run.solve(time));
    return (potential[1] - potential[0]) / (0.01 * time) / run.equilibrium.power() - 1;
}

TEST(HardWheel, OnASharpCorner) {
    // Down the diagonal onto the upper left corner of a square whose lower and right sides are held: the mirror image of itself,
    // until the corner gives way to one side, at 0.62 mm on cells of 0.5 mm.
    for (const double cell : {0.5e-3, 0.2e-3}) {
        const double radius = 1e-3;
        Scene scene = at_rest({10e-3, 10e-3}, cell);
        scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0}), moving("right", Side::right, {0.0, 0.0})};
        const Vec2 out = Vec2(-1.0, 1.0).normalized();
        scene.bodies = {wheel("wheel", Vec2(0, 10e-3) + radius * out, radius, -1e-3 * out)};
        scene.measure = {"wheel", "wheel"};
        StaticTrial run(scene);
        for (int k = 1; k <= 5; ++k) ASSERT_TRUE(run.solve(0.1 * k)) << k;
        const Vec2 push = push_of(run, 0);
        const std::string name = fmt::format("wheel on a sharp corner, {:.1f} mm cells", 1e3 * cell);
        EXPECT_GT(push.x(), 0.0);
        hard_case(name, "force along the diagonal: mirror symmetry", (push.x() + push.y()) / push.norm(), 1e-6);
        hard_case(name, "slope of the potential is the power", slope_against_power(run, 0.5), 1e-3);
    }
}

// A V notch with flanks of slope 2 from 3 mm deep in 10 x 10 mm, two wheels on them 1 mm below the top, which go down by 1 mm a
// second.
Scene notched(double radius, double cell) {
    const double half = std::atan(0.5), deep = 3e-3;
    Scene scene = at_rest({10e-3, 10e-3}, cell);
    scene.specimen.cutouts = {Polygon{{Vec2(3.5e-3, 10e-3), Vec2(6.5e-3, 10e-3), Vec2(5e-3, 10e-3 - deep)}}};
    scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
    for (const double side : {-1.0, 1.0}) {
        const Vec2 touched(5e-3 + side * 0.5 * (deep - 1e-3), 9e-3);
        const Vec2 out(-side * std::cos(half), std::sin(half));
        scene.bodies.push_back(wheel(side < 0 ? "left" : "right", touched + radius * out, radius, {0.0, -1e-3}));
    }
    scene.measure = {"left", "left"};
    return scene;
}

TEST(HardWheel, OfOneCellsRadius) {
    for (const double cell : {0.2e-3, 0.1e-3}) {
        StaticTrial run(notched(cell, cell));
        for (int k = 1; k <= 4; ++k) ASSERT_TRUE(run.solve(0.005 * k)) << k;
        const Vec2 left = push_of(run, 0), right = push_of(run, 1);
        const std::string name = fmt::format("wheel of one cell's radius, {:.1f} mm", 1e3 * cell);
        hard_case(name, "left and right push alike: mirror symmetry", (left.x() + right.x()) / left.norm(), 1e-6);
        hard_case(name, "F_H = F_V / (2 tan(A / 2)): normal to the flank", std::abs(left.x() / left.y()) / 2 - 1, 0.05);
        hard_case(name, "slope of the potential is the power", slope_against_power(run, 0.02), 1e-3);
    }
}

// ---- held too little

void expect_mechanism(const std::string& what, const Scene& scene) {
    double off = 1.0;
    std::string said = "accepted";
    try {
        said = simulate(scene).message;
    } catch (const InputError& error) {
        said = error.what();
        if (error.key == "edges" && error.file == "test.toml") off = 0.0;
    }
    hard_case(what, "an error that names file and key", off, 0.0);
    if (off > 0.0) std::printf("   says: %s\n", said.c_str());
}

TEST(HardMechanism, IsANamedError) {
    const Edge top = pulled("top", Side::top, {0.0, 1e4});
    Scene scene = at_rest({10e-3, 10e-3}, 0.5e-3);
    scene.measure = {"top", "top"};
    scene.edges = {top, without(moving("floor", Side::bottom, {0.0, 0.0}), 0)};
    expect_mechanism("free to slide to the side", scene);
    scene.edges = {top, moving("floor", Side::bottom, {0.0, 0.0})};
    scene.edges[1].range = {{0.0, 0.0}};
    expect_mechanism("free to turn about a corner", scene);
    scene.edges = {top, moving("floor", Side::bottom, {0.0, 0.0})};
    Crack through;
    through.points = {Vec2(0.0, 5e-3), Vec2(10e-3, 5e-3)};
    scene.cracks = {through};
    expect_mechanism("cut in two, one half not held", scene);
    through.points = {Vec2(-1e-3, 4.2e-3), Vec2(11e-3, 6.1e-3)};
    scene.cracks = {through};
    expect_mechanism("cut in two at an angle, one half not held", scene);
    through.points = {Vec2(0.0, 2e-3), Vec2(2e-3, 0.0)};
    scene.cracks = {through};
    scene.edges = {top, moving("right", Side::right, {0.0, 0.0})};
    expect_mechanism("a corner cut off", scene);
}

// ---- toughness

// A strip between grips, 60 x 10 mm, pulled by a micrometre a second up to 10 um.
Scene strip(double toughness) {
    Scene scene = at_equilibrium(block({60e-3, 10e-3}, 1e-3));
    scene.materials["EW"].toughness = toughness;
    scene.edges = {moving("top", Side::top, {0.0, 1e-6}), moving("bottom", Side::bottom, {0.0, 0.0})};
    Crack crack;
    crack.points = {Vec2(0.0, 5e-3), Vec2(20e-3, 5e-3)};
    crack.grows = Growth::end;
    crack.direction = GrowthDirection::straight;
    crack.advance = 1e-3;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.stop.displacement = 1e-5;
    return scene;
}

TEST(HardToughness, SoSmallThatTheCrackRunsAtOnce) {
    for (const double toughness : {1e-6, 1e-12}) {
        const Record record = simulate(strip(toughness));
        const double modulus = 40e6 * 0.67 / (1.33 * 0.34);
        const double exact = 10e-3 * std::sqrt(toughness / (modulus * 5e-3));  // REFERENCES: strip
        const std::string name = fmt::format("toughness {:.0e} J/m^2", toughness);
        ASSERT_FALSE(record.driving.empty());
        hard_case(name, "displacement at which the crack runs, exact for a strip",
                  record.driving.front().displacement / exact - 1, 0.01);
        hard_case(name, "it ends split", record.status == RunStatus::split ? 0.0 : 1.0, 0.0);
        hard_case(name, "toughness times new face", record.series.back().fracture_energy / (toughness * 40e-3) - 1, 1e-6);
    }
}

TEST(HardToughness, SoLargeThatTheCrackNeverMoves) {
    for (const double toughness : {1e6, 1e12}) {
        const Record record = simulate(strip(toughness));
        const Instant &half = record.series[record.series.size() / 2], &end = record.series.back();
        const std::string name = fmt::format("toughness {:.0e} J/m^2", toughness);
        hard_case(name, "the crack stays as long as it was", end.crack_length / 20e-3 - 1, 1e-12);
        hard_case(name, "force proportional to displacement", end.force / half.force / (end.displacement / half.displacement) - 1,
                  1e-9);
        hard_case(name, "work is strain energy", end.external_work / end.strain_energy - 1, 1e-9);
        hard_case(name, "it ends at its displacement", end.displacement / 1e-5 - 1, 1e-9);
    }
}

TEST(HardToughness, UnderWheels) {
    // A crack from the notch: runs at the first touch, or never.
    for (const double toughness : {1e-9, 1e9}) {
        Scene scene = notched(0.5e-3, 0.25e-3);
        scene.materials["EW"].toughness = toughness;
        Crack crack;
        crack.points = {Vec2(5e-3, 7e-3), Vec2(5e-3, 6e-3)};
        crack.grows = Growth::end;
        crack.direction = GrowthDirection::straight;
        crack.advance = 0.5e-3;
        scene.cracks = {crack};
        scene.stop.time.reset();
        scene.stop.displacement = 0.1e-3;
        scene.output.samples = 20;
        const Record record = simulate(scene);
        const Instant& end = record.series.back();
        const std::string name = fmt::format("wedge, toughness {:.0e} J/m^2", toughness);
        std::printf("   %s: %s, crack %.3f mm at %.6f mm\n", name.c_str(), crampfit::name(record.status), 1e3 * end.crack_length,
                    1e3 * end.displacement);
        if (toughness > 1.0) {
            hard_case(name, "the crack stays as long as it was", end.crack_length / 1e-3 - 1, 1e-12);
            hard_case(name, "it ends at its displacement", end.displacement / 0.1e-3 - 1, 1e-9);
        } else {
            // Energy given off by then is at most what came in by the wheels, and the crack has run most of the way.
            const auto first = std::find_if(record.series.begin(), record.series.end(),
                                            [](const Instant& row) { return row.crack_length > 4e-3; });
            ASSERT_NE(first, record.series.end());
            hard_case(name, "it has run four times its length by a thousandth of the travel", first->displacement / 0.1e-3, 1e-3);
        }
    }
}

}  // namespace
}  // namespace crampfit::test

// The findings of Nairn (2007), on the scenes of scripts/paper with coarse cells; docs/paper.md says what is seen at fine ones.
#include "datasets/io.hpp"
#include "forward/geometry.hpp"
#include "forward/material_map.hpp"
#include "forward/simulate.hpp"
#include "imaging/picture.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace crampfit::test {
namespace {

constexpr double at_equilibrium = 0.0;  // as a speed of the loading

struct Trip {
    Scene scene;
    Record record;
};

// A sample with the loading at a speed [m/s].
Trip run(const std::string& sample, double speed, double cell_mm, Overrides further = {}) {
    const auto number = [](double value) { return std::to_string(value); };
    Overrides overrides = {{"model.cell", number(cell_mm) + " mm"},
                           {"cracks.0.advance", "0.2 mm"},
                           {"output.frames", "0"},
                           {"output.samples", "1000"}};
    overrides.emplace_back("solver.kind", speed == at_equilibrium ? "quasistatic" : "explicit");
    if (speed != at_equilibrium) {
        const std::string along = "[\"" + number(speed) + " m/s\", \"0 m/s\"]", up = "[\"0 m/s\", \"" + number(speed) + " m/s\"]";
        if (sample == "wedge")
            for (const char* wheel : {"bodies.left wheel.velocity", "bodies.right wheel.velocity"})
                overrides.emplace_back(wheel, "[\"0 m/s\", \"-" + number(speed) + " m/s\"]");
        else if (sample == "tension_rt") overrides.emplace_back("edges.right.velocity", along);
        else overrides.emplace_back("edges.top.velocity", up);
    }
    overrides.insert(overrides.end(), further.begin(), further.end());
    Trip made;
    made.scene = read_scene(fmt::format("{}/{}.toml", SAMPLES, sample), overrides);
    load_specimen(made.scene);
    made.record = simulate(made.scene);
    return made;
}

const Overrides turned_by_45 = {{"specimen.rotation", "45 deg"}, {"specimen.offset", "[\"3.5 mm\", \"-3.571 mm\"]"}};
Overrides from_latewood(double x_mm) {
    return {{"cracks.0.points", fmt::format(R"([["{0} mm", "0 mm"], ["{0} mm", "2.5 mm"]])", x_mm)}};
}

// Of the crack's way and time, what is spent in earlywood and in latewood, by density.
bool is_latewood(const MaterialMap& materials, const Vec2& x) { return materials.at(x).density > 0.5 * (300.0 + 750.0); }

struct Spent {
    double way[2] = {0, 0};   // [m]
    double time[2] = {0, 0};  // [s]
    double speed(int wood) const { return way[wood] / time[wood]; }
    double latewood() const { return way[1] / (way[0] + way[1]); }
};

Spent spent(const Trip& run) {
    const MaterialMap materials(run.scene);
    Spent sum;
    const auto& rows = run.record.series;
    for (std::size_t i = 1; i < rows.size(); ++i) {
        if (rows[i].crack_length <= rows[0].crack_length + 0.02e-3) continue;  // not yet on its way
        const int wood = is_latewood(materials, 0.5 * (rows[i].tip + rows[i - 1].tip));
        sum.way[wood] += rows[i].crack_length - rows[i - 1].crack_length;
        sum.time[wood] += rows[i].time - rows[i - 1].time;
    }
    return sum;
}

// What part of the straight way on from the notch to the other side is latewood.
double latewood_straight_ahead(const Scene& scene) {
    const MaterialMap materials(scene);
    const Vec2 from = scene.cracks[0].points[1], ahead = (from - scene.cracks[0].points[0]).normalized();
    const double way = *exit_distance(from, ahead, {Vec2::Zero(), scene.specimen.size});
    constexpr int samples = 1000;
    int latewood = 0;
    for (int i = 0; i < samples; ++i) latewood += is_latewood(materials, from + (i + 0.5) / samples * way * ahead);
    return static_cast<double>(latewood) / samples;
}

// How often the force falls by this part of its largest value, or more, before it rises again.
int falls(const Record& record, double part) {
    double largest = 0.0;
    for (const Instant& row : record.series) largest = std::max(largest, std::abs(row.force));
    int count = 0;
    double high = 0.0, low = 0.0;
    bool falling = false;
    for (const Instant& row : record.series) {
        const double force = std::abs(row.force);
        if (falling) {
            low = std::min(low, force);
            if (force > low + part * largest) falling = false, high = force;
        } else {
            high = std::max(high, force);
            if (force < high - part * largest) ++count, falling = true, low = force;
        }
    }
    return count;
}

// The way that the crack has grown, from the notch on.
std::vector<Vec2> grown(const Trip& run) {
    std::vector<Vec2> path = run.record.paths[0];
    const Vec2 notch = run.scene.cracks[0].points.back();
    const auto nearest = std::min_element(path.begin(), path.end(),
                                          [&](const Vec2& a, const Vec2& b) { return (a - notch).norm() < (b - notch).norm(); });
    path.erase(path.begin(), nearest);
    return path;
}

// Root mean square of its direction about the mean [degrees].
double zig_zag(const Trip& run) {
    const std::vector<Vec2> path = grown(run);
    const Vec2 ahead = (run.scene.cracks[0].points[1] - run.scene.cracks[0].points[0]).normalized();
    double length = 0.0, sum = 0.0, squares = 0.0;
    for (std::size_t k = 0; k + 1 < path.size(); ++k) {
        const Vec2 leg = path[k + 1] - path[k];
        const double angle = std::atan2(cross(ahead, leg), ahead.dot(leg));
        length += leg.norm();
        sum += angle * leg.norm();
        squares += angle * angle * leg.norm();
    }
    return 180.0 / std::numbers::pi * std::sqrt(squares / length - sum * sum / (length * length));
}

// Largest distance of a way's corners from another way [m].
double apart(const Trip& from, const Trip& to) {
    double most = 0.0;
    const std::vector<Vec2> other = grown(to);
    for (const Vec2& x : grown(from)) {
        double nearest = INFINITY;
        for (std::size_t k = 0; k + 1 < other.size(); ++k) {
            const Vec2 along = other[k + 1] - other[k];
            nearest = std::min(
                nearest, (x - other[k] - std::clamp((x - other[k]).dot(along) / along.squaredNorm(), 0.0, 1.0) * along).norm());
        }
        most = std::max(most, nearest);
    }
    return most;
}

double displacement_at_growth(const Record& record) {
    for (const Instant& row : record.series)
        if (row.crack_length > record.series[0].crack_length + 0.02e-3) return row.displacement;
    return NAN;
}

TEST(SlowPaper, TrPlusIsFasterThroughLatewood) {
    for (const double speed : {2.0, 5.0, 10.0, 20.0}) {
        const Spent way = spent(run("tension_tr_plus", speed, 0.2));
        std::printf("TR+ at %.0f m/s: crack at %.0f m/s in earlywood, %.0f m/s in latewood\n", speed, way.speed(0), way.speed(1));
        EXPECT_GT(way.speed(1), way.speed(0));
    }
}

TEST(SlowPaper, TrPlusForceRisesAndFallsAtLatewood) {
    for (const double speed : {2.0, 5.0, 10.0, 20.0}) {  // at equilibrium one jump goes through several bands
        const int count = falls(run("tension_tr_plus", speed, 0.2).record, 0.25);
        std::printf("TR+ at %.0f m/s: the force falls by a quarter of its peak %d times\n", speed, count);
        EXPECT_GE(count, 2);
    }
}

// Boxes about the tip once took more energy off, along bands that lie askew, than an advance releases: the crack stopped for
// good.
TEST(SlowPaper, TrMinusGoesThroughAtEquilibrium) {
    double peak[2];
    for (const int fine : {0, 1}) {
        const Record record = run("tension_tr_minus", at_equilibrium, fine ? 0.1 : 0.2).record;
        EXPECT_EQ(record.status, RunStatus::split);
        const auto lower = [](const Instant& a, const Instant& b) { return a.force < b.force; };
        peak[fine] = std::max_element(record.series.begin(), record.series.end(), lower)->force;
    }
    std::printf("TR-: peak %.1f N with cells of 0.2 mm, %.1f N with 0.1 mm\n", peak[0], peak[1]);
    EXPECT_NEAR(peak[0], peak[1], 0.02 * peak[1]);
}

TEST(SlowPaper, TrMinusIsNotTheMirrorOfTrPlus) {
    for (const double speed : {at_equilibrium, 2.0, 5.0, 10.0, 20.0}) {
        const double plus = displacement_at_growth(run("tension_tr_plus", speed, 0.2).record);
        const double minus = displacement_at_growth(run("tension_tr_minus", speed, 0.2).record);
        std::printf("at %.0f m/s: TR+ grows from %.3f mm on, TR- from %.3f mm\n", speed, 1e3 * plus, 1e3 * minus);
        EXPECT_GT(minus, 1.5 * plus);
    }
}

TEST(SlowPaper, TrMinusTakesAnotherWayAtTheHighestRate) {
    const Trip slow = run("tension_tr_minus", 2.0, 0.2);
    const double five = apart(run("tension_tr_minus", 5.0, 0.2), slow), ten = apart(run("tension_tr_minus", 10.0, 0.2), slow);
    const double twenty = apart(run("tension_tr_minus", 20.0, 0.2), slow);
    std::printf("TR- at 5, 10, 20 m/s: %.2f, %.2f, %.2f mm off the way at 2 m/s\n", 1e3 * five, 1e3 * ten, 1e3 * twenty);
    EXPECT_GT(twenty, 1.5 * std::max(five, ten));
}

TEST(SlowPaper, ObliqueRingsMakeACrackZigZag) {
    for (const double speed : {at_equilibrium, 2.0, 5.0, 10.0}) {
        const double across = zig_zag(run("tension_tr_plus", speed, 0.2));
        const double at_45 = zig_zag(run("tension_tr135", speed, 0.2, turned_by_45)),
                     at_135 = zig_zag(run("tension_tr135", speed, 0.2));
        std::printf("at %.0f m/s: direction varies by %.1f degrees across the rings, %.1f at 45, %.1f at 135 degrees\n", speed,
                    across, at_45, at_135);
        EXPECT_GT(at_45, 1.5 * across);
        EXPECT_GT(at_135, 1.5 * across);
    }
}

// The paper has a crack along the rings drawn to latewood, and one in latewood stays there. In elastic wood of one toughness
// latewood turns a crack away and out (`VerificationAlongRings`), and so it goes here: a crack that starts in earlywood spends no
// more of its way in latewood than the straight way on does, over which the waving band leans, and one that starts in latewood
// leaves it. Where is chance in motion: of starts a hundredth of a millimetre apart one stays in it twice as long.
TEST(SlowPaper, RtIsNotDrawnToLatewood) {
    for (const double speed : {at_equilibrium, 2.0, 10.0}) {
        const Trip from_earlywood = run("tension_rt", speed, 0.1);
        const double outside = spent(from_earlywood).latewood(), straight = latewood_straight_ahead(from_earlywood.scene);
        double inside = 0.0;
        for (const double start : {5.2, 5.25, 5.3})
            inside += spent(run("tension_rt", speed, 0.1, from_latewood(start))).latewood() / 3;
        std::printf("RT at %.0f m/s: started in earlywood %.0f %% of the way in latewood, straight on %.0f %%; started in "
                    "latewood %.0f %%\n",
                    speed, 100 * outside, 100 * straight, 100 * inside);
        EXPECT_LE(outside, straight + 0.02);  // the rows of a record are up to 0.01 of the way apart
        EXPECT_LT(inside, 0.7);
    }
}

TEST(SlowPaper, WedgeIsStraighterThanTension) {
    for (const double speed : {at_equilibrium, 2.0, 5.0, 10.0, 20.0}) {
        const Trip wedge = run("wedge", speed, 0.2);
        const double split = zig_zag(wedge), pulled = zig_zag(run("tension_tr_minus", speed, 0.2));
        const int count = falls(wedge.record, 0.1);
        std::printf(
            "at %.0f m/s: direction varies by %.1f degrees in the wedge test, %.1f in tension; wedge force falls %d times\n",
            speed, split, pulled, count);
        EXPECT_LT(split, pulled);
        EXPECT_GE(count, 1);
    }
}

TEST(SlowPaper, EnergyBooksClose) {
    for (const char* sample : {"tension_tr_plus", "tension_tr_minus", "tension_tr135", "tension_rt", "wedge"}) {
        for (const double speed : {2.0, 5.0, 10.0, 20.0}) {
            const double off = run(sample, speed, 0.2).record.worst_energy_imbalance;
            std::printf("%s at %.0f m/s: books off by %.2f %%\n", sample, speed, 100 * off);
            EXPECT_LT(off, 0.01);
        }
    }
}

}  // namespace
}  // namespace crampfit::test

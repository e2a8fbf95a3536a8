// Wood that remembers: what is refused, and the times that equilibrium takes it through.
#include "datasets/error.hpp"
#include "forward/march.hpp"
#include "tests/forward/scenes_that_remember.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace crampfit::test {
namespace {

TEST(UnitHistory, Refusals) {
    const auto refuses = [](const Scene& scene, const std::string& key) {
        try {
            explain(scene);
        } catch (const InputError& error) {
            EXPECT_NE(std::string(error.what()).find(key), std::string::npos) << error.what();
            return;
        }
        FAIL() << key;
    };
    Scene scene = ring_specimen(3e-3, 0.5e-3);
    scene.materials["EW"] = relaxing(0.5, 1.0);
    EXPECT_NO_THROW(explain(scene));
    Scene other = scene;
    other.specimen.rings->transition = 0.3e-3;
    refuses(other, "specimen.rings.transition");
    other = scene;
    other.cracks[0].grows = Growth::end;
    EXPECT_NO_THROW(explain(other));
    other.cracks[0].direction = GrowthDirection::hoop_stress;
    refuses(other, "cracks.0.direction");
    other.cracks[0].direction = GrowthDirection::straight;
    other.materials["EW"] = relaxing(0.5, 1e-4);
    refuses(other, "materials.EW.prony.0.tau");
    other = scene;
    other.cracks[0].grows = Growth::end;
    other.cracks[0].advance = 1e-3;
    refuses(other, "cracks.0.advance");
    other = at_equilibrium(scene);
    other.cracks[0].grows = Growth::end;
    refuses(other, "cracks.0.grows");
    other = scene;
    other.cracks[0].grows = Growth::end;
    other.materials["LW"] = flowing(1e6, 0.0);
    refuses(other, "cracks.0.grows");
    other = scene;
    other.solver.time_step = 1.0;
    refuses(other, "solver.time_step");
    other = at_equilibrium(ring_specimen(3e-3, 0.5e-3));
    other.solver.time_step = 1.0;
    refuses(other, "solver.time_step");
    other = at_equilibrium(scene);
    other.stop = {};
    other.stop.crack_length = 5e-3;
    refuses(other, "stop");
}

// Steps begin with a twentieth of the relaxation time wherever the load changes, and come to what stops, to frames and to the
// end.
TEST(UnitMarch, Times) {
    Scene scene = bar(relaxing(0.5, 0.01), PlaneCondition::strain, pull(1e-6, 0.3));
    scene.output.frames = 3;
    const MaterialMap materials(scene);
    const Discretisation body(scene, materials);
    const Plan plan = make_plan(scene, materials, body);
    const std::vector<double> times = march_times(scene, plan, materials);
    const auto has = [&](double time) { return std::find(times.begin(), times.end(), time) != times.end(); };
    EXPECT_DOUBLE_EQ(times.front(), 0.5e-3);
    EXPECT_TRUE(has(0.3) && has(0.5) && has(1.0));
    EXPECT_EQ(times.back(), 1.0);
    for (std::size_t k = 0; k < times.size(); ++k) {
        const double from = k == 0 ? 0.0 : times[k - 1];
        EXPECT_GT(times[k], from);
        EXPECT_LE(times[k] - from, 0.01 * (1 + 1e-9));
        if (from == 0.3) {
            EXPECT_NEAR(times[k] - from, 0.5e-3, 1e-12);
        }
    }
    scene.solver.time_step = 0.1;
    scene.output.frames = 0;
    EXPECT_EQ(march_times(scene, plan, materials).size(), 10U);
}

// Frames at even times, with the stress that acts; probes at times or displacements.
TEST(UnitMarch, FramesAndProbes) {
    Scene scene = bar(relaxing(0.6, 0.7), PlaneCondition::strain, pulled("right", Side::right, {0.1e6, 0.0}));
    scene.stop.time = 2.1;
    scene.output.frames = 4;
    scene.output.probes.places = {Vec2(4e-3 * (1 - 1e-9), 1e-3)};
    scene.output.probes.instants = {0.0, 0.35, 1.0, 2.1};
    const Record record = simulate(scene);
    ASSERT_EQ(record.frames.size(), 4U);
    ASSERT_EQ(record.probes.size(), 4U);
    for (int k = 0; k < 4; ++k) {
        EXPECT_DOUBLE_EQ(record.frames[k].time, 0.7 * k);
        for (const Eigen::Vector4f& stress : record.frames[k].stress) {
            EXPECT_NEAR(stress[0], 0.1e6, 1.0);
            EXPECT_NEAR(stress[1], 0.0, 1.0);
            EXPECT_NEAR(stress[3], 0.033e6, 1.0);  // nu stays what it is
        }
    }
    const auto moved = [&](double time) { return 0.1e6 * 4e-3 / bar_modulus(PlaneCondition::strain) * creep(0.6, 0.7, time); };
    for (int k = 0; k < 4; ++k)
        EXPECT_NEAR(record.probes[k].moved[0].x(), moved(scene.output.probes.instants[k]), 1e-3 * moved(0.0));
    scene.output.probes.by_displacement = true;
    scene.output.probes.instants = {moved(0.5), moved(1.5)};
    const Record by_displacement = simulate(scene);
    ASSERT_EQ(by_displacement.probes.size(), 2U);
    for (int k = 0; k < 2; ++k)
        EXPECT_NEAR(by_displacement.probes[k].moved[0].x(), scene.output.probes.instants[k], 1e-6 * moved(0.0));
}

}  // namespace
}  // namespace crampfit::test

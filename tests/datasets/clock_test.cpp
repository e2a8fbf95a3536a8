// Setting the images' clock by the load's.
#include "datasets/clock.hpp"
#include "datasets/density_table.hpp"
#include "datasets/error.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

using namespace crampfit;

namespace {

/// A test that rises, drops at a jump of the crack, and rises again.
double force_at(double time) { return time < 40 ? 3 * time : 60 + 2 * (time - 40); }

Curves load_record() {
    Curves load;
    for (double time = 0; time <= 100; time += 0.1) {
        load.time.push_back(time);
        load.force.push_back(force_at(time));
    }
    return load;
}

/// Pictures every 2 s of a camera whose clock starts `offset` s later on the load's and runs by `rate`, with noise on its
/// channel.
Curves camera_record(double offset, double rate, double noise) {
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    Curves images;
    for (double time = 0; offset + rate * time <= 95; time += 2) {
        images.time.push_back(time);
        images.force.push_back(force_at(offset + rate * time) + noise * normal(generator));
    }
    return images;
}

}  // namespace

TEST(UnitClock, IsSetByASharedChannel) {
    const double offset = 12.34, rate = 1.01, noise = 0.25;
    const Curves images = camera_record(offset, rate, noise);
    const ClockSetting clock = set_clock(images, load_record(), {}, "times.csv");
    const double slope = 2.4;  // root mean square, roughly: 3 N/s and 2 N/s
    std::printf("offset %.3f s (true %.2f), rate %.5f (true %.2f), misalignment %.3f s a picture\n", clock.offset, offset,
                clock.rate, rate, *clock.misalignment);
    const double images_count = static_cast<double>(images.time.size());
    EXPECT_NEAR(clock.offset, offset, 4 * 2 * noise / slope / std::sqrt(images_count));
    EXPECT_NEAR(clock.rate, rate, 0.01);
    ASSERT_TRUE(clock.misalignment.has_value());
    EXPECT_NEAR(*clock.misalignment, noise / slope, 0.3 * noise / slope);
}

TEST(UnitClock, IsSetAsTold) {
    const Curves load = load_record(), images = camera_record(12.5, 1, 0);
    Curves bare;
    bare.time = {5, 7};
    EXPECT_EQ(set_clock(bare, load, {}, "").offset, 0);
    EXPECT_FALSE(set_clock(bare, load, {}, "").misalignment.has_value());
    EXPECT_EQ(set_clock(bare, load, {.offset = 3, .trigger = {}, .rate = {}}, "").offset, 3);
    const ClockSetting triggered = set_clock(bare, load, {.offset = {}, .trigger = 20, .rate = 2}, "");
    EXPECT_EQ(triggered.offset + triggered.rate * bare.time[0], 20);
    EXPECT_EQ(triggered.offset + triggered.rate * bare.time[1], 24);
    // What is told is kept, and the shared channel says how well it fits: 1 s off.
    const ClockSetting off = set_clock(images, load, {.offset = 13.5, .trigger = {}, .rate = 1}, "");
    EXPECT_EQ(off.offset, 13.5);
    EXPECT_NEAR(*off.misalignment, 1, 1e-6);
}

// The first and the last picture of a record are on it whatever an offset and a rate have rounded; a little beyond they are not.
TEST(UnitClock, RoundingLosesNoPicture) {
    std::vector<double> times, values;
    for (int i = 0; i <= 10; ++i) {
        times.push_back(1.1 + 0.3 * i);
        values.push_back(i);
    }
    EXPECT_NEAR(load_at(times, values, times.front() * (1 - 1e-15)), 0, 1e-6);
    EXPECT_NEAR(load_at(times, values, times.back() * (1 + 1e-15)), 10, 1e-6);
    EXPECT_TRUE(std::isnan(load_at(times, values, times.front() - 1e-6)));
    EXPECT_TRUE(std::isnan(load_at(times, values, times.back() + 1e-6)));
    EXPECT_TRUE(std::isnan(load_at(times, values, NAN)));
}

TEST(UnitClock, AChannelThatSaysNothingIsRefused) {
    Curves images = camera_record(12, 1, 0), load = load_record();
    for (double& force : load.force) force = 5;
    EXPECT_THROW(set_clock(images, load, {}, "times.csv"), InputError);
}

TEST(UnitDensityTable, ReadsAndRefuses) {
    const TemporaryFolder folder;
    const DensityTable table =
        read_density_table(folder.write("good.csv", "# wedge\ngray,density [g/cm^3]\n0,0\n100,0.4\n200,1.2\n"));
    EXPECT_DOUBLE_EQ(table.at(50), 200);
    EXPECT_DOUBLE_EQ(table.at(150), 800);
    EXPECT_DOUBLE_EQ(table.at(255), 1200);
    for (const char* bad :
         {"", "gray,density [kg/m^3]\n1,1\n", "gray,density\n1,1\n2,2\n", "gray,density [mm]\n1,1\n2,2\n",
          "gray,density [kg/m^3]\n2,1\n1,2\n", "gray,density [kg/m^3]\n1,a\n2,2\n", "gray,density [kg/m^3]\n1,1\n2,-2\n",
          "gray,density [kg/m^3]\n1,1\n300,2\n", "gray,density [kg/m^3]\n1,1\n2,3\n3,2\n", "gray,density [kg/m^3]\n1\n2\n",
          "x,density [kg/m^3]\n1,1\n2,2\n"})
        EXPECT_THROW(read_density_table(folder.write("bad.csv", bad)), InputError) << bad;
}

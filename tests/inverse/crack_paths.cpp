// Distances between paths, against geometry; where cracks go in a study's models.
#include "inverse/crack_paths.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace crampfit::testing {
namespace {

const std::vector<std::vector<Vec2>> notch{{{0, 0}, {1, 0}}};

TEST(UnitCrackPaths, DistanceOfParallelLines) {
    SimulatedPath path{.model = "", .status = "", .cracks = {{{0, 0}, {1, 0}, {3, 0}}}};
    compare_paths({{0, 0.25}, {5, 0.25}}, notch, path);  // the notch ends at 1, the simulated crack at 3
    EXPECT_NEAR(path.mean_distance, 0.25, 1e-12);
    EXPECT_NEAR(path.largest_distance, 0.25, 1e-12);
    EXPECT_NEAR(path.compared_length, 2, 0.01);  // to a place in 1000
}

// A kink of 45 degrees at the notch's tip: at s along the straight path the distance is s / sqrt 2, up to the foot of the
// simulated tip, s = 2 for a kinked length of sqrt 2.
TEST(UnitCrackPaths, DistanceFromAKinkedPath) {
    SimulatedPath path{.model = "", .status = "", .cracks = {{{0, 0}, {1, 0}, {2, 1}}}};
    compare_paths({{1, 0}, {9, 0}}, notch, path);
    EXPECT_NEAR(path.compared_length, 2, 0.02);
    EXPECT_NEAR(path.largest_distance, std::sqrt(2), 0.01);
    EXPECT_NEAR(path.mean_distance, std::sqrt(0.5), 0.01);
}

TEST(UnitCrackPaths, NothingToCompare) {
    for (const std::vector<std::vector<Vec2>>& cracks : {notch, std::vector<std::vector<Vec2>>{}}) {
        SimulatedPath path{.model = "", .status = "", .cracks = cracks};
        compare_paths({{0, 0.1}, {2, 0.1}}, notch, path);
        EXPECT_TRUE(std::isnan(path.mean_distance));
        EXPECT_TRUE(std::isnan(path.largest_distance));
        EXPECT_EQ(path.compared_length, 0);
    }
    SimulatedPath path{.model = "", .status = "", .cracks = notch};
    compare_paths({}, {}, path);
    EXPECT_TRUE(std::isnan(path.mean_distance));
}

}  // namespace
}  // namespace crampfit::testing

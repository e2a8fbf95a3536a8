#pragma once

#include "datasets/placement.hpp"

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

namespace crampfit {

/// A gray picture of the specimen's plane, upright on its axes.
struct PlanePicture {
    int columns = 0;
    int rows = 0;
    std::vector<std::uint8_t> gray;  // [rows x columns], row 0 at the top
    Vec2 low = Vec2::Zero();         // lower left corner in the specimen [m]
    Vec2 high = Vec2::Zero();        // upper right corner in the specimen [m]
};

/// What a test's pictures show of its crack.
struct Photograph {
    std::filesystem::path file;        // of one of them, to be drawn; empty: none
    std::filesystem::path track = {};  // that `path` comes from; empty: none
    Placement placement;
    std::vector<Vec2> path;     // of the crack, in the specimen [m]; empty: not known
    int columns = 0, rows = 0;  // of the pictures that it was tracked in [px]; 0: none
    PlanePicture picture;       // what the file shows, once it has been read
};

/// Where cracks went in one model of an experiment, at its best parameters.
struct SimulatedPath {
    static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    std::string model;                      // empty where none were compared
    std::string status;                     // how the run ended
    std::vector<std::vector<Vec2>> cracks;  // of the scene, in its order; none where the run did not end well [m]
    // From places of the photographed path to the simulated ones; not a number where there is nothing to compare:
    double mean_distance = unknown;     // [m]
    double largest_distance = unknown;  // [m]
    double compared_length = 0;         // of the photographed path, beside which the simulated crack has grown [m]
};

/// Simulated and photographed crack paths of one experiment.
struct CrackPaths {
    std::string experiment;
    bool on_photograph = false;  // else the picture is the model's wood, the darker the later
    PlanePicture picture;
    std::vector<Vec2> photographed;        // empty: not known [m]
    std::vector<SimulatedPath> simulated;  // of each model, the best first
};

}  // namespace crampfit

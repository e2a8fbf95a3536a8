#pragma once

#include "cli/common.hpp"
#include "datasets/crack_track.hpp"

namespace crampfit::cli {

/// When the pictures of a series were taken, as the command line tells it.
struct PictureTimes {
    std::filesystem::path times, load;
    std::string offset, trigger, rate;  // as written; empty: not told
};

void add_picture_times(CLI::App& verb, PictureTimes& times);

/// What is known of each picture then. Columns are empty where it is not.
struct PictureInstants {
    std::vector<double> time;           // on the load's clock [s]
    std::vector<double> displacement;   // of the loading [m]
    std::vector<double> force;          // [N]
    std::optional<ClockSetting> clock;  // where a load was given
};

/// Reads the tables and sets the clocks; reports how. Throws InputError.
PictureInstants read_picture_times(const PictureTimes& times, std::size_t images, const CommonOptions& common);

}  // namespace crampfit::cli

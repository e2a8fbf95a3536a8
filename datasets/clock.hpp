#pragma once

#include "datasets/crack_track.hpp"
#include "datasets/experiment.hpp"

#include <optional>

namespace crampfit {

/// What is told of the images' clock.
struct ClockChoice {
    std::optional<double> offset;   // of the images' time 0 on the load's clock [s]
    std::optional<double> trigger;  // when the first image was taken, on the load's clock, in place of the offset [s]
    std::optional<double> rate;     // seconds of the load's clock in one of the images'
};

/// How the images' clock stands to the load's: as told, or else, where `images` has a displacement or a force beside its times,
/// as brings that nearest to the load's curve (least squares over offset and rate, from the best of many offsets), or else the
/// same. Where there is such a shared channel, what it leaves is reported as misalignment: root mean square over that of the
/// curve's slope. Throws InputError, naming `file`, for a shared channel that does not change or of which the load's record holds
/// too little.
ClockSetting set_clock(const Curves& images, const Curves& load, const ClockChoice& told, const std::filesystem::path& file);

/// A column of the load at a time, linearly between its rows; not a number outside them, but for rounding. Times must rise.
double load_at(const std::vector<double>& times, const std::vector<double>& values, double time);

}  // namespace crampfit

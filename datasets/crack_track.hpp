#pragma once

#include "datasets/experiment.hpp"
#include "datasets/scene.hpp"

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace crampfit {

/// Whether a tip was found in an image.
enum class TipStatus : std::uint8_t {
    ok,
    too_few_points,  // of the image were followed
    no_crack,        // a field without a crack describes the displacements as well
    outside,         // the crack's tip is not in the picture
    not_lined_up,    // the picture shows something else than the reference
};

inline constexpr std::size_t tip_status_count = 5;

/// In words, as the table `series` prints it.
const char* name(TipStatus status);

/// The tip of a crack in one image, at the place that its material has in the reference. Numbers are not a number
/// unless `ok`.
struct CrackTip {
    static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    TipStatus status = TipStatus::no_crack;
    Vec2 tip{unknown, unknown};  // x right, y down, from the centre of the picture's first pixel [px]
    double angle = unknown;      // in which the crack points, clockwise as seen, from +x [rad]
    double length = unknown;     // from where the crack's line enters the picture to the tip [px]
    double sigma = unknown;      // standard error of the length [px]
    // Of the crack from its mouth to the tip, or through the picture, where it was followed; else it is straight [px].
    std::vector<Vec2> way = {};
    double tip_sigma = unknown;  // standard error of the tip, along the crack; no file keeps it [px]
};

/// How the images' clock was set by the load's: load time = offset + rate * image time.
struct ClockSetting {
    double offset = 0;                   // [s]
    double rate = 1;                     // seconds of the load's clock in one of the images'
    std::string reason;                  // how that is known, for a person
    std::optional<double> misalignment;  // that is left between the clocks, one sigma, where a shared channel tells [s]
};

/// Crack tip and crack length in a series of images, with what else is known of their times.
struct CrackTrack {
    std::string reference;
    std::vector<std::string> images;
    std::optional<double> pixel;        // edge of a pixel, where it was told [m]
    int columns = 0, rows = 0;          // of the pictures [px]; 0: not known
    std::vector<CrackTip> tips;         // of each image
    std::vector<double> time;           // of each image on the load's clock, or empty [s]
    std::vector<double> displacement;   // of the loading then, or empty [m]; not a number outside the load's record
    std::vector<double> force;          // of the loading then, or empty [N]; likewise
    std::optional<ClockSetting> clock;  // where a load was given
};

/// What a fit takes as an experiment's data: time, displacement, force and crack length as far as they are known.
Curves curves_of(const CrackTrack& track);

/// The crack's path as far as the pictures show it [px]: its way in the last image where it was followed; where it never was,
/// from its mouth through its tips in one image after the other.
std::vector<Vec2> path_of(const CrackTrack& track);

void write(const CrackTrack& track, const std::filesystem::path& file);
CrackTrack read_crack_track(const std::filesystem::path& file);

}  // namespace crampfit

#include "datasets/crack_track.hpp"

#include "datasets/error.hpp"
#include "datasets/hdf5.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace crampfit {

using hdf5::Group;

namespace {

constexpr std::array<const char*, tip_status_count> tip_status_names{
    "ok", "too few points", "no crack", "tip outside the picture", "not lined up with the reference"};

struct TipColumn {
    const char* name;
    hdf5::Meaning meaning;
    double CrackTip::*value;
};

const TipColumn tip_columns[] = {
    {"angle", {"rad", "in which the crack points, clockwise as seen, from +x"}, &CrackTip::angle},
    {"length", {"px", "from where the crack's line enters the picture to the tip"}, &CrackTip::length},
    {"sigma", {"px", "standard error of the length"}, &CrackTip::sigma},
};

struct LoadColumn {
    const char* name;
    hdf5::Meaning meaning;
    std::vector<double> CrackTrack::*values;
};

const LoadColumn load_columns[] = {
    {"time", {"s", "of each image"}, &CrackTrack::time},
    {"displacement", {"m", "of the loading at each image's time"}, &CrackTrack::displacement},
    {"force", {"N", "of the loading at each image's time"}, &CrackTrack::force},
};

/// All ways in one array: that of an image ends where `way ends` says, and begins where the one before ends.
void write_ways(Group& root, const std::vector<CrackTip>& tips) {
    std::vector<Vec2> points;
    std::vector<std::int64_t> ends;
    for (const CrackTip& tip : tips) {
        points.insert(points.end(), tip.way.begin(), tip.way.end());
        ends.push_back(static_cast<std::int64_t>(points.size()));
    }
    root.write("way points", points,
               {"px", "of the cracks' ways from mouth to tip, where they were followed, one image after the other"});
    root.write("way ends", ends, {"1", "row of `way points` before which each image's way ends"});
}

void read_ways(const Group& root, std::vector<CrackTip>& tips) {
    const std::vector<Vec2> points = root.read_rows<double, 2>("way points");
    std::int64_t first = 0;
    const std::vector<std::int64_t> ends = root.read_column<std::int64_t>("way ends", tips.size());
    for (std::size_t i = 0; i < tips.size(); ++i) {
        if (ends[i] < first || ends[i] > static_cast<std::int64_t>(points.size()))
            root.refuse("way ends", std::to_string(ends[i]), fmt::format("must rise, to {} at most", points.size()));
        tips[i].way.assign(points.begin() + first, points.begin() + ends[i]);
        first = ends[i];
    }
}

}  // namespace

const char* name(TipStatus status) { return tip_status_names.at(static_cast<std::size_t>(status)); }

Curves curves_of(const CrackTrack& track) {
    Curves curves;
    curves.time = track.time;
    curves.displacement = track.displacement;
    curves.force = track.force;
    for (const CrackTip& tip : track.tips)
        if (track.pixel) curves.crack_length.push_back(tip.length * *track.pixel);
    return curves;
}

std::vector<Vec2> path_of(const CrackTrack& track) {
    for (auto tip = track.tips.rbegin(); tip != track.tips.rend(); ++tip)
        if (!tip->way.empty()) return tip->way;
    std::vector<Vec2> path;
    for (const CrackTip& tip : track.tips) {
        if (tip.status != TipStatus::ok) continue;
        if (path.empty()) path.push_back(tip.tip - tip.length * Vec2(std::cos(tip.angle), std::sin(tip.angle)));
        path.push_back(tip.tip);
    }
    return path;
}

void write(const CrackTrack& track, const std::filesystem::path& file) {
    hdf5::save(file, "track", [&](Group& root) {
        root.write_text("reference", track.reference, "picture that all others are compared with");
        root.write_texts("image files", track.images, "pictures by their number");
        if (track.pixel) root.write("pixel", *track.pixel, {"m", "edge of a pixel"});
        root.write_texts("status names", {tip_status_names.begin(), tip_status_names.end()}, "whether a tip was found");
        if (track.rows > 0) {
            root.write<std::int64_t>("columns", track.columns, {"px", "width of the pictures"});
            root.write<std::int64_t>("rows", track.rows, {"px", "height of the pictures"});
        }
        std::vector<std::uint8_t> status;
        std::vector<Vec2> tips;
        for (const CrackTip& tip : track.tips) {
            status.push_back(static_cast<std::uint8_t>(tip.status));
            tips.push_back(tip.tip);
        }
        root.write("status", status, {"1", "index into `status names`; 0 is a tip that was found"});
        root.write("tip", tips,
                   {"px", "x right, y down, from the centre of the first pixel, at the material's place in the reference"});
        for (const TipColumn& column : tip_columns) {
            std::vector<double> values;
            for (const CrackTip& tip : track.tips) values.push_back(tip.*column.value);
            root.write(column.name, values, column.meaning);
        }
        write_ways(root, track.tips);
        if (track.clock) {
            Group clock = root.make_group("clock", "load time = offset + rate * image time");
            clock.write("offset", track.clock->offset, {"s", "of the images' time 0 on the load's clock"});
            clock.write("rate", track.clock->rate, {"1", "seconds of the load's clock in one of the images'"});
            clock.write_text("reason", track.clock->reason, "how that is known");
            if (track.clock->misalignment)
                clock.write("misalignment", *track.clock->misalignment, {"s", "that is left between the clocks, one sigma"});
        }
        for (const LoadColumn& column : load_columns)
            if (!(track.*column.values).empty()) root.write(column.name, track.*column.values, column.meaning);
    });
}

CrackTrack read_crack_track(const std::filesystem::path& file) {
    const Group root = hdf5::open(file, "track");
    CrackTrack track;
    track.reference = root.read_text("reference");
    track.images = root.read_texts("image files");
    if (root.has("pixel")) track.pixel = root.read_number<double>("pixel");
    if (root.has("rows")) {
        track.columns = static_cast<int>(root.read_number<std::int64_t>("columns"));
        track.rows = static_cast<int>(root.read_number<std::int64_t>("rows"));
    }
    const std::size_t count = track.images.size();
    const std::vector<Vec2> tips = root.read_rows<double, 2>("tip", count);
    const std::vector<std::uint8_t> status = root.read_column<std::uint8_t>("status", count);
    track.tips.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        if (status[i] >= tip_status_count)
            root.refuse("status", std::to_string(status[i]), fmt::format("must be less than {}", tip_status_count));
        track.tips[i].status = static_cast<TipStatus>(status[i]);
        track.tips[i].tip = tips[i];
    }
    for (const TipColumn& column : tip_columns) {
        const std::vector<double> values = root.read_column<double>(column.name, count);
        for (std::size_t i = 0; i < count; ++i) track.tips[i].*column.value = values[i];
    }
    if (root.has("way ends")) read_ways(root, track.tips);
    if (root.has("clock")) {
        const Group clock = root.group("clock");
        track.clock =
            ClockSetting{clock.read_number<double>("offset"), clock.read_number<double>("rate"), clock.read_text("reason"), {}};
        if (clock.has("misalignment")) track.clock->misalignment = clock.read_number<double>("misalignment");
    }
    for (const LoadColumn& column : load_columns)
        if (root.has(column.name)) track.*column.values = root.read_column<double>(column.name, count);
    return track;
}

}  // namespace crampfit

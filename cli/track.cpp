#include "cli/pictures.hpp"
#include "cli/progress.hpp"
#include "cli/stop.hpp"
#include "cli/verbs.hpp"
#include "datasets/crack_track.hpp"
#include "datasets/error.hpp"
#include "imaging/crack_tip.hpp"
#include "imaging/field_preview.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

namespace crampfit::cli {

namespace {

struct Arguments {
    PictureSeries pictures;
    std::filesystem::path times;
    std::filesystem::path load;
};

/// Times of the images: a row for each, in their order.
std::vector<double> read_times(const std::filesystem::path& file, std::size_t images) {
    const std::vector<double> times = read_curves(file).time;
    if (times.size() != images)
        throw InputError(
            file.string(), "time", fmt::format("{} rows", times.size()),
            fmt::format("needs a column time [s] with a row for each of the {} images, in their order", images));
    for (std::size_t i = 0; i < times.size(); ++i)
        if (std::isnan(times[i]) || (i > 0 && times[i] < times[i - 1]))
            throw InputError(file.string(), fmt::format("time, row {}", i + 1), fmt::format("{} s", times[i]),
                             "times of the images must not fall, and have no gaps");
    return times;
}

CrackTrack start_track(const Arguments& arguments) {
    const PictureSeries& pictures = arguments.pictures;
    CrackTrack track;
    track.reference = pictures.reference.string();
    track.images = names_of(pictures);
    track.pixel = pixel_of(pictures);
    if (!arguments.times.empty())
        track.time = read_times(arguments.times, track.images.size());
    if (!arguments.load.empty()) {
        if (track.time.empty())
            throw InputError("command line", "--load", arguments.load.string(),
                             "needs --times, the images' times on the load's clock");
        add_load(track, read_curves(arguments.load), arguments.load);
    }
    return track;
}

/// Drops what belongs to images that were not looked at.
void keep_first(CrackTrack& track, std::size_t count) {
    track.images.resize(count);
    for (std::vector<double>* column : {&track.time, &track.displacement, &track.force})
        column->resize(std::min(column->size(), count));
}

ExitStatus track_and_save(const Arguments& arguments, const CommonOptions& common) {
    const PictureSeries& pictures = arguments.pictures;
    check_series(pictures, common);
    CrackTrack track = start_track(arguments);
    const FinePicture reference = read_reference(pictures);
    const Correlator correlator = make_correlator(pictures, common);
    const FieldGeometry geometry{correlator.lattice(), pictures.options.subset, reference.columns, reference.rows};

    stop_on_signals();
    ProgressLine line(common, "images");
    const int count = static_cast<int>(pictures.images.size());
    for (int image = 0; image < count && !stop_requested(); ++image) {
        track.tips.push_back(find_crack_tip(geometry, correlator.field(read_image(pictures, image))));
        line.show(static_cast<double>(image + 1) / count, image + 1, name(track.tips.back().status));
    }
    const int done = static_cast<int>(track.tips.size());
    keep_first(track, track.tips.size());
    write(track, pictures.output);
    if (!pictures.preview.empty() && done > 0)
        draw_track(read_image(pictures, done - 1), track.tips, pictures.preview);
    report(common, fmt::format("tip found in {} of {} images, saved as {}",
                               std::ranges::count(track.tips, TipStatus::ok, &CrackTip::status), done,
                               pictures.output.string()));
    return done < count ? ExitStatus::interrupted : ExitStatus::done;
}

}  // namespace

Verb track_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<Arguments>();
    CLI::App* verb = command.add_subcommand("track", "Crack tip and crack length from pictures");
    add_picture_series(*verb, arguments->pictures, "TRACK.h5");
    verb->add_option("--times", arguments->times, "Table with the column time [s], a row an image")
        ->type_name("TIMES.csv");
    verb->add_option("--load", arguments->load,
                     "Table with time [s] on the same clock and displacement [mm], force [N] or both")
        ->type_name("LOAD.csv");
    return {verb, [arguments, &common] { return track_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

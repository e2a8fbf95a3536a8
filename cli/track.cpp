#include "cli/picture_times.hpp"
#include "cli/pictures.hpp"
#include "cli/progress.hpp"
#include "cli/stop.hpp"
#include "cli/verbs.hpp"
#include "datasets/crack_track.hpp"
#include "imaging/crack_tip.hpp"
#include "imaging/field_preview.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace crampfit::cli {

namespace {

struct Arguments {
    PictureSeries pictures;
    PictureTimes times;
};

CrackTrack start_track(const Arguments& arguments, const CommonOptions& common) {
    const PictureSeries& pictures = arguments.pictures;
    CrackTrack track;
    track.reference = pictures.reference.string();
    track.images = names_of(pictures);
    track.pixel = pixel_of(pictures);
    const PictureInstants instants = read_picture_times(arguments.times, track.images.size(), common);
    track.time = instants.time;
    track.displacement = instants.displacement;
    track.force = instants.force;
    track.clock = instants.clock;
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
    CrackTrack track = start_track(arguments, common);
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
    add_picture_times(*verb, arguments->times);
    return {verb, [arguments, &common] { return track_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

#include "cli/picture_times.hpp"
#include "cli/pictures.hpp"
#include "cli/progress.hpp"
#include "cli/stop.hpp"
#include "cli/verbs.hpp"
#include "datasets/crack_track.hpp"
#include "imaging/crack_tip.hpp"
#include "imaging/field_preview.hpp"
#include "imaging/gray_track.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

namespace crampfit::cli {

namespace {

struct TrackArguments {
    PictureSeries pictures;
    PictureTimes times;
    std::string from = "auto";  // auto, fields or gray
};

constexpr double well_known = 1;      // standard error of a tip, which a dark line does not tell any better [px]
constexpr double hardly_known = 0.2;  // of a subset: a tip by displacements that an open line's end overrules
constexpr double agree = 3;           // standard errors between two places of one tip
constexpr double least_apart = 0.25;  // of the sides of a dark line that is a crack, half of what it needs to be seen [px]

/// The tip by the displacement field, by the picture's gray, or by that of the two which knows it better.
class TipFinder {
  public:
    TipFinder(const PictureSeries& pictures, const std::string& from, const CommonOptions& common)
        : TipFinder(pictures, from, common, read_reference(pictures)) {}

    CrackTip operator()(const FinePicture& image) {
        if (!by_fields_) return counted(gray_->tip(image));
        const DisplacementField field = correlator_.field(image);
        const CrackTip tip = find_crack_tip(geometry_, field);
        if (!gray_ || (tip.status == TipStatus::ok && tip.tip_sigma < well_known)) return tip;
        return better(tip, gray_->tip(image), field);
    }

    int from_gray() const { return from_gray_; }
    const FieldGeometry& geometry() const { return geometry_; }

  private:
    TipFinder(const PictureSeries& pictures, const std::string& from, const CommonOptions& common, const FinePicture& reference)
        : correlator_(make_correlator(pictures, common)),
          silhouette_(reference), geometry_{correlator_.lattice(), pictures.options.subset, reference.columns, reference.rows,
                                            silhouette_},
          by_fields_(from != "gray") {
        if (from != "fields") gray_.emplace(reference, read_mask(pictures.mask, reference));
    }

    CrackTip counted(const CrackTip& by_gray) {
        from_gray_ += by_gray.status == TipStatus::ok;
        return by_gray;
    }

    CrackTip better(const CrackTip& tip, const CrackTip& by_gray, const DisplacementField& field) {
        const bool known = tip.status == TipStatus::ok;
        // A line through the whole picture is no crack's where displacements show a tip that can be nowhere near its end.
        const bool parted = by_gray.status == TipStatus::outside &&
                            (!known || by_gray.way.empty() || (by_gray.way.back() - tip.tip).norm() < agree * tip.tip_sigma);
        if (tip.status == TipStatus::too_few_points || parted) return counted(by_gray);
        if (by_gray.status != TipStatus::ok || (known && by_gray.tip_sigma >= tip.tip_sigma)) return tip;
        // The dark line's end is behind the tip where the crack's opening is too small to be seen: so near the two agree.
        const double distance = (by_gray.tip - tip.tip).norm();
        if (known && distance < agree * std::hypot(by_gray.tip_sigma, tip.tip_sigma)) return counted(by_gray);
        // A line whose sides lie still is a shadow.
        const std::optional<double> apart = motion_apart(geometry_, field, by_gray);
        if (apart ? *apart <= least_apart : known) return tip;
        if (!known || tip.tip_sigma > hardly_known * geometry_.subset) return counted(by_gray);
        // Two that know it well and contradict each other: neither may say so much.
        CrackTip doubtful = tip;
        doubtful.tip_sigma = distance / agree;
        doubtful.sigma *= doubtful.tip_sigma / tip.tip_sigma;
        return doubtful;
    }

    Correlator correlator_;
    Silhouette silhouette_;
    FieldGeometry geometry_;
    std::optional<GrayTracker> gray_;
    bool by_fields_;
    int from_gray_ = 0;
};

CrackTrack start_track(const TrackArguments& arguments, const CommonOptions& common) {
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

ExitStatus track_and_save(const TrackArguments& arguments, const CommonOptions& common) {
    const PictureSeries& pictures = arguments.pictures;
    check_series(pictures, arguments.times, common);
    CrackTrack track = start_track(arguments, common);
    TipFinder find_tip(pictures, arguments.from, common);
    track.columns = find_tip.geometry().columns;
    track.rows = find_tip.geometry().rows;

    stop_on_signals();
    ProgressLine line(common, "images");
    const int count = static_cast<int>(pictures.images.size());
    for (int image = 0; image < count && !stop_requested(); ++image) {
        track.tips.push_back(find_tip(read_image(pictures, image)));
        line.show(static_cast<double>(image + 1) / count, image + 1, name(track.tips.back().status));
    }
    const int done = static_cast<int>(track.tips.size());
    keep_first(track, track.tips.size());
    save(track, pictures.output);
    if (!pictures.preview.empty() && done > 0) draw_track(read_image(pictures, done - 1), track.tips, pictures.preview);
    report(common,
           fmt::format(
               "tip found in {} of {} images{}, saved as {}", std::ranges::count(track.tips, TipStatus::ok, &CrackTip::status),
               done, find_tip.from_gray() > 0 ? fmt::format(", {} by the dark line that the crack is", find_tip.from_gray()) : "",
               pictures.output.string()));
    if (!track.pixel) report(common, "the crack's length is not known without --pixel: its tip is in pixels");
    return done < count ? ExitStatus::interrupted : ExitStatus::done;
}

}  // namespace

Verb track_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<TrackArguments>();
    CLI::App* verb = command.add_subcommand("track", "Crack tip and crack length from pictures");
    add_picture_series(*verb, arguments->pictures, "TRACK.h5");
    add_picture_times(*verb, arguments->times);
    verb->add_option(
            "--from", arguments->from,
            "fields: displacements by correlation; gray: the dark line that opens; auto: the one that knows the tip better")
        ->check(CLI::IsMember({"auto", "fields", "gray"}))
        ->capture_default_str();
    return {verb, [arguments, &common] { return track_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

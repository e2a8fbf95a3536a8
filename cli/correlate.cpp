#include "cli/picture_times.hpp"
#include "cli/pictures.hpp"
#include "cli/progress.hpp"
#include "cli/stop.hpp"
#include "cli/verbs.hpp"
#include "imaging/field_preview.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace crampfit::cli {

namespace {

ExitStatus correlate(const PictureSeries& pictures, const PictureTimes& times, const CommonOptions& common) {
    check_series(pictures, times, common);
    const std::optional<double> pixel = pixel_of(pictures);
    const Correlator correlator = make_correlator(pictures, common);
    const FinePicture reference = read_reference(pictures);
    FieldSeries series{pictures.reference.string(),
                       names_of(pictures),
                       correlator.lattice(),
                       pictures.options.subset,
                       pictures.options.order,
                       pixel,
                       reference.columns,
                       reference.rows,
                       {},
                       {}};
    const PictureInstants instants = read_picture_times(times, series.images.size(), common);
    series.time = instants.time;
    series.displacement = instants.displacement;

    stop_on_signals();
    ProgressLine line(common, "points");
    long followed = 0;
    int done = 0;
    std::optional<DisplacementField> last;
    const int count = static_cast<int>(pictures.images.size());
    const auto next_field = [&](int image) -> std::optional<DisplacementField> {
        if (stop_requested()) return std::nullopt;
        last = correlator.field(read_image(pictures, image));
        followed += std::ranges::count(last->status, PointStatus::ok);
        done = image + 1;
        line.show(static_cast<double>(done) / count, followed, fmt::format("image {} of {}", done, count));
        return last;
    };
    write_fields(series, next_field, pictures.output);
    if (!pictures.preview.empty() && last) draw_field(reference, series.lattice, *last, pictures.preview);
    report(common, fmt::format("{} of {} points in {} images followed, saved as {}", followed,
                               static_cast<long>(series.lattice.count()) * done, done, pictures.output.string()));
    if (followed == 0 && done > 0)
        report(common, "no point was followed: do the images show the reference's pattern? The points' status says why");
    return done < count ? ExitStatus::interrupted : ExitStatus::done;
}

}  // namespace

Verb correlate_verb(CLI::App& command, const CommonOptions& common) {
    auto pictures = std::make_shared<PictureSeries>();
    CLI::App* verb = command.add_subcommand("correlate", "Displacement and strain by image correlation");
    add_picture_series(*verb, *pictures, "FIELD.h5");
    auto times = std::make_shared<PictureTimes>();
    add_picture_times(*verb, *times);
    return {verb, [pictures, times, &common] { return correlate(*pictures, *times, common); }};
}

}  // namespace crampfit::cli

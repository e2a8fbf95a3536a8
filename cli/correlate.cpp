#include "cli/pictures.hpp"
#include "cli/progress.hpp"
#include "cli/stop.hpp"
#include "cli/verbs.hpp"
#include "datasets/error.hpp"
#include "imaging/correlate.hpp"
#include "imaging/field_preview.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace crampfit::cli {

namespace {

struct Arguments {
    PictureSeries pictures;
    CorrelateOptions options;
    std::filesystem::path mask;
};

std::vector<std::uint8_t> read_mask(const std::filesystem::path& file, const FinePicture& reference) {
    if (file.empty())
        return {};
    GrayPicture mask = read_gray(file, {"command line", "--mask"});
    if (mask.columns != reference.columns || mask.rows != reference.rows)
        throw InputError("command line", "--mask", file.string(),
                         fmt::format("is {} x {} pixels, the reference {} x {}: must have its size", mask.columns, mask.rows,
                                     reference.columns, reference.rows));
    if (std::ranges::all_of(mask.gray, [](std::uint8_t gray) { return gray == 0; }))
        throw InputError("command line", "--mask", file.string(), "is black all over: black is left out");
    return std::move(mask.gray);
}

ExitStatus correlate(const Arguments& arguments, const CommonOptions& common) {
    const PictureSeries& pictures = arguments.pictures;
    check_series(pictures, common);
    CorrelateOptions options = arguments.options;
    options.threads = common.threads;
    options.validate();
    FieldSeries series;
    series.pixel = pixel_of(pictures);
    series.reference = pictures.reference.string();
    series.subset = options.subset;
    series.order = options.order;
    const FinePicture reference = read_named(pictures.reference, "reference");
    const Correlator correlator(reference, read_mask(arguments.mask, reference), options, series.reference);
    series.lattice = correlator.lattice();
    // A bad picture among many is found before hours are spent on the others.
    for (const std::filesystem::path& image : pictures.images) {
        correlator.check(read_named(image, "image"), image.string());
        series.images.push_back(image.string());
    }

    stop_on_signals();
    ProgressLine line(common, "points");
    long followed = 0;
    int done = 0;
    std::optional<DisplacementField> last;
    const int count = static_cast<int>(pictures.images.size());
    write_fields(series, [&](int image) -> std::optional<DisplacementField> {
        if (stop_requested())
            return std::nullopt;
        last = correlator.field(read_named(pictures.images[static_cast<std::size_t>(image)], "image"));
        followed += std::ranges::count(last->status, PointStatus::ok);
        done = image + 1;
        line.show(static_cast<double>(done) / count, followed, fmt::format("image {} of {}", done, count));
        return last;
    }, pictures.output);
    if (!pictures.preview.empty() && last)
        draw_field(reference, series.lattice, *last, pictures.preview);
    report(common, fmt::format("{} of {} points in {} images followed, saved as {}", followed,
                               static_cast<long>(series.lattice.count()) * done, done, pictures.output.string()));
    return done < count ? ExitStatus::interrupted : ExitStatus::done;
}

}  // namespace

Verb correlate_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<Arguments>();
    CLI::App* verb = command.add_subcommand("correlate", "Displacement and strain by image correlation");
    add_picture_series(*verb, arguments->pictures, "FIELD.h5");
    verb->add_option("--subset", arguments->options.subset, "Edge of a subset in pixels, odd")->capture_default_str();
    verb->add_option("--step", arguments->options.step, "Pixels between points")->capture_default_str();
    verb->add_option("--order", arguments->options.order, "Of the warp within a subset: 1 or 2")->capture_default_str();
    verb->add_option("--smoothing", arguments->options.smoothing, "Radius in pixels of the Gaussian that smooths all pictures, 0 for none")
        ->capture_default_str();
    verb->add_option("--mask", arguments->mask, "Picture of the reference's size, black where nothing is to be followed")->type_name("M.png");
    return {verb, [arguments, &common] { return correlate(*arguments, common); }};
}

}  // namespace crampfit::cli

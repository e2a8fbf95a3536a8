#include "cli/pictures.hpp"

#include "datasets/error.hpp"
#include "datasets/limits.hpp"
#include "imaging/field_preview.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace crampfit::cli {

std::vector<std::uint8_t> read_mask(const std::filesystem::path& file, const FinePicture& reference) {
    if (file.empty()) return {};
    GrayPicture mask = read_gray(file, {"command line", "--mask"});
    if (mask.columns != reference.columns || mask.rows != reference.rows)
        throw InputError("command line", "--mask", file.string(),
                         fmt::format("is {} x {} pixels, the reference {} x {}: must have its size", mask.columns, mask.rows,
                                     reference.columns, reference.rows));
    if (std::ranges::all_of(mask.gray, [](std::uint8_t gray) { return gray == 0; }))
        throw InputError("command line", "--mask", file.string(), "is black all over: black is left out");
    return std::move(mask.gray);
}

void add_picture_series(CLI::App& verb, PictureSeries& series, const std::string& file_kind) {
    verb.add_option("reference", series.reference, "The picture that all others are compared with")
        ->type_name("REFERENCE")
        ->required();
    verb.add_option("images", series.images, "Pictures of the same size, in order")
        ->type_name("IMAGE")
        ->required()
        ->expected(1, -1);
    verb.add_option("-o,--output", series.output, "Where the result goes")->type_name(file_kind)->required();
    verb.add_option("--pixel", series.pixel, "Edge of a pixel, as in \"10 um\"")->type_name("LENGTH");
    verb.add_option("--preview", series.preview, "A picture of the last result, to check by eye")->type_name("P.png");
    CorrelateOptions& options = series.options;
    verb.add_option("--subset", options.subset, "Edge of a subset in pixels, odd")->capture_default_str();
    verb.add_option("--step", options.step, "Pixels between points")->capture_default_str();
    verb.add_option("--order", options.order, "Of the warp within a subset: 1 or 2")->capture_default_str();
    verb.add_option(
        "--smoothing", options.smoothing,
        "Radius in pixels of the Gaussian that smooths the reference's slopes, 0 for none; if left out, by its pattern");
    verb.add_option("--mask", series.mask, "Picture of the reference's size, black where nothing is to be followed")
        ->type_name("M.png");
}

void check_series(const PictureSeries& series, const PictureTimes& times, const CommonOptions& common) {
    if (!common.settings.empty())
        throw InputError("command line", "--set", common.settings.front(), "has nothing to override here: options say it all");
    std::vector<std::filesystem::path> read = series.images;
    read.insert(read.end(), {series.reference, series.mask, times.times, times.load});
    check_output(series.output, read);
    series.options.validate();
    if (!series.preview.empty()) {
        read.push_back(series.output);
        check_output(series.preview, read, "--preview");
        require_picture_name(series.preview, "--preview");
    }
}

std::optional<double> pixel_of(const PictureSeries& series) {
    if (series.pixel.empty()) return std::nullopt;
    const double pixel = parse_quantity(series.pixel, limits::pixel.dimension, {"command line", "--pixel"});
    if (!limits::pixel.allows(pixel)) throw InputError("command line", "--pixel", series.pixel, limits::pixel.rule);
    return pixel;
}

FinePicture read_reference(const PictureSeries& series) {
    return read_fine_gray(series.reference, {"command line", "reference"});
}

FinePicture read_image(const PictureSeries& series, int image) {
    return read_fine_gray(series.images.at(static_cast<std::size_t>(image)), {"command line", "image"});
}

Correlator make_correlator(const PictureSeries& series, const CommonOptions& common) {
    CorrelateOptions options = series.options;
    options.threads = common.threads;
    FinePicture reference = read_reference(series);
    const std::vector<std::uint8_t> mask = read_mask(series.mask, reference);
    Correlator correlator(std::move(reference), mask, options, series.reference.string());
    for (int image = 0; image < static_cast<int>(series.images.size()); ++image) {
        const std::string name = series.images[static_cast<std::size_t>(image)].string();
        const FinePicture picture = read_image(series, image);
        correlator.check(picture, name);
        if (has_one_gray(picture))
            report(common, fmt::format("{}: has gray {} only and counts as lost", name, picture.gray.front()));
    }
    return correlator;
}

std::vector<std::string> names_of(const PictureSeries& series) {
    std::vector<std::string> names;
    for (const std::filesystem::path& image : series.images) names.push_back(image.string());
    return names;
}

}  // namespace crampfit::cli

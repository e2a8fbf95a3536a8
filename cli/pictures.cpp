#include "cli/pictures.hpp"

#include "datasets/error.hpp"
#include "datasets/limits.hpp"
#include "imaging/field_preview.hpp"

namespace crampfit::cli {

void add_picture_series(CLI::App& verb, PictureSeries& series, const std::string& file_kind) {
    verb.add_option("reference", series.reference, "The picture that all others are compared with")->type_name("REFERENCE")->required();
    verb.add_option("images", series.images, "Pictures of the same size, in order")->type_name("IMAGE")->required()->expected(1, -1);
    verb.add_option("-o,--output", series.output, "Where the result goes")->type_name(file_kind)->required();
    verb.add_option("--pixel", series.pixel, "Edge of a pixel, as in \"10 um\"")->type_name("LENGTH");
    verb.add_option("--preview", series.preview, "A picture of the last result, to check by eye")->type_name("P.png");
}

void check_series(const PictureSeries& series, const CommonOptions& common) {
    if (!common.settings.empty())
        throw InputError("command line", "--set", common.settings.front(), "has nothing to override here: options say it all");
    check_output(series.output, series.reference);
    for (const std::filesystem::path& image : series.images)
        check_output(series.output, image);
    if (!series.preview.empty())
        require_picture_name(series.preview, "--preview");
}

std::optional<double> pixel_of(const PictureSeries& series) {
    if (series.pixel.empty())
        return std::nullopt;
    const double pixel = parse_quantity(series.pixel, limits::pixel.dimension, {"command line", "--pixel"});
    if (!limits::pixel.allows(pixel))
        throw InputError("command line", "--pixel", series.pixel, limits::pixel.rule);
    return pixel;
}

FinePicture read_named(const std::filesystem::path& file, const std::string& role) {
    return read_fine_gray(file, {"command line", role});
}

}  // namespace crampfit::cli

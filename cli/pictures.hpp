#pragma once

#include "cli/common.hpp"
#include "cli/picture_times.hpp"
#include "imaging/correlate.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace crampfit::cli {

/// What the verbs have in common that follow a series of pictures.
struct PictureSeries {
    std::filesystem::path reference;
    std::vector<std::filesystem::path> images;
    std::filesystem::path output;
    std::string pixel;  // as written; empty: not told
    std::filesystem::path preview;
    std::filesystem::path mask;
    CorrelateOptions options;
};

/// Adds them to a verb's command line; `file_kind` is shown for the output, such as FIELD.h5.
void add_picture_series(CLI::App& verb, PictureSeries& series, const std::string& file_kind);

/// Throws InputError unless the results can be saved without harm to the pictures, options are right and --set is not
/// there.
void check_series(const PictureSeries& series, const PictureTimes& times, const CommonOptions& common);

/// Edge of a pixel, where it was told [m]. Throws InputError for one that is no length or not positive.
std::optional<double> pixel_of(const PictureSeries& series);

FinePicture read_reference(const PictureSeries& series);
FinePicture read_image(const PictureSeries& series, int image);

/// A pixel each, 0 where nothing is to be followed; empty where `file` is. Throws InputError.
std::vector<std::uint8_t> read_mask(const std::filesystem::path& file, const FinePicture& reference);

/// Reads reference and mask, and looks at every image: a bad one among many is found before hours are spent on the
/// others. Throws InputError.
Correlator make_correlator(const PictureSeries& series, const CommonOptions& common);

/// The images' files, as they were named.
std::vector<std::string> names_of(const PictureSeries& series);

}  // namespace crampfit::cli

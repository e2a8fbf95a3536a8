#include "imaging/segment.hpp"
#include "cli/verbs.hpp"
#include "datasets/borders_file.hpp"
#include "datasets/error.hpp"
#include "datasets/units.hpp"
#include "datasets/whole_file.hpp"
#include "imaging/preview.hpp"

#include <malloc.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <sstream>

namespace crampfit::cli {

namespace {

struct SegmentArguments {
    std::filesystem::path image, output, borders, preview;
    std::filesystem::path density, direction;
    std::string pixel, scale, pith, growth = "auto";
    std::vector<std::string> gray;
    int classes = 2;
};

/// Edge of a pixel from two places of the picture and their distance, as in "120,80 1320,85 = 25 mm" [m].
double pixel_by_two_points(const std::string& text) {
    const auto fail = [&]() -> double {
        throw InputError("command line", "--scale", text,
                         "must be two places in pixels and their distance, as in \"120,80 1320,85 = 25 mm\"");
    };
    const std::size_t equals = text.find('=');
    double x[4];
    int read = 0;
    if (equals == std::string::npos ||
        std::sscanf(text.substr(0, equals).c_str(), " %lf , %lf %lf , %lf %n", &x[0], &x[1], &x[2], &x[3], &read) != 4 ||
        read != static_cast<int>(equals))
        return fail();
    const double apart = std::hypot(x[2] - x[0], x[3] - x[1]);
    const double length = parse_quantity(trim(text.substr(equals + 1)), dimension::length, {"command line", "--scale"});
    return std::isfinite(apart) && apart > 0 && length > 0 ? length / apart : fail();
}

/// A place in pixels, as in "120,80".
Vec2 place_of(const std::string& text) {
    Vec2 place;
    int read = 0;
    if (std::sscanf(text.c_str(), " %lf , %lf %n", &place.x(), &place.y(), &read) != 2 || read != static_cast<int>(text.size()) ||
        !place.allFinite())
        throw InputError("command line", "--pith", text, "must be \"fit\" or a place in pixels, as in \"-300,150\"");
    return place;
}

/// A class by its grays, as in "EW 128-255".
GrayClass gray_class(const std::string& text) {
    GrayClass range;
    std::istringstream in(text);
    char dash = 0;
    std::string rest;
    if (!(in >> range.material >> range.low >> dash >> range.high) || dash != '-' || in >> rest)
        throw InputError("command line", "--gray", text, "must be a class and its grays from 0 to 255, as in \"EW 128-255\"");
    return range;
}

SegmentOptions options_of(const SegmentArguments& arguments) {
    static const std::map<std::string, GrowthAxis> growths{
        {"+x", GrowthAxis::right}, {"-x", GrowthAxis::left}, {"+y", GrowthAxis::up}, {"-y", GrowthAxis::down}};
    SegmentOptions options;
    options.classes = arguments.classes;
    if (arguments.growth != "auto") {
        const auto growth = growths.find(arguments.growth);
        if (growth == growths.end())
            throw InputError("command line", "--growth", arguments.growth, "must be +x, -x, +y, -y or auto");
        options.growth = growth->second;
    }
    if (!arguments.pixel.empty()) {
        options.pixel = parse_quantity(arguments.pixel, dimension::length, {"command line", "--pixel"});
        if (!(options.pixel > 0)) throw InputError("command line", "--pixel", arguments.pixel, "must be greater than 0");
    }
    if (!arguments.scale.empty()) {
        options.pixel = pixel_by_two_points(arguments.scale);
        options.pixel_from = "two points";
    }
    for (const std::string& range : arguments.gray) options.gray.push_back(gray_class(range));
    if (!arguments.density.empty()) options.density = read_density_table(arguments.density);
    options.direction = arguments.direction;
    options.fit_pith = arguments.pith == "fit";
    if (!arguments.pith.empty() && !options.fit_pith) options.pith = place_of(arguments.pith);
    if (!arguments.borders.empty()) options.borders = read_borders(arguments.borders);
    return options;
}

/// Maps of the whole picture come and go. Memory that went back to the system each time would come back page by page, which took
/// a quarter of the time.
void keep_memory() {
    mallopt(M_MMAP_MAX, 0);
    mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
}

ExitStatus segment_and_save(const SegmentArguments& arguments, const CommonOptions& common) {
    if (!common.settings.empty())
        throw InputError("command line", "--set", common.settings.front(), "has nothing to override in a picture");
    std::vector<std::filesystem::path> read{arguments.image, arguments.borders, arguments.density, arguments.direction};
    check_output(arguments.output, read);
    if (!arguments.preview.empty()) {
        read.push_back(arguments.output);
        check_output(arguments.preview, read, "--preview");
        check_preview_name(arguments.preview);
    }
    keep_memory();
    SegmentOptions options = options_of(arguments);
    options.threads = common.threads;
    const Segmentation result = segment(arguments.image, options);
    for (const std::string& note : result.notes) report(common, note);
    save(result.specimen, arguments.output);
    if (!arguments.preview.empty()) write_preview(arguments.image, result.specimen, arguments.preview);
    report(common, "saved as " + arguments.output.string());
    return ExitStatus::done;
}

}  // namespace

Verb segment_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<SegmentArguments>();
    CLI::App* verb = command.add_subcommand("segment", "Picture to specimen: EW, LW, transition; ring borders; orientation");
    verb->add_option("image", arguments->image, "Any picture of the cross-section")->type_name("IMAGE")->required();
    verb->add_option("-o,--output", arguments->output, "Where the specimen goes")->type_name("SPECIMEN.h5")->required();
    verb->add_option("--pixel", arguments->pixel, "Edge of a pixel, as in \"21.17 um\"; else the file's resolution tag counts")
        ->type_name("LENGTH");
    verb->add_option("--scale", arguments->scale, "Two places in pixels and their distance, as in \"120,80 1320,85 = 25 mm\"")
        ->type_name("X,Y X,Y = LENGTH")
        ->excludes("--pixel");
    auto* ranges = verb->add_option("--gray", arguments->gray,
                                    "A class by its grays, as in \"EW 128-255\"; once for each, grays in none are void")
                       ->type_name("CLASS LOW-HIGH")
                       ->allow_extra_args(false);
    verb->add_option("--density", arguments->density, "Table gray,density [kg/m^3]: the specimen gets a map of its density")
        ->type_name("CAL.csv");
    verb->add_option("--direction", arguments->direction, "Second picture, as large, to see the radial direction in")
        ->type_name("IMAGE");
    verb->add_option("--pith", arguments->pith,
                     "Radial directions away from here, as in \"-300,150\" pixels, or \"fit\": from where they fit best")
        ->type_name("fit|X,Y");
    verb->add_option("--classes", arguments->classes, "2: EW and LW; 3: transition wood between them, too")
        ->check(CLI::IsMember({2, 3}))
        ->excludes(ranges);
    verb->add_option("--growth", arguments->growth, "From pith to bark: +x, -x, +y, -y (up) or auto")->type_name("AXIS");
    verb->add_option("--borders", arguments->borders, "Ring borders to use, as `csv SPECIMEN.h5 borders` prints them")
        ->type_name("EDITED.csv");
    verb->add_option("--preview", arguments->preview, "A picture to check by eye")->type_name("P.png");
    return {verb, [arguments, &common] { return segment_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

#include "imaging/segment.hpp"
#include "cli/verbs.hpp"
#include "datasets/borders_file.hpp"
#include "datasets/error.hpp"
#include "datasets/units.hpp"
#include "datasets/whole_file.hpp"
#include "imaging/preview.hpp"

#include <map>
#include <memory>

namespace crampfit::cli {

namespace {

struct Arguments {
    std::filesystem::path image, output, borders, preview;
    std::string pixel, growth = "auto";
    int classes = 2;
};

SegmentOptions options_of(const Arguments& arguments) {
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
        if (!(options.pixel > 0))
            throw InputError("command line", "--pixel", arguments.pixel, "must be greater than 0");
    }
    if (!arguments.borders.empty())
        options.borders = read_borders(arguments.borders);
    return options;
}

ExitStatus segment_and_save(const Arguments& arguments, const CommonOptions& common) {
    if (!common.settings.empty())
        throw InputError("command line", "--set", common.settings.front(), "has nothing to override in a picture");
    check_output(arguments.output, arguments.image);
    if (!arguments.preview.empty()) {
        check_output(arguments.preview, arguments.image);
        check_preview_name(arguments.preview);
    }
    const Segmentation result = segment(arguments.image, options_of(arguments));
    for (const std::string& note : result.notes)
        report(common, note);
    write(result.specimen, arguments.output);
    if (!arguments.preview.empty())
        write_preview(arguments.image, result.specimen, arguments.preview);
    report(common, "saved as " + arguments.output.string());
    return ExitStatus::done;
}

}  // namespace

Verb segment_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<Arguments>();
    CLI::App* verb = command.add_subcommand("segment", "Picture to specimen: EW, LW, transition; ring borders; orientation");
    verb->add_option("image", arguments->image, "Any picture of the cross-section")->type_name("IMAGE")->required();
    verb->add_option("-o,--output", arguments->output, "Where the specimen goes")->type_name("SPECIMEN.h5")->required();
    verb->add_option("--pixel", arguments->pixel, "Edge of a pixel, as in \"21.17 um\"; else the file's resolution tag counts")
        ->type_name("LENGTH");
    verb->add_option("--classes", arguments->classes, "2: EW and LW; 3: transition wood between them, too")
        ->check(CLI::IsMember({2, 3}));
    verb->add_option("--growth", arguments->growth, "From pith to bark: +x, -x, +y, -y (up) or auto")->type_name("AXIS");
    verb->add_option("--borders", arguments->borders, "Ring borders to use, as `csv SPECIMEN.h5 borders` prints them")
        ->type_name("EDITED.csv");
    verb->add_option("--preview", arguments->preview, "A picture to check by eye")->type_name("P.png");
    return {verb, [arguments, &common] { return segment_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

#include "cli/progress.hpp"
#include "cli/stop.hpp"
#include "cli/verbs.hpp"
#include "datasets/error.hpp"
#include "datasets/limits.hpp"
#include "datasets/record_file.hpp"
#include "datasets/toml_reader.hpp"
#include "datasets/whole_file.hpp"
#include "imaging/record_camera.hpp"
#include "imaging/wood_surface.hpp"
#include "inverse/pool.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>

namespace crampfit::cli {

namespace {

struct CameraArguments {
    std::filesystem::path record, folder;
    std::string pixel, margin = "0 mm";
    std::filesystem::path wood;  // empty: a speckle pattern
    std::string wood_pixel;      // as written; empty: as the scene has it
    std::optional<double> blur;  // [px]
    VirtualCameraOptions options{.columns = 1, .rows = 1};
};

// Of plain wood narrow gaps are seen by what they darken, through a lens.
constexpr int wood_samples = 3;
constexpr double wood_blur = 0.7;  // [px]

double length_of(const std::string& text, const NumberRule& rule, const char* option) {
    const double value = parse_quantity(text, rule.dimension, {"command line", option});
    if (!rule.allows(value)) throw InputError("command line", option, text, rule.rule);
    return value;
}

/// How the wood's picture lies on the specimen: as the record's scene has it, where it is made from a picture.
Placement placement_of_wood(const CameraArguments& arguments, const Record& record) {
    const Document scene(record.scene_text, arguments.record, {});
    const Entry specimen = scene.root().at("specimen");
    Placement placement;
    if (!arguments.wood_pixel.empty()) placement.pixel = length_of(arguments.wood_pixel, limits::pixel, "--wood-pixel");
    else if (const auto pixel = specimen.find("pixel")) placement.pixel = pixel->number(limits::pixel);
    else
        throw InputError("command line", "--wood-pixel", "absent",
                         "must be given: the record's scene does not say how large a pixel of the picture is");
    if (const auto offset = specimen.find("offset")) placement.offset = offset->point();
    if (const auto rotation = specimen.find("rotation")) placement.rotation = rotation->number(limits::rotation);
    return placement;
}

/// The gray of the wood that the scene's specimen was made from.
std::function<double(const Vec2&)> wood_of(const CameraArguments& arguments, const Record& record, double pixel) {
    if (arguments.wood.empty()) return {};
    Placement placement = placement_of_wood(arguments, record);
    const FinePicture picture = read_fine_gray(arguments.wood, {"command line", "--wood"});
    placement.rows = picture.rows;
    Vec2 size = Vec2::Zero();
    for (const Vec2& place : record.point_position) size = size.cwiseMax(place);
    if (!covers(picture, placement, size))
        throw InputError("command line", "--wood", arguments.wood.string(),
                         fmt::format("must show the whole specimen, {:.3g} x {:.3g} mm; it is {:.3g} x {:.3g} mm, its lower left "
                                     "corner at {:.3g}, {:.3g} mm",
                                     1e3 * size.x(), 1e3 * size.y(), 1e3 * placement.pixel * picture.columns,
                                     1e3 * placement.pixel * picture.rows, 1e3 * placement.offset.x(),
                                     1e3 * placement.offset.y()));
    return wood_surface(picture, placement, pixel);
}

/// The row of the series at a frame's time.
const Instant& row_of(const Record& record, const Frame& frame) {
    const auto after = std::ranges::lower_bound(record.series, frame.time, {}, &Instant::time);
    return after == record.series.end() ? record.series.back() : *after;
}

/// What the load cell and the transducer said at each picture, as `--times` and `--load` take it.
Curves load_of(const Record& record) {
    Curves curves;
    for (const Frame& frame : record.frames) {
        curves.time.push_back(frame.time);
        curves.displacement.push_back(frame.displacement);
        curves.force.push_back(row_of(record, frame).force);
    }
    return curves;
}

/// The tip as `crampfit track` counts it.
std::string truth_of(const Record& record, const CameraView& view) {
    std::string text = "image,time_s,tip_x_px,tip_y_px,crack_length_m\n";
    for (std::size_t i = 0; i < record.frames.size(); ++i) {
        const Instant& row = row_of(record, record.frames[i]);
        const Vec2 tip = view.to_picture(row.tip);
        text += fmt::format("{},{:.9g},{:.3f},{:.3f},{:.9g}\n", i, record.frames[i].time, tip.x(), tip.y(), row.crack_length);
    }
    return text;
}

std::filesystem::path make_folder(const std::filesystem::path& folder) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error || !std::filesystem::is_directory(folder))
        throw InputError("command line", "--output", folder.string(), "must be a folder, or a name that one can be made under");
    return folder;
}

ExitStatus photograph(const CameraArguments& arguments, const CommonOptions& common) {
    if (!common.settings.empty())
        throw InputError("command line", "--set", common.settings.front(), "has nothing to override here: options say it all");
    const double pixel = length_of(arguments.pixel, limits::pixel, "--pixel");
    const double margin = length_of(arguments.margin, limits::not_negative(dimension::length), "--margin");
    VirtualCameraOptions options = arguments.options;
    options.samples = arguments.wood.empty() ? 1 : wood_samples;
    options.blur = arguments.blur.value_or(arguments.wood.empty() ? 0 : wood_blur);
    options.validate();
    const Record record = read_record(arguments.record);
    const RecordCamera camera(record, arguments.record, pixel, margin, options, wood_of(arguments, record, pixel));
    const std::filesystem::path folder = make_folder(arguments.folder);
    write_gray(camera.reference(), folder / "reference.png");
    write_curves(load_of(record), folder / "load.csv");
    if (record.series.front().crack_length > 0) write_whole_file(folder / "truth.csv", truth_of(record, camera.view()));

    stop_on_signals();
    ProgressLine line(common, "pictures");
    std::mutex mutex;
    const int count = static_cast<int>(record.frames.size());
    std::atomic<int> done = 0;
    parallel_for(count, common.threads, [&](int frame) {
        if (stop_requested()) return;
        write_gray(camera.photograph(frame), folder / fmt::format("image_{:04}.png", frame));
        const std::lock_guard lock(mutex);
        ++done;
        line.show(static_cast<double>(done) / count, done, "");
    });
    // Minus nothing plus nothing is nothing, without the sign.
    report(common,
           fmt::format(
               "{} pictures beside reference.png in {}; the lower left corner lies at [\"{:g} mm\", \"{:g} mm\"] of the specimen",
               done.load(), folder.string(), 1e3 * camera.view().corner.x() + 0.0, 1e3 * camera.view().corner.y() + 0.0));
    return done < count ? ExitStatus::interrupted : ExitStatus::done;
}

}  // namespace

Verb camera_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<CameraArguments>();
    CLI::App* verb = command.add_subcommand("camera", "Pictures that a camera would take of a simulated specimen");
    VirtualCameraOptions& options = arguments->options;
    verb->add_option("record", arguments->record, "A record with frames")->type_name("RECORD.h5")->required();
    verb->add_option("-o,--output", arguments->folder, "Folder for reference.png, image_0000.png ..., load.csv and truth.csv")
        ->type_name("FOLDER")
        ->required();
    verb->add_option("--pixel", arguments->pixel, "Edge of a pixel on the specimen, as in \"20 um\"")
        ->type_name("LENGTH")
        ->required();
    verb->add_option("--margin", arguments->margin, "Of background around the specimen")
        ->type_name("LENGTH")
        ->capture_default_str();
    CLI::Option* wood =
        verb->add_option("--wood", arguments->wood,
                         "A picture of the specimen, which is then seen as it is, without a speckle pattern on it")
            ->type_name("PICTURE");
    verb->add_option("--wood-pixel", arguments->wood_pixel,
                     "Edge of that picture's pixel on the specimen; else as the scene has it")
        ->type_name("LENGTH")
        ->needs(wood);
    verb->add_option("--blur", arguments->blur, "Of the lens, one standard deviation in pixels; 0.7 with --wood, else in --spot")
        ->type_name("PIXELS");
    verb->add_option("--noise", options.noise, "Standard deviation of each pixel's gray, of 255")->capture_default_str();
    verb->add_option("--spot", options.spot_radius, "Radius of the pattern's spots in pixels, one standard deviation")
        ->capture_default_str()
        ->excludes(wood);
    verb->add_option("--contrast", options.contrast, "Standard deviation of the pattern's gray, of 255")
        ->capture_default_str()
        ->excludes(wood);
    verb->add_option("--seed", options.seed, "Of the pattern and the noise")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    return {verb, [arguments, &common] { return photograph(*arguments, common); }};
}

}  // namespace crampfit::cli

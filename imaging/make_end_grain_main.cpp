// Writes a picture of synthetic end grain and the truth that it was drawn from.
#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "imaging/end_grain.hpp"

#include <CLI/CLI.hpp>
#include <opencv2/imgcodecs.hpp>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>

namespace {

using namespace crampfit;

/// One row a vertex, pixels counted from the picture's upper left corner (centre of the first pixel at 0,0).
void write_borders(const EndGrain& grown, const std::filesystem::path& file) {
    std::ofstream out(file);
    out << "ring,x_px,y_px\n";
    char line[64];
    for (const RingBorder& border : grown.borders) {
        for (const Vec2& point : border.points) {
            const Vec2 pixels = point / grown.truth.pixel;
            std::snprintf(line, sizeof line, "%d,%.3f,%.3f\n", border.ring, pixels.x() - 0.5, grown.rows - pixels.y() - 0.5);
            out << line;
        }
    }
    if (!out.flush()) {
        throw InputError("command line", "--borders", file.string(), "cannot be written");
    }
}

void write_picture(const EndGrain& grown, bool colour, const std::filesystem::path& file) {
    if (!cv::haveImageWriter(file.string())) {
        throw InputError("command line", "--picture", file.string(), "must end as a picture does, such as .png or .bmp");
    }
    const cv::Mat pixels(grown.rows, grown.columns, colour ? CV_8UC3 : CV_8UC1,
                         const_cast<std::uint8_t*>(colour ? grown.bgr.data() : grown.gray.data()));
    if (!cv::imwrite(file.string(), pixels, {cv::IMWRITE_PNG_COMPRESSION, 9})) {
        throw InputError("command line", "--picture", file.string(), "cannot be written");
    }
}

/// A length option: a number and its unit, such as "25 um".
CLI::Option* length(CLI::App& app, const std::string& name, double& value, const std::string& help) {
    static const std::map<std::string, double> units{{"m", 1.0}, {"mm", 1e-3}, {"um", 1e-6}};
    return app.add_option(name, value, help)
        ->transform(CLI::AsNumberWithUnit(
            units, CLI::AsNumberWithUnit::Options(CLI::AsNumberWithUnit::CASE_SENSITIVE | CLI::AsNumberWithUnit::UNIT_REQUIRED)));
}

}  // namespace

int main(int argc, char** argv) {
    EndGrainOptions options;
    std::filesystem::path picture, truth, borders;
    bool gray = false;

    CLI::App app("Grows synthetic end grain. Lengths carry their unit: m, mm or um.");
    app.add_option("--picture", picture, "picture to write; its ending says which format")->required();
    app.add_option("--truth", truth, "classes, density grade and orientation that it was drawn from, HDF5");
    app.add_option("--borders", borders, "ring borders as CSV: ring,x_px,y_px");
    app.add_flag("--gray", gray, "a gray picture");
    length(app, "--width", options.size.x(), "of the block");
    length(app, "--height", options.size.y(), "of the block");
    length(app, "--pixel", options.pixel, "edge of a pixel");
    length(app, "--pith-x", options.pith.x(), "pith, from the block's lower left corner");
    length(app, "--pith-y", options.pith.y(), "pith, from the block's lower left corner");
    length(app, "--period", options.period, "mean width of a ring");
    length(app, "--period-sd", options.period_sd, "its standard deviation from ring to ring");
    app.add_option("--latewood-fraction", options.latewood_fraction, "mean, 0..1");
    app.add_option("--latewood-fraction-sd", options.latewood_fraction_sd, "standard deviation from ring to ring");
    length(app, "--transition", options.transition, "width of the rise from EW to LW");
    length(app, "--onset-roughness", options.onset_roughness, "standard deviation of where LW begins along a ring");
    length(app, "--waviness", options.waviness, "root mean square distance of a ring from a circle");
    length(app, "--waviness-length", options.waviness_length, "wavelength along the ring");
    length(app, "--ray-spacing", options.ray_spacing, "mean distance of rays");
    length(app, "--ray-width", options.ray_width, "width of a ray");
    length(app, "--ray-length", options.ray_length, "length over which a ray is seen");
    app.add_option("--ray-contrast", options.ray_contrast, "0..1");
    app.add_option("--earlywood", options.earlywood, "blue, green, red, 0..255");
    app.add_option("--latewood", options.latewood, "blue, green, red, 0..255");
    app.add_option("--ray", options.ray, "blue, green, red, 0..255");
    length(app, "--cell-size", options.cell_size, "tangential width of a tracheid");
    app.add_option("--texture", options.texture, "of the cells, standard deviation in grays");
    app.add_option("--mottle", options.mottle, "of patches, standard deviation in grays");
    app.add_option("--noise", options.noise, "of each pixel and colour, standard deviation in grays");
    app.add_option("--illumination", options.illumination, "relative change of brightness from left to right");
    app.add_option("--seed", options.seed, "another seed, another tree");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    }

    try {
        const EndGrain grown = grow_end_grain(options);
        write_picture(grown, !gray, picture);
        if (!truth.empty()) {
            write(grown.truth, truth);
        }
        if (!borders.empty()) {
            write_borders(grown, borders);
        }
    } catch (const std::exception& error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 2;
    }
    return 0;
}

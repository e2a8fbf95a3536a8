#include "datasets/hdf5.hpp"
#include "datasets/io.hpp"

#include <fmt/format.h>

#include <cmath>

namespace crampfit {

using hdf5::Group;

namespace {

struct OptionalMap {
    const char* name;
    hdf5::Meaning meaning;
    std::vector<float> Specimen::*values;
};

const OptionalMap optional_maps[] = {
    {"grade", {"1", "0 is the pixel's class, 1 the class after it, between them transition wood"}, &Specimen::grade},
    {"density", {"kg/m^3", "density"}, &Specimen::density},
    {"orientation", {"rad", "radial direction, counter-clockwise from +x"}, &Specimen::orientation},
    {"coherency", {"1", "how plainly the picture shows the radial direction, 0 to 1"}, &Specimen::coherency},
};

/// What indexes a list must point into it.
void check_labels(const Group& root, const Specimen& specimen) {
    for (std::size_t i = 0; i < specimen.label.size(); ++i) {
        const std::size_t label = specimen.label[i];
        if (label == Specimen::void_label) continue;
        if (label >= specimen.classes.size())
            root.refuse("label", std::to_string(label),
                        fmt::format("must be {} (no material) or less than the {} classes", Specimen::void_label,
                                    specimen.classes.size()));
        if (specimen.grade.empty() || specimen.grade[i] == 0) continue;
        if (!(specimen.grade[i] > 0 && specimen.grade[i] <= 1) || label + 1 >= specimen.classes.size())
            root.refuse("grade", fmt::format("{} in class {}", specimen.grade[i], label),
                        "must be from 0 to 1, and 0 in the last class");
    }
}

void write_borders(Group& root, const std::vector<BorderPolyline>& borders) {
    Group group = root.make_group("borders", "ring borders, vertex by vertex; the table `borders`");
    std::vector<std::int64_t> ring;
    std::vector<Eigen::Vector2d> vertex;
    for (const BorderPolyline& border : borders) {
        ring.insert(ring.end(), border.points.size(), border.ring);
        vertex.insert(vertex.end(), border.points.begin(), border.points.end());
    }
    group.write("ring", ring, {"1", "number of the ring that ends there, from the pith outward"});
    group.write("vertex", vertex, {"pixel", "x, y from the upper left corner, centre of the first pixel at 0, 0"});
}

std::vector<BorderPolyline> read_borders(const Group& group) {
    const auto ring = group.read_column<std::int64_t>("ring");
    const auto vertex = group.read_rows<double, 2>("vertex", ring.size());
    std::vector<BorderPolyline> borders;
    for (std::size_t i = 0; i < ring.size(); ++i) {
        if (borders.empty() || borders.back().ring != ring[i]) borders.push_back({ring[i], {}});
        borders.back().points.push_back(vertex[i]);
    }
    return borders;
}

void write_rings(Group& root, const std::vector<RingFigures>& rings) {
    Group group = root.make_group("rings", "rings that lie between two borders; the table `rings`");
    std::vector<std::int64_t> ring;
    std::vector<double> width, latewood;
    for (const RingFigures& figures : rings) {
        ring.push_back(figures.ring);
        width.push_back(figures.width);
        latewood.push_back(figures.latewood_fraction);
    }
    group.write("ring", ring, {"1", "number, from the pith outward"});
    group.write("width", width, {"pixel", "mean distance of its two borders, across the ring"});
    group.write("latewood_fraction", latewood, {"1", "share of latewood in its area"});
}

std::vector<RingFigures> read_rings(const Group& group) {
    const auto ring = group.read_column<std::int64_t>("ring");
    const auto width = group.read_column<double>("width", ring.size());
    const auto latewood = group.read_column<double>("latewood_fraction", ring.size());
    std::vector<RingFigures> rings(ring.size());
    for (std::size_t i = 0; i < rings.size(); ++i) rings[i] = {ring[i], width[i], latewood[i]};
    return rings;
}

}  // namespace

void write(const Specimen& specimen, const std::filesystem::path& file) {
    const hdf5::Shape shape{static_cast<std::size_t>(specimen.rows), static_cast<std::size_t>(specimen.columns)};
    hdf5::save(file, "specimen", [&](Group& root) {
        root.write_text("source", specimen.source, "where the picture came from");
        root.write("pixel", specimen.pixel, {"m", "edge of a pixel; 0 when it is not known"});
        root.write_texts("classes", specimen.classes, "names of the materials");
        root.write("label", specimen.label, shape, {"1", "index into `classes` or 255 for no material; top row first"});
        for (const OptionalMap& map : optional_maps)
            if (const std::vector<float>& values = specimen.*map.values; !values.empty())
                root.write(map.name, values, shape, map.meaning);
        if (!specimen.feature.empty())
            root.write("feature", specimen.feature, shape,
                       {"1", "0 wood, 1 background, 2 crack, 3 ink or dirt, 4 ray, 5 resin canal"});
        write_borders(root, specimen.borders);
        write_rings(root, specimen.rings);
    });
}

Specimen read_specimen(const std::filesystem::path& file) {
    const Group root = hdf5::open(file, "specimen");
    Specimen specimen;
    specimen.source = root.read_text("source");
    specimen.pixel = root.read_number<double>("pixel");
    if (!(specimen.pixel >= 0 && std::isfinite(specimen.pixel)))
        root.refuse("pixel", fmt::format("{} m", specimen.pixel), "must be positive, or 0 when it is not known");
    specimen.classes = root.read_texts("classes");
    auto label = root.read<std::uint8_t>("label", {std::nullopt, std::nullopt});
    specimen.rows = static_cast<int>(label.shape[0]);
    specimen.columns = static_cast<int>(label.shape[1]);
    specimen.label = std::move(label.values);
    for (const OptionalMap& map : optional_maps)
        if (root.has(map.name)) specimen.*map.values = root.read<float>(map.name, {label.shape[0], label.shape[1]}).values;
    if (root.has("feature")) specimen.feature = root.read<std::uint8_t>("feature", {label.shape[0], label.shape[1]}).values;
    // Files of earlier versions have neither.
    if (root.has("borders")) specimen.borders = read_borders(root.group("borders"));
    if (root.has("rings")) specimen.rings = read_rings(root.group("rings"));
    check_labels(root, specimen);
    return specimen;
}

}  // namespace crampfit

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
};

/// What indexes a list must point into it.
void check_labels(const Group& root, const Specimen& specimen) {
    for (std::size_t i = 0; i < specimen.label.size(); ++i) {
        const std::size_t label = specimen.label[i];
        if (label == Specimen::void_label)
            continue;
        if (label >= specimen.classes.size())
            root.refuse("label", std::to_string(label),
                        fmt::format("must be {} (no material) or less than the {} classes", Specimen::void_label,
                                    specimen.classes.size()));
        if (specimen.grade.empty() || specimen.grade[i] == 0)
            continue;
        if (!(specimen.grade[i] > 0 && specimen.grade[i] <= 1) || label + 1 >= specimen.classes.size())
            root.refuse("grade", fmt::format("{} in class {}", specimen.grade[i], label),
                        "must be from 0 to 1, and 0 in the last class");
    }
}

}  // namespace

void write(const Specimen& specimen, const std::filesystem::path& file) {
    const hdf5::Shape shape{static_cast<std::size_t>(specimen.rows), static_cast<std::size_t>(specimen.columns)};
    hdf5::save(file, "specimen", [&](Group& root) {
        root.write_text("source", specimen.source, "where the picture came from");
        root.write("pixel", specimen.pixel, {"m", "edge of a pixel"});
        root.write_texts("classes", specimen.classes, "names of the materials");
        root.write("label", specimen.label, shape, {"1", "index into `classes` or 255 for no material; top row first"});
        for (const OptionalMap& map : optional_maps)
            if (const std::vector<float>& values = specimen.*map.values; !values.empty())
                root.write(map.name, values, shape, map.meaning);
    });
}

Specimen read_specimen(const std::filesystem::path& file) {
    const Group root = hdf5::open(file, "specimen");
    Specimen specimen;
    specimen.source = root.read_text("source");
    specimen.pixel = root.read_number<double>("pixel");
    if (!(specimen.pixel > 0 && std::isfinite(specimen.pixel)))
        root.refuse("pixel", fmt::format("{} m", specimen.pixel), "must be positive");
    specimen.classes = root.read_texts("classes");
    auto label = root.read<std::uint8_t>("label", {std::nullopt, std::nullopt});
    specimen.rows = static_cast<int>(label.shape[0]);
    specimen.columns = static_cast<int>(label.shape[1]);
    specimen.label = std::move(label.values);
    for (const OptionalMap& map : optional_maps)
        if (root.has(map.name))
            specimen.*map.values = root.read<float>(map.name, {label.shape[0], label.shape[1]}).values;
    check_labels(root, specimen);
    return specimen;
}

}  // namespace crampfit

#include "datasets/displacement_field.hpp"
#include "datasets/hdf5.hpp"

#include <fmt/format.h>

namespace crampfit {

using hdf5::Group;

namespace {

constexpr std::array<const char*, point_status_count> point_status_names{
    "ok",          "masked",         "across the mask",  "no contrast",
    "not reached", "no convergence", "left the picture", "low correlation",
    "moved apart"};

struct FieldColumn {
    const char* name;
    hdf5::Meaning meaning;
    std::vector<double> DisplacementField::*values;
};

const FieldColumn field_columns[] = {
    {"u", {"px", "displacement to the right"}, &DisplacementField::u},
    {"v", {"px", "displacement down the picture"}, &DisplacementField::v},
    {"exx", {"1", "du/dx"}, &DisplacementField::exx},
    {"eyy", {"1", "dv/dy"}, &DisplacementField::eyy},
    {"exy", {"1", "(du/dy + dv/dx) / 2"}, &DisplacementField::exy},
    {"zncc", {"1", "zero-normalised correlation coefficient"}, &DisplacementField::zncc},
    {"sigma", {"px", "standard error of u and v by the noise of the pictures"}, &DisplacementField::sigma},
};

struct InstantColumn {
    const char* name;
    hdf5::Meaning meaning;
    std::vector<double> FieldSeries::*values;
};

const InstantColumn instant_columns[] = {
    {"time", {"s", "of each image"}, &FieldSeries::time},
    {"displacement", {"m", "of the loading at each image"}, &FieldSeries::displacement},
};

hdf5::Shape shape_of(const PointLattice& lattice) {
    return {static_cast<std::size_t>(lattice.rows), static_cast<std::size_t>(lattice.columns)};
}

void write_lattice(Group& root, const PointLattice& lattice) {
    Group group = root.make_group("lattice", "places of the points in the reference; centre of its first pixel at 0,0");
    const auto put = [&](const char* name, int value, const char* units, const char* description) {
        group.write<std::int64_t>(name, value, {units, description});
    };
    put("columns", lattice.columns, "1", "points side by side");
    put("rows", lattice.rows, "1", "points one below the other");
    put("first_x", lattice.first_x, "px", "x of the first column");
    put("first_y", lattice.first_y, "px", "y of the first row");
    put("step", lattice.step, "px", "distance of neighbours");
}

/// A whole number from a file that must be at least `least`.
int read_int(const Group& group, const char* name, int least) {
    const std::int64_t value = group.read_number<std::int64_t>(name);
    if (value < least || value > 1'000'000)
        group.refuse(name, std::to_string(value), fmt::format("must lie between {} and 1000000", least));
    return static_cast<int>(value);
}

PointLattice read_lattice(const Group& group) {
    return {read_int(group, "columns", 1), read_int(group, "rows", 1), read_int(group, "first_x", 0),
            read_int(group, "first_y", 0), read_int(group, "step", 1)};
}

void write_field(Group& images, int image, const PointLattice& lattice, const DisplacementField& field) {
    Group group = images.make_group(std::to_string(image), "one image; a row of numbers a row of points");
    for (const FieldColumn& column : field_columns)
        group.write(column.name, field.*column.values, shape_of(lattice), column.meaning);
    std::vector<std::uint8_t> status;
    for (const PointStatus one : field.status) status.push_back(static_cast<std::uint8_t>(one));
    group.write("status", status, shape_of(lattice), {"1", "index into `status names`; 0 is a point that was followed"});
}

DisplacementField read_field(const Group& group, const PointLattice& lattice) {
    const hdf5::Shape shape = shape_of(lattice);
    DisplacementField field;
    for (const FieldColumn& column : field_columns)
        field.*column.values = group.read<double>(column.name, {shape[0], shape[1]}).values;
    for (const std::uint8_t status : group.read<std::uint8_t>("status", {shape[0], shape[1]}).values) {
        if (status >= point_status_count)
            group.refuse("status", std::to_string(status), fmt::format("must be less than {}", point_status_count));
        field.status.push_back(static_cast<PointStatus>(status));
    }
    return field;
}

FieldSeries read_series(const Group& root) {
    FieldSeries series;
    series.reference = root.read_text("reference");
    series.subset = read_int(root, "subset", 1);
    series.order = read_int(root, "order", 1);
    if (root.has("pixel")) series.pixel = root.read_number<double>("pixel");
    series.lattice = read_lattice(root.group("lattice"));
    series.images = root.read_texts("image files");
    if (root.has("picture columns")) {
        series.columns = read_int(root, "picture columns", 1);
        series.rows = read_int(root, "picture rows", 1);
    }
    for (const InstantColumn& column : instant_columns)
        if (root.has(column.name)) series.*column.values = root.read_column<double>(column.name, series.images.size());
    return series;
}

}  // namespace

const char* name(PointStatus status) { return point_status_names.at(static_cast<std::size_t>(status)); }

void write_fields(const FieldSeries& series, const std::function<std::optional<DisplacementField>(int)>& field_of,
                  const std::filesystem::path& file) {
    hdf5::save(file, "field", [&](Group& root) {
        root.write_text("reference", series.reference, "picture that all others are compared with");
        root.write<std::int64_t>("subset", series.subset, {"px", "edge of a subset"});
        root.write<std::int64_t>("order", series.order, {"1", "of the warp within a subset"});
        if (series.pixel) root.write("pixel", *series.pixel, {"m", "edge of a pixel"});
        root.write_texts("status names", {point_status_names.begin(), point_status_names.end()}, "what became of a point");
        write_lattice(root, series.lattice);
        Group images = root.make_group("images", "a group an image, by its number from 0");
        std::vector<std::string> written;
        for (int image = 0; image < static_cast<int>(series.images.size()); ++image) {
            const std::optional<DisplacementField> field = field_of(image);
            if (!field) break;
            write_field(images, image, series.lattice, *field);
            written.push_back(series.images[static_cast<std::size_t>(image)]);
        }
        root.write_texts("image files", written, "pictures by their number");
        if (series.columns > 0) {
            root.write<std::int64_t>("picture columns", series.columns, {"px", "of all pictures"});
            root.write<std::int64_t>("picture rows", series.rows, {"px", "of all pictures"});
        }
        for (const InstantColumn& column : instant_columns)
            if (const std::vector<double>& values = series.*column.values; !values.empty())
                root.write(column.name, std::vector<double>(values.begin(), values.begin() + written.size()), column.meaning);
    });
}

FieldSeries read_field_series(const std::filesystem::path& file) { return read_series(hdf5::open(file, "field")); }

void read_fields(const std::filesystem::path& file,
                 const std::function<void(const FieldSeries&, int image, const DisplacementField&)>& take) {
    const Group root = hdf5::open(file, "field");
    const FieldSeries series = read_series(root);
    const Group images = root.group("images");
    for (int image = 0; image < static_cast<int>(series.images.size()); ++image)
        take(series, image, read_field(images.group(std::to_string(image)), series.lattice));
}

}  // namespace crampfit

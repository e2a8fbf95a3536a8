#include "datasets/displacement_field.hpp"
#include "datasets/error.hpp"
#include "datasets/limits.hpp"
#include "datasets/study_parts.hpp"

#include <Eigen/QR>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {
namespace {

// More points than this say hardly more about a few parameters.
constexpr int most_points = 4000;

/// When the pictures were taken: from a table that the study names, or as the file has it.
void read_instants(const Entry& entry, const FieldSeries& series, MeasuredFields& fields) {
    const auto table = entry.is_table() ? entry.find("times") : std::nullopt;
    Curves curves;
    if (table) {
        fields.times_file = table->existing_file();
        curves = read_curves(fields.times_file);
    } else {
        curves.time = series.time;
        curves.displacement = series.displacement;
    }
    const Entry& at = table ? *table : entry;
    fields.by_displacement = !curves.displacement.empty();
    fields.instants = fields.by_displacement ? curves.displacement : curves.time;
    if (fields.instants.size() != series.images.size()) {
        at.fail(fmt::format(
            "a time or a displacement of the loading is needed for each of the {} pictures, a row each, in their order; "
            "there are {}",
            series.images.size(), fields.instants.size()));
    }
    for (std::size_t i = 0; i < fields.instants.size(); ++i) {
        if (!(fields.instants[i] >= (i > 0 ? fields.instants[i - 1] : 0.0))) {
            at.fail(fmt::format("the pictures' {} must rise from 0 on, without gaps: {:g} {} in row {}",
                                fields.by_displacement ? "displacements" : "times",
                                (fields.by_displacement ? 1e3 : 1.0) * fields.instants[i], fields.by_displacement ? "mm" : "s",
                                i + 1));
        }
    }
}

/// The points that are compared: as far apart as subsets are wide, so that no pixel counts twice and their errors are
/// independent.
std::vector<int> independent_points(const FieldSeries& series, const Placement& placement, const Vec2& size) {
    const PointLattice& lattice = series.lattice;
    for (int every = (series.subset + lattice.step - 1) / lattice.step;; ++every) {
        std::vector<int> points;
        for (int row = (lattice.rows - 1) % every / 2; row < lattice.rows; row += every) {
            for (int column = (lattice.columns - 1) % every / 2; column < lattice.columns; column += every) {
                const int point = row * lattice.columns + column;
                const Vec2 place = placement.place(lattice.x(point), lattice.y(point));
                if ((place.array() >= 0.0).all() && (place.array() <= size.array()).all()) {
                    points.push_back(point);
                }
            }
        }
        if (static_cast<int>(points.size()) <= most_points) {
            return points;
        }
    }
}

}  // namespace

std::vector<double> subset_weights(int order) {
    constexpr int terms = 6;
    Eigen::Matrix<double, samples_a_subset, terms> rows;
    for (int k = 0; k < samples_a_subset; ++k) {
        const double x = (k % samples_a_side + 0.5) / samples_a_side - 0.5;
        const double y = (k / samples_a_side + 0.5) / samples_a_side - 0.5;
        rows.row(k) << 1, x, y, x * x, x * y, y * y;
    }
    const Eigen::MatrixXd design = rows.leftCols(order == 1 ? 3 : terms);
    const Eigen::MatrixXd inverse = design.completeOrthogonalDecomposition().pseudoInverse();
    return {inverse.row(0).begin(), inverse.row(0).end()};
}

Probes probes_for(const MeasuredFields& fields) {
    Probes probes{{}, fields.instants, fields.by_displacement, subset_weights(fields.order)};
    const Eigen::Rotation2Dd turn(fields.rotation);
    for (const Vec2& place : fields.places) {
        for (int k = 0; k < samples_a_subset; ++k) {
            const Vec2 at((k % samples_a_side + 0.5) / samples_a_side - 0.5, (k / samples_a_side + 0.5) / samples_a_side - 0.5);
            probes.places.push_back(place + fields.subset * (turn * at));
        }
    }
    return probes;
}

MeasuredFields read_measured_fields(const Entry& entry, const Scene& scene) {
    if (entry.is_table()) {
        entry.only({"file", "pixel", "times", "offset", "rotation", "camera"});
    }
    MeasuredFields fields;
    fields.file = (entry.is_table() ? entry.at("file") : entry).existing_file();
    const FieldSeries series = read_field_series(fields.file);
    if (series.rows == 0) {
        entry.fail("the file does not know the size of the pictures: correlate them again");
    }
    const Placement placement = read_placement(entry, series.pixel, series.rows);
    read_instants(entry, series, fields);
    if (const auto camera = entry.is_table() ? entry.find("camera") : std::nullopt) {
        fields.camera_moves = camera->choice<bool>({{"moves", true}, {"still", false}});
    }
    fields.subset = series.subset * placement.pixel;
    fields.rotation = placement.rotation;
    fields.order = series.order;
    const std::vector<int> points = independent_points(series, placement, scene.specimen.size);
    for (const int point : points) {
        fields.places.push_back(placement.place(series.lattice.x(point), series.lattice.y(point)));
    }
    long followed = 0;
    read_fields(fields.file, [&](const FieldSeries&, int, const DisplacementField& field) {
        constexpr double lost = std::numeric_limits<double>::quiet_NaN();
        std::vector<Vec2>& moved = fields.moved.emplace_back();
        std::vector<double>& sigma = fields.sigma.emplace_back();
        for (const int point : points) {
            const auto i = static_cast<std::size_t>(point);
            const bool ok = field.status[i] == PointStatus::ok;
            followed += ok;
            moved.push_back(ok ? placement.displacement(field.u[i], field.v[i]) : Vec2(lost, lost));
            sigma.push_back(ok ? placement.pixel * field.sigma[i] : lost);
        }
    });
    if (followed == 0) {
        entry.fail(
            fmt::format("no point that was followed lies on the specimen, {:g} x {:g} mm: check pixel, offset and rotation",
                        1e3 * scene.specimen.size.x(), 1e3 * scene.specimen.size.y()));
    }
    return fields;
}

}  // namespace crampfit

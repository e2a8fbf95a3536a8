#include "inverse/field_comparison.hpp"

#include "datasets/error.hpp"
#include "forward/geometry.hpp"

#include <Eigen/Dense>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace crampfit {
namespace {

constexpr double of_one_picture = 0.5;  // of a displacement's variance, which is that of two

// A small motion of the whole picture: a translation, and a turn about the origin.
Eigen::MatrixXd motion_at(const Vec2& place) {
    Eigen::MatrixXd rows(2, 3);
    rows << 1, 0, -place.y(), 0, 1, place.x();
    return rows;
}

}  // namespace

FieldComparison::FieldComparison(const Experiment& experiment) {
    const MeasuredFields& fields = *experiment.fields;
    places_ = fields.places;
    reach_ = fields.subset * std::numbers::sqrt2 / 2;
    camera_moves_ = fields.camera_moves;
    std::size_t followed = 0, compared = 0;
    for (std::size_t k = 0; k < fields.instants.size(); ++k) {
        std::vector<Point>& points = pictures_.emplace_back();
        for (std::size_t i = 0; i < places_.size(); ++i) {
            if (fields.moved[k][i].allFinite()) {
                points.push_back({i, fields.moved[k][i], experiment.noise.displacement_field.value_or(fields.sigma[k][i]), 0.0});
                if (!(points.back().sigma > 0)) {
                    throw InputError(fields.file.string(), fmt::format("sigma of image {}", k),
                                     fmt::format("{:g}", points.back().sigma), "must be positive: give noise.displacement_field");
                }
            }
        }
        constexpr std::size_t least_points = 4;  // more numbers than a motion has
        if (points.size() < least_points) {
            points.clear();
        }
        followed += points.size();
        compared += !points.empty();
    }
    std::vector<ReferenceError> reference(places_.size());
    for (std::vector<Point>& points : pictures_) {
        for (Point& point : points) {
            ReferenceError& error = reference[point.place];
            point.unforeseen = std::sqrt(error.variance(point.sigma) + of_one_picture * point.sigma * point.sigma);
            error.take_in(Vec2::Zero(), point);
        }
    }
    for (int axis = 0; axis < 2; ++axis) {
        for (std::size_t k = 0; k < pictures_.size(); ++k) {
            for (const Point& point : pictures_[k]) {
                FitResidual station{.experiment = experiment.name, .kind = axis == 0 ? "u_x" : "u_y", .at = fields.instants[k]};
                station.measured = point.measured[axis];
                station.sigma = point.unforeseen;
                stations_.push_back(station);
            }
        }
    }
    remark_ = fmt::format("{}: displacements of {} points in {} pictures are compared, {} with no pixel in common{}.",
                          experiment.name, followed, compared, places_.size(),
                          camera_moves_ ? "; each picture may have moved and turned as a whole" : "");
}

// Nothing is known beforehand but that the reference has half of the first variance; a picture that is the reference itself tells
// nothing of its noise.
void FieldComparison::ReferenceError::take_in(const Vec2& off, const Point& point) {
    if (!point.measured.isZero(0.0)) {
        const double weight = 1 / (of_one_picture * point.sigma * point.sigma);
        precision += precision > 0 ? weight : 2 * weight;
        sum += weight * off;
    }
}

double FieldComparison::ReferenceError::variance(double sigma) const {
    return precision > 0 ? 1 / precision : of_one_picture * sigma * sigma;
}

std::vector<Vec2> FieldComparison::modelled(const std::vector<Point>& points, const ProbeReading& reading,
                                            std::vector<ReferenceError>& reference) const {
    std::vector<Vec2> values;
    std::vector<double> share;  // of a point that counts
    for (const Point& point : points) {
        double nearest = INFINITY;
        for (const std::vector<Vec2>& crack : reading.cracks) {
            nearest = std::min(nearest, distance_to(crack, places_[point.place]));
        }
        const Vec2& value = reading.moved[point.place];
        share.push_back(value.allFinite() ? std::clamp(nearest / reach_ - 1, 0.0, 1.0) : 0.0);
        values.push_back(share.back() > 0 ? value : point.measured);
    }
    if (camera_moves_) {
        move_with_camera(points, share, values);
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
        ReferenceError& error = reference[points[i].place];
        const Vec2 off = values[i] - points[i].measured;
        values[i] = points[i].measured + share[i] * (off - error.mean());
        if (share[i] == 1.0) {
            error.take_in(off, points[i]);
        }
    }
    return values;
}

void FieldComparison::move_with_camera(const std::vector<Point>& points, const std::vector<double>& share,
                                       std::vector<Vec2>& values) const {
    // Of any size: at three gcc 12 takes Eigen's blocks for reads beyond their end.
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(3, 3);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(3);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto rows = motion_at(places_[points[i].place] / reach_);
        const double weight = std::pow(share[i] / points[i].sigma, 2);
        normal += weight * rows.transpose() * rows;
        right += weight * rows.transpose() * (points[i].measured - values[i]);
    }
    const Eigen::VectorXd motion = normal.completeOrthogonalDecomposition().solve(right);
    for (std::size_t i = 0; i < points.size(); ++i) {
        values[i] += motion_at(places_[points[i].place] / reach_) * motion;
    }
}

std::vector<double> FieldComparison::modelled(const Record& record) const {
    if (record.probes.size() != pictures_.size()) {
        throw std::invalid_argument(
            fmt::format("the run read {} of {} displacement fields", record.probes.size(), pictures_.size()));
    }
    std::vector<Vec2> values;
    std::vector<ReferenceError> reference(places_.size());
    for (std::size_t k = 0; k < pictures_.size(); ++k) {
        const std::vector<Vec2> of_picture = modelled(pictures_[k], record.probes[k], reference);
        values.insert(values.end(), of_picture.begin(), of_picture.end());
    }
    std::vector<double> all;
    for (int axis = 0; axis < 2; ++axis) {
        for (const Vec2& value : values) {
            all.push_back(value[axis]);
        }
    }
    return all;
}

}  // namespace crampfit

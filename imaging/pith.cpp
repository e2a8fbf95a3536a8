#include "imaging/pith.hpp"

#include "imaging/quantile.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <vector>

namespace crampfit {
namespace {

constexpr double normal_sd = 1.4826;  // of a normal distribution, in medians of the absolute value
constexpr double cauchy = 2.385;      // standard deviations: 95 % efficient where all is normal (Holland & Welsch 1977)

cv::Point2d middle_of(cv::Size picture) { return {0.5 * (picture.width - 1), 0.5 * (picture.height - 1)}; }

/// Where a lattice node stands [pixels].
cv::Point2d node(const OrientationField& field, int i, int j) {
    return {field.step * (i + 0.5) - 0.5, field.step * (j + 0.5) - 0.5};
}

/// Where a lattice node stands, and the direction along its ring.
struct Ring {
    cv::Point2d place, along;
    double weight;
};

std::vector<Ring> rings_of(const OrientationField& field) {
    std::vector<Ring> rings;
    for (int j = 0; j < field.cos2.rows; ++j)
        for (int i = 0; i < field.cos2.cols; ++i) {
            const double angle = 0.5 * std::atan2(field.sin2.at<float>(j, i), field.cos2.at<float>(j, i));
            const double coherency = field.coherency.at<float>(j, i);
            if (coherency > 0) rings.push_back({node(field, i, j), {-std::sin(angle), std::cos(angle)}, coherency * coherency});
        }
    return rings;
}

}  // namespace

std::optional<cv::Point2d> RadialFan::pith() const {
    if (turn == 0) return std::nullopt;
    return middle - away / turn;
}

RadialFan fan_from(const cv::Point2d& pith, cv::Size picture) {
    const cv::Point2d middle = middle_of(picture);
    return {middle, middle - pith, 1, 0};
}

std::optional<RadialFan> fit_fan(const OrientationField& field, cv::Size picture) {
    constexpr int rounds = 30;  // each leaves some tenth of the change of the one before
    const std::vector<Ring> rings = rings_of(field);
    if (rings.size() < 3) return std::nullopt;
    const double length = 0.5 * std::hypot(picture.width, picture.height);
    RadialFan fan{middle_of(picture), {}, 0, 0};
    std::vector<double> weight(rings.size());
    std::ranges::transform(rings, weight.begin(), &Ring::weight);
    std::vector<float> sines(rings.size());
    for (int round = 0; round < rounds; ++round) {
        Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
        for (std::size_t i = 0; i < rings.size(); ++i) {
            const Ring& ring = rings[i];
            const Eigen::Vector3d row(ring.along.x, ring.along.y, ring.along.dot(ring.place - fan.middle) / length);
            normal += weight[i] * row * row.transpose();
        }
        const Eigen::Vector3d best = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(normal).eigenvectors().col(0);
        fan.away = {best[0], best[1]};
        fan.turn = best[2] / length;
        for (std::size_t i = 0; i < rings.size(); ++i) {
            const cv::Point2d radial = fan.direction(rings[i].place);
            sines[i] = static_cast<float>(std::abs(rings[i].along.dot(radial)) / std::max(std::sqrt(radial.dot(radial)), 1e-9));
        }
        fan.scatter = normal_sd * quantile(sines, 0.5);
        for (std::size_t i = 0; i < rings.size(); ++i) {
            const cv::Point2d radial = fan.direction(rings[i].place);
            const double far = sines[i] / (cauchy * std::max(fan.scatter, 1e-6));
            // Nearer to the pith than a node no direction tells.
            const double square = std::max(radial.dot(radial), fan.turn * fan.turn * field.step * field.step);
            weight[i] = rings[i].weight / (std::max(square, 1e-12) * (1 + far * far));
        }
    }
    return fan;
}

void turn_to_fan(OrientationField& field, const RadialFan& fan) {
    for (int j = 0; j < field.cos2.rows; ++j)
        for (int i = 0; i < field.cos2.cols; ++i) {
            const cv::Point2d n = fan.direction(node(field, i, j));
            const double square = n.dot(n);
            if (!(square > 0)) continue;  // the pith itself
            field.cos2.at<float>(j, i) = static_cast<float>((n.x * n.x - n.y * n.y) / square);
            field.sin2.at<float>(j, i) = static_cast<float>(2 * n.x * n.y / square);
        }
}

}  // namespace crampfit

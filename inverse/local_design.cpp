#include "inverse/local_design.hpp"

#include "inverse/differences.hpp"

#include <Eigen/LU>

#include <array>
#include <cassert>
#include <cmath>
#include <limits>

namespace crampfit {
namespace {

constexpr std::size_t points_a_parameter = 4;

// Where a point's neighbours stand on an axis, the near ones first.
std::array<double, points_a_parameter> offsets(double x) {
    constexpr double h = 0.5 * difference_step;
    if (x - 2 * h >= 0 && x + 2 * h <= 1) {
        return {-h, h, -2 * h, 2 * h};
    }
    const double inward = x < 0.5 ? h : -h;
    return {inward, 2 * inward, 3 * inward, 4 * inward};
}

// Slope at 0 of the polynomial through (0, 0) and all points.
double slope(std::span<const double> at, std::span<const double> values) {
    const auto count = static_cast<Eigen::Index>(at.size());
    Eigen::MatrixXd powers(count, count);
    for (Eigen::Index i = 0; i < count; ++i) {
        for (Eigen::Index k = 0; k < count; ++k) {
            powers(i, k) = std::pow(at[static_cast<std::size_t>(i)] / difference_step, static_cast<double>(k + 1));
        }
    }
    const Eigen::VectorXd coefficients = powers.partialPivLu().solve(Eigen::Map<const Eigen::VectorXd>(values.data(), count));
    return coefficients[0] / difference_step;
}

}  // namespace

LocalDesign::LocalDesign(const Eigen::VectorXd& x) : points_{x} {
    for (Eigen::Index j = 0; j < x.size(); ++j) {
        for (const double offset : offsets(x[j])) {
            points_.push_back(x);
            points_.back()[j] += offset;
        }
    }
}

std::vector<Estimate> LocalDesign::derivatives(std::span<const double> values) const {
    assert(values.size() == points_.size());
    std::vector<Estimate> derivatives;
    const auto parameters = static_cast<std::size_t>(points_.front().size());
    for (std::size_t j = 0; j < parameters; ++j) {
        std::vector<double> at, change;
        for (std::size_t k = 1 + j * points_a_parameter; k < 1 + (j + 1) * points_a_parameter; ++k) {
            if (std::isfinite(values[k] - values[0])) {
                at.push_back((points_[k] - points_[0])[static_cast<Eigen::Index>(j)]);
                change.push_back(values[k] - values[0]);
            }
        }
        if (at.size() < 2) {
            constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
            derivatives.push_back({unknown, unknown, unknown});
            continue;
        }
        const double value = slope(at, change);
        const std::size_t fewer = at.size() > 3 ? at.size() - 2 : at.size() - 1;
        const double error = std::abs(value - slope(std::span(at).first(fewer), std::span(change).first(fewer)));
        derivatives.push_back({value, value - error, value + error});
    }
    return derivatives;
}

}  // namespace crampfit

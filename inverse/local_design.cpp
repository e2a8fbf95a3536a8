#include "inverse/local_design.hpp"

#include "inverse/differences.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

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

// The neighbours that a jump of the function parts from 0 are left out: between two points that follow each other it changes by
// more than this part of its value, and otherwise than between all others, farther than these differ: a slope in the middle that
// changes evenly lies between them, one at an end half as far off. Whether there was one.
bool drop_beyond_jump(std::vector<double>& at, std::vector<double>& change, double value) {
    constexpr double spreads_inside = 1.0, spreads_at_end = 5.0, part = 0.2, least = 1e-5;
    if (at.size() < points_a_parameter) {
        return false;
    }
    std::vector<std::pair<double, double>> line{{0.0, 0.0}};
    for (std::size_t k = 0; k < at.size(); ++k) {
        line.emplace_back(at[k], change[k]);
    }
    std::ranges::sort(line);
    std::vector<double> slopes;
    for (std::size_t k = 0; k + 1 < line.size(); ++k) {
        slopes.push_back((line[k + 1].second - line[k].second) / (line[k + 1].first - line[k].first));
    }
    for (std::size_t k = 0; k < slopes.size(); ++k) {
        std::vector<double> others = slopes;
        others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
        const auto [low, high] = std::ranges::minmax(others);
        const double off = std::max(low - slopes[k], slopes[k] - high);
        const double spreads = k == 0 || k + 1 == slopes.size() ? spreads_at_end : spreads_inside;
        if (off <= spreads * (high - low) || off <= part * std::max(std::abs(low), std::abs(high)) ||
            off * (line[k + 1].first - line[k].first) <= least * std::abs(value)) {
            continue;
        }
        const double before = line[k].first, after = line[k + 1].first;
        std::vector<double> kept_at, kept_change;
        for (std::size_t i = 0; i < at.size(); ++i) {
            if (after > 0 ? at[i] <= before : at[i] >= after) {
                kept_at.push_back(at[i]);
                kept_change.push_back(change[i]);
            }
        }
        at = kept_at;
        change = kept_change;
        return true;
    }
    return false;
}

// The slopes from below and from above (parabolas through 0 and both points there), where the function has a kink nearby: from
// one stretch between points to the next its slope changes by turns much and little, and by more than this part of itself. A
// smooth one's changes nearly evenly.
std::optional<std::pair<double, double>> sides_of_kink(const std::vector<double>& at, const std::vector<double>& change) {
    constexpr double uneven = 0.5, part = 0.01;
    if (at.size() < points_a_parameter || at[0] * at[1] > 0) {
        return std::nullopt;
    }
    const double h = at[1];
    const std::array<double, points_a_parameter> slopes{(change[0] - change[2]) / h, -change[0] / h, change[1] / h,
                                                        (change[3] - change[1]) / h};
    std::array<double, points_a_parameter - 1> turns{};
    double steepest = 0;
    for (std::size_t k = 0; k < slopes.size(); ++k) {
        steepest = std::max(steepest, std::abs(slopes[k]));
        if (k > 0) {
            turns[k - 1] = slopes[k] - slopes[k - 1];
        }
    }
    const auto [least, most] = std::ranges::minmax(turns);
    const double sharpest = std::max(std::abs(least), std::abs(most));
    if (most - least <= uneven * sharpest || sharpest <= part * steepest) {
        return std::nullopt;
    }
    return std::pair(1.5 * slopes[1] - 0.5 * slopes[0], 1.5 * slopes[2] - 0.5 * slopes[3]);
}

}  // namespace

LocalDesign::LocalDesign(const Eigen::VectorXd& x, const std::vector<std::size_t>& left_out) : points_{x} {
    for (Eigen::Index j = 0; j < x.size(); ++j) {
        if (std::ranges::find(left_out, static_cast<std::size_t>(j)) != left_out.end()) {
            continue;
        }
        parameters_.push_back(static_cast<std::size_t>(j));
        for (const double offset : offsets(x[j])) {
            points_.push_back(x);
            points_.back()[j] += offset;
        }
    }
}

std::vector<Estimate> LocalDesign::derivatives(std::span<const double> values, bool* jumps) const {
    assert(values.size() == points_.size());
    constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    std::vector<Estimate> derivatives(static_cast<std::size_t>(points_.front().size()), {unknown, unknown, unknown});
    for (std::size_t number = 0; number < parameters_.size(); ++number) {
        const std::size_t j = parameters_[number];
        std::vector<double> at, change;
        for (std::size_t k = 1 + number * points_a_parameter; k < 1 + (number + 1) * points_a_parameter; ++k) {
            if (std::isfinite(values[k] - values[0])) {
                at.push_back((points_[k] - points_[0])[static_cast<Eigen::Index>(j)]);
                change.push_back(values[k] - values[0]);
            }
        }
        const bool jumped = drop_beyond_jump(at, change, values[0]);
        if (jumps) {
            *jumps = *jumps || jumped;
        }
        if (at.size() < 2) {
            continue;
        }
        const double value = slope(at, change);
        const std::size_t fewer = at.size() > 3 ? at.size() - 2 : at.size() - 1;
        const double error = std::abs(value - slope(std::span(at).first(fewer), std::span(change).first(fewer)));
        Estimate estimate{value, value - error, value + error};
        if (const auto sides = sides_of_kink(at, change)) {
            const auto [low, high] = std::minmax(sides->first, sides->second);
            estimate = {0.5 * (low + high), std::min(low, estimate.lower_95), std::max(high, estimate.upper_95)};
        }
        derivatives[j] = estimate;
    }
    return derivatives;
}

}  // namespace crampfit

#include "imaging/ring_profile.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace crampfit {
namespace {

constexpr double most_steps = 64;
constexpr double model_error = 0.003;  // of the contrast: what a blur that is no Gaussian leaves in a mean

using Points = std::vector<Eigen::Vector2d>;  // (place in steps, gray)

/// The line through some points by least squares, at a place.
double line_at(double place, const Eigen::Vector2d* begin, const Eigen::Vector2d* end) {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const auto* point = begin; point != end; ++point) mean += *point / static_cast<double>(end - begin);
    double xx = 0, xy = 0;
    for (const auto* point = begin; point != end; ++point) {
        xx += std::pow(point->x() - mean.x(), 2);
        xy += (point->x() - mean.x()) * (point->y() - mean.y());
    }
    return mean.y() + xy / xx * (place - mean.x());
}

double normal_distribution(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

/// Integral of the normal distribution.
double normal_ramp(double z) { return z * normal_distribution(z) + std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi); }

/// Share of a gray that runs straight between knots, at 0 to the number of steps, which is below half way between its extremes.
SharpProfile figures(const Eigen::VectorXd& knots) {
    SharpProfile profile{knots.maxCoeff(), knots.minCoeff(), 0};
    const double half = 0.5 * (profile.earlywood + profile.latewood);
    double below = 0;
    for (Eigen::Index i = 0; i + 1 < knots.size(); ++i) {
        const double a = half - knots[i], b = half - knots[i + 1];
        if (a >= 0 && b >= 0) below += 1;
        else if (a > 0 || b > 0) below += std::max(a, b) / std::abs(a - b);
    }
    profile.latewood_fraction = below / static_cast<double>(knots.size() - 1);
    return profile;
}

}  // namespace

RingProfile::RingProfile(double width)
    : width_(width), sum_(static_cast<std::size_t>(std::clamp(std::round(width), 1.0, most_steps)), 0.0),
      squares_(sum_.size(), 0.0), count_(sum_.size(), 0) {}

void RingProfile::add(double place, double gray) {
    const double step = std::clamp(place, 0.0, 1.0) * static_cast<double>(sum_.size());
    const auto i = std::min(sum_.size() - 1, static_cast<std::size_t>(step));
    sum_[i] += gray;
    squares_[i] += gray * gray;
    ++count_[i];
}

void RingProfile::add(const RingProfile& stretch) {
    for (std::size_t i = 0; i < sum_.size(); ++i) {
        if (stretch.count_[i] == 0) continue;
        sum_[i] += stretch.sum_[i];
        squares_[i] += stretch.squares_[i];
        count_[i] += stretch.count_[i];
        scatter_ += std::max(0.0, stretch.squares_[i] - stretch.sum_[i] * stretch.mean(i));
        freedom_ += stretch.count_[i] - 1;
    }
}

SharpProfile RingProfile::seen() const {
    const std::size_t n = sum_.size(), reach = n / 40, some = std::max<std::size_t>(3, n / 8);
    Points means;
    for (std::size_t i = 0; i < n; ++i) {
        double sum = 0;
        int count = 0;
        for (std::size_t k = i - std::min(i, reach); k <= std::min(n - 1, i + reach); ++k) {
            sum += sum_[k];
            count += count_[k];
        }
        if (count_[i] > 0) means.emplace_back(static_cast<double>(i) + 0.5, sum / count);
    }
    const auto [dark, bright] = std::ranges::minmax(means, {}, [](const Eigen::Vector2d& mean) { return mean.y(); });
    SharpProfile profile{bright.y(), dark.y(), 0};
    if (means.size() >= 2 * some) {
        const auto *first = means.data(), *end = first + means.size();
        profile.earlywood = std::max(profile.earlywood, line_at(0, first, first + some));
        profile.latewood = std::min(profile.latewood, line_at(static_cast<double>(n), end - some, end));
    }
    const double half = 0.5 * (profile.earlywood + profile.latewood);
    const auto late = std::ranges::count_if(means, [half](const Eigen::Vector2d& mean) { return mean.y() < half; });
    profile.latewood_fraction = static_cast<double>(late) / static_cast<double>(means.size());
    return profile;
}

SharpProfile RingProfile::sharpened(double blur, const BorderGrays& inner, const BorderGrays& outer) const {
    const double before = inner.latewood, after = outer.earlywood;
    const auto n = static_cast<Eigen::Index>(sum_.size());
    const double step = width_ / static_cast<double>(n), contrast = std::abs(after - before);
    if (n < 3 || !(contrast > 0)) return seen();
    const double sigma = std::hypot(blur, step / std::sqrt(12.0)) / step;  // in steps; a mean is one over a step
    const double noise = freedom_ > 0 ? scatter_ / static_cast<double>(freedom_) : 0;

    // Gray is before + (t_0 - before) H(x) + sum of bends b_i (x - i)_+ ...; H blurs to Phi, a ramp to its integral.
    Eigen::MatrixXd shape(n, n + 1);
    Eigen::VectorXd means(n), weight = Eigen::VectorXd::Zero(n);
    for (Eigen::Index row = 0; row < n; ++row) {
        const double x = static_cast<double>(row) + 0.5, end = static_cast<double>(n);
        const auto ramp = [&](Eigen::Index knot) { return sigma * normal_ramp((x - static_cast<double>(knot)) / sigma); };
        const double inside = normal_distribution(x / sigma), beyond = normal_distribution((x - end) / sigma);
        shape(row, 0) = inside - ramp(0) + ramp(1);
        shape(row, n) = ramp(n - 1) - ramp(n) - beyond;
        for (Eigen::Index knot = 1; knot < n; ++knot) shape(row, knot) = ramp(knot - 1) - 2 * ramp(knot) + ramp(knot + 1);
        const auto i = static_cast<std::size_t>(row);
        if (count_[i] == 0) continue;
        means[row] = mean(i) - before * (1 - inside) - after * beyond;
        weight[row] = 1 / (noise / count_[i] + std::pow(model_error * contrast, 2));
    }
    const Eigen::MatrixXd normal = shape.transpose() * weight.asDiagonal() * shape;
    const Eigen::VectorXd right = shape.transpose() * weight.cwiseProduct(means);
    const auto known = static_cast<double>((weight.array() > 0).count());

    // |b| as b^2 / |b| of the round before; ever less of it until the means are met within their noise.
    constexpr int rounds = 5, most_halvings = 60;
    constexpr double left_free = 0.8;  // of the means: the profile takes up the rest
    const double least_bend = 0.02 * contrast / static_cast<double>(n);
    Eigen::VectorXd knots, bend_weight = Eigen::VectorXd::Constant(n - 1, 1 / contrast);
    double price = normal.trace() * contrast;
    for (int halving = 0; halving < most_halvings; ++halving, price *= 0.5) {
        for (int round = 0; round < rounds; ++round) {
            Eigen::MatrixXd matrix = normal;
            for (Eigen::Index i = 0; i + 1 < n; ++i) {
                const Eigen::Vector3d bend(1, -2, 1);
                matrix.block<3, 3>(i, i) += price * bend_weight[i] * bend * bend.transpose();
            }
            knots = matrix.ldlt().solve(right);
            for (Eigen::Index i = 0; i + 1 < n; ++i)
                bend_weight[i] = 1 / std::hypot(knots[i] - 2 * knots[i + 1] + knots[i + 2], least_bend);
        }
        if (weight.dot((means - shape * knots).cwiseAbs2()) <= left_free * known) break;
    }
    // Where LW is but a few steps wide a profile may swing beyond what there is of it.
    const SharpProfile limits = seen();
    const double brightest = std::max(limits.earlywood, inner.earlywood), darkest = std::min(limits.latewood, outer.latewood);
    return figures(knots.cwiseMax(darkest).cwiseMin(brightest));
}

std::pair<double, double> RingProfile::line_to(const RingProfile& there) const {
    double weight = 0, x = 0, y = 0, xx = 0, xy = 0;
    const auto for_all = [&](const auto& visit) {
        for (std::size_t i = 0; i < sum_.size(); ++i)
            if (count_[i] > 0 && there.count_[i] > 0) visit(there.count_[i], mean(i), there.mean(i));
    };
    for_all([&](double count, double here, double other) {
        weight += count;
        x += count * here;
        y += count * other;
    });
    if (weight == 0) return {0, 1};
    x /= weight;
    y /= weight;
    for_all([&](double count, double here, double other) {
        xx += count * (here - x) * (here - x);
        xy += count * (here - x) * (other - y);
    });
    if (!(xy > 0)) return {0, 1};
    return {y - xy / xx * x, xy / xx};
}

}  // namespace crampfit

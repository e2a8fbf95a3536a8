#include "imaging/opening.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace crampfit {
namespace {

constexpr double blur = 1.5;       // of the opening along the crack: lens, pixels and interpolation [px]
constexpr int places_a_pixel = 4;  // that are looked at
constexpr double power_step = 0.25, highest_power = 1.5;
constexpr int least_points = 8;       // on either side of the tip
constexpr double least_freedom = 10;  // neighbours go along where the model misses something, too
constexpr double least_gain = 25;     // of the F statistic: a crack is no chance
constexpr double own_motion = 0.1;    // of the wood from place to place, beside what changes slowly: a judgement [px]

/// r^p behind the tip and 0 ahead, blurred, r over `length`; at every part of a pixel from -length to length.
class BlurredPower {
  public:
    BlurredPower(int length, double power) : length_(length) {
        for (int i = -length * places_a_pixel; i <= length * places_a_pixel; ++i) {
            double sum = 0, mass = 0;
            for (double deviations = -3; deviations <= 3; deviations += 0.25) {
                const double weight = std::exp(-0.5 * deviations * deviations);
                const double r = static_cast<double>(i) / places_a_pixel + blur * deviations;
                sum += r > 0 ? weight * std::pow(r / length, power) : 0;
                mass += weight;
            }
            values_.push_back(sum / mass);
        }
    }
    double at(int parts) const { return values_[static_cast<std::size_t>(parts + length_ * places_a_pixel)]; }

  private:
    int length_;
    std::vector<double> values_;
};

constexpr int opening_terms = 2, other_terms = 5;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, opening_terms + other_terms>;

/// The terms that are the same wherever the tip is: a constant, and motions that change slowly along the line.
Rows other_rows(const OpeningProfile& profile) {
    const auto count = static_cast<Eigen::Index>(profile.opening.size());
    Rows rows = Rows::Zero(count, opening_terms + other_terms);
    for (Eigen::Index i = 0; i < count; ++i) {
        const double s = 2.0 * static_cast<double>(i) / static_cast<double>(count) - 1;
        const double along = profile.along[static_cast<std::size_t>(i)], across = profile.across[static_cast<std::size_t>(i)];
        rows.row(i).tail<other_terms>() << 1, along, s * along, across, s * across;
    }
    return rows;
}

/// What the best coefficients leave. Motions are held to a few tenths of a pixel's.
Eigen::VectorXd residuals(const Rows& rows, const Eigen::VectorXd& opening, const Eigen::VectorXd& weights) {
    const auto weighted = rows.transpose() * weights.asDiagonal();
    Eigen::Matrix<double, Rows::ColsAtCompileTime, Rows::ColsAtCompileTime> normal = weighted * rows;
    normal.diagonal().array() += 1e-9 * weights.sum();
    return opening - rows * normal.ldlt().solve(weighted * opening);
}

/// How much a place has to say: where the gray changes fast along the line, as at a ring's border, the least motion of the wood
/// passes for light that is missing.
Eigen::VectorXd weights_of(const OpeningProfile& profile) {
    const std::size_t count = profile.opening.size();
    std::vector<double> bends;
    for (std::size_t i = 1; i + 1 < count; ++i)
        bends.push_back(std::abs(profile.opening[i - 1] - 2 * profile.opening[i] + profile.opening[i + 1]));
    std::ranges::nth_element(bends, bends.begin() + static_cast<std::ptrdiff_t>(bends.size() / 2));
    const double noise = 1.4826 * bends[bends.size() / 2] / std::sqrt(6.0);  // three places make a bend
    Eigen::VectorXd weights(count);
    for (std::size_t i = 0; i < count; ++i) {
        const double by_motion = own_motion * profile.along[i];
        weights[static_cast<Eigen::Index>(i)] = 1 / (1 + std::pow(by_motion / std::max(noise, 1e-6), 2));
    }
    return weights;
}

/// Tukey's biweight (Beaton and Tukey 1974), 95 % efficient for Gaussian noise.
Eigen::VectorXd tukey_weights(const Eigen::VectorXd& left) {
    std::vector<double> sizes(left.size());
    Eigen::Map<Eigen::VectorXd>(sizes.data(), left.size()) = left.cwiseAbs();
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::ranges::nth_element(sizes, middle);
    const double far = 4.685 * 1.4826 * std::max(*middle, 1e-6);
    return (1 - (left / far).array().square()).cwiseMax(0).square();
}

/// How many of the values say something of their own, as their neighbours go along with them.
double independent(const Eigen::VectorXd& left) {
    const Eigen::Index n = left.size();
    const double together = left.head(n - 1).dot(left.tail(n - 1)) / std::max(left.squaredNorm(), 1e-300);
    return std::clamp((1 - together) / (1 + together), 0.05, 1.0) * static_cast<double>(n);
}

struct Fitted {
    double place;  // [px]
    double squares;
    Eigen::VectorXd left;
};

/// All powers and all places.
std::vector<Fitted> fit_all(Rows rows, const Eigen::VectorXd& opening, const Eigen::VectorXd& weights) {
    const int count = static_cast<int>(opening.size());
    std::vector<Fitted> all;
    for (double power = 0; power <= highest_power; power += power_step) {
        const BlurredPower first(count, power), second(count, power + 1);
        for (int place = least_points * places_a_pixel; place <= (count - 1 - least_points) * places_a_pixel; ++place) {
            for (int i = 0; i < count; ++i)
                rows.row(i).head<opening_terms>() << first.at(place - i * places_a_pixel), second.at(place - i * places_a_pixel);
            Fitted& fitted =
                all.emplace_back(Fitted{static_cast<double>(place) / places_a_pixel, 0, residuals(rows, opening, weights)});
            fitted.squares = fitted.left.cwiseAbs2().dot(weights);
        }
    }
    return all;
}

}  // namespace

std::optional<OpeningStart> find_opening_start(const OpeningProfile& profile) {
    const int count = static_cast<int>(profile.opening.size());
    if (count < 2 * least_points + 1) return std::nullopt;
    const Eigen::VectorXd opening = Eigen::Map<const Eigen::VectorXd>(profile.opening.data(), count);
    const Rows rows = other_rows(profile);
    const Eigen::VectorXd known = weights_of(profile);
    Eigen::VectorXd weights = known;
    std::vector<Fitted> all = fit_all(rows, opening, weights);
    for (int i = 0; i < 2; ++i) {
        const Eigen::VectorXd& left = std::ranges::min_element(all, {}, &Fitted::squares)->left;
        weights = known.cwiseProduct(tukey_weights(known.cwiseSqrt().cwiseProduct(left)));
        all = fit_all(rows, opening, weights);
    }
    const Fitted& best = *std::ranges::min_element(all, {}, &Fitted::squares);
    const double none = residuals(rows, opening, weights).cwiseAbs2().dot(weights);
    const double freedom =
        std::max(independent(weights.cwiseSqrt().cwiseProduct(best.left)) - static_cast<double>(rows.cols()) - 2, least_freedom);
    if (!((none - best.squares) / 4 > least_gain * best.squares / freedom)) return std::nullopt;
    double mass = 0, mean = 0, square = 0;
    for (const Fitted& one : all) {
        const double weight = std::exp(-0.5 * freedom * (one.squares / best.squares - 1));
        mass += weight;
        mean += weight * one.place;
        square += weight * one.place * one.place;
    }
    mean /= mass;
    constexpr double step = 1.0 / places_a_pixel;
    return OpeningStart{mean, std::sqrt(std::max(square / mass - mean * mean, 0.0) + step * step / 12)};
}

}  // namespace crampfit

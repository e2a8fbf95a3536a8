#include "imaging/border_edges.hpp"

#include "imaging/quantile.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace crampfit {
namespace {

constexpr double bin_width = 0.25;  // pixels
constexpr int least_pixels = 40;    // of a stretch: ten for each unknown

double normal_density(double z) { return std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi); }
double normal_distribution(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

/// What l0, l1, e0 and e1 count at a distance from the jump.
Eigen::Vector4d parts(double d, double blur) {
    const double over = normal_distribution(d / blur), ramp = blur * normal_density(d / blur);
    return {1 - over, d * (1 - over) - ramp, over, d * over + ramp};
}

/// Width of the ring on one side of a border at a column; infinite where there is none.
double width_beside(const std::vector<BorderLine>& borders, std::size_t border, int step, int u) {
    const auto other = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(border) + step);
    if (other >= borders.size() || !borders[other].covers(u)) return std::numeric_limits<double>::infinity();
    return std::abs(borders[other].at(u) - borders[border].at(u));
}

/// The value among some that makes a function least.
template <class Function>
double least(const std::vector<double>& values, const Function& function) {
    return *std::ranges::min_element(values, {}, function);
}

}  // namespace

double BorderEdges::Stretch::distance(std::size_t bin) const { return (static_cast<double>(bin) + 0.5) * bin_width - reach; }

void BorderEdges::Stretch::narrow(double to) {
    const auto cut = static_cast<std::ptrdiff_t>((reach - to) / bin_width);
    if (cut <= 0) return;
    reach -= static_cast<double>(cut) * bin_width;
    sum = {sum.begin() + cut, sum.end() - cut};
    count = {count.begin() + cut, count.end() - cut};
}

BorderEdges::BorderEdges(const cv::Mat& gray, const cv::Mat& valid, const std::vector<BorderLine>& borders, double ring_width) {
    constexpr double least_reach = 3, share = 0.125;  // pixels; of a ring, over which its gray is as good as a line
    const int length = std::max(40, static_cast<int>(ring_width)), step = std::max(1, length / 50);
    stretches_.resize(borders.size());
    for (std::size_t i = 0; i < borders.size(); ++i) {
        const BorderLine& border = borders[i];
        const int columns = border.end() - border.first, count = std::max(1, columns / length);
        for (int k = 0; k < count; ++k) {
            const int begin = border.first + columns * k / count, end = border.first + columns * (k + 1) / count;
            const int middle = (begin + end) / 2;
            if (!border.covers(begin) || !border.covers(middle) || !border.covers(end - 1)) continue;
            double before = width_beside(borders, i, -1, middle), after = width_beside(borders, i, 1, middle);
            if (std::isinf(before) && std::isinf(after)) {  // of rings that reach out of the picture what is in it
                before = border.at(middle);
                after = gray.rows - 1 - before;
            }
            const double beside = std::min(before, after);
            if (beside < 4 * least_reach) continue;  // rows that tell of a ring's end would be a quarter of it
            const double slope = end - 1 > begin ? (border.at(end - 1) - border.at(begin)) / (end - 1 - begin) : 0;
            const double cosine = 1 / std::sqrt(1 + slope * slope);
            Stretch stretch{0.5 * (begin + end - 1), std::max(least_reach, share * beside * cosine), {}, {}, {}, {}};
            stretch.before = cosine * (std::isfinite(before) ? before : after);
            stretch.after = cosine * (std::isfinite(after) ? after : before);
            const auto bins = static_cast<std::size_t>(std::floor(2 * stretch.reach / bin_width));
            stretch.sum.assign(bins, 0.0);
            stretch.count.assign(bins, 0);
            int pixels = 0;
            for (int u = begin; u < end; u += step) {
                if (!border.covers(u)) continue;
                const double reach = stretch.reach / cosine;
                for (int v = std::max(0, static_cast<int>(std::ceil(border.at(u) - reach)));
                     v <= std::min(gray.rows - 1, static_cast<int>(std::floor(border.at(u) + reach))); ++v) {
                    const auto bin = static_cast<std::size_t>(((v - border.at(u)) * cosine + stretch.reach) / bin_width);
                    if (valid.at<float>(v, u) == 0 || bin >= bins) continue;
                    stretch.sum[bin] += gray.at<float>(v, u);
                    ++stretch.count[bin];
                    ++pixels;
                }
            }
            if (pixels >= least_pixels) stretches_[i].push_back(std::move(stretch));
        }
    }
    std::vector<double> blurs, places;
    for (double blur = 0.3; blur < 3; blur *= 1.1)  // pixels; beyond half the reach a blur looks like a slope
        blurs.push_back(blur);
    for (double place = -1; place < 1.01; place += 0.1) places.push_back(place);
    for (const double next : {0.0, 0.2, 0.04, 0.0}) {  // of these steps; what the blur is off by shows up as slopes
        blur_ = least(blurs, [&](double blur) { return left(blur, place_); });
        place_ = least(places, [&](double place) { return left(blur_, place); });
        for (auto& border : stretches_)  // what is farther than the blur reaches tells nothing of it, and less of the ring's end
            for (Stretch& stretch : border) stretch.narrow(std::max(least_reach, 4 * blur_));
        if (next == 0) continue;
        blurs.clear();
        places.clear();
        for (int i = -5; i <= 5; ++i) {
            blurs.push_back(blur_ * std::pow(1.1, i * next));
            places.push_back(place_ + 0.1 * i * next);
        }
    }
    std::vector<float> latewood, earlywood;
    for (const auto& border : stretches_)
        for (const Stretch& stretch : border) {
            const Fit found = fit(stretch, blur_, place_);
            latewood.push_back(static_cast<float>(found.latewood_slope * stretch.before));
            earlywood.push_back(static_cast<float>(found.earlywood_slope * stretch.after));
        }
    latewood_slope_ = quantile(latewood, 0.5);
    earlywood_slope_ = quantile(earlywood, 0.5);
}

BorderEdges::Fit BorderEdges::fit(const Stretch& stretch, double blur, double place) {
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    double squares = 0;
    for (std::size_t bin = 0; bin < stretch.sum.size(); ++bin) {
        if (stretch.count[bin] == 0) continue;
        const Eigen::Vector4d row = parts(stretch.distance(bin) - place, blur);
        normal += stretch.count[bin] * row * row.transpose();
        right += stretch.sum[bin] * row;
        squares += stretch.sum[bin] * stretch.sum[bin] / stretch.count[bin];
    }
    const Eigen::Vector4d line = normal.ldlt().solve(right);
    return {line[0], line[1], line[2], line[3], std::max(0.0, squares - line.dot(right))};
}

double BorderEdges::left(double blur, double place) const {
    double sum = 0;
    for (const auto& border : stretches_)
        for (const Stretch& stretch : border) sum += fit(stretch, blur, place).left;
    return sum;
}

std::optional<BorderGrays> BorderEdges::at(std::size_t border, int column) const {
    const std::vector<Stretch>& all = stretches_[border];
    if (all.empty()) return std::nullopt;
    const auto away = [column](const Stretch& one) { return std::abs(one.column - column); };
    const Stretch& nearest = *std::ranges::min_element(all, {}, away);
    if (blur_ > 0.5 * nearest.reach) return std::nullopt;  // what looks like this is no jump
    return ends(nearest);
}

BorderGrays BorderEdges::ends(const Stretch& stretch) const {
    BorderGrays grays;
    double most = 0;  // slope [gray per pixel]: where gray went more than half way within reach, LW would be narrower than that
    for (int round = 0; round < 2; ++round) {
        const double latewood_slope = std::clamp(latewood_slope_ / stretch.before, -most, most);
        const double earlywood_slope = std::clamp(earlywood_slope_ / stretch.after, -most, most);
        Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
        Eigen::Vector2d right = Eigen::Vector2d::Zero();
        for (std::size_t bin = 0; bin < stretch.sum.size(); ++bin) {
            const Eigen::Vector4d row = parts(stretch.distance(bin) - place_, blur_);
            const double sloped = row[1] * latewood_slope + row[3] * earlywood_slope;
            const Eigen::Vector2d level(row[0], row[2]);
            normal += stretch.count[bin] * level * level.transpose();
            right += (stretch.sum[bin] - stretch.count[bin] * sloped) * level;
        }
        const Eigen::Vector2d found = normal.ldlt().solve(right);
        grays = {found[0], found[1]};
        most = 0.5 * std::abs(grays.earlywood - grays.latewood) / stretch.reach;
    }
    return grays;
}

}  // namespace crampfit

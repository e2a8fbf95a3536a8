#include "imaging/line_up.hpp"

#include <Eigen/Dense>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace crampfit {
namespace {

constexpr int motions = 6, parameters = motions + 4;
constexpr double coarsest_side = 40;     // shorter side of the coarsest copies [px]
constexpr double most_pixels = 1 << 20;  // of the finest copies: more says no more
constexpr int most_iterations = 30;
constexpr double settled = 1e-3;  // [px]
constexpr double least_seen = 2;  // of a motion, in what noise would say of it
constexpr double tukey = 4.685;   // 95 % efficient for Gaussian noise (Holland and Welsch 1977)

using Row = Eigen::Matrix<double, parameters, 1>;
using Normal = Eigen::Matrix<double, parameters, parameters>;

/// Coordinates that run from -1 to 1 over the picture, so that the parameters are of like size.
struct Unit {
    explicit Unit(cv::Size size)
        : middle((size.width - 1) / 2.0, (size.height - 1) / 2.0), half(size.width / 2.0, size.height / 2.0) {}
    double x(double column) const { return (column - middle.x) / half.x; }
    double y(double row) const { return (row - middle.y) / half.y; }
    cv::Point2d middle, half;
};

double median(std::vector<float>& values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

/// What the motion's parameters do to the map: shift and slope of x, then of y, each over the unit coordinates.
void move(cv::Matx23d& map, const Row& step, const Unit& unit) {
    for (int i = 0; i < 2; ++i) {
        const double by_x = step[3 * i + 1] / unit.half.x, by_y = step[3 * i + 2] / unit.half.y;
        map(i, 0) += by_x;
        map(i, 1) += by_y;
        map(i, 2) += step[3 * i] - by_x * unit.middle.x - by_y * unit.middle.y;
    }
}

/// The parameters that lead from one map to another.
Row between(const cv::Matx23d& from, const cv::Matx23d& to, const Unit& unit) {
    Row row = Row::Zero();
    const cv::Matx23d change = to - from;
    for (int i = 0; i < 2; ++i) {
        row[3 * i] = change(i, 2) + change(i, 0) * unit.middle.x + change(i, 1) * unit.middle.y;
        row[3 * i + 1] = change(i, 0) * unit.half.x;
        row[3 * i + 2] = change(i, 1) * unit.half.y;
    }
    return row;
}

/// The same alignment for copies `scale` times as large; pixels' centres lie half a pixel in.
cv::Matx23d scaled(const cv::Matx23d& map, double scale) {
    cv::Matx23d out = map;
    for (int i = 0; i < 2; ++i)
        out(i, 2) = scale * (map(i, 2) + 0.5 - 0.5 * (map(i, 0) + map(i, 1))) - 0.5 + 0.5 * (map(i, 0) + map(i, 1));
    return out;
}

struct Level {
    cv::Mat reference, image, by_x, by_y, weight;
};

Level level_at(const cv::Mat& reference, const cv::Mat& image, const cv::Mat& weight, double scale) {
    Level level;
    const auto copy = [&](const cv::Mat& full, cv::Mat& small) {
        cv::resize(full, small, {}, scale, scale, cv::INTER_AREA);
        cv::GaussianBlur(small, small, {}, 1.0);
    };
    copy(reference, level.reference);
    copy(image, level.image);
    if (!weight.empty()) cv::resize(weight, level.weight, level.reference.size(), 0, 0, cv::INTER_AREA);
    cv::Scharr(level.image, level.by_x, CV_32F, 1, 0, 1.0 / 32);
    cv::Scharr(level.image, level.by_y, CV_32F, 0, 1, 1.0 / 32);
    return level;
}

double modelled(const Alignment& now, const Unit& unit, int x, int y, double reference) {
    return (now.light[0] + now.light[1] * unit.x(x) + now.light[2] * unit.y(y)) * reference + now.light[3];
}

using Motion = Eigen::Matrix<double, motions, 1>;
using Information = Eigen::Matrix<double, motions, motions>;

/// What the pictures say of the motion, and what they would say if noise were all there is.
struct Evidence {
    Information found = Information::Zero(), by_noise = Information::Zero();
};

/// A step of Gauss-Newton, of the light alone unless it `moves`; gives the farthest that it moves a place of the picture [px].
double improve(const Level& level, Alignment& now, const cv::Matx23d& start, double likely, bool moves, Evidence& evidence) {
    const cv::Size size = level.reference.size();
    const Unit unit(size);
    const auto warped = [&](const cv::Mat& of) {
        cv::Mat out;
        cv::warpAffine(of, out, now.map, size, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT,
                       cv::Scalar::all(NAN));
        return out;
    };
    const cv::Mat image = warped(level.image), by_x = warped(level.by_x), by_y = warped(level.by_y);
    const int every = std::max(1, static_cast<int>(std::sqrt(size.area() / 2e4)));
    std::vector<float> sizes;
    for (int y = 0; y < size.height; y += every)
        for (int x = 0; x < size.width; x += every)
            if (const float seen = image.at<float>(y, x);
                !std::isnan(seen) && (level.weight.empty() || level.weight.at<float>(y, x) > 0.5f))
                sizes.push_back(std::abs(seen - static_cast<float>(modelled(now, unit, x, y, level.reference.at<float>(y, x)))));
    now.residual = std::max(1.4826 * median(sizes), 0.1);  // of the rounding to whole grays, at least

    Normal normal = Normal::Zero();
    Row right = Row::Zero();
    evidence = {};
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            const double gx = by_x.at<float>(y, x), gy = by_y.at<float>(y, x);
            if (std::isnan(gx + gy)) continue;
            const double reference = level.reference.at<float>(y, x),
                         left = image.at<float>(y, x) - modelled(now, unit, x, y, reference);
            const double share = left / (tukey * now.residual);
            if (std::abs(share) >= 1) continue;
            const double weight = std::pow(1 - share * share, 2) * (level.weight.empty() ? 1.0 : level.weight.at<float>(y, x));
            const double a = unit.x(x), b = unit.y(y);
            Row row;
            row << gx, gx * a, gx * b, gy, gy * a, gy * b, -reference, -reference * a, -reference * b, -1;
            normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
            right -= weight * left * row;
            const Eigen::Vector3d place(1, a, b);
            evidence.by_noise.topLeftCorner<3, 3>() += weight * place * place.transpose();
        }
    // Noise v in both pictures, blurred by a pixel, leaves 2 v and slopes of v / 2.
    evidence.by_noise.topLeftCorner<3, 3>() *= 0.25 * now.residual * now.residual;
    evidence.by_noise.bottomRightCorner<3, 3>() = evidence.by_noise.topLeftCorner<3, 3>();
    evidence.found = Normal(normal.selfadjointView<Eigen::Lower>()).topLeftCorner<motions, motions>();
    if (!moves) {
        normal.topRows<motions>().setZero();
        normal.leftCols<motions>().setZero();
        right.head<motions>().setZero();
    }
    const double hold = now.residual * now.residual / (likely * likely);
    const Row away = between(start, now.map, unit);
    for (int i = 0; i < motions; ++i) {
        normal(i, i) += hold;
        right[i] -= moves ? hold * away[i] : 0;
    }
    for (int i = motions; i < parameters; ++i) normal(i, i) *= 1 + 1e-9;
    normal(parameters - 1, parameters - 1) +=
        1e-6 * normal(motions, motions);  // gain and offset are one in a picture of one gray
    const Row step = normal.selfadjointView<Eigen::Lower>().ldlt().solve(right);
    if (!step.allFinite()) return 0;
    move(now.map, step, unit);
    for (int i = 0; i < 4; ++i) now.light[i] += step[motions + i];
    return step.head<motions>().cwiseAbs().maxCoeff();
}

/// Takes back what the pictures do not show: motions in which their slopes are no more than noise, as along straight rings.
void take_back_unseen(Alignment& now, const cv::Matx23d& start, const Evidence& evidence, const Unit& unit) {
    const Information noise = evidence.by_noise + 1e-9 * evidence.by_noise.trace() * Information::Identity();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Information> parts(evidence.found, noise);
    if (parts.info() != Eigen::Success) return;
    const Motion away = between(start, now.map, unit).head<motions>();
    Row back = Row::Zero();
    for (int i = 0; i < motions; ++i)
        if (const Motion part = parts.eigenvectors().col(i); parts.eigenvalues()[i] < least_seen)
            back.head<motions>() -= part * part.dot(noise * away);  // eigenvectors are of length 1 by the noise
    move(now.map, back, unit);
}

}  // namespace

cv::Point2d Alignment::to_image(const cv::Point2d& p) const {
    const cv::Vec2d q = map * cv::Vec3d(p.x, p.y, 1);
    return {q[0], q[1]};
}

cv::Point2d Alignment::to_reference(const cv::Point2d& q) const {
    cv::Matx23d back;
    cv::invertAffineTransform(map, back);
    const cv::Vec2d p = back * cv::Vec3d(q.x, q.y, 1);
    return {p[0], p[1]};
}

Alignment line_up(const cv::Mat& reference, const cv::Mat& image, const cv::Mat& weight, const Alignment& start, double likely) {
    const double side = std::min(reference.cols, reference.rows);
    const double finest = std::min(1.0, std::sqrt(most_pixels / static_cast<double>(reference.total())));
    Alignment now = start;
    double scale = finest;
    while (scale * side > 2 * coarsest_side) scale *= 0.5;
    for (;; scale = std::min(2 * scale, finest)) {
        const Level level = level_at(reference, image, weight, scale);
        now.map = scaled(now.map, scale);
        const cv::Matx23d held = scaled(start.map, scale);
        Evidence evidence;
        for (int i = 0; i < most_iterations && improve(level, now, held, scale * likely, true, evidence) > settled; ++i) {
        }
        take_back_unseen(now, held, evidence, Unit(level.reference.size()));
        for (int i = 0; i < 3; ++i) improve(level, now, held, scale * likely, false, evidence);
        now.map = scaled(now.map, 1 / scale);
        if (scale >= finest) return now;
    }
}

cv::Mat seen_as_reference(const cv::Mat& image, const Alignment& alignment, cv::Size size) {
    cv::Mat seen;
    cv::warpAffine(image, seen, alignment.map, size, cv::INTER_CUBIC | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
    const Unit unit(size);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            const double gain = alignment.light[0] + alignment.light[1] * unit.x(x) + alignment.light[2] * unit.y(y);
            float& gray = seen.at<float>(y, x);
            gray = static_cast<float>((gray - alignment.light[3]) / std::max(gain, 1e-3));
        }
    return seen;
}

cv::Mat shown_of_reference(cv::Size image, const Alignment& alignment, cv::Size size) {
    cv::Mat shown;
    cv::warpAffine(cv::Mat(image, CV_8U, cv::Scalar(255)), shown, alignment.map, size, cv::INTER_NEAREST | cv::WARP_INVERSE_MAP);
    return shown;
}

}  // namespace crampfit

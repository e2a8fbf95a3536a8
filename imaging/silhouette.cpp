#include "imaging/silhouette.hpp"

#include "imaging/foreign.hpp"

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace crampfit {
namespace {

constexpr double most_noise = 0.03;  // of a ground's pixels, of the picture's brightest: a camera's in poor light
constexpr double ground = 0.3;       // of the picture's brightest, up to which it is dark
constexpr int corner = 12;           // how far it may reach into a notch's root, too narrow to be seen as even [px]
constexpr int edge_blur = 3;         // of a specimen's edge by the lens [px]

}  // namespace

double to_border(const Eigen::Vector2d& from, const Eigen::Vector2d& d, int columns, int rows) {
    double length = std::numeric_limits<double>::infinity();
    if (d.x() != 0) length = std::min(length, ((d.x() > 0 ? columns - 0.5 : -0.5) - from.x()) / d.x());
    if (d.y() != 0) length = std::min(length, ((d.y() > 0 ? rows - 0.5 : -0.5) - from.y()) / d.y());
    return std::max(length, 0.0);
}

Silhouette::Silhouette(const FinePicture& picture) : columns_(picture.columns), rows_(picture.rows) {
    const cv::Mat pixels(rows_, columns_, CV_32F, const_cast<float*>(picture.gray.data()));
    double brightest = 0;
    cv::minMaxLoc(pixels, nullptr, &brightest);
    const cv::Mat gray = pixels / std::max(brightest, 1.0);
    const double noise = std::min(noise_of_black(gray, ground), most_noise);
    cv::Mat blank = find_blank(gray, {}, ground, noise) | find_notches(gray, ground, noise), smooth;
    cv::blur(gray, smooth, {3, 3});
    for (int i = 0; i < corner; ++i) {
        cv::Mat wider;
        cv::dilate(blank, wider, cv::Mat::ones(3, 3, CV_8U));
        blank |= wider & (smooth < ground);
    }
    // Bright wood without any pattern is as even as a bright ground.
    const cv::Mat specimen = (blank == 0) | (pixels > 0.5 * cv::mean(pixels)[0]);
    mask_.assign(specimen.begin<std::uint8_t>(), specimen.end<std::uint8_t>());
}

double Silhouette::to_edge(const Eigen::Vector2d& from, const Eigen::Vector2d& direction) const {
    const double border = to_border(from, direction, columns_, rows_);
    const auto on_specimen = [&](double length) {  // between pixels as those around it are, by more than half
        const Eigen::Vector2d p = from + length * direction;
        const double x = std::clamp(p.x(), 0.0, columns_ - 1.0), y = std::clamp(p.y(), 0.0, rows_ - 1.0);
        const int x0 = std::min(static_cast<int>(x), columns_ - 2), y0 = std::min(static_cast<int>(y), rows_ - 2);
        const auto at = [&](int dx, int dy) { return mask_[static_cast<std::size_t>(y0 + dy) * columns_ + x0 + dx] ? 1.0 : 0.0; };
        return std::lerp(std::lerp(at(0, 0), at(1, 0), x - x0), std::lerp(at(0, 1), at(1, 1), x - x0), y - y0) > 0.5;
    };
    constexpr double step = 0.5;
    double length = 0;
    while (length < border && on_specimen(length)) length += step;
    if (length >= border) return border;
    double inside = std::max(0.0, length - step);
    for (int i = 0; i < 10; ++i) (on_specimen(std::midpoint(inside, length)) ? inside : length) = std::midpoint(inside, length);
    return length;
}

double Silhouette::to_mouth(const Eigen::Vector2d& tip, const Eigen::Vector2d& direction) const {
    constexpr int widest = 15, beside = 6;  // [degrees]
    constexpr double farther = 1.03;        // an even edge is by 1.006, six degrees aside of where it is nearest
    std::vector<double> lengths;
    for (int turn = -widest - beside; turn <= widest + beside; ++turn)
        lengths.push_back(to_edge(tip, Eigen::Rotation2Dd(turn * std::numbers::pi / 180) * direction));
    const auto nearest = std::min_element(lengths.begin() + beside, lengths.end() - beside);
    const bool is_root = std::min(*(nearest - beside), *(nearest + beside)) > farther * *nearest;
    return is_root ? *nearest : lengths[widest + beside];
}

std::vector<bool> Silhouette::subsets_at_edge(const PointLattice& lattice, int subset) const {
    const cv::Mat specimen(rows_, columns_, CV_8U, const_cast<std::uint8_t*>(mask_.data()));
    const int reach = subset + edge_blur;
    cv::Mat whole;
    cv::erode(specimen, whole, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U), {-1, -1}, 1, cv::BORDER_REPLICATE);
    std::vector<bool> at_edge;
    for (int point = 0; point < lattice.count(); ++point)
        at_edge.push_back(whole.at<std::uint8_t>(lattice.y(point), lattice.x(point)) == 0);
    return at_edge;
}

}  // namespace crampfit

#include "imaging/foreign.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr double too_dark = 0.25;  // below LW, of the contrast
constexpr double dark_line = 0.5;   // a crack below its ring, of the contrast
constexpr double light_line = 0.33; // a ray above its ring, of the contrast
constexpr double too_blue = 0.08;  // blue above red: wood is never bluer than white light
constexpr double too_green = 0.04; // green above red and blue

double number(Feature feature) { return static_cast<double>(feature); }

cv::Mat disk(double radius) {
    const int size = 2 * static_cast<int>(std::lround(radius)) + 1;
    return cv::getStructuringElement(cv::MORPH_ELLIPSE, {size, size});
}

/// 255 where hue cannot be wood's.
cv::Mat strange_hue(const cv::Mat& bgr, cv::Size size) {
    if (bgr.empty())
        return cv::Mat::zeros(size, CV_8U);
    cv::Mat smooth;
    cv::GaussianBlur(bgr, smooth, {}, 1.5);
    cv::Mat channel[3];
    cv::split(smooth, channel);
    return ((channel[0] - channel[2]) > too_blue) |
           (((channel[1] - channel[2]) > too_green) & ((channel[1] - channel[0]) > too_green));
}

/// Calls `visit(patch number, figures)` for every connected patch of a mask.
template <class Visit> cv::Mat for_patches(const cv::Mat& mask, const Visit& visit) {
    cv::Mat patches, figures, centres;
    const int count = cv::connectedComponentsWithStats(mask, patches, figures, centres, 8);
    for (int i = 1; i < count; ++i)
        visit(i, figures.ptr<int>(i));
    return patches;
}

bool touches_edge(const int* box, cv::Size size) {
    return box[cv::CC_STAT_LEFT] == 0 || box[cv::CC_STAT_TOP] == 0 ||
           box[cv::CC_STAT_LEFT] + box[cv::CC_STAT_WIDTH] == size.width ||
           box[cv::CC_STAT_TOP] + box[cv::CC_STAT_HEIGHT] == size.height;
}

/// The patches that `wanted(figures)` picks.
template <class Wanted> cv::Mat pick(const cv::Mat& mask, const Wanted& wanted) {
    std::vector<std::uint8_t> chosen{0};
    const cv::Mat patches = for_patches(mask, [&](int, const int* box) { chosen.push_back(wanted(box) ? 255 : 0); });
    cv::Mat picked(mask.size(), CV_8U);
    for (int v = 0; v < mask.rows; ++v)
        for (int u = 0; u < mask.cols; ++u)
            picked.at<std::uint8_t>(v, u) = chosen[patches.at<int>(v, u)];
    return picked;
}

/// At twenty pixels a ring, which is fine enough for an outline and makes the cost one of the picture's size alone.
cv::Mat find_background(const cv::Mat& strange, double ring_width) {
    const double scale = std::min(1.0, 20 / ring_width), width = scale * ring_width;
    cv::Mat wide;
    cv::resize(strange, wide, {}, scale, scale, cv::INTER_AREA);
    wide = wide > 127;
    cv::morphologyEx(wide, wide, cv::MORPH_OPEN, disk(std::max(1.0, 0.12 * width)));
    cv::morphologyEx(wide, wide, cv::MORPH_CLOSE, disk(std::max(1.0, 0.25 * width)));
    const cv::Size size = wide.size();
    cv::Mat background = pick(wide, [&](const int* box) {
        return touches_edge(box, size) && box[cv::CC_STAT_AREA] > width * width;
    });
    if (cv::countNonZero(background) == 0)
        return cv::Mat::zeros(strange.size(), CV_8U);
    const cv::Mat islands =
        pick(background == 0, [&](const int* box) { return box[cv::CC_STAT_AREA] < 6 * width * width; });
    background.setTo(255, islands);
    cv::resize(background, background, strange.size(), 0, 0, cv::INTER_NEAREST);
    cv::dilate(background, background, disk(2));
    return background;
}

}  // namespace

cv::Mat find_foreign(const WoodView& view) {
    const auto& [gray, bgr, around, levels, width] = view;
    const double contrast = levels.contrast(), dark = levels.latewood - too_dark * contrast;
    const cv::Mat hue = strange_hue(bgr, gray.size());
    cv::Mat smooth;
    cv::GaussianBlur(gray, smooth, {}, std::max(1.0, 0.06 * width));
    const cv::Mat background = find_background((smooth < dark) | hue, width);

    cv::GaussianBlur(gray, smooth, {}, 0.7);
    cv::Mat inked;
    cv::dilate(hue | background, inked, disk(3));
    const auto lines = [&](const cv::Mat& mask, double least) {
        return pick(mask & (inked == 0), [&](const int* box) {
            const double length = box[cv::CC_STAT_HEIGHT], thickness = box[cv::CC_STAT_AREA] / length;
            return length > std::max(8.0, least * width) && thickness < 0.25 * length && thickness < 0.2 * width;
        });
    };
    cv::Mat features(gray.size(), CV_8U, cv::Scalar(number(Feature::wood)));
    const cv::Mat patches = ((smooth < dark) | hue) & (background == 0);
    features.setTo(number(Feature::mark), pick(patches, [](const int* box) { return box[cv::CC_STAT_AREA] >= 4; }));
    features.setTo(number(Feature::ray), lines(smooth > around + light_line * contrast, 0.15));
    features.setTo(number(Feature::crack), lines(smooth < around - dark_line * contrast, 0.4));
    features.setTo(number(Feature::background), background);
    return features;
}

cv::Mat countable(const cv::Mat& features) {
    cv::Mat foreign, counts;
    cv::dilate(features != number(Feature::wood), foreign, disk(1));
    cv::Mat(foreign == 0).convertTo(counts, CV_32F, 1.0 / 255);
    return counts;
}

}  // namespace crampfit

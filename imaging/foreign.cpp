#include "imaging/foreign.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {
namespace {

constexpr double too_dark = 0.25;       // below LW, of the contrast
constexpr double dark_line = 0.5;       // a crack below its ring, of the contrast
constexpr double light_line = 0.33;     // a ray above its ring, of the contrast
constexpr double too_blue = 0.08;       // blue above red: wood is never bluer than white light
constexpr double too_green = 0.04;      // green above red and blue
constexpr double blank_white = 0.92;    // of the brightest in the picture, in each colour
constexpr double blank_grain = 0.012;   // largest standard deviation over a few pixels: wood has more
constexpr double least_blank = 0.0005;  // of the picture
constexpr double most_within = 0.25;    // of blank's area, that is as plain elsewhere: more, and wood itself is

double number(Feature feature) { return static_cast<double>(feature); }

cv::Mat disk(double radius) {
    const int size = 2 * static_cast<int>(std::lround(radius)) + 1;
    return cv::getStructuringElement(cv::MORPH_ELLIPSE, {size, size});
}

/// 255 where hue cannot be wood's.
cv::Mat strange_hue(const cv::Mat& bgr, cv::Size size) {
    if (bgr.empty()) return cv::Mat::zeros(size, CV_8U);
    cv::Mat smooth;
    cv::GaussianBlur(bgr, smooth, {}, 1.5);
    cv::Mat channel[3];
    cv::split(smooth, channel);
    return ((channel[0] - channel[2]) > too_blue) |
           (((channel[1] - channel[2]) > too_green) & ((channel[1] - channel[0]) > too_green));
}

/// Calls `visit(patch number, figures)` for every connected patch of a mask.
template <class Visit>
cv::Mat for_patches(const cv::Mat& mask, const Visit& visit) {
    cv::Mat patches, figures, centres;
    const int count = cv::connectedComponentsWithStats(mask, patches, figures, centres, 8);
    for (int i = 1; i < count; ++i) visit(i, figures.ptr<int>(i));
    return patches;
}

bool touches_edge(const int* box, cv::Size size) {
    return box[cv::CC_STAT_LEFT] == 0 || box[cv::CC_STAT_TOP] == 0 ||
           box[cv::CC_STAT_LEFT] + box[cv::CC_STAT_WIDTH] == size.width ||
           box[cv::CC_STAT_TOP] + box[cv::CC_STAT_HEIGHT] == size.height;
}

/// 255 where the number of a patch is chosen.
cv::Mat chosen_patches(const cv::Mat& patches, const std::vector<std::uint8_t>& chosen) {
    cv::Mat picked(patches.size(), CV_8U);
    for (int v = 0; v < patches.rows; ++v)
        for (int u = 0; u < patches.cols; ++u) picked.at<std::uint8_t>(v, u) = chosen[patches.at<int>(v, u)] ? 255 : 0;
    return picked;
}

/// The patches that `wanted(figures)` picks.
template <class Wanted>
cv::Mat pick(const cv::Mat& mask, const Wanted& wanted) {
    std::vector<std::uint8_t> chosen{0};
    const cv::Mat patches = for_patches(mask, [&](int, const int* box) { chosen.push_back(wanted(box)); });
    return chosen_patches(patches, chosen);
}

/// The patches that `wanted(length, area)` picks, length being how far they reach across the rings.
template <class Wanted>
cv::Mat pick_by_length(const cv::Mat& mask, const cv::Mat& coordinate, const Wanted& wanted) {
    std::vector<int> area{0};
    const cv::Mat patches = for_patches(mask, [&](int, const int* box) { area.push_back(box[cv::CC_STAT_AREA]); });
    std::vector<cv::Vec2f> ends(area.size(), {std::numeric_limits<float>::max(), std::numeric_limits<float>::lowest()});
    for (int v = 0; v < mask.rows; ++v)
        for (int u = 0; u < mask.cols; ++u) {
            cv::Vec2f& end = ends[patches.at<int>(v, u)];
            end = {std::min(end[0], coordinate.at<float>(v, u)), std::max(end[1], coordinate.at<float>(v, u))};
        }
    std::vector<std::uint8_t> chosen{0};
    for (std::size_t i = 1; i < area.size(); ++i) chosen.push_back(wanted(1.0 + ends[i][1] - ends[i][0], area[i]));
    return chosen_patches(patches, chosen);
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
    cv::Mat background =
        pick(wide, [&](const int* box) { return touches_edge(box, size) && box[cv::CC_STAT_AREA] > width * width; });
    if (cv::countNonZero(background) == 0) return cv::Mat::zeros(strange.size(), CV_8U);
    const cv::Mat islands = pick(background == 0, [&](const int* box) { return box[cv::CC_STAT_AREA] < 6 * width * width; });
    background.setTo(255, islands);
    cv::resize(background, background, strange.size(), 0, 0, cv::INTER_NEAREST);
    cv::dilate(background, background, disk(2));
    return background;
}

/// The darkest or the brightest colour of each pixel; the gray itself in a gray picture.
cv::Mat extreme_colour(const cv::Mat& gray, const cv::Mat& bgr, bool brightest) {
    if (bgr.empty()) return gray;
    cv::Mat channel[3];
    cv::split(bgr, channel);
    return brightest ? cv::max(channel[0], cv::max(channel[1], channel[2]))
                     : cv::min(channel[0], cv::min(channel[1], channel[2]));
}

}  // namespace

cv::Mat find_blank(const cv::Mat& gray, const cv::Mat& bgr, double black) {
    cv::Mat mean, squares;
    cv::blur(gray, mean, {5, 5});
    cv::blur(gray.mul(gray), squares, {5, 5});
    const cv::Mat even = squares - mean.mul(mean) < blank_grain * blank_grain;
    cv::Mat blank = cv::Mat::zeros(gray.size(), CV_8U);
    for (const bool dark : {true, false}) {
        cv::Mat colour;
        cv::blur(extreme_colour(gray, bgr, dark), colour, {5, 5});
        cv::Mat plain = even & (dark ? cv::Mat(colour < black) : cv::Mat(colour > blank_white));
        cv::morphologyEx(plain, plain, cv::MORPH_OPEN, disk(4));
        const cv::Size size = plain.size();
        const cv::Mat around = pick(plain, [&](const int* box) {
            const bool left = box[cv::CC_STAT_LEFT] <= 4, top = box[cv::CC_STAT_TOP] <= 4;
            const bool right = box[cv::CC_STAT_LEFT] + box[cv::CC_STAT_WIDTH] >= size.width - 4;
            const bool bottom = box[cv::CC_STAT_TOP] + box[cv::CC_STAT_HEIGHT] >= size.height - 4;
            return (left || right) && (top || bottom) && box[cv::CC_STAT_AREA] > least_blank * static_cast<double>(size.area());
        });
        const int area = cv::countNonZero(around);
        if (cv::countNonZero(plain) - area <= most_within * area) blank |= around;
    }
    if (cv::countNonZero(blank) > 0) cv::dilate(blank, blank, disk(4));  // its blurred rim
    return blank;
}

cv::Mat find_foreign(const WoodView& view) {
    const auto& [gray, bgr, around, coordinate, levels, width] = view;
    const double contrast = levels.contrast(), dark = levels.latewood - too_dark * contrast;
    const cv::Mat hue = strange_hue(bgr, gray.size());
    cv::Mat smooth;
    cv::GaussianBlur(gray, smooth, {}, std::max(1.0, 0.06 * width));
    const cv::Mat background = find_background((smooth < dark) | hue, width);

    cv::GaussianBlur(gray, smooth, {}, 0.7);
    cv::Mat inked;
    cv::dilate(hue | background, inked, disk(3));
    const auto lines = [&](const cv::Mat& mask, double least) {
        return pick_by_length(mask & (inked == 0), coordinate, [&](double length, double area) {
            const double thickness = area / length;
            return length > std::max(8.0, least * width) && thickness < 0.25 * length && thickness < 0.2 * width;
        });
    };
    cv::Mat features(gray.size(), CV_8U, cv::Scalar(number(Feature::wood)));
    const cv::Mat patches = ((smooth < dark) | hue) & (background == 0);
    features.setTo(number(Feature::mark), pick(patches, [](const int* box) { return box[cv::CC_STAT_AREA] >= 4; }));
    features.setTo(number(Feature::resin_canal), pick(smooth > around + light_line * contrast, [&](const int* box) {
                       const double length = std::max(box[cv::CC_STAT_WIDTH], box[cv::CC_STAT_HEIGHT]);
                       const double across = std::min(box[cv::CC_STAT_WIDTH], box[cv::CC_STAT_HEIGHT]);
                       return across >= 3 && length < 1.8 * across && length < 0.2 * width &&
                              box[cv::CC_STAT_AREA] > 0.5 * length * across;
                   }));
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

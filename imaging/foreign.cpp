#include "imaging/foreign.hpp"

#include "imaging/quantile.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

namespace crampfit {
namespace {

constexpr double too_dark = 0.25;       // below LW, of the contrast
constexpr double dark_line = 0.5;       // a crack below its ring, of the contrast
constexpr double light_line = 0.33;     // a ray above its ring, of the contrast
constexpr double slender = 0.25;        // thickness of a line, of its length, at most
constexpr double too_blue = 0.08;       // blue above red: wood is never bluer than the light on it
constexpr double too_green = 0.04;      // green above red and blue
constexpr double blank_white = 0.92;    // of the brightest in the picture, in each colour
constexpr double blank_grain = 0.012;   // largest standard deviation over a few pixels: wood has more
constexpr double least_blank = 0.0005;  // of the picture
constexpr double most_within = 0.25;    // of blank's area, that is as plain elsewhere: more, and wood itself is
constexpr double most_noise = 0.03;     // largest standard deviation of a ground's pixels: a camera's in poor light

double number(Feature feature) { return static_cast<double>(feature); }

cv::Mat disk(double radius) {
    const int size = 2 * static_cast<int>(std::lround(radius)) + 1;
    return cv::getStructuringElement(cv::MORPH_ELLIPSE, {size, size});
}

/// The median of `colour` over `other` in the middle of the picture, where the specimen is, without what is black; at least 1.
double cast(const cv::Mat& colour, const cv::Mat& other) {
    std::vector<float> ratios;
    for (int v = colour.rows / 4; v < colour.rows - colour.rows / 4; v += 2)
        for (int u = colour.cols / 4; u < colour.cols - colour.cols / 4; u += 2)
            if (other.at<float>(v, u) > 0.1f) ratios.push_back(colour.at<float>(v, u) / other.at<float>(v, u));
    return std::max(1.0, quantile(std::move(ratios), 0.5));
}

/// 255 where hue cannot be wood's. In white light wood has no more blue than red, and no more green: where most of it has, that
/// is the light's.
cv::Mat strange_hue(const cv::Mat& bgr, cv::Size size) {
    if (bgr.empty()) return cv::Mat::zeros(size, CV_8U);
    cv::Mat smooth;
    cv::GaussianBlur(bgr, smooth, {}, 1.5);
    cv::Mat channel[3];
    cv::split(smooth, channel);
    channel[0] /= cast(channel[0], channel[2]);
    channel[1] /= cast(channel[1], cv::max(channel[0], channel[2]));
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

/// Long dark patches whichever way they run. LW is long and dark, too, but not as much darker than LW is elsewhere. Nothing is
/// smoothed: of a line of three pixels that would leave little.
cv::Mat long_dark(const cv::Mat& gray, const WoodLevels& levels, double ring_width) {
    return pick(gray < levels.darkest - dark_line * levels.contrast(), [&](const int* box) {
        const double length = std::hypot(box[cv::CC_STAT_WIDTH], box[cv::CC_STAT_HEIGHT]);
        return length > std::max(8.0, 0.4 * ring_width) && box[cv::CC_STAT_AREA] < slender * length * length;
    });
}

/// A dark line with the pixels right beside it that are nearer to its gray than to that of the wood there.
cv::Mat with_rim(const cv::Mat& line, const cv::Mat& gray) {
    cv::Mat wide, darkest, brightest;
    cv::dilate(line, wide, disk(1));
    cv::erode(gray, darkest, disk(3));
    cv::dilate(gray, brightest, disk(3));
    return line | (wide & (gray < 0.5 * (darkest + brightest)));
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

/// Patches of `plain` that hold a corner of the picture, or nearly. (An arc of a ring reaches two of its sides, too.)
cv::Mat pick_from_corners(const cv::Mat& plain) {
    constexpr int near = 5;  // pixels
    const auto least = static_cast<int>(least_blank * static_cast<double>(plain.total()));
    std::vector<std::uint8_t> large{0}, chosen;
    const cv::Mat patches = for_patches(plain, [&](int, const int* box) { large.push_back(box[cv::CC_STAT_AREA] > least); });
    chosen.assign(large.size(), 0);
    for (const int x : {0, plain.cols - near})
        for (const int y : {0, plain.rows - near}) {
            const cv::Mat corner = patches(cv::Rect(x, y, near, near));
            for (auto patch = corner.begin<int>(); patch != corner.end<int>(); ++patch)
                chosen[static_cast<std::size_t>(*patch)] = large[static_cast<std::size_t>(*patch)];
        }
    return chosen_patches(patches, chosen);
}

/// Whether gray is another beyond at least this share of a patch's rim; light that fades has no rim.
bool has_rim(const cv::Mat& patch, const cv::Mat& other, double least) {
    cv::Mat near, far;
    cv::dilate(patch, near, disk(6));
    cv::dilate(patch, far, disk(10));
    const cv::Mat beyond = far & (near == 0);
    return cv::countNonZero(beyond & other) > least * cv::countNonZero(beyond);
}

/// The patches that reach in from a corner, if they lie around something: they have a rim, beyond a share of which `other` is,
/// and there is hardly anything as plain within.
cv::Mat around_something(const cv::Mat& plain, const cv::Mat& other, double rim) {
    cv::Mat open;
    cv::morphologyEx(plain, open, cv::MORPH_OPEN, disk(4));
    const cv::Mat around = pick_from_corners(open);
    const int area = cv::countNonZero(around);
    if (area > 0 && cv::countNonZero(open) - area <= most_within * area && has_rim(around, other, rim)) return around;
    return cv::Mat::zeros(plain.size(), CV_8U);
}

/// Gray of an even ground, and the standard deviation of its pixels.
struct Ground {
    double gray = 0, noise = 0;

    /// By which the mean of a few of its pixels may differ: light is never quite even.
    double tolerance() const { return std::max(3 * noise, 0.02); }
    /// Of a few pixels; what rounding to whole grays adds is in it.
    double most_scatter() const { return 2 * noise + 0.008; }
};

/// Of the 25 pixels about each.
cv::Mat local_mean(const cv::Mat& gray) {
    cv::Mat mean;
    cv::blur(gray, mean, {5, 5});
    return mean;
}

cv::Mat local_variance(const cv::Mat& gray) {
    const cv::Mat mean = local_mean(gray);
    return local_mean(gray.mul(gray)) - mean.mul(mean);
}

/// 255 where no grain is seen beyond a camera's noise.
cv::Mat even_ground(const cv::Mat& gray, double noise) {
    constexpr double most_scatter = 1.8;  // of what its most even tenth has: of 25 pixels nearly all have less
    return local_variance(gray) < std::pow(std::max(blank_grain, most_scatter * noise), 2);
}

/// The ground that at least three of a picture's corners show: two may lie in the same ring.
std::optional<Ground> ground_in_corners(const cv::Mat& gray) {
    constexpr int side = 9, least_corners = 3;
    std::vector<Ground> corners;
    for (const int x : {0, gray.cols - side})
        for (const int y : {0, gray.rows - side}) {
            cv::Scalar mean, deviation;
            cv::meanStdDev(gray(cv::Rect(x, y, side, side)), mean, deviation);
            corners.push_back({mean[0], deviation[0]});
        }
    std::ranges::sort(corners, {}, &Ground::noise);
    for (const Ground& one : corners) {
        const auto alike = std::ranges::count_if(corners, [&](const Ground& other) {
            return std::abs(other.gray - one.gray) < one.tolerance() && other.noise < one.most_scatter();
        });
        if (one.noise < most_noise && alike >= least_corners) return one;
    }
    return std::nullopt;
}

}  // namespace

double noise_of_black(const cv::Mat& gray, double black) {
    constexpr double most_even = 0.1;
    const cv::Mat mean = local_mean(gray), variance = local_variance(gray);
    std::vector<float> there;
    for (int v = 2; v < gray.rows - 2; ++v)
        for (int u = 2; u < gray.cols - 2; ++u)
            if (mean.at<float>(v, u) < static_cast<float>(black)) there.push_back(variance.at<float>(v, u));
    return std::sqrt(std::max(0.0, quantile(std::move(there), most_even)));
}

cv::Mat find_blank(const cv::Mat& gray, const cv::Mat& bgr, double black, double noise) {
    constexpr double apart = 0.03;  // beyond the limit of black or white: another gray for sure
    constexpr double rim = 0.1;     // EW may be as white as the ground, LW is not
    const cv::Mat even = even_ground(gray, noise);
    cv::Mat blank = cv::Mat::zeros(gray.size(), CV_8U);
    for (const bool dark : {true, false}) {
        cv::Mat colour;
        cv::blur(extreme_colour(gray, bgr, dark), colour, {5, 5});
        blank |= dark ? around_something(even & (colour < black), colour > black + apart, rim)
                      : around_something(even & (colour > blank_white), colour < blank_white - apart, rim);
    }
    cv::Scalar rest, scatter;
    cv::Mat within;
    cv::dilate(blank, within, disk(8));
    cv::meanStdDev(gray, rest, scatter, within == 0);
    if (scatter[0] < 2 * blank_grain) return cv::Mat::zeros(gray.size(), CV_8U);  // around nothing
    if (cv::countNonZero(blank) > 0) cv::dilate(blank, blank, disk(4));           // its blurred rim
    return blank;
}

cv::Mat find_notches(const cv::Mat& gray, double black, double noise) {
    constexpr double wide = 8, slenderest = 8;  // half the width where it is widest [px]; length over width
    cv::Mat dark = even_ground(gray, noise) & (local_mean(gray) < black), padded, to_rim;
    cv::morphologyEx(dark, dark, cv::MORPH_OPEN, disk(2));
    cv::copyMakeBorder(dark, padded, 1, 1, 1, 1, cv::BORDER_REPLICATE);
    cv::distanceTransform(padded, to_rim, cv::DIST_L2, 5);
    to_rim = to_rim(cv::Rect({1, 1}, dark.size()));
    std::vector<std::uint8_t> chosen{0};
    const cv::Mat patches = for_patches(dark, [&](int, const int* box) { chosen.push_back(touches_edge(box, gray.size())); });
    std::vector<float> half(chosen.size(), 0);
    std::vector<int> area(chosen.size(), 0);
    for (int v = 0; v < gray.rows; ++v)
        for (int u = 0; u < gray.cols; ++u) {
            half[patches.at<int>(v, u)] = std::max(half[patches.at<int>(v, u)], to_rim.at<float>(v, u));
            ++area[patches.at<int>(v, u)];
        }
    int of_notches = 0, elsewhere = 0;
    for (std::size_t i = 1; i < chosen.size(); ++i) {
        chosen[i] = chosen[i] && half[i] > wide && area[i] < slenderest * std::pow(2 * half[i], 2);
        (chosen[i] ? of_notches : elsewhere) += area[i];
    }
    if (of_notches == 0 || elsewhere > most_within * of_notches) return cv::Mat::zeros(gray.size(), CV_8U);
    cv::Mat notches = chosen_patches(patches, chosen);
    cv::dilate(notches, notches, disk(4));  // its blurred rim
    return notches;
}

cv::Mat find_ground(const cv::Mat& gray) {
    constexpr double apart = 0.03;  // beyond the tolerance: another gray for sure
    constexpr double rim = 0.85;    // of EW in falling light, the half that runs along its ring
    cv::Mat none = cv::Mat::zeros(gray.size(), CV_8U);
    const std::optional<Ground> ground = ground_in_corners(gray);
    if (!ground) return none;
    const cv::Mat off = cv::abs(local_mean(gray) - ground->gray);
    const cv::Mat plain = (off < ground->tolerance()) & (local_variance(gray) < std::pow(ground->most_scatter(), 2));
    cv::Mat around = around_something(plain, off > ground->tolerance() + apart, rim);
    // Over a larger stretch noise is gone, and what is left of wood is its mottle and the light on it.
    cv::Mat inside, mean;
    cv::erode(around, inside, disk(8));
    cv::Scalar middle, drift;
    cv::blur(gray, mean, {15, 15});
    cv::meanStdDev(mean, middle, drift, inside);
    if (drift[0] > std::max(ground->noise, 0.5 * ground->tolerance())) return none;
    cv::dilate(around, around, disk(4));  // its blurred rim
    return around;
}

cv::Mat find_foreign(const WoodView& view) {
    const auto& [gray, bgr, around, coordinate, levels, width] = view;
    const double contrast = levels.contrast(), dark = levels.darkest - too_dark * contrast;
    const cv::Mat hue = strange_hue(bgr, gray.size());
    cv::Mat smooth;
    cv::GaussianBlur(gray, smooth, {}, std::max(1.0, 0.06 * width));
    const cv::Mat background = find_background((smooth < dark) | hue, width);

    cv::GaussianBlur(gray, smooth, {}, 0.7);
    cv::Mat inked;
    cv::dilate(hue | background, inked, disk(3));
    const auto lines = [&](const cv::Mat& mask, double least, double thickest) {
        return pick_by_length(mask & (inked == 0), coordinate, [&](double length, double area) {
            const double thickness = area / length;
            return length > std::max(8.0, least * width) && thickness < slender * length && thickness < thickest * width;
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
    features.setTo(number(Feature::ray), lines(smooth > around + light_line * contrast, 0.15, 0.2));
    // A broad crack darkens the gray around, too: what is too dark for wood need not be darker than that.
    const cv::Mat cracks = lines(smooth < around - dark_line * contrast, 0.4, 0.2) |
                           lines(patches, 0.4, std::numeric_limits<double>::infinity()) |
                           (long_dark(gray, levels, width) & (inked == 0));
    features.setTo(number(Feature::crack), with_rim(cracks, smooth));
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

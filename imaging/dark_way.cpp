#include "imaging/dark_way.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>

namespace crampfit {
namespace {

constexpr int tolerance = 3;                 // of motion that the alignment does not follow [px]
constexpr double least_dark = 4;             // of a crack's pixels, in standard deviations of what is left elsewhere
constexpr double least_share = 0.04;         // of them, of the reference's mean gray
constexpr double least_seed = 2;             // of a crack's darkest pixel, in the least of its pixels
constexpr double stands_out = 3;             // of a crack, against the strongest line that brightens
constexpr double least_length = 12;          // of a crack [px]
constexpr double least_slender = 4;          // length over width
constexpr double longest_gap = 30;           // in a line that is broken [px]
constexpr double least_cosine = 0.8;         // of the turn that it may make there
constexpr int heading = 25;                  // of a line's last stretch, that says how it goes on [px]
constexpr double at_border = 2 * tolerance;  // from here to the border a line is taken to go on [px]

cv::Mat disk(int radius) { return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}); }

double robust_deviation(const cv::Mat& values, const cv::Mat& counts) {
    std::vector<float> sizes;
    const int every = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(values.total()) / 1e5)));
    for (int y = 0; y < values.rows; y += every)
        for (int x = 0; x < values.cols; x += every)
            if (counts.at<std::uint8_t>(y, x)) sizes.push_back(std::abs(values.at<float>(y, x)));
    if (sizes.empty()) return 0;
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::ranges::nth_element(sizes, middle);
    return 1.4826 * static_cast<double>(*middle);
}

/// Patches of what stands out by more than `least`.
struct Patches {
    cv::Mat numbers;            // of the patch that each pixel lies in, 0 for none
    std::vector<double> score;  // sum of what is above `least` [gray px^2]; 0 for a patch that nowhere stands out clearly
    int strongest = 0;          // 0: none
};

Patches find_patches(const cv::Mat& excess, double least) {
    cv::Mat mask = excess > least;
    cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, disk(2));
    Patches patches;
    const int count = cv::connectedComponents(mask, patches.numbers, 8);
    patches.score.assign(count, 0);
    std::vector<double> peak(count, 0);
    for (int y = 0; y < excess.rows; ++y)
        for (int x = 0; x < excess.cols; ++x)
            if (const int patch = patches.numbers.at<int>(y, x); patch > 0) {
                const double here = excess.at<float>(y, x);
                patches.score[patch] += std::max(0.0, here - least);
                peak[patch] = std::max(peak[patch], here);
            }
    patches.score[0] = 0;
    for (int i = 1; i < count; ++i) {
        if (peak[i] <= least_seed * least) patches.score[i] = 0;
        if (patches.score[i] > patches.score[patches.strongest]) patches.strongest = i;
    }
    return patches;
}

/// What is darker, and what is brighter, than all of the reference that counts within some pixels.
struct Contrast {
    Patches dark, bright;
    bool is_crack() const { return dark.score[dark.strongest] > stands_out * bright.score[bright.strongest]; }
};

Contrast compare(const cv::Mat& before, const cv::Mat& now, const cv::Mat& counts, const cv::Mat& inner, double least,
                 int within) {
    cv::Mat lowest = before.clone(), highest = before.clone();
    lowest.setTo(std::numeric_limits<float>::max(), counts == 0);  // a dark margin must not hide a crack that runs into it
    highest.setTo(std::numeric_limits<float>::lowest(), counts == 0);
    cv::erode(lowest, lowest, disk(within));
    cv::dilate(highest, highest, disk(within));
    cv::Mat darker = lowest - now, brighter = now - highest;
    darker.setTo(0, inner == 0);
    brighter.setTo(0, inner == 0);
    return {find_patches(darker, least), find_patches(brighter, least)};
}

/// Shortest ways from one pixel of a patch to all others; steps near the patch's rim are dear, so that ways keep to its middle.
class Ways {
  public:
    Ways(const cv::Mat& mask, const cv::Mat& to_rim, cv::Point from)
        : cost_(mask.size(), CV_64F, cv::Scalar(std::numeric_limits<double>::infinity())),
          came_(mask.size(), CV_8S, cv::Scalar(-1)) {
        using Item = std::pair<double, std::pair<int, int>>;
        std::priority_queue<Item, std::vector<Item>, std::greater<>> open;
        cost_.at<double>(from) = 0;
        open.push({0, {from.y, from.x}});
        while (!open.empty()) {
            const auto [cost, place] = open.top();
            open.pop();
            const cv::Point here(place.second, place.first);
            if (cost > cost_.at<double>(here)) continue;
            for (int i = 0; i < 8; ++i) {
                const cv::Point next = here + steps[i];
                if (!cv::Rect({0, 0}, mask.size()).contains(next) || !mask.at<std::uint8_t>(next)) continue;
                const double then = cost + (i < 4 ? 1 : std::sqrt(2.0)) * (1 + 2 / to_rim.at<float>(next));
                if (then < cost_.at<double>(next)) {
                    cost_.at<double>(next) = then;
                    came_.at<schar>(next) = static_cast<schar>(i);
                    open.push({then, {next.y, next.x}});
                }
            }
        }
    }

    cv::Point farthest() const {
        cv::Point best;
        double most = -1;
        for (int y = 0; y < cost_.rows; ++y)
            for (int x = 0; x < cost_.cols; ++x)
                if (const double cost = cost_.at<double>(y, x); std::isfinite(cost) && cost > most) {
                    most = cost;
                    best = {x, y};
                }
        return best;
    }

    std::vector<cv::Point> way_to(cv::Point to) const {
        std::vector<cv::Point> way{to};
        for (int step = came_.at<schar>(to); step >= 0; step = came_.at<schar>(way.back()))
            way.push_back(way.back() - steps[static_cast<std::size_t>(step)]);
        std::ranges::reverse(way);
        return way;
    }

  private:
    inline static const std::array<cv::Point, 8> steps{cv::Point{1, 0}, {-1, 0}, {0, 1},  {0, -1},
                                                       {1, 1},          {1, -1}, {-1, 1}, {-1, -1}};
    cv::Mat cost_, came_;
};

/// What the line lies in.
struct Ground {
    cv::Mat gray;  // of the reference
    cv::Mat room;  // of each pixel to what does not count: the picture's border, a margin around the specimen, a mask [px]

    double to_border(const cv::Point2d& p) const {
        const int x = static_cast<int>(std::lround(p.x)), y = static_cast<int>(std::lround(p.y));
        return cv::Rect({0, 0}, room.size()).contains({x, y}) ? room.at<float>(y, x) : 0;
    }
};

Ground ground_of(const cv::Mat& gray, const cv::Mat& counts) {
    cv::Mat padded, room;
    cv::copyMakeBorder(counts, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    cv::distanceTransform(padded, room, cv::DIST_L2, 5);
    return {gray, room(cv::Rect({1, 1}, counts.size()))};
}

/// Means over `reach` points to either side, fewer near the ends.
std::vector<cv::Point2d> smoothed(const std::vector<cv::Point2d>& way, int reach) {
    std::vector<cv::Point2d> smooth;
    const int count = static_cast<int>(way.size());
    for (int i = 0; i < count; ++i) {
        const int side = std::min({reach, i, count - 1 - i});
        cv::Point2d sum(0, 0);
        for (int j = i - side; j <= i + side; ++j) sum += way[static_cast<std::size_t>(j)];
        smooth.push_back(sum / (2.0 * side + 1));
    }
    return smooth;
}

double mean_of(const std::vector<double>& values, std::size_t from, std::size_t to) {
    double sum = 0;
    for (std::size_t i = from; i < to; ++i) sum += values[i];
    return sum / static_cast<double>(to - from);
}

/// Where the set is widest at the border; outside for a set that does not come near it. `corner` is the set's in the picture.
cv::Point mouth_at_border(const cv::Mat& to_rim, const cv::Point& corner, const Ground& ground) {
    cv::Point mouth(-1, -1);
    float widest = 0;
    for (int y = 0; y < to_rim.rows; ++y)
        for (int x = 0; x < to_rim.cols; ++x)
            if (to_rim.at<float>(y, x) > widest && ground.to_border(cv::Point(x, y) + corner) <= at_border) {
                widest = to_rim.at<float>(y, x);
                mouth = {x, y};
            }
    return mouth;
}

/// Which end of a line that lies inside the picture is its mouth: where the reference goes on dark, as a notch or an older crack
/// does; else the end that is clearly wider; else the one nearer to the border.
bool back_is_mouth(const DarkWay& way, const cv::Mat& gray, bool back_is_nearer) {
    const auto beyond = [&](bool back) {
        const cv::Point2d end = back ? way.points.back() : way.points.front(), d = direction_at(way.points, back, heading);
        double darkest = INFINITY;
        for (int i = 2; i <= 12; ++i)
            if (const cv::Point at = end + i * d; cv::Rect({0, 0}, gray.size()).contains(at))
                darkest = std::min<double>(darkest, gray.at<float>(at));
        return darkest;
    };
    const double front = beyond(false), back = beyond(true);
    if (std::min(front, back) < 0.6 * std::max(front, back)) return back < front;
    const std::size_t count = way.points.size(), part = std::max<std::size_t>(1, count / 4);
    const double wide_front = mean_of(way.half_width, 0, part), wide_back = mean_of(way.half_width, count - part, count);
    if (std::min(wide_front, wide_back) < 0.8 * std::max(wide_front, wide_back)) return wide_back > wide_front;
    return back_is_nearer;
}

/// The middle of what is set from one of its ends to the other, the mouth first.
DarkWay middle_of(const cv::Mat& set, const Ground& ground) {
    const cv::Rect box = cv::boundingRect(set);
    const cv::Mat mask = set(box);
    cv::Mat padded, to_rim;
    cv::copyMakeBorder(mask, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    cv::distanceTransform(padded, to_rim, cv::DIST_L2, 3);
    to_rim = to_rim(cv::Rect(1, 1, box.width, box.height));
    const cv::Point mouth = mouth_at_border(to_rim, box.tl(), ground);
    cv::Point deepest;
    cv::minMaxLoc(to_rim, nullptr, nullptr, nullptr, &deepest, mask);
    const Ways ways(mask, to_rim, mouth.x >= 0 ? mouth : Ways(mask, to_rim, deepest).farthest());
    DarkWay way;
    for (const cv::Point& p : ways.way_to(ways.farthest())) {
        way.points.emplace_back(p.x + box.x, p.y + box.y);
        way.half_width.push_back(to_rim.at<float>(p));
    }
    const double front = ground.to_border(way.points.front()), back = ground.to_border(way.points.back());
    way.ends_inside = std::max(front, back) > at_border;
    if (mouth.x < 0 && back_is_mouth(way, ground.gray, back < front)) {
        std::ranges::reverse(way.points);
        std::ranges::reverse(way.half_width);
    }
    way.points = smoothed(way.points, 6);
    return way;
}

/// The nearest pixel of another patch that a line goes on to from one of its ends; the place itself where there is none. Patches
/// in `taken` are the line's own.
std::pair<cv::Point, int> next_patch(const Patches& patches, const std::vector<char>& taken, const cv::Point2d& end,
                                     const cv::Point2d& onward) {
    std::pair<cv::Point, int> best{cv::Point(end), 0};
    double nearest = longest_gap;
    const int reach = static_cast<int>(longest_gap), x0 = static_cast<int>(end.x), y0 = static_cast<int>(end.y);
    for (int y = std::max(0, y0 - reach); y <= std::min(patches.numbers.rows - 1, y0 + reach); ++y)
        for (int x = std::max(0, x0 - reach); x <= std::min(patches.numbers.cols - 1, x0 + reach); ++x) {
            const int patch = patches.numbers.at<int>(y, x);
            if (patch == 0 || taken[patch] || patches.score[patch] == 0) continue;
            const cv::Point2d offset = cv::Point2d(x, y) - end;
            const double distance = cv::norm(offset);
            if (distance < nearest && offset.dot(onward) > least_cosine * distance) {
                nearest = distance;
                best = {{x, y}, patch};
            }
        }
    return best;
}

/// The strongest patch, and those that go on from its ends: where a crack passes through dark wood its line may be broken.
cv::Mat join_patches(const Patches& patches, const Ground& ground) {
    std::vector<char> taken(patches.score.size(), 0);
    taken[patches.strongest] = 1;
    cv::Mat joined = patches.numbers == patches.strongest;
    for (bool grown = true; grown;) {
        grown = false;
        const DarkWay way = middle_of(joined, ground);
        for (const bool back : {false, true}) {
            const cv::Point2d end = back ? way.points.back() : way.points.front();
            const auto [place, patch] = next_patch(patches, taken, end, direction_at(way.points, back, heading));
            if (patch == 0) continue;
            taken[patch] = 1;
            joined |= patches.numbers == patch;
            cv::line(joined, end, place, cv::Scalar(255), 2);
            grown = true;
        }
    }
    return joined;
}

/// The middle of the strongest line that has darkened, where it is long and slender.
std::optional<DarkWay> line_in(const Contrast& contrast, const Ground& ground) {
    if (contrast.dark.strongest == 0) return std::nullopt;
    const cv::Mat joined = join_patches(contrast.dark, ground);
    const DarkWay way = middle_of(joined, ground);
    const double length = static_cast<double>(way.points.size()), width = cv::countNonZero(joined) / length;
    if (length < std::max(least_length, least_slender * width)) return std::nullopt;
    return way;
}

}  // namespace

cv::Point2d direction_at(const std::vector<cv::Point2d>& line, bool back, int reach) {
    const std::size_t far = std::min(line.size() - 1, static_cast<std::size_t>(reach));
    const cv::Point2d d = back ? line.back() - line[line.size() - 1 - far] : line.front() - line[far];
    return d / std::max(cv::norm(d), 1e-9);
}

std::optional<DarkWay> find_dark_way(const cv::Mat& reference, const cv::Mat& seen, const cv::Mat& counts) {
    cv::Mat before, now, inner;
    cv::GaussianBlur(reference, before, {}, 1.0);
    cv::GaussianBlur(seen, now, {}, 1.0);
    cv::erode(counts, inner, disk(tolerance));
    const double least = std::max(least_dark * robust_deviation(now - before, inner), least_share * cv::mean(before, inner)[0]);
    const Ground ground = ground_of(before, counts);
    const Contrast contrast = compare(before, now, counts, inner, least, tolerance);
    const std::optional<DarkWay> way = line_in(contrast, ground);
    if (!way) return std::nullopt;
    // The wood beside a wide crack has moved by half its width, and where rings run along it that darkens and brightens as well.
    // Where the specimen has come apart all of it has moved, and only what is darker than all wood that may lie there now is the
    // crack.
    const int opened = static_cast<int>(std::ceil(*std::ranges::max_element(way->half_width)));
    const bool apart = opened > tolerance && !way->ends_inside;
    if (!apart && contrast.is_crack()) return way;
    const Contrast farther = compare(before, now, counts, inner, least, tolerance + opened);
    if (apart && farther.is_crack())
        if (const std::optional<DarkWay> clear = line_in(farther, ground)) return clear;
    return contrast.is_crack() || farther.is_crack() ? way : std::nullopt;
}

}  // namespace crampfit

#include "imaging/wood_classes.hpp"

#include "imaging/quantile.hpp"
#include "imaging/ring_profile.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace crampfit {
namespace {

constexpr std::size_t least_pixels = 20;  // of a stretch of ring that tells its levels
constexpr double dark_share = 0.03;       // of a ring, that is no brighter than its dark wood
constexpr double bright_share = 0.90;     // of a ring, that is no brighter than its bright wood
constexpr double mixed = 1.5;             // pixels on either side of a border that show some of the other side

/// Fills what is missing from the rows before and behind it, straight in between.
void fill_across(cv::Mat& gray, const cv::Mat& missing) {
    const auto gap = [&](int v, int u) { return missing.at<std::uint8_t>(v, u) != 0; };
    for (int u = 0; u < gray.cols; ++u)
        for (int v = 0; v < gray.rows; ++v) {
            if (!gap(v, u)) continue;
            int end = v;
            while (end < gray.rows && gap(end, u)) ++end;
            const float before = v > 0 ? gray.at<float>(v - 1, u) : end < gray.rows ? gray.at<float>(end, u) : 0;
            const float behind = end < gray.rows ? gray.at<float>(end, u) : before;
            for (int i = v; i < end; ++i)
                gray.at<float>(i, u) = std::lerp(before, behind, static_cast<float>(i - v + 1) / static_cast<float>(end - v + 1));
            v = end;
        }
}

/// Gray along the rings, each gap filled from a wider and wider stretch of its ring, and what is left, as where a crack runs
/// along a ring, from the wood on both sides of it.
cv::Mat smooth_wood(const StraightWood& wood, const RingCoordinate& rings, double ring_width) {
    constexpr double nothing = 1e-3;  // of the stretch: a narrow picture shows little of a long one
    cv::Mat smooth, missing, unknown;
    for (const double along : {2.0, std::max(8.0, 0.5 * ring_width), std::max(32.0, 2 * ring_width)}) {
        const StraightPicture straight = wood.blurred_along(along);
        if (smooth.empty()) smooth = straight.gray;
        else straight.gray.copyTo(smooth, missing);
        // A place whose neighbours along the ring hardly count is still to be filled.
        missing = straight.known < 0.3;
        unknown = straight.known < nothing;
        if (cv::countNonZero(missing) == 0) break;
    }
    fill_across(smooth, unknown);
    return rings.bend(smooth);
}

/// Levels of one ring at some columns, a stretch of ring apart.
class RingLevels {
  public:
    /// The ring between border `ring` - 1 and border `ring`.
    RingLevels(const cv::Mat& pixels, const cv::Mat& smooth, const cv::Mat& valid, const std::vector<BorderLine>& borders,
               const BorderEdges& edges, std::size_t ring, int stretch) {
        const BorderLine &inner = borders[ring - 1], &outer = borders[ring];
        const int from = std::max(inner.first, outer.first), to = std::min(inner.end(), outer.end());
        const int count = std::max(1, (to - from) / stretch), step = std::max(1, stretch / 50);  // enough of broad rings
        std::vector<RingProfile> profiles;
        BorderGrays at_inner, at_outer;  // sums over the stretches
        const double width = mean_distance(inner, outer);
        int edges_seen = 0;
        for (int k = 0; k < count; ++k) {
            const int begin = from + (to - from) * k / count, end = from + (to - from) * (k + 1) / count;
            RingProfile profile(width);
            std::vector<float> grays;
            for (int u = begin; u < end; u += step) {
                if (!inner.covers(u) || !outer.covers(u)) continue;
                const double here = outer.at(u) - inner.at(u);
                for (int v = static_cast<int>(inner.at(u)) + 1; v <= static_cast<int>(outer.at(u)); ++v) {
                    if (valid.at<float>(v, u) == 0) continue;
                    profile.add((v - inner.at(u)) / here, pixels.at<float>(v, u));
                    grays.push_back(smooth.at<float>(v, u));
                }
            }
            if (grays.size() < least_pixels) continue;
            columns_.push_back(0.5 * (begin + end - 1));
            ranges_.push_back({quantile(grays, bright_share), quantile(grays, dark_share)});
            const int middle = (begin + end) / 2;
            if (const auto one = edges.at(ring - 1, middle), other = edges.at(ring, middle); one && other) {
                at_inner += *one;
                at_outer += *other;
                ++edges_seen;
            }
            profiles.push_back(std::move(profile));
        }
        if (profiles.empty()) return;
        RingProfile all(width);
        for (const RingProfile& profile : profiles) all.add(profile);
        SharpProfile sharp = all.seen();
        if (edges_seen > 0) {
            sharp = all.sharpened(edges.blur(), at_inner / edges_seen, at_outer / edges_seen);
            latewood_fraction_ = sharp.latewood_fraction;
        }
        for (const RingProfile& profile : profiles) {
            const auto [first, second] = all.line_to(profile);
            levels_.push_back({first + second * sharp.earlywood, first + second * sharp.latewood});
        }
    }

    bool empty() const { return levels_.empty(); }
    /// Of the wood as it is without the picture's blur, where that is known.
    const std::optional<double>& latewood_fraction() const { return latewood_fraction_; }
    /// What most of the wood's grays lie between, noise and all.
    const std::vector<WoodLevels>& ranges() const { return ranges_; }

    WoodLevels at(int u) const {
        const auto after = std::lower_bound(columns_.begin(), columns_.end(), u);
        if (after == columns_.begin()) return levels_.front();
        if (after == columns_.end()) return levels_.back();
        const std::size_t i = static_cast<std::size_t>(after - columns_.begin());
        const double a = (u - columns_[i - 1]) / (columns_[i] - columns_[i - 1]);
        return {(1 - a) * levels_[i - 1].earlywood + a * levels_[i].earlywood,
                (1 - a) * levels_[i - 1].latewood + a * levels_[i].latewood};
    }

    /// A stretch without its own LW or EW (a gap, a wedging ring) takes the picture's.
    void mend(const WoodLevels& typical) {
        for (WoodLevels& level : levels_)
            if (level.contrast() < 0.3 * typical.contrast()) level = typical;
    }

  private:
    std::vector<double> columns_;
    std::vector<WoodLevels> levels_, ranges_;
    std::optional<double> latewood_fraction_;
};

WoodLevels usual_range(const std::vector<RingLevels>& rings) {
    std::vector<float> early, late;
    for (const RingLevels& ring : rings)
        for (const WoodLevels& level : ring.ranges()) {
            early.push_back(static_cast<float>(level.earlywood));
            late.push_back(static_cast<float>(level.latewood));
        }
    // Rings differ in how dark their LW is. What one alone shows may be a crack.
    const double darkest = std::clamp(1.5 / static_cast<double>(rings.size()), 0.1, 0.5);
    return {quantile(early, 0.5), quantile(late, 0.5), quantile(late, darkest)};
}

/// Otsu's thresholds: those that make the variance between the classes largest. Values count from `low` to `high`.
std::vector<double> otsu(const cv::Mat& values, const cv::Mat& counts, int classes, double low, double high) {
    constexpr int bins = 256;
    std::array<double, bins + 1> mass{}, moment{};  // of all bins before
    for (int v = 0; v < values.rows; ++v)
        for (int u = 0; u < values.cols; ++u)
            if (counts.at<float>(v, u) > 0) {
                const double share = (values.at<float>(v, u) - low) / (high - low);
                ++mass[1 + static_cast<int>(std::clamp(share * bins, 0.0, bins - 1.0))];
            }
    for (int i = 0; i < bins; ++i) moment[i + 1] = moment[i] + mass[i + 1] * i;
    for (int i = 0; i < bins; ++i) mass[i + 1] += mass[i];
    const auto between = [&](int from, int to) {
        const double n = mass[to] - mass[from], m = moment[to] - moment[from];
        return n > 0 ? m * m / n : 0.0;
    };
    double best = -1;
    std::pair<int, int> cuts;
    for (int a = 1; a < bins; ++a)
        for (int b = classes == 3 ? a + 1 : bins; b <= (classes == 3 ? bins - 1 : bins); ++b) {
            const double sum = between(0, a) + between(a, b) + between(b, bins);
            if (sum > best) {
                best = sum;
                cuts = {a, b};
            }
        }
    std::vector<double> thresholds{low + (high - low) * cuts.first / bins};
    if (classes == 3) thresholds.push_back(low + (high - low) * cuts.second / bins);
    return thresholds;
}

WoodLevels otsu_levels(const cv::Mat& gray, const cv::Mat& valid) {
    double low = 0, high = 1;
    cv::minMaxLoc(gray, &low, &high, nullptr, nullptr, valid > 0);
    const double cut = otsu(gray, valid, 2, low, high + 1e-6).front();
    return {cv::mean(gray, (gray >= cut) & (valid > 0))[0], cv::mean(gray, (gray < cut) & (valid > 0))[0]};
}

/// Gives patches of `label` equal to `one` that are smaller than `least` pixels to the class `other`.
void remove_specks(cv::Mat& label, int one, int other, double least) {
    cv::Mat patches, figures, centres;
    const int count = cv::connectedComponentsWithStats(label == one, patches, figures, centres, 8);
    std::vector<char> small(count, 0);
    for (int i = 1; i < count; ++i) small[i] = figures.at<int>(i, cv::CC_STAT_AREA) < least;
    for (int v = 0; v < label.rows; ++v)
        for (int u = 0; u < label.cols; ++u)
            if (small[patches.at<int>(v, u)]) label.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(other);
}

/// Blur and noise move the place where a ring's degree passes one half, and less on its steep side than on the other. So half is
/// set to the degree beyond which as much of the ring lies as is LW in its profile.
/// `own` is the number of each ring's levels, -1 of one that is not whole; `nearest` of those that it takes.
void set_half(cv::Mat& degree, const cv::Mat& numbers, const cv::Mat& valid, const std::vector<BorderLine>& borders,
              const std::vector<RingLevels>& whole, const std::vector<int>& own, const std::vector<int>& nearest) {
    constexpr double most = 0.15;  // that half moves: of two plateaus nothing lies in between
    std::vector<std::vector<float>> degrees(whole.size());
    const auto ring_at = [&](int v, int u) { return static_cast<std::size_t>(numbers.at<int>(v, u)); };
    for (int v = 0; v < degree.rows; ++v)
        for (int u = 0; u < degree.cols; ++u)
            if (const std::size_t ring = ring_at(v, u);
                own[ring] >= 0 && valid.at<float>(v, u) > 0 && borders[ring - 1].covers(u) && borders[ring].covers(u))
                degrees[static_cast<std::size_t>(own[ring])].push_back(degree.at<float>(v, u));
    std::vector<float> half(whole.size(), 0.5f);
    for (std::size_t i = 0; i < whole.size(); ++i)
        if (const auto& late = whole[i].latewood_fraction())
            half[i] = static_cast<float>(std::clamp(quantile(degrees[i], 1 - *late), 0.5 - most, 0.5 + most));
    for (int v = 0; v < degree.rows; ++v)
        for (int u = 0; u < degree.cols; ++u)
            if (const int ring = nearest[ring_at(v, u)]; ring >= 0) {
                float& here = degree.at<float>(v, u);
                const float seen = half[static_cast<std::size_t>(ring)];
                here = here < seen ? 0.5f * here / seen : 0.5f + 0.5f * (here - seen) / (1 - seen);
            }
}

}  // namespace

cv::Mat ring_numbers(const std::vector<BorderLine>& borders, cv::Size frame) {
    cv::Mat numbers(frame, CV_32S);
    std::vector<int> next(frame.width, 0);     // row of each column that no border before has passed
    std::vector<int> outside(frame.width, 0);  // number of what lies there
    for (std::size_t i = 0; i < borders.size(); ++i)
        for (int u = std::max(0, borders[i].first); u < std::min(frame.width, borders[i].end()); ++u) {
            for (int& v = next[u]; v < frame.height && v <= borders[i].at(u); ++v) numbers.at<int>(v, u) = static_cast<int>(i);
            outside[u] = static_cast<int>(i) + 1;
        }
    for (int u = 0; u < frame.width; ++u)
        for (int v = next[u]; v < frame.height; ++v) numbers.at<int>(v, u) = outside[u];
    return numbers;
}

cv::Mat density_degree(const StraightWood& wood, const cv::Mat& pixels, const cv::Mat& valid, const RingCoordinate& rings,
                       const std::vector<BorderLine>& borders, const BorderEdges& edges, double ring_width, WoodLevels& range) {
    const cv::Mat smooth = smooth_wood(wood, rings, ring_width);
    std::vector<RingLevels> whole;  // rings that lie between two borders
    std::vector<int> nearest_whole(borders.size() + 1, -1);
    for (std::size_t i = 1; i < borders.size(); ++i) {
        RingLevels ring(pixels, smooth, valid, borders, edges, i, std::max(40, static_cast<int>(ring_width)));
        if (!ring.empty()) {
            nearest_whole[i] = static_cast<int>(whole.size());
            whole.push_back(std::move(ring));
        }
    }
    range = whole.empty() ? otsu_levels(smooth, valid) : usual_range(whole);
    for (RingLevels& ring : whole) ring.mend(range);
    const std::vector<int> own = nearest_whole;
    for (std::size_t i = 1; i < nearest_whole.size(); ++i)
        if (nearest_whole[i] < 0) nearest_whole[i] = nearest_whole[i - 1];
    for (std::size_t i = nearest_whole.size() - 1; i-- > 0;)
        if (nearest_whole[i] < 0) nearest_whole[i] = nearest_whole[i + 1];

    const cv::Mat numbers = ring_numbers(borders, valid.size());
    cv::Mat degree(valid.size(), CV_32F);
    const auto distance = [&](std::size_t border, int u, int v) {
        return border < borders.size() && borders[border].covers(u) ? v - borders[border].at(u)
                                                                    : std::numeric_limits<double>::infinity();
    };
    cv::parallel_for_({0, valid.rows}, [&](const cv::Range& rows) {
        for (int v = rows.start; v < rows.end; ++v)
            for (int u = 0; u < valid.cols; ++u) {
                const auto ring = static_cast<std::size_t>(numbers.at<int>(v, u));
                float gray = smooth.at<float>(v, u);
                if (distance(ring, u, v) > -mixed && distance(ring, u, v) <= 0)
                    for (int i = std::max(0, v - 2); i < v; ++i) gray = std::min(gray, smooth.at<float>(i, u));
                else if (ring > 0 && distance(ring - 1, u, v) < mixed)
                    for (int i = std::min(valid.rows - 1, v + 2); i > v; --i) gray = std::max(gray, smooth.at<float>(i, u));
                const WoodLevels here = nearest_whole[ring] < 0 ? range : whole[nearest_whole[ring]].at(u);
                degree.at<float>(v, u) = static_cast<float>((here.earlywood - gray) / std::max(here.contrast(), 1e-6));
            }
    });
    set_half(degree, numbers, valid, borders, whole, own, nearest_whole);
    return degree;
}

cv::Mat classify(const cv::Mat& degree, int classes, double ring_width) {
    std::vector<double> thresholds{0.5};
    if (classes == 3) thresholds = otsu(degree, cv::Mat::ones(degree.size(), CV_32F), 3, -0.25, 1.25);
    cv::Mat label = cv::Mat::zeros(degree.size(), CV_8U);
    for (std::size_t i = 0; i < thresholds.size(); ++i) label.setTo(static_cast<double>(i + 1), degree >= thresholds[i]);
    cv::medianBlur(label, label, 3);
    const double least = std::max(9.0, 0.02 * ring_width * ring_width);
    for (int one = 0; one < classes; ++one) remove_specks(label, one, one > 0 ? one - 1 : 1, least);
    return label;
}

}  // namespace crampfit

#include "imaging/ring_figures.hpp"

#include "datasets/error.hpp"
#include "imaging/quantile.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr int vertex_spacing = 5;  // columns

/// How steep both borders of a ring are on average about a column; of one border, its slope.
double slope(const BorderLine& inner, const BorderLine& outer, int u, int reach) {
    const auto both_cover = [&](int k) { return inner.covers(k) && outer.covers(k); };
    int a = u, b = u;
    while (a > u - reach && both_cover(a - 1)) --a;
    while (b < u + reach && both_cover(b + 1)) ++b;
    return b > a ? 0.5 * (inner.at(b) - inner.at(a) + outer.at(b) - outer.at(a)) / (b - a) : 0;
}

/// Mean over the columns that both borders cover; 0 for none.
double mean_width(const BorderLine& inner, const BorderLine& outer) {
    double sum = 0;
    int columns = 0;
    for (int u = std::max(inner.first, outer.first); u < std::min(inner.end(), outer.end()); ++u) {
        if (!inner.covers(u) || !outer.covers(u)) continue;
        const double along_growth = outer.at(u) - inner.at(u);
        sum += along_growth / std::hypot(1, slope(inner, outer, u, std::max(2, static_cast<int>(along_growth / 2))));
        ++columns;
    }
    return sum / std::max(columns, 1);
}

/// What a straight line outward from a ring's inner border, at a right angle to it, passes through up to the outer one.
struct RadialLine {
    double weight = 0;          // length of the inner border that it stands for [pixels]; 0: leaves what is seen of the ring
    double wood = 0, late = 0;  // places on it

    /// `reach` [pixels] of the inner border tells the line's direction.
    RadialLine(const BorderLine& inner, const BorderLine& outer, int u, int reach, const cv::Mat& classes, int latewood,
               const cv::Mat& features) {
        constexpr double step = 0.25;  // pixels
        const double steep = slope(inner, inner, u, reach), stretch = std::hypot(1, steep);
        for (double along = 0.5 * step;; along += step) {
            const int column = static_cast<int>(std::lround(u - along * steep / stretch));
            const double v = inner.at(u) + along / stretch;
            if (!outer.covers(column) || v > classes.rows) return;
            if (v > outer.at(column)) {
                weight = stretch;
                return;
            }
            // Its own pixel, not the one of the next ring that the border runs through.
            const int first = inner.covers(column) ? static_cast<int>(std::floor(inner.at(column))) + 1 : 0;
            const int last = static_cast<int>(std::floor(outer.at(column)));
            if (first > last) continue;
            const int row = std::clamp(static_cast<int>(std::lround(v)), first, last);
            // Rays, cracks and marks hide wood whose class is that of the ring around, and more of the LW than of the EW.
            if (features.at<std::uint8_t>(row, column) == static_cast<int>(Feature::background)) continue;
            ++wood;
            late += classes.at<std::uint8_t>(row, column) == latewood;
        }
    }
};

/// Median distance of a polyline's vertices across the growth.
double usual_spacing(const std::vector<cv::Point2d>& points) {
    std::vector<float> spacings;
    for (std::size_t i = 1; i < points.size(); ++i) spacings.push_back(static_cast<float>(points[i].x - points[i - 1].x));
    return quantile(std::move(spacings), 0.5);
}

}  // namespace

BorderPolyline polyline_of(const BorderLine& line, std::int64_t ring, const GrowthFrame& frame) {
    BorderPolyline polyline{ring, {}};
    const auto add = [&](int u) {
        const cv::Point2d p = frame.to_picture({static_cast<double>(u), line.at(u)});
        polyline.points.emplace_back(p.x, p.y);
    };
    for (int u = line.first; u < line.end() - 1; u += vertex_spacing)
        if (line.covers(u)) add(u);
    add(line.end() - 1);
    return polyline;
}

BorderLine line_of(const BorderPolyline& polyline, const GrowthFrame& frame) {
    std::vector<cv::Point2d> points;
    for (const Eigen::Vector2d& point : polyline.points) points.push_back(frame.from_picture({point.x(), point.y()}));
    std::stable_sort(points.begin(), points.end(), [](const cv::Point2d& a, const cv::Point2d& b) { return a.x < b.x; });
    const auto refuse = [&](const char* rule) { throw InputError("--borders", "ring", std::to_string(polyline.ring), rule); };
    BorderLine line;
    line.first = std::max(0, static_cast<int>(std::ceil(points.front().x)));
    const int last = std::min(frame.size().width - 1, static_cast<int>(std::floor(points.back().x)));
    const double usual = usual_spacing(points);
    // Where a border leaves the picture and comes back on the same side there are no vertices.
    const auto is_outside = [&](const cv::Point2d& a, const cv::Point2d& b) {
        constexpr double many = 3, near = 10;  // spacings; pixels
        const double highest = std::max(a.y, b.y), lowest = std::min(a.y, b.y);
        return b.x - a.x > many * usual && (highest < near || lowest > frame.size().height - near);
    };
    std::size_t next = 1;
    for (int u = line.first; u <= last; ++u) {
        while (next + 1 < points.size() && points[next].x < u) ++next;
        const cv::Point2d &a = points[next - 1], &b = points[next];
        const double v = b.x > a.x ? a.y + (u - a.x) / (b.x - a.x) * (b.y - a.y) : b.y;
        const bool within = v >= -0.5 && v <= frame.size().height - 0.5 && (u == a.x || u == b.x || !is_outside(a, b));
        line.v.push_back(within ? std::clamp(v, 0.0, frame.size().height - 1.0) : std::nan(""));
    }
    while (!line.v.empty() && std::isnan(line.v.back())) line.v.pop_back();
    const auto begins = std::ranges::find_if(line.v, [](double v) { return !std::isnan(v); });
    line.first += static_cast<int>(begins - line.v.begin());
    line.v.erase(line.v.begin(), begins);
    if (line.v.size() < 2) refuse("must run across the growth, within the picture");
    return line;
}

std::vector<RingFigures> ring_figures(const std::vector<BorderLine>& borders, const cv::Mat& classes, int latewood,
                                      const cv::Mat& features) {
    std::vector<RingFigures> rings;
    for (std::size_t i = 1; i < borders.size(); ++i) {
        const BorderLine &inner = borders[i - 1], &outer = borders[i];
        const int reach = std::max(2, static_cast<int>(0.5 * mean_distance(inner, outer)));  // waves and noise are shorter
        double wood = 0, late = 0;
        for (int u = inner.first; u < inner.end(); ++u) {
            if (!inner.covers(u)) continue;
            const RadialLine line(inner, outer, u, reach, classes, latewood, features);
            wood += line.weight * line.wood;
            late += line.weight * line.late;
        }
        if (wood > 0) rings.push_back({static_cast<std::int64_t>(i) + 1, mean_width(inner, outer), late / wood});
    }
    return rings;
}

}  // namespace crampfit

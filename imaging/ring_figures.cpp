#include "imaging/ring_figures.hpp"

#include "datasets/error.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr int vertex_spacing = 5;  // columns

bool both_cover(const BorderLine& inner, const BorderLine& outer, int u) { return inner.covers(u) && outer.covers(u); }

/// How steep both borders of a ring are on average about a column.
double slope(const BorderLine& inner, const BorderLine& outer, int u, int reach) {
    int a = u, b = u;
    while (a > u - reach && both_cover(inner, outer, a - 1)) --a;
    while (b < u + reach && both_cover(inner, outer, b + 1)) ++b;
    return b > a ? 0.5 * (inner.at(b) - inner.at(a) + outer.at(b) - outer.at(a)) / (b - a) : 0;
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
    if (last <= line.first) refuse("must run across the growth, within the picture");
    std::size_t next = 1;
    for (int u = line.first; u <= last; ++u) {
        while (next + 1 < points.size() && points[next].x < u) ++next;
        const cv::Point2d &a = points[next - 1], &b = points[next];
        const double v = b.x > a.x ? a.y + (u - a.x) / (b.x - a.x) * (b.y - a.y) : b.y;
        if (!(v >= -0.5 && v <= frame.size().height - 0.5)) refuse("must lie within the picture");
        line.v.push_back(std::clamp(v, 0.0, frame.size().height - 1.0));
    }
    return line;
}

std::vector<RingFigures> ring_figures(const std::vector<BorderLine>& borders, const cv::Mat& classes, int latewood,
                                      const cv::Mat& features) {
    std::vector<RingFigures> rings;
    for (std::size_t i = 1; i < borders.size(); ++i) {
        const BorderLine &inner = borders[i - 1], &outer = borders[i];
        const int from = std::max(inner.first, outer.first), to = std::min(inner.end(), outer.end());
        double width = 0;
        long columns = 0, late = 0, wood = 0;
        for (int u = from; u < to; ++u) {
            if (!both_cover(inner, outer, u)) continue;
            ++columns;
            const double along_growth = outer.at(u) - inner.at(u);
            const double steep = slope(inner, outer, u, std::max(2, static_cast<int>(along_growth / 2)));
            width += along_growth / std::sqrt(1 + steep * steep);
            for (int v = static_cast<int>(std::floor(inner.at(u))) + 1; v <= outer.at(u); ++v) {
                if (features.at<std::uint8_t>(v, u) == static_cast<int>(Feature::background))
                    continue;  // rays, cracks and marks hide wood whose class is that of the ring around, and more of the LW than
                               // of the EW
                ++wood;
                late += classes.at<std::uint8_t>(v, u) == latewood;
            }
        }
        if (wood > 0)
            rings.push_back({static_cast<std::int64_t>(i) + 1, width / static_cast<double>(columns),
                             static_cast<double>(late) / static_cast<double>(wood)});
    }
    return rings;
}

}  // namespace crampfit

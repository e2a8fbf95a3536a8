#include "imaging/border_directions.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr double steepest = 1e3;  // rows a column, that a ring may rise

/// Rows that a ring rises in a column of the frame, by its doubled direction in the picture.
double slope_of(double cos2, double sin2, const GrowthFrame& frame) {
    const double angle = 0.5 * std::atan2(sin2, cos2);
    const cv::Point2d normal = frame.direction({std::cos(angle), std::sin(angle)});
    return -normal.x / std::copysign(std::max(std::abs(normal.y), 1 / steepest), normal.y);
}

/// The slope in each column of a border, as the directions there have it; 0 where it is not.
std::vector<double> slopes_along(const BorderLine& border, const cv::Mat& cos2, const cv::Mat& sin2, const GrowthFrame& frame) {
    std::vector<double> slopes(border.v.size(), 0.0);
    for (int u = border.first; u < border.end(); ++u)
        if (border.covers(u)) {
            const cv::Point place(u, static_cast<int>(std::lround(border.at(u))));
            slopes[static_cast<std::size_t>(u - border.first)] = slope_of(cos2.at<float>(place), sin2.at<float>(place), frame);
        }
    return slopes;
}

/// Angle of a border in each column of the frame: `slopes` and the slope, by a Gaussian window, of what lies between the border
/// and a line of these.
std::vector<double> angles(const BorderLine& border, const std::vector<double>& slopes, int columns, double sigma) {
    std::vector<double> apart(border.v.size());
    double line = 0;
    for (std::size_t i = 0; i < apart.size(); ++i) {
        line += i > 0 ? 0.5 * (slopes[i - 1] + slopes[i]) : 0;
        apart[i] = border.v[i] - line;
    }
    std::vector<double> angle(static_cast<std::size_t>(columns), 0.0);
    const int reach = static_cast<int>(std::ceil(3 * sigma));
    for (int u = border.first; u < border.end(); ++u) {
        double mass = 0, x1 = 0, x2 = 0, y = 0, xy = 0;
        const auto add = [&](int k) {
            const double x = k - u, weight = std::exp(-0.5 * x * x / (sigma * sigma)),
                         value = apart[static_cast<std::size_t>(k - border.first)];
            mass += weight, x1 += weight * x, x2 += weight * x * x, y += weight * value, xy += weight * x * value;
        };
        for (int k = u; k <= u + reach && border.covers(k); ++k) add(k);
        for (int k = u - 1; k >= u - reach && border.covers(k); --k) add(k);
        const double spread = mass * x2 - x1 * x1;
        const bool known = spread > 0.25 * sigma * sigma * mass * mass;  // a quarter of what the whole window has
        const double more = known ? (mass * xy - x1 * y) / spread : 0;
        angle[static_cast<std::size_t>(u)] = std::atan(slopes[static_cast<std::size_t>(u - border.first)] + more);
    }
    return angle;
}

/// A border and its direction in each column of the frame: the angle whose tangent is its slope.
struct Traced {
    const BorderLine& border;
    std::vector<double> angle;

    struct Foot {
        double v, angle;
        bool met;  // false: the normal meets the border beyond its end, which stands for it
    };
    /// Where the normal to a ring of this slope, through a place in a column that the border covers, meets it.
    Foot foot(int u, double v, double slope) const {
        int column = u;
        bool met = true;
        for (int i = 0; i < 3; ++i) {
            // Newton: v' = b + slope (u' - column) on the border, u' = u - slope (v' - v) on the normal.
            const double along = (u - slope * (border.at(column) - slope * column - v)) / (1 + slope * slope);
            const int next = static_cast<int>(std::lround(std::clamp<double>(along, border.first, border.end() - 1)));
            met = std::abs(next - along) < 1;
            if (!border.covers(next)) {
                met = false;
                break;
            }
            column = next;
        }
        return {border.at(column), angle[static_cast<std::size_t>(column)], met};
    }
};

/// Direction at a place: rings between two borders run alike along their normals, and those beyond the outermost as that does,
/// the less the farther. `covering` are those that cover its column, in order.
double angle_at(const std::vector<const Traced*>& covering, int u, double v, double before, double ring_width) {
    const auto outer = std::ranges::upper_bound(covering, v, {}, [u](const Traced* one) { return one->border.at(u); });
    double angle = before;
    for (int round = 0; round < 2 && !covering.empty(); ++round) {
        const double slope = std::tan(angle);
        if (outer == covering.end() || outer == covering.begin()) {
            const Traced::Foot foot = (outer == covering.end() ? covering.back() : covering.front())->foot(u, v, slope);
            if (foot.met) angle = before + std::clamp(2 - std::abs(v - foot.v) / ring_width, 0.0, 1.0) * (foot.angle - before);
            continue;
        }
        const Traced::Foot below = outer[-1]->foot(u, v, slope), above = (*outer)->foot(u, v, slope);
        const double share = above.v > below.v ? std::clamp((v - below.v) / (above.v - below.v), 0.0, 1.0) : 0.5;
        const double from = below.met || !above.met ? below.angle : above.angle;
        const double to = above.met || !below.met ? above.angle : below.angle;
        angle = from + share * (to - from);
    }
    return angle;
}

}  // namespace

void turn_to_borders(OrientationField& field, const std::vector<BorderLine>& borders, const GrowthFrame& frame,
                     double ring_width) {
    const double sigma = std::clamp(0.08 * ring_width, 4.0, 6.0);
    const cv::Mat cos2 = frame.turn(field.full(field.cos2, frame.picture())),
                  sin2 = frame.turn(field.full(field.sin2, frame.picture()));
    const int columns = frame.size().width;
    std::vector<Traced> all;
    for (const BorderLine& border : borders)
        all.push_back({border, angles(border, slopes_along(border, cos2, sin2, frame), columns, sigma)});
    const auto covering = [&](int u) {
        std::vector<const Traced*> these;
        for (const Traced& one : all)
            if (one.border.covers(u)) these.push_back(&one);
        std::ranges::sort(these, {}, [u](const Traced* one) { return one->border.at(u); });
        return these;
    };
    const int lines = frame.across() ? field.cos2.rows : field.cos2.cols,
              nodes = frame.across() ? field.cos2.cols : field.cos2.rows;
    const auto place = [&](int node) { return field.step * (node + 0.5) - 0.5; };
    for (int line = 0; line < lines; ++line) {
        const int u = std::clamp(static_cast<int>(std::lround(place(line))), 0, columns - 1);
        const std::vector<const Traced*> these = covering(u);
        for (int node = 0; node < nodes; ++node) {
            const cv::Point at = frame.across() ? cv::Point(node, line) : cv::Point(line, node);
            float &c = field.cos2.at<float>(at), &s = field.sin2.at<float>(at);
            const double v = frame.from_picture({place(at.x), place(at.y)}).y;
            const double slope = std::tan(angle_at(these, u, v, std::atan(slope_of(c, s, frame)), ring_width));
            const cv::Point2d n = frame.to_picture({-slope, 1}) - frame.to_picture({0, 0});
            const double square = n.dot(n);
            c = static_cast<float>((n.x * n.x - n.y * n.y) / square);
            s = static_cast<float>(2 * n.x * n.y / square);
        }
    }
}

}  // namespace crampfit

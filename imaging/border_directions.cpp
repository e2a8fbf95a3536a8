#include "imaging/border_directions.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

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

/// Mean over a Gaussian window.
std::vector<double> smooth(const BorderLine& border, const std::vector<double>& slopes, double sigma) {
    std::vector<double> means(slopes.size(), 0.0);
    const int reach = static_cast<int>(std::ceil(3 * sigma));
    for (int u = border.first; u < border.end(); ++u) {
        double mass = 0, sum = 0;
        const auto add = [&](int k) {
            const double weight = std::exp(-0.5 * (k - u) * (k - u) / (sigma * sigma));
            mass += weight;
            sum += weight * slopes[static_cast<std::size_t>(k - border.first)];
        };
        for (int k = u; k <= u + reach && border.covers(k); ++k) add(k);
        for (int k = u - 1; k >= u - reach && border.covers(k); --k) add(k);
        if (mass > 0) means[static_cast<std::size_t>(u - border.first)] = sum / mass;
    }
    return means;
}

/// What lies between a border and a line of these slopes.
std::vector<double> apart_from_line(const BorderLine& border, const std::vector<double>& slopes) {
    std::vector<double> apart(border.v.size());
    double line = 0;
    for (std::size_t i = 0; i < apart.size(); ++i) {
        line += i > 0 ? 0.5 * (slopes[i - 1] + slopes[i]) : 0;
        apart[i] = border.v[i] - line;
    }
    return apart;
}

/// The straight line through what lies about a column of a border, by a Gaussian window without its middle.
struct LocalLine {
    double value = 0, slope = 0;
    bool known = false;

    LocalLine(const BorderLine& border, const std::vector<double>& apart, int u, double sigma, int left_out = 0) {
        double mass = 0, x1 = 0, x2 = 0, y = 0, xy = 0;
        const int reach = static_cast<int>(std::ceil(3 * sigma));
        const auto add = [&](int k) {
            if (std::abs(k - u) < left_out) return;
            const double x = k - u, weight = std::exp(-0.5 * x * x / (sigma * sigma)),
                         here = apart[static_cast<std::size_t>(k - border.first)];
            mass += weight, x1 += weight * x, x2 += weight * x * x, y += weight * here, xy += weight * x * here;
        };
        for (int k = u; k <= u + reach && border.covers(k); ++k) add(k);
        for (int k = u - 1; k >= u - reach && border.covers(k); --k) add(k);
        const double spread = mass * x2 - x1 * x1;
        known = spread > 0.25 * sigma * sigma * mass * mass;  // a quarter of what the whole window has
        if (!known) return;
        slope = (mass * xy - x1 * y) / spread;
        value = (x2 * y - x1 * xy) / spread;
    }
};

/// The window that tells best where a border is from what lies about it on both sides: wide where noise moves borders to and fro,
/// narrow where they wave (leave-one-out cross-validation, Stone 1974). What noise does to a place it does to its neighbours.
double best_window(const std::vector<BorderLine>& borders, const std::vector<std::vector<double>>& slopes) {
    constexpr int alike = 7, every = 3;  // columns
    double best = 0, least = std::numeric_limits<double>::infinity();
    for (const double sigma : {4.0, 6.0, 9.0, 13.5, 20.0}) {
        double sum = 0;
        for (std::size_t i = 0; i < borders.size(); ++i) {
            const BorderLine& border = borders[i];
            const std::vector<double> apart = apart_from_line(border, smooth(border, slopes[i], sigma));
            for (int u = border.first + 20; u < border.end() - 20; u += every)
                if (const LocalLine line(border, apart, u, sigma, alike); line.known)
                    sum += std::pow(apart[static_cast<std::size_t>(u - border.first)] - line.value, 2);
        }
        if (sum < least) {
            least = sum;
            best = sigma;
        }
    }
    return best;
}

/// Angle of a border in each column of the frame: `slopes` and the slope of what lies between the border and a line of these.
std::vector<double> angles(const BorderLine& border, const std::vector<double>& slopes, int columns, double sigma) {
    const std::vector<double> first = smooth(border, slopes, sigma), apart = apart_from_line(border, first);
    std::vector<double> angle(static_cast<std::size_t>(columns), 0.0);
    for (int u = border.first; u < border.end(); ++u)
        angle[static_cast<std::size_t>(u)] =
            std::atan(first[static_cast<std::size_t>(u - border.first)] + LocalLine(border, apart, u, sigma).slope);
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

/// Direction at a place: rings between two borders run alike along the ray that leads there, whose normal has the slope `across`,
/// and those beyond the outermost as that does, the less the farther.
double angle_at(const std::vector<const Traced*>& covering, int u, double v, double before, double across, double ring_width) {
    if (covering.empty()) return before;
    const auto outer = std::ranges::upper_bound(covering, v, {}, [u](const Traced* one) { return one->border.at(u); });
    if (outer == covering.end() || outer == covering.begin()) {
        const Traced::Foot foot = (outer == covering.end() ? covering.back() : covering.front())->foot(u, v, across);
        return foot.met ? before + std::clamp(2 - std::abs(v - foot.v) / ring_width, 0.0, 1.0) * (foot.angle - before) : before;
    }
    const Traced::Foot below = outer[-1]->foot(u, v, across), above = (*outer)->foot(u, v, across);
    const double share = above.v > below.v ? std::clamp((v - below.v) / (above.v - below.v), 0.0, 1.0) : 0.5;
    const double from = below.met || !above.met ? below.angle : above.angle;
    const double to = above.met || !below.met ? above.angle : below.angle;
    return from + share * (to - from);
}

/// A map of the field over a few rings, without the rings' waves: where rays run.
cv::Mat without_waves(const cv::Mat& map, double step, double ring_width) {
    constexpr double rings = 2, nodes = 4;  // of its Gaussian; of a coarser lattice to a ring, which is as good
    const double scale = std::min(1.0, nodes * step / ring_width), sigma = rings * ring_width / step * scale;
    const auto coarse = [scale](int size) { return std::max(1, cvRound(scale * size)); };
    cv::Mat small, smooth;
    cv::resize(map, small, {coarse(map.cols), coarse(map.rows)}, 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(small, small, {}, sigma, sigma, cv::BORDER_REFLECT);
    cv::resize(small, smooth, map.size(), 0, 0, cv::INTER_LINEAR);
    return smooth;
}

}  // namespace

void turn_to_borders(OrientationField& field, const std::vector<BorderLine>& borders, const GrowthFrame& frame,
                     double ring_width) {
    const cv::Mat cos2 = frame.turn(field.full(field.cos2, frame.picture())),
                  sin2 = frame.turn(field.full(field.sin2, frame.picture()));
    const int columns = frame.size().width;
    std::vector<std::vector<double>> slopes;
    for (const BorderLine& border : borders) slopes.push_back(slopes_along(border, cos2, sin2, frame));
    const double sigma = best_window(borders, slopes);
    std::vector<Traced> all;
    for (std::size_t i = 0; i < borders.size(); ++i) all.push_back({borders[i], angles(borders[i], slopes[i], columns, sigma)});
    const auto covering = [&](int u) {
        std::vector<const Traced*> these;
        for (const Traced& one : all)
            if (one.border.covers(u)) these.push_back(&one);
        std::ranges::sort(these, {}, [u](const Traced* one) { return one->border.at(u); });
        return these;
    };
    const cv::Mat ray_cos2 = without_waves(field.cos2, field.step, ring_width),
                  ray_sin2 = without_waves(field.sin2, field.step, ring_width);
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
            const double across = slope_of(ray_cos2.at<float>(at), ray_sin2.at<float>(at), frame);
            const double slope = std::tan(angle_at(these, u, v, std::atan(slope_of(c, s, frame)), across, ring_width));
            const cv::Point2d n = frame.to_picture({-slope, 1}) - frame.to_picture({0, 0});
            const double square = n.dot(n);
            c = static_cast<float>((n.x * n.x - n.y * n.y) / square);
            s = static_cast<float>(2 * n.x * n.y / square);
        }
    }
}

}  // namespace crampfit

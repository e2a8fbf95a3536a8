#include "imaging/closed_way.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace crampfit {
namespace {

constexpr double narrow = 2;  // half of the width from which sides are told apart [px]
constexpr double clear = 2;   // from the crack's edge to the wood that is lined up [px]
constexpr double reach = 60;  // of that wood from the crack's middle [px]

cv::Point2d across(const cv::Point2d& along) { return cv::Point2d(-along.y, along.x) / std::max(cv::norm(along), 1e-9); }

/// What counts of the wood along one side of a way, 0 elsewhere; `out` is the unit vector away from the crack.
cv::Mat strip_beside(const DarkWay& way, const cv::Point2d& out, double widest, const cv::Mat& weight) {
    std::vector<cv::Point> outline;
    for (const cv::Point2d& p : way.points) outline.emplace_back(p + (widest + clear) * out);
    for (auto p = way.points.rbegin(); p != way.points.rend(); ++p) outline.emplace_back(*p + (widest + reach) * out);
    cv::Mat strip(weight.size(), CV_32F, cv::Scalar(0));
    cv::fillPoly(strip, std::vector{outline}, cv::Scalar(1));
    return strip.mul(weight);
}

}  // namespace

std::vector<cv::Point2d> closed_way(const cv::Mat& reference, const cv::Mat& image, const cv::Mat& weight, const Alignment& whole,
                                    const DarkWay& way) {
    const double widest = *std::ranges::max_element(way.half_width);
    if (widest <= narrow) return way.points;
    const cv::Point2d chord = across(way.points.back() - way.points.front());
    std::array<Alignment, 2> sides;
    for (const int side : {0, 1})
        sides[side] = line_up(reference, image, strip_beside(way, side == 0 ? chord : -chord, widest, weight), whole, 2 * widest);
    std::vector<cv::Point2d> closed;
    const int count = static_cast<int>(way.points.size());
    for (int i = 0; i < count; ++i) {
        const cv::Point2d& middle = way.points[i];
        cv::Point2d out = across(way.points[std::min(i + 5, count - 1)] - way.points[std::max(i - 5, 0)]);
        if (out.dot(chord) < 0) out = -out;
        const cv::Point2d edge = way.half_width[i] * out;
        closed.push_back(
            0.5 * (sides[0].to_reference(whole.to_image(middle + edge)) + sides[1].to_reference(whole.to_image(middle - edge))));
    }
    return closed;
}

}  // namespace crampfit

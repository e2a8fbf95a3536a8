#include "imaging/growth.hpp"

#include "imaging/ring_borders.hpp"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr double plain_skewness = 0.15;  // of the steps' squares, -1..1
constexpr double plain_spread = 0.05;    // of the radial direction across the picture [rad]
constexpr double least_share = 1.0 / 3;  // of the directions' variance, that is the spread: of waves it is less

/// How much steeper gray rises than it falls down the straightened columns: the difference of the steps' mean squares over their
/// sum, -1..1. Rises and falls have a mean each, as a picture of few rings has more of the one than of the other; steep steps
/// weigh more, noise hardly anything.
double step_skewness(const cv::Mat& gray, const cv::Mat& valid, const RingCoordinate& rings) {
    const StraightPicture straight = StraightWood(gray, valid, rings).blurred_along(std::clamp(gray.cols / 60.0, 1.0, 20.0));
    cv::Mat smooth, slope, unknown;
    cv::GaussianBlur(straight.gray, smooth, {1, 0}, 1.5, 1.5);
    cv::sepFilter2D(smooth, slope, CV_32F, cv::Mat::ones(1, 1, CV_32F), cv::Mat(cv::Vec3f(-0.5f, 0, 0.5f)));
    cv::dilate(straight.known < 0.9, unknown, cv::Mat::ones(11, 1, CV_8U));
    slope.setTo(0, unknown);
    const auto steepness = [](const cv::Mat& steps) {
        const cv::Mat squares = steps.mul(steps);
        const double all = cv::sum(squares)[0];
        return all > 0 ? std::pow(cv::sum(squares.mul(steps))[0] / all, 2) : 0;
    };
    const double rise = steepness(cv::max(slope, 0)), fall = steepness(cv::max(-slope, 0));
    return rise > 0 && fall > 0 ? (rise - fall) / (rise + fall) : 0;
}

/// How far the directions turn outward from one side of the frame to the other [rad]; 0 where that is but waves' chance.
double spread(const OrientationField& field, const GrowthFrame& frame) {
    double weight = 0, mean_u = 0, mean_angle = 0, uu = 0, ua = 0, aa = 0;
    const auto for_all = [&](const auto& visit) {
        for (int j = 0; j < field.coherency.rows; ++j)
            for (int i = 0; i < field.coherency.cols; ++i) {
                const double half = 0.5 * std::atan2(field.sin2.at<float>(j, i), field.cos2.at<float>(j, i));
                cv::Point2d n = frame.direction({std::cos(half), std::sin(half)});
                n = n.y < 0 ? -n : n;
                const double u = frame.from_picture({field.step * (i + 0.5) - 0.5, field.step * (j + 0.5) - 0.5}).x;
                visit(field.coherency.at<float>(j, i), u, std::atan2(n.x, n.y));
            }
    };
    for_all([&](double w, double u, double angle) {
        weight += w;
        mean_u += w * u;
        mean_angle += w * angle;
    });
    if (!(weight > 0)) return 0;
    mean_u /= weight;
    mean_angle /= weight;
    for_all([&](double w, double u, double angle) {
        uu += w * (u - mean_u) * (u - mean_u);
        ua += w * (u - mean_u) * (angle - mean_angle);
        aa += w * (angle - mean_angle) * (angle - mean_angle);
    });
    return ua * ua > least_share * uu * aa ? ua / uu * frame.size().width : 0;
}

}  // namespace

const char* name(GrowthAxis growth) {
    switch (growth) {
    case GrowthAxis::right:
        return "+x";
    case GrowthAxis::left:
        return "-x";
    case GrowthAxis::up:
        return "+y";
    case GrowthAxis::down:
        return "-y";
    }
    throw std::logic_error("a growth without a name");
}

GrowthGuess guess_growth(const cv::Mat& gray, const cv::Mat& valid, const OrientationField& field) {
    const bool across = cv::sum(field.cos2.mul(field.coherency))[0] > 0;
    const GrowthAxis with = across ? GrowthAxis::right : GrowthAxis::up, against = across ? GrowthAxis::left : GrowthAxis::down;
    const GrowthFrame frame(with, gray.size());
    const double skewness = step_skewness(frame.turn(gray), frame.turn(valid), RingCoordinate(field, frame));
    if (std::abs(skewness) > plain_skewness)
        return {skewness > 0 ? with : against, fmt::format("LW's sharper side (skewness {:.2f})", std::abs(skewness))};
    const double turned = spread(field, frame);
    if (std::abs(turned) > plain_spread)
        return {turned > 0 ? with : against,
                fmt::format("the rings' curvature ({:.2f} rad across the picture)", std::abs(turned))};
    return {with, "assumption, for neither LW's sharper side nor curvature shows it: give --growth", false};
}

}  // namespace crampfit

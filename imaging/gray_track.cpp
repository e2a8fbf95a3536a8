#include "imaging/gray_track.hpp"

#include "imaging/closed_way.hpp"
#include "imaging/line_up.hpp"
#include "imaging/opening.hpp"
#include "imaging/silhouette.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

namespace crampfit {
namespace {

constexpr double likely_motion = 30;    // of the camera and the specimen as a whole [px]
constexpr double likely_about_tip = 3;  // of the wood about the tip beside that [px]
constexpr double place_error = 1;       // of the wood's motion about the tip and of the line's middle [px]
constexpr double about = 40;            // standard deviation of what that is taken from [px]
// The wood about the tip of an opening crack goes ahead of it, by the root of the distance (Williams 1957): what it does so
// within a standard deviation half as long tells how it would be lined up at the tip itself. Known to half of that: a judgement.
constexpr double nearer = 0.5, unsure = 0.5;
constexpr double most_left = 0.7;       // of the reference's contrast, in pictures that lie on each other
constexpr int behind = 80, ahead = 60;  // of where the line is lost: what the tip is found from [px]
constexpr int side = 2;                 // of a strip, over which its wood is taken [px]
constexpr double slack = 3;             // of the line's middle [px]
constexpr double edge = 6;              // of the ground, by the lens and what of it is not even: a judgement [px]
constexpr int heading = 40;             // of the line's last stretch, that says how it goes on [px]

cv::Mat pixels_of(const FinePicture& picture) {
    return cv::Mat(picture.rows, picture.columns, CV_32F, const_cast<float*>(picture.gray.data())).clone();
}

double length_of(const std::vector<cv::Point2d>& line) {
    double length = 0;
    for (std::size_t i = 1; i < line.size(); ++i) length += cv::norm(line[i] - line[i - 1]);
    return length;
}

/// Points a pixel apart along a line.
std::vector<cv::Point2d> even(const std::vector<cv::Point2d>& line) {
    std::vector<cv::Point2d> points{line.front()};
    double left = 1;
    for (std::size_t i = 1; i < line.size(); ++i) {
        cv::Point2d from = line[i - 1];
        for (double length = cv::norm(line[i] - from); length >= left; length = cv::norm(line[i] - from)) {
            from += (line[i] - from) * (left / length);
            points.push_back(from);
            left = 1;
        }
        left -= cv::norm(line[i] - from);
    }
    return points;
}

/// The picture along a line and `reach` pixels to either side [points of the line x 2 reach + 1].
cv::Mat strip_along(const cv::Mat& picture, const std::vector<cv::Point2d>& line, int reach) {
    const int count = static_cast<int>(line.size());
    cv::Mat places(count, 2 * reach + 1, CV_32FC2), strip;
    for (int i = 0; i < count; ++i) {
        const cv::Point2d along =
            line[static_cast<std::size_t>(std::min(i + 5, count - 1))] - line[static_cast<std::size_t>(std::max(i - 5, 0))];
        const cv::Point2d across = cv::Point2d(-along.y, along.x) / std::max(cv::norm(along), 1e-9);
        for (int j = -reach; j <= reach; ++j)
            places.at<cv::Point2f>(i, j + reach) = line[static_cast<std::size_t>(i)] + j * across;
    }
    cv::remap(picture, strip, places, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    return strip;
}

/// A crack that opens within a strip pushes wood out at its sides: the light that is missing, over that of the wood at the sides,
/// is the opening, whatever the strip shows in between.
OpeningProfile opening_along(const cv::Mat& reference, const cv::Mat& seen, const std::vector<cv::Point2d>& line, int reach) {
    const cv::Mat before = strip_along(reference, line, reach), now = strip_along(seen, line, reach);
    const int count = before.rows, last = before.cols - 1;
    const auto sum = [](const cv::Mat& strip, int row) { return cv::sum(strip.row(row))[0]; };
    OpeningProfile profile;
    for (int i = 0; i < count; ++i) {
        const double left = cv::mean(before(cv::Rect(0, i, side, 1)))[0],
                     right = cv::mean(before(cv::Rect(last + 1 - side, i, side, 1)))[0];
        const double wood = std::max(0.5 * (left + right), 1.0);
        profile.opening.push_back((sum(before, i) - sum(now, i)) / wood);
        profile.along.push_back((sum(before, std::min(i + 1, count - 1)) - sum(before, std::max(i - 1, 0))) / (2 * wood));
        profile.across.push_back((right - left) / wood);
    }
    return profile;
}

struct Tip {
    cv::Point2d place, direction;
    double along, sigma;            // from the line's first point [px]
    std::vector<cv::Point2d> last;  // stretch of the line, up to the tip
};

/// The tip along a line that is lost at its end.
std::optional<Tip> tip_along(const cv::Mat& reference, const cv::Mat& seen, const DarkWay& way) {
    const std::vector<cv::Point2d> known = even(way.points);
    const std::size_t from = known.size() > behind ? known.size() - behind : 0;
    std::vector<cv::Point2d> line(known.begin() + static_cast<std::ptrdiff_t>(from), known.end());
    const cv::Point2d d = direction_at(known, true, heading);
    const int room = std::min(
        ahead, static_cast<int>(to_border({known.back().x, known.back().y}, {d.x, d.y}, reference.cols, reference.rows)));
    for (int i = 1; i <= room; ++i) line.push_back(known.back() + i * d);
    const std::size_t tail = way.half_width.size() > behind ? way.half_width.size() - behind : 0;
    const double widest = *std::max_element(way.half_width.begin() + static_cast<std::ptrdiff_t>(tail), way.half_width.end());
    const std::optional<OpeningStart> start =
        find_opening_start(opening_along(reference, seen, line, static_cast<int>(std::ceil(widest + slack))));
    if (!start) return std::nullopt;
    const auto i = static_cast<std::size_t>(start->place);
    const double part = start->place - static_cast<double>(i);
    const cv::Point2d place = line[i] + part * (line[std::min(i + 1, line.size() - 1)] - line[i]);
    line.resize(i + 1);
    line.push_back(place);
    return Tip{place, d, static_cast<double>(from) + start->place, start->sigma, std::move(line)};
}

/// How much a place counts when the wood about the tip is lined up.
cv::Mat around(const cv::Point2d& tip, cv::Size size, double reach) {
    cv::Mat weight(size, CV_32F);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            weight.at<float>(y, x) =
                static_cast<float>(std::exp(-0.5 * (std::pow(x - tip.x, 2) + std::pow(y - tip.y, 2)) / (reach * reach)));
    return weight;
}

/// A line that was found in one alignment, in another.
DarkWay moved(DarkWay way, const Alignment& from, const Alignment& to) {
    for (cv::Point2d& point : way.points) point = to.to_reference(from.to_image(point));
    return way;
}

/// Where a way leaves the ground about the specimen: of a notch that has opened its flanks darken, too. `room`: from each place
/// to the ground [px].
std::size_t mouth_of(const DarkWay& way, const cv::Mat& room) {
    std::size_t i = 0;
    double widest = 0;
    const auto at_ground = [&](const cv::Point2d& p) {
        const int x = std::clamp(static_cast<int>(std::lround(p.x)), 0, room.cols - 1);
        const int y = std::clamp(static_cast<int>(std::lround(p.y)), 0, room.rows - 1);
        widest = std::max(widest, way.half_width[i]);
        return room.at<float>(y, x) <= widest + edge;
    };
    while (i + 2 < way.points.size() && at_ground(way.points[i])) ++i;
    return i;
}

std::vector<Vec2> vectors(const std::vector<cv::Point2d>& points) {
    std::vector<Vec2> result;
    for (const cv::Point2d& point : points) result.emplace_back(point.x, point.y);
    return result;
}

}  // namespace

struct GrayTracker::State {
    Silhouette silhouette;
    cv::Mat reference = {};
    cv::Mat allowed = {};  // 0 on a dark ground around the specimen and where masked
    cv::Mat room = {};     // from each place to that ground [px]
    double contrast = 0;
};

GrayTracker::GrayTracker(const FinePicture& reference, const std::vector<std::uint8_t>& mask) {
    auto state = std::make_unique<State>(State{Silhouette(reference)});
    state->reference = pixels_of(reference);
    state->allowed =
        cv::Mat(reference.rows, reference.columns, CV_8U, const_cast<std::uint8_t*>(state->silhouette.mask().data())).clone();
    cv::distanceTransform(state->allowed, state->room, cv::DIST_L2, cv::DIST_MASK_5);
    if (!mask.empty())
        state->allowed &= cv::Mat(reference.rows, reference.columns, CV_8U, const_cast<std::uint8_t*>(mask.data())) != 0;
    cv::Scalar mean, deviation;
    cv::meanStdDev(state->reference, mean, deviation, state->allowed);
    state->contrast = deviation[0];
    state_ = std::move(state);
}

GrayTracker::~GrayTracker() = default;

CrackTip GrayTracker::tip(const FinePicture& picture) const {
    const cv::Mat &reference = state_->reference, image = pixels_of(picture);
    const cv::Size size = reference.size();
    cv::Mat weight;
    state_->allowed.convertTo(weight, CV_32F, 1.0 / 255);
    const Alignment whole = line_up(reference, image, weight, {}, likely_motion);
    CrackTip found;
    double darkest = 0, brightest = 0;
    cv::minMaxLoc(image, &darkest, &brightest);
    // An image of one gray, as a frame that a camera dropped, lies on anything.
    if (darkest == brightest || whole.residual > most_left * state_->contrast) {
        found.status = TipStatus::not_lined_up;
        return found;
    }
    const cv::Mat seen = seen_as_reference(image, whole, size);
    const std::optional<DarkWay> way =
        find_dark_way(reference, seen, shown_of_reference(image.size(), whole, size) & state_->allowed);
    if (!way) return found;
    if (!way->ends_inside) {
        found.status = TipStatus::outside;
        found.way = vectors(closed_way(reference, image, weight, whole, *way));
        return found;
    }
    // The wood about the tip moves by itself: once more, lined up there.
    const auto line_up_about = [&](const cv::Point2d& place, double reach, const Alignment& start) {
        return line_up(reference, image, weight.mul(around(place, size, reach)), start, likely_about_tip);
    };
    const auto tip_as = [&](const Alignment& lined_up) {
        return tip_along(reference, seen_as_reference(image, lined_up, size), moved(*way, whole, lined_up));
    };
    const Alignment about_tip = line_up_about(way->points.back(), about, whole);
    std::optional<Tip> tip = tip_as(about_tip);
    if (!tip) return found;
    const Alignment near_tip = line_up_about(tip->place, nearer * about, about_tip);
    const cv::Point2d nearer_by = about_tip.to_image(tip->place) - near_tip.to_image(tip->place);
    const double ahead_of_tip = std::clamp(nearer_by.dot(tip->direction) / (1 - std::sqrt(nearer)), 0.0, likely_about_tip);
    if (ahead_of_tip > 0) {
        Alignment at_tip = about_tip;
        at_tip.map(0, 2) -= ahead_of_tip * tip->direction.x;
        at_tip.map(1, 2) -= ahead_of_tip * tip->direction.y;
        if (const std::optional<Tip> again = tip_as(at_tip)) tip = again;
    }
    found.status = TipStatus::ok;
    found.tip = {tip->place.x, tip->place.y};
    found.angle = std::atan2(tip->direction.y, tip->direction.x);
    const auto mouth = static_cast<std::ptrdiff_t>(mouth_of(*way, state_->room));
    const std::vector<cv::Point2d> flank(way->points.begin(), way->points.begin() + mouth + 1);
    std::vector<cv::Point2d> points = closed_way(reference, image, weight, whole, *way);
    points.erase(points.begin(), points.begin() + mouth);
    const cv::Point2d front = points.front(), outward = direction_at(points, false, heading);
    found.length = state_->silhouette.to_edge({front.x, front.y}, {outward.x, outward.y}) + tip->along - length_of(flank);
    points.resize(points.size() > behind ? points.size() - behind : 0);
    points.insert(points.end(), tip->last.begin(), tip->last.end());
    found.way = vectors(points);
    found.tip_sigma = found.sigma = std::hypot(tip->sigma, place_error, unsure * ahead_of_tip);
    return found;
}

}  // namespace crampfit

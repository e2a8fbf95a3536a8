#include "forward/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

namespace {

bool inside_polygon(const std::vector<Vec2>& points, const Vec2& x) {
    bool in = false;
    for (std::size_t k = 0, last = points.size() - 1; k < points.size(); last = k++) {
        const Vec2& a = points[k];
        const Vec2& b = points[last];
        if ((a.y() > x.y()) != (b.y() > x.y()) && x.x() < (b.x() - a.x()) * (x.y() - a.y()) / (b.y() - a.y()) + a.x()) in = !in;
    }
    return in;
}

template <class Counts>
OutlinePoint nearest_on_polygon(const std::vector<Vec2>& points, const Vec2& x, const Counts& counts) {
    const double sense = signed_area(points) > 0 ? 1.0 : -1.0;
    OutlinePoint best{Vec2::Zero(), Vec2::Zero(), std::numeric_limits<double>::infinity()};
    for (std::size_t k = 0; k < points.size(); ++k) {
        const Vec2& a = points[k];
        const Vec2& b = points[(k + 1) % points.size()];
        const Vec2 on = a + nearest_on_segment(a, b, x) * (b - a);
        const double distance = (x - on).norm();
        if (distance >= best.distance) continue;
        const Vec2 normal = -sense * left_of((b - a).normalized());
        if (counts(normal)) best = {on, normal, distance};
    }
    return best;
}

}  // namespace

double signed_area(const std::vector<Vec2>& corners) {
    double twice = 0.0;
    for (std::size_t k = 0; k < corners.size(); ++k) twice += cross(corners[k], corners[(k + 1) % corners.size()]);
    return 0.5 * twice;
}

bool inside(const Shape& shape, const Vec2& x) {
    if (const auto* circle = std::get_if<Circle>(&shape)) return (x - circle->centre).norm() <= circle->radius;
    const auto& points = std::get<Polygon>(shape).points;
    return inside_polygon(points, x);
}

bool has_wood(const SpecimenPlan& specimen, const Vec2& x) {
    const auto in = [&](const Part& part) { return inside(part.shape, x); };
    if (!specimen.parts.empty() && std::none_of(specimen.parts.begin(), specimen.parts.end(), in)) return false;
    return std::none_of(specimen.cutouts.begin(), specimen.cutouts.end(), [&](const Shape& cutout) { return inside(cutout, x); });
}

Box bounds(const Shape& shape) {
    if (const auto* circle = std::get_if<Circle>(&shape))
        return {circle->centre.array() - circle->radius, circle->centre.array() + circle->radius};
    const auto& points = std::get<Polygon>(shape).points;
    Box box{points.front(), points.front()};
    for (const Vec2& x : points) {
        box.low = box.low.cwiseMin(x);
        box.high = box.high.cwiseMax(x);
    }
    return box;
}

OutlinePoint nearest_on_outline(const Shape& shape, const Vec2& x) {
    if (const auto* circle = std::get_if<Circle>(&shape)) {
        const Vec2 arm = x - circle->centre;
        const double reach = arm.norm();
        const Vec2 normal = reach > 0 ? Vec2(arm / reach) : Vec2(0.0, 1.0);
        return {circle->centre + circle->radius * normal, normal, std::abs(reach - circle->radius)};
    }
    return nearest_on_polygon(std::get<Polygon>(shape).points, x, [](const Vec2&) { return true; });
}

std::optional<OutlinePoint> nearest_facing(const Polygon& polygon, const Vec2& x, const Vec2& toward, double angle) {
    const double least = std::cos(angle);
    const OutlinePoint found =
        nearest_on_polygon(polygon.points, x, [&](const Vec2& normal) { return normal.dot(toward) >= least; });
    if (!std::isfinite(found.distance)) return std::nullopt;
    return found;
}

std::optional<double> exit_distance(const Vec2& origin, const Vec2& direction, const Box& box) {
    double enter = 0.0;
    double leave = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 2; ++axis) {
        const double d = direction[axis];
        if (d == 0.0) {
            if (origin[axis] < box.low[axis] || origin[axis] > box.high[axis]) return std::nullopt;
            continue;
        }
        const double to_low = (box.low[axis] - origin[axis]) / d;
        const double to_high = (box.high[axis] - origin[axis]) / d;
        enter = std::max(enter, std::min(to_low, to_high));
        leave = std::min(leave, std::max(to_low, to_high));
    }
    if (leave <= enter) return std::nullopt;
    return leave;
}

std::optional<std::array<double, 2>> part_within(const Vec2& a, const Vec2& b, const Box& box) {
    double enter = 0.0, leave = 1.0;
    for (int axis = 0; axis < 2; ++axis) {
        const double d = b[axis] - a[axis];
        if (d == 0.0) {
            if (a[axis] <= box.low[axis] || a[axis] >= box.high[axis]) return std::nullopt;
            continue;
        }
        const double to_low = (box.low[axis] - a[axis]) / d, to_high = (box.high[axis] - a[axis]) / d;
        enter = std::max(enter, std::min(to_low, to_high));
        leave = std::min(leave, std::max(to_low, to_high));
    }
    if (leave <= enter) return std::nullopt;
    return std::array{enter, leave};
}

Piece left_part(const Box& box, const Vec2& a, const Vec2& b) {
    const std::array<Vec2, 4> corners{box.low, Vec2(box.high.x(), box.low.y()), box.high, Vec2(box.low.x(), box.high.y())};
    std::vector<Vec2> outline;
    const auto side = [&](const Vec2& x) { return cross(b - a, x - a); };
    for (int k = 0; k < 4; ++k) {
        const Vec2 &from = corners[k], &to = corners[(k + 1) % 4];
        const double here = side(from), there = side(to);
        if (here >= 0.0) outline.push_back(from);
        if ((here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0))
            outline.push_back(from + here / (here - there) * (to - from));
    }
    Piece piece{0.0, Vec2::Zero(), Vec2::Zero(), {box.high, box.low}};
    for (const Vec2& x : outline) piece.bounds = {piece.bounds.low.cwiseMin(x), piece.bounds.high.cwiseMax(x)};
    for (const bool middle_is_known : {false, true}) {  // triangles about the first corner
        for (std::size_t k = 2; k < outline.size(); ++k) {
            const Vec2 p = outline[0] - piece.middle, q = outline[k - 1] - piece.middle, r = outline[k] - piece.middle;
            const double area = 0.5 * cross(q - p, r - p);
            if (middle_is_known)
                piece.moments += area / 12.0 * (p.cwiseAbs2() + q.cwiseAbs2() + r.cwiseAbs2() + (p + q + r).cwiseAbs2());
            else piece.area += area;
        }
        if (piece.area == 0.0) return piece;
        if (middle_is_known) break;
        Vec2 sum = Vec2::Zero();
        for (std::size_t k = 2; k < outline.size(); ++k)
            sum += 0.5 * cross(outline[k - 1] - outline[0], outline[k] - outline[0]) *
                   (outline[0] + outline[k - 1] + outline[k]) / 3.0;
        piece.middle = sum / piece.area;
    }
    piece.moments /= piece.area;
    return piece;
}

double nearest_on_segment(const Vec2& a, const Vec2& b, const Vec2& x) {
    const Vec2 along = b - a;
    const double squared = along.squaredNorm();
    return squared > 0 ? std::clamp((x - a).dot(along) / squared, 0.0, 1.0) : 0.0;
}

double distance_to(const std::vector<Vec2>& line, const Vec2& x) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k + 1 < line.size(); ++k)
        least = std::min(least, (line[k] + nearest_on_segment(line[k], line[k + 1], x) * (line[k + 1] - line[k]) - x).norm());
    return least;
}

}  // namespace crampfit

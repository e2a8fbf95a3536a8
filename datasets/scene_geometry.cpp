#include "datasets/scene_geometry.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr double rounding = 1e-12;  // of positions that were written in decimals, relative to the lengths at hand

double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

/// On which side of a-b the point c lies: 1 left, -1 right, 0 on the line.
int side_of(const Vec2& a, const Vec2& b, const Vec2& c) {
    const double turn = cross(b - a, c - a);
    const double scale = (b - a).norm() * (c - a).norm();
    return std::abs(turn) <= rounding * scale ? 0 : (turn > 0 ? 1 : -1);
}

bool in_box_of(const Vec2& a, const Vec2& b, const Vec2& c) {
    return c.x() >= std::min(a.x(), b.x()) && c.x() <= std::max(a.x(), b.x()) && c.y() >= std::min(a.y(), b.y()) &&
           c.y() <= std::max(a.y(), b.y());
}

/// Whether segments a-b and c-d have a point in common.
bool touch(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
    const int c_side = side_of(a, b, c);
    const int d_side = side_of(a, b, d);
    const int a_side = side_of(c, d, a);
    const int b_side = side_of(c, d, b);
    if (c_side * d_side < 0 && a_side * b_side < 0) {
        return true;
    }
    return (c_side == 0 && in_box_of(a, b, c)) || (d_side == 0 && in_box_of(a, b, d)) || (a_side == 0 && in_box_of(c, d, a)) ||
           (b_side == 0 && in_box_of(c, d, b));
}

bool doubles_back(const Vec2& a, const Vec2& corner, const Vec2& b) {
    return side_of(a, corner, b) == 0 && (a - corner).dot(b - corner) > 0;
}

}  // namespace

double area(const std::vector<Vec2>& polygon) {
    double twice = 0;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        twice += cross(polygon[i] - polygon[0], polygon[(i + 1) % polygon.size()] - polygon[0]);
    }
    return std::abs(twice) / 2;
}

std::size_t repeated_point(const std::vector<Vec2>& points, bool closed) {
    for (std::size_t i = 1; i < points.size(); ++i) {
        if (points[i] == points[i - 1] || (closed && i + 1 == points.size() && points[i] == points[0])) {
            return i;
        }
    }
    return points.size();
}

bool crosses_itself(const std::vector<Vec2>& points, bool closed) {
    const std::size_t n = points.size();
    const std::size_t segments = closed ? n : n - 1;
    const auto point = [&](std::size_t i) -> const Vec2& { return points[i % n]; };
    for (std::size_t i = 0; i < segments; ++i) {
        if ((closed || i + 1 < segments) && doubles_back(point(i), point(i + 1), point(i + 2))) {
            return true;
        }
        for (std::size_t j = i + 2; j < segments; ++j) {
            const bool neighbours = closed && i == 0 && j + 1 == segments;
            if (!neighbours && touch(point(i), point(i + 1), point(j), point(j + 1))) {
                return true;
            }
        }
    }
    return false;
}

bool share_a_stretch(const std::vector<Vec2>& line, const std::vector<Vec2>& other) {
    constexpr double hair = 1e-9;  // of a segment
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
        const Vec2 way = line[i + 1] - line[i];
        const double squared = way.squaredNorm();
        for (std::size_t j = 0; j + 1 < other.size(); ++j) {
            const Vec2 from = other[j] - line[i], to = other[j + 1] - line[i];
            if (std::max(std::abs(cross(way, from)), std::abs(cross(way, to))) > hair * squared) {
                continue;
            }
            const double first = std::min(way.dot(from), way.dot(to)) / squared;
            const double last = std::max(way.dot(from), way.dot(to)) / squared;
            if (std::min(last, 1.0) - std::max(first, 0.0) > hair) {
                return true;
            }
        }
    }
    return false;
}

bool meets_rectangle(const std::vector<Vec2>& line, const Vec2& size) {
    constexpr double rounding = 1e-9;  // of the size
    // Each segment is a + s (b - a), 0 <= s <= 1; the rectangle's four sides cut that stretch of s down (Liang and
    // Barsky 1984).
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
        const Vec2& a = line[i];
        const Vec2 along = line[i + 1] - a;
        double first = 0;
        double last = 1;
        for (int axis = 0; axis < 2; ++axis) {
            if (along[axis] == 0) {
                const double margin = rounding * size[axis];
                last = a[axis] > margin && a[axis] < size[axis] - margin ? last : -1;
                continue;
            }
            const double low = (0 - a[axis]) / along[axis];
            const double high = (size[axis] - a[axis]) / along[axis];
            first = std::max(first, std::min(low, high));
            last = std::min(last, std::max(low, high));
        }
        if (first < last) {
            return true;
        }
    }
    return false;
}

}  // namespace crampfit

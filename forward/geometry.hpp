#pragma once

#include "datasets/scene.hpp"

#include <array>
#include <optional>

namespace crampfit {

inline double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

/// A quarter turn counter-clockwise.
inline Vec2 left_of(const Vec2& a) { return {-a.y(), a.x()}; }

struct Box {
    Vec2 low;   // [m]
    Vec2 high;  // [m]

    bool contains(const Vec2& x) const { return (x.array() >= low.array()).all() && (x.array() <= high.array()).all(); }
    bool touches(const Box& b) const { return (low.array() <= b.high.array()).all() && (b.low.array() <= high.array()).all(); }
};

/// True inside the shape and on its outline.
bool inside(const Shape& shape, const Vec2& x);

Box bounds(const Shape& shape);

/// True where neither cutouts nor what lies between parts take the specimen's rectangle.
bool has_wood(const SpecimenPlan& specimen, const Vec2& x);

struct OutlinePoint {
    Vec2 position;    // [m]
    Vec2 normal;      // unit, out of the shape
    double distance;  // from the asked point, always positive [m]
};

/// The place on a shape's outline that is nearest to x.
OutlinePoint nearest_on_outline(const Shape& shape, const Vec2& x);

/// The same of those of a polygon's sides whose normals lie within `angle` of `toward`, a unit vector; nothing where none does
/// [rad].
std::optional<OutlinePoint> nearest_facing(const Polygon& polygon, const Vec2& x, const Vec2& toward, double angle);

/// Where along a ray from `origin` with unit `direction` it leaves the box for good; nothing when it misses the box [m].
std::optional<double> exit_distance(const Vec2& origin, const Vec2& direction, const Box& box);

/// What of a straight line goes through a box, as fractions of the way from a to b; nothing where it only touches it.
std::optional<std::array<double, 2>> part_within(const Vec2& a, const Vec2& b, const Box& box);

struct Piece {
    double area;   // [m^2]
    Vec2 middle;   // of it [m]
    Vec2 moments;  // second ones about its middle, of x and y, over the area [m^2]
    Box bounds;
};

/// What of a box lies on the left of the line from a to b. No area: nothing does.
Piece left_part(const Box& box, const Vec2& a, const Vec2& b);

/// Of a polygon, positive where its corners go round counter-clockwise [m^2].
double signed_area(const std::vector<Vec2>& corners);

/// Nearest place on segment a-b to x, as a fraction of the way from a to b.
double nearest_on_segment(const Vec2& a, const Vec2& b, const Vec2& x);

/// From a place to the nearest of a line of at least two vertices [m].
double distance_to(const std::vector<Vec2>& line, const Vec2& x);

}  // namespace crampfit

#pragma once

#include "datasets/scene.hpp"

#include <vector>

namespace crampfit {

/// Area of a polygon, whatever its sense [m^2].
double area(const std::vector<Vec2>& polygon);

/// The first point that repeats the one before it (in a polygon also the first point that repeats the last); `size()`:
/// none.
std::size_t repeated_point(const std::vector<Vec2>& points, bool closed);

/// Whether a line or polygon touches, crosses or doubles back on itself.
bool crosses_itself(const std::vector<Vec2>& points, bool closed);

/// Whether two lines go the same way for a stretch; that they cross or touch is no matter.
bool share_a_stretch(const std::vector<Vec2>& line, const std::vector<Vec2>& other);

/// Whether any part of a line lies in the rectangle from the origin to `size`; not what only runs along its border.
bool meets_rectangle(const std::vector<Vec2>& line, const Vec2& size);

}  // namespace crampfit

#pragma once

#include "datasets/scene.hpp"

#include <array>

namespace crampfit {

/// Value and slope of one node's shape function along one axis.
struct Weight {
    double value;
    double slope;  // [1/m]
};

/// Linear hat of a node at distance `offset` = x_point - x_node, with grid spacing h.
Weight linear_weight(double offset, double h);

/// Generalized interpolation (GIMP): the hat and its slope averaged over a point's domain of half width `half`.
/// Bardenhagen and Kober (2004), eq. 17-18, for the box (uGIMP) characteristic function.
Weight gimp_weight(double offset, double h, double half);

/// Shape functions of a cell's four nodes (lower left, lower right, upper left, upper right) at one place in the cell.
struct CellWeights {
    std::array<double, 4> value;
    std::array<double, 4> slope_x;  // [1/m]
    std::array<double, 4> slope_y;  // [1/m]
};

/// At `place` in the cell (from its lower left corner, [m]) for a point whose domain has half widths `half`.
CellWeights cell_weights(ShapeFunction kind, const Vec2& place, const Vec2& cell, const Vec2& half);

} // namespace crampfit

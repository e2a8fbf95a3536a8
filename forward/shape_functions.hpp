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

/// Where a cell lies along one axis of the grid.
struct CellEnds {
    bool first;  // no cell before it
    bool last;   // none after it
};

/// The three quadratic B-splines that a cell sees, at `place` from its lower end [m]. The knots at the grid's ends are threefold
/// (de Boor 1978, ch. IX), so that the splines add up to one there as well and the outermost one alone has a value on the
/// boundary.
std::array<Weight, 3> spline_weights(double place, double h, CellEnds ends);

/// Most nodes that a cell sees: 3 x 3 with quadratic B-splines; 2 x 2 with all others.
constexpr int most_nodes = 9;

/// Of a cell's corners: the displacement u_0 - u_1 - u_2 + u_3 is how far the gradient changes across the cell.
inline constexpr std::array<double, 4> crosswise_sign{1.0, -1.0, -1.0, 1.0};

/// Shape functions of the nodes that a cell sees, row by row from the lower left one, at one place in the cell.
struct CellWeights {
    std::array<double, most_nodes> value{};
    std::array<double, most_nodes> slope_x{};  // [1/m]
    std::array<double, most_nodes> slope_y{};  // [1/m]
};

/// At `place` in the cell (from its lower left corner, [m]) for a point whose domain has half widths `half`. CPDI: the hats
/// averaged over the corners of the domain, as a parallelogram (Sadeghirad, Brannon and Burghardt 2011).
CellWeights cell_weights(ShapeFunction kind, const Vec2& place, const Vec2& cell, const Vec2& half,
                         const std::array<CellEnds, 2>& ends = {});

}  // namespace crampfit

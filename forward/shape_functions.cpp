#include "forward/shape_functions.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {

Weight linear_weight(double offset, double h) {
    const double r = std::abs(offset) / h;
    if (r >= 1.0) return {0.0, 0.0};
    return {1.0 - r, offset > 0 ? -1.0 / h : 1.0 / h};
}

Weight gimp_weight(double offset, double h, double half) {
    // Integral of the hat from its left foot to t, in units of h: exact, so that the average over a domain is a difference.
    const auto integral = [](double t) {
        t = std::clamp(t, -1.0, 1.0);
        return t < 0 ? 0.5 * (1.0 + t) * (1.0 + t) : 1.0 - 0.5 * (1.0 - t) * (1.0 - t);
    };
    const auto hat = [](double t) { return std::max(0.0, 1.0 - std::abs(t)); };
    const double low = (offset - half) / h;
    const double high = (offset + half) / h;
    return {(integral(high) - integral(low)) / (high - low), (hat(high) - hat(low)) / (2.0 * half)};
}

std::array<Weight, 3> spline_weights(double place, double h, CellEnds ends) {
    // With knots a, 0, 1, b about the cell, in units of h: (1 - t)^2 / (1 - a) and t^2 / b are the outer two.
    const double t = place / h;
    const double before = ends.first ? 1.0 : 2.0;  // 1 - a
    const double after = ends.last ? 1.0 : 2.0;    // b
    const Weight low{(1.0 - t) * (1.0 - t) / before, -2.0 * (1.0 - t) / (before * h)};
    const Weight high{t * t / after, 2.0 * t / (after * h)};
    return {low, {1.0 - low.value - high.value, -low.slope - high.slope}, high};
}

namespace {

// Products of weights along x and y.
template <std::size_t Nodes>
CellWeights product(const std::array<Weight, Nodes>& x, const std::array<Weight, Nodes>& y) {
    CellWeights weights;
    for (std::size_t k = 0; k < Nodes * Nodes; ++k) {
        weights.value[k] = x[k % Nodes].value * y[k / Nodes].value;
        weights.slope_x[k] = x[k % Nodes].slope * y[k / Nodes].value;
        weights.slope_y[k] = x[k % Nodes].value * y[k / Nodes].slope;
    }
    return weights;
}

CellWeights cpdi_weights(const Vec2& place, const Vec2& cell, const Vec2& half) {
    CellWeights weights;
    for (const double right : {-1.0, 1.0}) {
        for (const double up : {-1.0, 1.0}) {
            const CellWeights corner =
                cell_weights(ShapeFunction::linear, place + half.cwiseProduct(Vec2(right, up)), cell, half);
            for (std::size_t k = 0; k < 4; ++k) {
                weights.value[k] += 0.25 * corner.value[k];
                weights.slope_x[k] += 0.25 * right / half.x() * corner.value[k];
                weights.slope_y[k] += 0.25 * up / half.y() * corner.value[k];
            }
        }
    }
    return weights;
}

}  // namespace

CellWeights cell_weights(ShapeFunction kind, const Vec2& place, const Vec2& cell, const Vec2& half,
                         const std::array<CellEnds, 2>& ends) {
    if (kind == ShapeFunction::cpdi) return cpdi_weights(place, cell, half);
    if (kind == ShapeFunction::bspline2)
        return product(spline_weights(place.x(), cell.x(), ends[0]), spline_weights(place.y(), cell.y(), ends[1]));
    const auto along = [&](int axis) {
        const auto at = [&](double offset) {
            return kind == ShapeFunction::linear ? linear_weight(offset, cell[axis])
                                                 : gimp_weight(offset, cell[axis], half[axis]);
        };
        return std::array{at(place[axis]), at(place[axis] - cell[axis])};
    };
    return product(along(0), along(1));
}

}  // namespace crampfit

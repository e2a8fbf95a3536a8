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

CellWeights cell_weights(ShapeFunction kind, const Vec2& place, const Vec2& cell, const Vec2& half) {
    const auto along = [&](int axis, int node) {
        const double offset = place[axis] - node * cell[axis];
        return kind == ShapeFunction::linear ? linear_weight(offset, cell[axis]) : gimp_weight(offset, cell[axis], half[axis]);
    };
    CellWeights weights;
    for (int node = 0; node < 4; ++node) {
        const Weight x = along(0, node % 2);
        const Weight y = along(1, node / 2);
        weights.value[node] = x.value * y.value;
        weights.slope_x[node] = x.slope * y.value;
        weights.slope_y[node] = x.value * y.slope;
    }
    return weights;
}

} // namespace crampfit

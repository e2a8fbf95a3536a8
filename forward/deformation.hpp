#pragma once

#include "forward/discretisation.hpp"

#include <cmath>

namespace crampfit {

using Mat2 = Eigen::Matrix2d;

/// Stress and energy of a point. `stress` is the first Piola-Kirchhoff stress: force on the undeformed area.
struct PointState {
    Mat2 gradient;       // displacement gradient, du_i / dX_j
    Mat2 strain;
    Mat2 stress;         // [Pa]
    double energy;       // per undeformed volume [J/m^3]
};

/// Linear elasticity. With `rotates`, of Biot's strain U - I in the frame that turns with the point (F = R U): the same line for
/// stretch, and no stress from rotation alone. Without, of the small strain.
inline PointState elastic_state(const Mat2& gradient, const Eigen::Matrix3d& stiffness, bool rotates) {
    PointState state;
    state.gradient = gradient;
    Mat2 turn = Mat2::Identity();
    if (rotates) {
        // Polar decomposition in the plane: R is along (F11 + F22, F21 - F12).
        const double c = 2.0 + gradient.trace();
        const double w = gradient(1, 0) - gradient(0, 1);
        const double size = std::sqrt(c * c + w * w);
        turn << c / size, -w / size, w / size, c / size;
        state.strain = turn.transpose() * (gradient + Mat2::Identity()) - Mat2::Identity();
    } else {
        state.strain = 0.5 * (gradient + gradient.transpose());
    }
    const Eigen::Vector3d s = stiffness * Eigen::Vector3d(state.strain(0, 0), state.strain(1, 1), 2.0 * state.strain(0, 1));
    Mat2 local;
    local << s[0], s[2], s[2], s[1];
    state.energy = 0.5 * local.cwiseProduct(state.strain).sum();
    state.stress = turn * local;
    return state;
}

/// Gradient at a point of a field given at the nodes (a displacement or a velocity).
inline Mat2 gradient_at(const Discretisation& body, int p, const std::vector<Vec2>& field) {
    const CellWeights& w = body.weights[body.points.slot[p]];
    Mat2 gradient = Mat2::Zero();
    for (int k = 0; k < 4; ++k) {
        const Vec2& u = field[body.points.node[p][k]];
        gradient.col(0) += w.slope_x[k] * u;
        gradient.col(1) += w.slope_y[k] * u;
    }
    return gradient;
}

inline Vec2 value_at(const Discretisation& body, int p, const std::vector<Vec2>& field) {
    const CellWeights& w = body.weights[body.points.slot[p]];
    Vec2 value = Vec2::Zero();
    for (int k = 0; k < 4; ++k) value += w.value[k] * field[body.points.node[p][k]];
    return value;
}

} // namespace crampfit

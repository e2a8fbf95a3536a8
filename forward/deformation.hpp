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

/// The polar decomposition F = R U in the plane: R is along (F11 + F22, F21 - F12).
struct Polar {
    Mat2 turn;     // R
    Mat2 stretch;  // U
    double trace;  // of U

    explicit Polar(const Mat2& gradient) {
        const double c = 2.0 + gradient.trace();
        const double w = gradient(1, 0) - gradient(0, 1);
        trace = std::sqrt(c * c + w * w);
        turn << c / trace, -w / trace, w / trace, c / trace;
        stretch = turn.transpose() * (gradient + Mat2::Identity());
    }

    /// Biot strain xx, yy, 2 xy per R^T dF, which is counted xx, xy, yx, yy. From dU = R^T dF - dtheta J U, J a quarter turn, and
    /// dU symmetric: dtheta = (yx - xy of R^T dF) / tr U.
    Eigen::Matrix<double, 3, 4> strain_slope() const {
        const Mat2 u = stretch / trace;
        Eigen::Matrix<double, 3, 4> B;
        B << 1, -u(0, 1), u(0, 1), 0,
             0, u(0, 1), -u(0, 1), 1,
             0, 2 * u(0, 0), 2 * u(1, 1), 0;
        return B;
    }
};

/// Linear elasticity. With `rotates`, of Biot's strain U - I in the frame that turns with the point (F = R U): the same line for
/// stretch, and no stress from rotation alone. Without, of the small strain.
inline PointState elastic_state(const Mat2& gradient, const Eigen::Matrix3d& stiffness, bool rotates) {
    PointState state;
    state.gradient = gradient;
    if (!rotates) {
        state.strain = 0.5 * (gradient + gradient.transpose());
        const Eigen::Vector3d s = stiffness * Eigen::Vector3d(state.strain(0, 0), state.strain(1, 1), 2.0 * state.strain(0, 1));
        state.stress << s[0], s[2], s[2], s[1];
        state.energy = 0.5 * state.stress.cwiseProduct(state.strain).sum();
        return state;
    }
    const Polar polar(gradient);
    state.strain = polar.stretch - Mat2::Identity();
    const Eigen::Vector3d strain(state.strain(0, 0), state.strain(1, 1), 2.0 * state.strain(0, 1));
    const Eigen::Vector3d s = stiffness * strain;
    const Eigen::Vector4d p = polar.strain_slope().transpose() * s;
    Mat2 local;
    local << p[0], p[1], p[2], p[3];
    state.stress = polar.turn * local;
    state.energy = 0.5 * s.dot(strain);
    return state;
}

/// Second derivative of the energy of `elastic_state` by the displacement gradient, counted xx, xy, yx, yy [Pa]; without `geometric`
/// only the part that is never negative, which leaves out that stress turns with the point.
inline Eigen::Matrix4d elastic_tangent(const Mat2& gradient, const Eigen::Matrix3d& stiffness, bool rotates, bool geometric = true) {
    Eigen::Matrix<double, 3, 4> B;
    if (!rotates) {
        B << 1, 0, 0, 0, 0, 0, 0, 1, 0, 1, 1, 0;
        return B.transpose() * stiffness * B;
    }
    // In the frame that turns: p = B^T s, so dp = B^T C B dG + dB^T s, and the turning adds dtheta J p. dB comes from dU = B dG.
    const Polar polar(gradient);
    B = polar.strain_slope();
    const Mat2& U = polar.stretch;
    const double t = polar.trace;
    const Eigen::Vector3d s = stiffness * Eigen::Vector3d(U(0, 0) - 1.0, U(1, 1) - 1.0, 2.0 * U(0, 1));
    const Eigen::Vector4d p = B.transpose() * s;
    const Eigen::RowVector4d dt = B.row(0) + B.row(1);
    const auto per_trace = [&](double u, const Eigen::RowVector4d& du) { return Eigen::RowVector4d(du / t - u / (t * t) * dt); };
    const Eigen::RowVector4d d00 = per_trace(U(0, 0), B.row(0));
    const Eigen::RowVector4d d11 = per_trace(U(1, 1), B.row(1));
    const Eigen::RowVector4d d01 = per_trace(U(0, 1), 0.5 * B.row(2));
    Eigen::Matrix4d A = B.transpose() * (stiffness * B);
    if (geometric) {
        A.row(1) += (s[1] - s[0]) * d01 + 2.0 * s[2] * d00;
        A.row(2) += (s[0] - s[1]) * d01 + 2.0 * s[2] * d11;
        A += Eigen::Vector4d(-p[2], -p[3], p[0], p[1]) * Eigen::RowVector4d(0, -1, 1, 0) / t;
    }
    // Turned back: first index by R from the left, second by R^T from the right.
    const double c = polar.turn(0, 0);
    const double w = polar.turn(1, 0);
    for (int j = 0; j < 2; ++j) {
        const Eigen::RowVector4d x = A.row(j);
        const Eigen::RowVector4d y = A.row(2 + j);
        A.row(j) = c * x - w * y;
        A.row(2 + j) = w * x + c * y;
    }
    for (int j = 0; j < 2; ++j) {
        const Eigen::Vector4d x = A.col(j);
        const Eigen::Vector4d y = A.col(2 + j);
        A.col(j) = c * x - w * y;
        A.col(2 + j) = w * x + c * y;
    }
    return A;
}

/// Gradient at a point of a field given at the nodes (a displacement or a velocity).
inline Mat2 gradient_at(const Discretisation& body, int p, const std::vector<Vec2>& field) {
    const CellWeights& w = body.weights[body.points.slot[p]];
    Mat2 gradient = Mat2::Zero();
    const auto node = body.points.node[p];
    for (std::size_t k = 0; k < node.size(); ++k) {
        const Vec2& u = field[node[k]];
        gradient.col(0) += w.slope_x[k] * u;
        gradient.col(1) += w.slope_y[k] * u;
    }
    return gradient;
}

inline Vec2 value_at(const Discretisation& body, int p, const std::vector<Vec2>& field) {
    const CellWeights& w = body.weights[body.points.slot[p]];
    Vec2 value = Vec2::Zero();
    const auto node = body.points.node[p];
    for (std::size_t k = 0; k < node.size(); ++k) value += w.value[k] * field[node[k]];
    return value;
}

} // namespace crampfit

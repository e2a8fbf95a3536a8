#pragma once

#include "forward/discretisation.hpp"

#include <array>
#include <cmath>

namespace crampfit {

using Mat2 = Eigen::Matrix2d;

/// Stress and energy of a point. `stress` is the first Piola-Kirchhoff stress: force on the undeformed area.
struct PointState {
    Mat2 gradient;  // displacement gradient, du_i / dX_j
    Mat2 strain;
    Mat2 stress;    // [Pa]
    double energy;  // per undeformed volume [J/m^3]
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
        B << 1, -u(0, 1), u(0, 1), 0, 0, u(0, 1), -u(0, 1), 1, 0, 2 * u(0, 0), 2 * u(1, 1), 0;
        return B;
    }
};

/// What a point is in whose stress xx, yy, xy is `stress_of` its strain xx, yy, 2 xy. With `rotates` these are Biot's strain U -
/// I and its stress in the frame that turns with the point (F = R U): no stress from rotation alone. Without, the strain is
/// small. The energy is that of a straight line from no stress to this.
template <class Stress>
PointState state_with(const Mat2& gradient, bool rotates, const Stress& stress_of) {
    PointState state;
    state.gradient = gradient;
    if (!rotates) {
        state.strain = 0.5 * (gradient + gradient.transpose());
        const Eigen::Vector3d s = stress_of(Eigen::Vector3d(state.strain(0, 0), state.strain(1, 1), 2.0 * state.strain(0, 1)));
        state.stress << s[0], s[2], s[2], s[1];
        state.energy = 0.5 * state.stress.cwiseProduct(state.strain).sum();
        return state;
    }
    const Polar polar(gradient);
    state.strain = polar.stretch - Mat2::Identity();
    const Eigen::Vector3d strain(state.strain(0, 0), state.strain(1, 1), 2.0 * state.strain(0, 1));
    const Eigen::Vector3d s = stress_of(strain);
    const Eigen::Vector4d p = polar.strain_slope().transpose() * s;
    Mat2 local;
    local << p[0], p[1], p[2], p[3];
    state.stress = polar.turn * local;
    state.energy = 0.5 * s.dot(strain);
    return state;
}

/// Linear elasticity: the same line for stretch whatever the rotation.
inline PointState elastic_state(const Mat2& gradient, const Eigen::Matrix3d& stiffness, bool rotates) {
    return state_with(gradient, rotates, [&](const Eigen::Vector3d& strain) -> Eigen::Vector3d { return stiffness * strain; });
}

/// Derivative of the stress of `state_with` by the displacement gradient, counted xx, xy, yx, yy [Pa], where that of `stress_of`
/// (xx, yy, xy of strain xx, yy, 2 xy) is C; without `geometric` only the part that is never negative, which leaves out that
/// stress turns with the point. Numbers are `double`, or arrays of them for many points at once. C is counted xx-xx, xx-yy,
/// yy-yy, xy-xy, xx-xy, yy-xy.
template <class Number, class Stress>
std::array<std::array<Number, 4>, 4> tangent_with(const std::array<Number, 4>& gradient, const std::array<Number, 6>& C,
                                                  const Stress& stress_of, bool rotates, bool geometric) {
    using std::sqrt;
    std::array<std::array<Number, 4>, 4> A;
    if (!rotates) {
        A[0] = {C[0], C[4], C[4], C[1]};
        A[1] = A[2] = {C[4], C[3], C[3], C[5]};
        A[3] = {C[1], C[5], C[5], C[2]};
        return A;
    }
    // In the frame that turns: p = B^T s, so dp = B^T C B dG + dB^T s, and the turning adds dtheta J p. dB comes from dU = B dG.
    const auto& [xx, xy, yx, yy] = gradient;
    const Number along = 2.0 + xx + yy;
    const Number across = yx - xy;
    const Number r = 1.0 / sqrt(along * along + across * across);  // 1 / tr U
    const Number cosine = along * r;
    const Number sine = across * r;
    const Number U_xx = cosine * (1.0 + xx) + sine * yx;
    const Number U_yy = cosine * (1.0 + yy) - sine * xy;
    const Number U_xy = cosine * xy + sine * (1.0 + yy);
    const Number u = U_xx * r, v = U_yy * r, w = U_xy * r;
    const auto times_B = [&](const Number& of_xx, const Number& of_yy, const Number& of_xy) {
        const Number skew = w * (of_yy - of_xx);
        return std::array<Number, 4>{of_xx, skew + 2.0 * u * of_xy, 2.0 * v * of_xy - skew, of_yy};
    };
    const std::array<Number, 4> x = times_B(C[0], C[1], C[4]);  // rows of C B
    const std::array<Number, 4> y = times_B(C[1], C[2], C[5]);
    const std::array<Number, 4> s = times_B(C[4], C[5], C[3]);
    for (int j = 0; j < 4; ++j) {
        const std::array<Number, 4> column = times_B(x[j], y[j], s[j]);
        for (int i = 0; i < 4; ++i) A[i][j] = column[i];
    }
    if (geometric) {
        const Number e_xx = U_xx - 1.0, e_yy = U_yy - 1.0, shear = 2.0 * U_xy;
        const auto [s_xx, s_yy, s_xy] = stress_of(e_xx, e_yy, shear);
        const std::array<Number, 4> p = times_B(s_xx, s_yy, s_xy);
        const Number difference = r * (s_yy - s_xx);
        const Number twice = 2.0 * r * s_xy;
        const std::array<Number, 4> d_u{1.0 - u, -w, w, -u};  // over r: of U_xx / tr U, U_yy / tr U, U_xy / tr U
        const std::array<Number, 4> d_v{-v, w, -w, 1.0 - v};
        const std::array<Number, 4> d_w{-w, u, v, -w};
        for (int j = 0; j < 4; ++j) {
            A[1][j] += difference * d_w[j] + twice * d_u[j];
            A[2][j] += twice * d_v[j] - difference * d_w[j];
        }
        const std::array<Number, 4> turned{-p[2], -p[3], p[0], p[1]};
        for (int i = 0; i < 4; ++i) {
            A[i][1] -= r * turned[i];
            A[i][2] += r * turned[i];
        }
    }
    const auto turn = [&](Number& first, Number& second) {
        const Number before = first;
        first = cosine * before - sine * second;
        second = sine * before + cosine * second;
    };
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 4; ++i) turn(A[j][i], A[2 + j][i]);
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 4; ++i) turn(A[i][j], A[i][2 + j]);
    return A;
}

/// Second derivative of the energy of `elastic_state`.
template <class Number>
std::array<std::array<Number, 4>, 4> elastic_tangent(const std::array<Number, 4>& gradient, const std::array<Number, 6>& C,
                                                     bool rotates, bool geometric) {
    const auto stress = [&](const Number& xx, const Number& yy, const Number& shear) {
        return std::array<Number, 3>{C[0] * xx + C[1] * yy + C[4] * shear, C[1] * xx + C[2] * yy + C[5] * shear,
                                     C[4] * xx + C[5] * yy + C[3] * shear};
    };
    return tangent_with(gradient, C, stress, rotates, geometric);
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

/// Its mean over the points of a box; nil where there are none.
Mat2 mean_gradient(const Discretisation& body, const Box& box, const std::vector<Vec2>& field);

/// Gradient at a point of the displacement as its energy knows it. A cell whose points are all on the same fields bends as wood
/// does: what its strain changes by across it, q = (u_0 - u_1 - u_2 + u_3) / (h_x h_y), puts stress along x and y on it alone
/// (`InternalForce`), so that its sides curve by as much as that takes.
Mat2 seen_gradient_at(const Discretisation& body, int p, const std::vector<Vec2>& displacement, bool rotates);

inline Vec2 value_at(const Discretisation& body, int p, const std::vector<Vec2>& field) {
    const CellWeights& w = body.weights[body.points.slot[p]];
    Vec2 value = Vec2::Zero();
    const auto node = body.points.node[p];
    for (std::size_t k = 0; k < node.size(); ++k) value += w.value[k] * field[node[k]];
    return value;
}

}  // namespace crampfit

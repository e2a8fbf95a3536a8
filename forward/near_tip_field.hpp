#pragma once

#include "forward/deformation.hpp"

#include <complex>
#include <numbers>

namespace crampfit {

/// Elastic fields around a tip of a straight crack with free faces in wood of any plane compliance, for K_I = 1 and for K_II = 1
/// [Pa sqrt(m)] (Sih, Paris and Irwin 1965, eqs. 20-23; Lekhnitskii's complex variables z_k = x + s_k y). The tip is the origin,
/// x goes ahead of it. Angles beyond +-pi go on smoothly into the other face's side.
///
/// The published form divides by s_1 - s_2 and fails for isotropic wood, where s_1 = s_2 = i. Here each such quotient is a
/// divided difference [g] = (g(s_1) - g(s_2)) / (s_1 - s_2), with [f g] = [f] g(s_1) + f(s_2) [g], and for g = z^-1/2
///     [g] = -y / ((z_1^1/2 + z_2^1/2) z_1^1/2 z_2^1/2),
/// which holds for equal roots too: there it is the first term of Williams (1957).
class NearTipField {
  public:
    using Complex = std::complex<double>;

    /// `compliance` in the axes of the crack, x ahead [1/Pa].
    explicit NearTipField(const Eigen::Matrix3d& compliance);

    struct Mode {
        Mat2 gradient;                     // du_i / dx_j
        Mat2 stress;                       // [Pa]
        std::array<Mat2, 2> stress_slope;  // by x and by y [Pa/m]
    };

    /// Modes I and II.
    std::array<Mode, 2> at(double r, double angle) const {
        const double scale = 1.0 / std::sqrt(2.0 * std::numbers::pi);
        const double x = r * std::cos(angle), y = r * std::sin(angle);
        const auto& [s1, s2] = s_;
        const Complex q1 = inverse_root(x + s1 * y, angle);
        const Complex q2 = inverse_root(x + s2 * y, angle);
        const Complex q1_cubed = q1 * q1 * q1;
        const Complex q = -y * q1 * q1 * q2 * q2 / (q1 + q2);  // [q]
        // dq_k / dx = -q_k^3 / 2 and dq_k / dy = s_k dq_k / dx.
        const Complex q1_x = -0.5 * q1_cubed;
        const Complex q_x = -0.5 * q * (q1 * q1 + q1 * q2 + q2 * q2);
        const Complex q_y = q1_x + s2 * q_x;
        std::array<Mode, 2> modes;
        const std::array<Mat2, 2> by_x = stresses(q1_x, q_x), by_y = stresses(s1 * q1_x, q_y), here = stresses(q1, q);
        // du / dy of mode I is -s_1 s_2 [p q], of mode II -[s p q], with p = a11 s^2 - a16 s + a12.
        const double a11 = a_(0, 0), a12 = a_(0, 1), a16 = a_(0, 2);
        const Complex p2 = (a11 * s2 - a16) * s2 + a12;
        const Complex p = a11 * (s1 + s2) - a16;
        const Complex sp = a11 * (s1 * s1 + s1 * s2 + s2 * s2) - a16 * (s1 + s2) + a12;
        const std::array<double, 2> shear{-(s1 * s2 * (p * q1 + p2 * q)).real(), -(sp * q1 + s2 * p2 * q).real()};
        for (int k = 0; k < 2; ++k) {
            Mode& mode = modes[k];
            mode.stress = scale * here[k];
            mode.stress_slope = {scale * by_x[k], scale * by_y[k]};
            const Eigen::Vector3d e = strain(mode.stress);
            mode.gradient << e[0], scale * shear[k], e[2] - scale * shear[k], e[1];
        }
        return modes;
    }

    /// H of G = K^T H K (Sih, Paris and Irwin 1965, eqs. 32, 33; |s_1 s_2|^2 = a22 / a11) [1/Pa].
    Mat2 release() const {
        const Complex sum = s_[0] + s_[1], product = s_[0] * s_[1];
        const double across = 0.5 * a_(0, 0) * product.imag();
        Mat2 H;
        H << -0.5 * a_(1, 1) * (sum / product).imag(), across, across, 0.5 * a_(0, 0) * sum.imag();
        return H;
    }

    /// xx, yy, 2 xy of wood at the tip under this stress.
    Eigen::Vector3d strain(const Mat2& stress) const { return a_ * Eigen::Vector3d(stress(0, 0), stress(1, 1), stress(0, 1)); }

  private:
    // z^-1/2. z and the place itself lie in the same half plane, so that both pass on to the next sheet together.
    static Complex inverse_root(const Complex& z, double angle) {
        const Complex root = std::sqrt(z);
        const Complex inverse = std::conj(root) / std::norm(root);
        return std::abs(angle) > std::numbers::pi ? -inverse : inverse;
    }

    // Both modes' stress times (2 pi)^1/2, with q1 and [q] of q = z^-1/2 or of a derivative of it:
    //     I: xx = -s_1 s_2 [s q], yy = q_1 - s_1 [q], xy = s_1 s_2 [q];   II: xx = -[s^2 q], yy = -[q], xy = [s q].
    std::array<Mat2, 2> stresses(const Complex& q1, const Complex& q) const {
        const auto& [s1, s2] = s_;
        const Complex sq = q1 + s2 * q, product = s1 * s2;
        const auto matrix = [](const Complex& xx, const Complex& yy, const Complex& xy) {
            Mat2 s;
            s << xx.real(), xy.real(), xy.real(), yy.real();
            return s;
        };
        return {matrix(-product * sq, q1 - s1 * q, product * q), matrix(-(s1 + s2) * q1 - s2 * s2 * q, -q, sq)};
    }

    Eigen::Matrix3d a_;
    std::array<Complex, 2> s_;  // roots with positive imaginary part
};

/// Of wood of this stiffness in x, y, for a crack that runs in this direction.
NearTipField near_tip_field(const Eigen::Matrix3d& stiffness, const Vec2& ahead);

}  // namespace crampfit

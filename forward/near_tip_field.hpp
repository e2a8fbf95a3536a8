#pragma once

#include "forward/deformation.hpp"

#include <complex>
#include <numbers>

namespace crampfit {

/// Elastic field around a tip of a straight crack with free faces in isotropic wood: the first term of Williams (1957), by
/// Kolosov's potentials phi = A z^1/2, psi = (conj A - A/2) z^1/2, A = (K_I - i K_II) / (2 pi)^1/2 (Muskhelishvili 1953):
///     2 mu (u + i v) = kappa phi - z conj(phi') - conj(psi),
///     s_xx + s_yy = 4 Re phi',   s_yy - s_xx + 2 i s_xy = 2 (conj(z) phi'' + psi').
/// The tip is the origin, x goes ahead of it. Angles beyond +-pi go on smoothly into the other face's side.
class NearTipField {
  public:
    /// With E' and nu' = nu in plane stress, nu / (1 - nu) in plane strain.
    NearTipField(double K_I, double K_II, double plane_modulus, double plane_poisson)
        : A_(std::complex<double>(K_I, -K_II) / std::sqrt(2.0 * std::numbers::pi)),
          mu_(plane_modulus / (2.0 * (1.0 + plane_poisson))), kappa_((3.0 - plane_poisson) / (1.0 + plane_poisson)) {}

    struct At {
        Mat2 gradient;                    // du_i / dx_j
        Mat2 stress;                      // [Pa]
        std::array<Mat2, 2> stress_slope;  // by x and by y [Pa/m]
    };

    At at(double r, double angle) const {
        using Complex = std::complex<double>;
        const Complex z = std::polar(r, angle);
        const Complex root = std::polar(std::sqrt(r), 0.5 * angle);
        const Complex B = std::conj(A_) - 0.5 * A_;
        const Complex first = 0.5 / root;  // derivatives of z^1/2
        const Complex second = -0.5 * first / z;
        const Complex third = -1.5 * second / z;
        const Complex i(0.0, 1.0);

        At field;
        const Complex by_z = kappa_ * A_ * first - std::conj(A_ * first);
        const Complex by_conjugate = -z * std::conj(A_ * second) - std::conj(B * first);
        const Complex by_x = (by_z + by_conjugate) / (2.0 * mu_);
        const Complex by_y = i * (by_z - by_conjugate) / (2.0 * mu_);
        field.gradient << by_x.real(), by_y.real(), by_x.imag(), by_y.imag();
        field.stress = stress(A_ * first, std::conj(z) * A_ * second + B * first);
        const Complex bent = std::conj(z) * A_ * third + B * second;
        field.stress_slope[0] = stress(A_ * second, A_ * second + bent);
        field.stress_slope[1] = stress(i * A_ * second, i * (bent - A_ * second));
        return field;
    }

  private:
    // From (s_xx + s_yy) / 4, of which only the real part counts, and (s_yy - s_xx + 2 i s_xy) / 2.
    static Mat2 stress(const std::complex<double>& mean, const std::complex<double>& rest) {
        Mat2 s;
        s << 2.0 * mean.real() - rest.real(), rest.imag(), rest.imag(), 2.0 * mean.real() + rest.real();
        return s;
    }

    std::complex<double> A_;  // [Pa sqrt(m)]
    double mu_;               // [Pa]
    double kappa_;
};

} // namespace crampfit

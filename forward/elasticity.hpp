#pragma once

#include "datasets/scene.hpp"

namespace crampfit {

// Stiffness and compliance of the plane problem: 3 x 3, between stress xx, yy, xy and strain xx, yy, 2 xy. A material's own axes
// are R, T; isotropic wood has no preferred ones.

/// Elastic constants of isotropic wood as the plane problem needs them: stress_xx = lambda (e_xx + e_yy) + 2 mu e_xx.
/// In plane strain lambda is Lame's; in plane stress it is 2 lambda mu / (lambda + 2 mu).
struct PlaneElasticity {
    double lambda = 0;  // [Pa]
    double mu = 0;      // [Pa]
};

PlaneElasticity plane_elasticity(double youngs_modulus, double poisson_ratio, PlaneCondition plane);

/// In the material's axes [1/Pa]. In plane strain the stress along L that keeps wood from straining there is eliminated:
/// b_ij = a_ij - a_iL a_jL / a_LL (Lekhnitskii 1963).
Eigen::Matrix3d plane_compliance(const Material& material, PlaneCondition plane);

/// In the material's axes [Pa].
Eigen::Matrix3d plane_stiffness(const Material& material, PlaneCondition plane);

/// A constant of a material, by its key in a scene without the units: E, nu of isotropic wood, the others of orthotropic.
enum class ElasticConstant { E, nu, E_R, E_T, G_RT, nu_RT, E_L, nu_LR, nu_LT };

/// Derivative of `plane_stiffness` by one constant; zero by those that the material or the plane problem does not have.
Eigen::Matrix3d plane_stiffness_slope(const Material& material, PlaneCondition plane, ElasticConstant constant);

/// Stiffness in x, y from that in axes whose first one is the unit vector `axis` and whose second stands to its left; and back.
Eigen::Matrix3d from_axes(const Eigen::Matrix3d& stiffness, const Vec2& axis);
inline Eigen::Matrix3d in_axes(const Eigen::Matrix3d& stiffness, const Vec2& axis) {
    return from_axes(stiffness, Vec2(axis.x(), -axis.y()));
}

/// Stress along x per strain along x where there is no other stress, and the same along y [Pa].
Vec2 uniaxial_moduli(const Eigen::Matrix3d& stiffness);

/// Elasticity of a small area that layers may cross. With n normal to the layers and s along them, s_nn, s_ns and e_ss are common
/// to all layers. The energy as a function of these,
///     Y = 1/2 [E' e_ss^2 + 2 (r s_nn + p s_ns) e_ss - a s_nn^2 - b s_ns^2 - 2 c s_nn s_ns],
/// is linear in the six coefficients, so that they simply average by area (Backus 1962; exact for a laminate). Isotropic wood has
///     E' = 4 mu (lambda + mu) / (lambda + 2 mu),   r = lambda / (lambda + 2 mu),   a = 1 / (lambda + 2 mu),   b = 1 / mu
/// whatever n; it and orthotropic wood in its own axes have p = c = 0.
struct LayeredElasticity {
    using Coefficients = Eigen::Matrix<double, 6, 1>;
    Coefficients coefficients = Coefficients::Zero();  // E' [Pa], r [1], a [1/Pa], b [1/Pa], p [1], c [1/Pa]
    Vec2 normal = Vec2::UnitX();                       // n, unit

    /// In x, y.
    Eigen::Matrix3d stiffness() const;
};

LayeredElasticity layered(const PlaneElasticity& isotropic);

/// The coefficients of wood of this stiffness in x, y for layers across `normal`.
LayeredElasticity layered(const Eigen::Matrix3d& stiffness, const Vec2& normal);

/// Speed of the surface wave that runs along x in wood of this stiffness [m/s]: the root of the secular equation of orthotropic
/// wood whose axes are x and y (Vinh and Ogden 2004, eq. 1); where they are not, the coupling of stretch and shear is left out.
double rayleigh_speed(const Eigen::Matrix3d& stiffness, double density);

}  // namespace crampfit

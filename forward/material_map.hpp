#pragma once

#include "datasets/scene.hpp"

namespace crampfit {

/// Elastic constants of isotropic wood as the plane problem needs them: stress_xx = lambda (e_xx + e_yy) + 2 mu e_xx.
/// In plane strain lambda is Lame's; in plane stress it is 2 lambda mu / (lambda + 2 mu).
struct PlaneElasticity {
    double lambda = 0;  // [Pa]
    double mu = 0;      // [Pa]
};

/// Elasticity of a small area that layers may cross. With n normal to the layers and s along them, s_nn, s_ns and e_ss are common
/// to all layers. The energy as a function of these,
///     Y = 1/2 [E' e_ss^2 + 2 r s_nn e_ss - a s_nn^2 - b s_ns^2],   E' = 4 mu (lambda + mu) / (lambda + 2 mu),
///     r = lambda / (lambda + 2 mu),   a = 1 / (lambda + 2 mu),   b = 1 / mu,
/// is linear in the four coefficients, so that they simply average by area (Backus 1962; exact for a laminate).
struct LayeredElasticity {
    Eigen::Vector4d coefficients = Eigen::Vector4d::Zero();  // E' [Pa], r [1], a [1/Pa], b [1/Pa]
    Vec2 normal = Vec2::UnitX();                             // n, unit

    /// Stress xx, yy, xy from strain xx, yy, 2 xy [Pa].
    Eigen::Matrix3d stiffness() const;
};

LayeredElasticity layered(const PlaneElasticity& isotropic);

/// What wood is made of at a place, or on average over an area.
struct LocalWood {
    LayeredElasticity elasticity;
    double density = 0;          // [kg/m^3]
    double toughness = 0;        // [J/m^2]
    double poisson_ratio = 0;    // for the stress out of the plane
    double filled = 0;           // share of the area that is not void
    double latewood = 0;         // 0 first material .. 1 last, for pictures

    /// E' = E in plane stress, E / (1 - nu^2) in plane strain [Pa].
    double plane_modulus() const { return elasticity.coefficients[0]; }
    double shear_modulus() const { return 1.0 / elasticity.coefficients[3]; }  // [Pa]
};

PlaneElasticity plane_elasticity(double youngs_modulus, double poisson_ratio, PlaneCondition plane);

/// The scene's wood by place: one material, analytic rings, or a picture. Cutouts are not its business.
/// Between EW and LW the density goes linearly and E and toughness follow it as a power law through both ends,
/// p = p_EW (rho / rho_EW)^n; Poisson's ratio goes linearly.
class MaterialMap {
  public:
    explicit MaterialMap(const Scene& scene);

    /// At a place. Outside a picture the nearest pixel counts, so that rounding at the edge costs no points.
    LocalWood at(const Vec2& x) const;

    /// Averaged over an upright rectangle: elasticity as layers across the direction in which the wood changes most, the rest by
    /// area.
    LocalWood average(const Vec2& centre, const Vec2& half) const;

    bool homogeneous() const { return homogeneous_; }

  private:
    LocalWood mix(int first, int second, double grade) const;
    LocalWood in_rings(const Vec2& x) const;
    LocalWood in_picture(const Vec2& x) const;

    const Scene& scene_;
    std::vector<IsotropicMaterial> materials_;  // in the order of labels
    std::vector<LocalWood> pure_;               // the same, ready made
    Vec2 picture_offset_ = Vec2::Zero();        // [m]
    double picture_cos_ = 1.0;
    double picture_sin_ = 0.0;
    double finest_ = 0.0;                       // size of the finest detail to average over [m]; 0: none
    bool homogeneous_ = true;
};

} // namespace crampfit

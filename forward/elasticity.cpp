#include "forward/elasticity.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace crampfit {

PlaneElasticity plane_elasticity(double youngs_modulus, double poisson_ratio, PlaneCondition plane) {
    const double mu = youngs_modulus / (2.0 * (1.0 + poisson_ratio));
    const double lambda = youngs_modulus * poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio));
    return {plane == PlaneCondition::strain ? lambda : 2.0 * lambda * mu / (lambda + 2.0 * mu), mu};
}

namespace {

Eigen::Matrix3d compliance_of(double rr, double tt, double rt, double shear) {
    Eigen::Matrix3d b;
    b << rr, rt, 0, rt, tt, 0, 0, 0, shear;
    return b;
}

// Derivative of the compliance by one constant.
Eigen::Matrix3d compliance_slope(const OrthotropicElasticity& wood, bool strain, ElasticConstant constant) {
    const auto& [E_R, E_T, G_RT, nu_RT, E_L, nu_LR, nu_LT] = wood;
    if (constant == ElasticConstant::E_R) return compliance_of(-1.0 / (E_R * E_R), 0, nu_RT / (E_R * E_R), 0);
    if (constant == ElasticConstant::E_T) return compliance_of(0, -1.0 / (E_T * E_T), 0, 0);
    if (constant == ElasticConstant::G_RT) return compliance_of(0, 0, 0, -1.0 / (G_RT * G_RT));
    if (constant == ElasticConstant::nu_RT) return compliance_of(0, 0, -1.0 / E_R, 0);
    if (strain && constant == ElasticConstant::E_L)
        return compliance_of(nu_LR * nu_LR, nu_LT * nu_LT, nu_LR * nu_LT, 0) / (E_L * E_L);
    if (strain && constant == ElasticConstant::nu_LR) return compliance_of(-2.0 * nu_LR, 0, -nu_LT, 0) / E_L;
    if (strain && constant == ElasticConstant::nu_LT) return compliance_of(0, -2.0 * nu_LT, -nu_LR, 0) / E_L;
    return Eigen::Matrix3d::Zero();
}

}  // namespace

Eigen::Matrix3d plane_compliance(const Material& material, PlaneCondition plane) {
    const bool strain = plane == PlaneCondition::strain;
    if (!material.orthotropic) {
        const double E = material.youngs_modulus, nu = material.poisson_ratio;
        const double own = strain ? 1.0 - nu * nu : 1.0, cross = strain ? nu * (1.0 + nu) : nu;
        return compliance_of(own, own, -cross, 2.0 * (1.0 + nu)) / E;
    }
    const auto& [E_R, E_T, G_RT, nu_RT, E_L, nu_LR, nu_LT] = *material.orthotropic;
    const Eigen::Matrix3d free = compliance_of(1.0 / E_R, 1.0 / E_T, -nu_RT / E_R, 1.0 / G_RT);
    if (!strain) return free;
    return free - compliance_of(nu_LR * nu_LR, nu_LT * nu_LT, nu_LR * nu_LT, 0) / E_L;
}

Eigen::Matrix3d plane_stiffness(const Material& material, PlaneCondition plane) {
    if (!material.orthotropic)
        return layered(plane_elasticity(material.youngs_modulus, material.poisson_ratio, plane)).stiffness();
    return plane_compliance(material, plane).inverse();
}

Eigen::Matrix3d plane_stiffness_slope(const Material& material, PlaneCondition plane, ElasticConstant constant) {
    const Eigen::Matrix3d C = plane_stiffness(material, plane);
    const bool strain = plane == PlaneCondition::strain;
    if (material.orthotropic) return -C * compliance_slope(*material.orthotropic, strain, constant) * C;
    if (constant == ElasticConstant::E) return C / material.youngs_modulus;
    if (constant != ElasticConstant::nu) return Eigen::Matrix3d::Zero();
    const double nu = material.poisson_ratio;
    const Eigen::Matrix3d slope =
        compliance_of(strain ? -2.0 * nu : 0.0, strain ? -2.0 * nu : 0.0, strain ? -1.0 - 2.0 * nu : -1.0, 2.0);
    return -C * slope * C / material.youngs_modulus;
}

Eigen::Matrix3d from_axes(const Eigen::Matrix3d& stiffness, const Vec2& axis) {
    const double cc = axis.x() * axis.x();
    const double ss = axis.y() * axis.y();
    const double cs = axis.x() * axis.y();
    Eigen::Matrix3d turn;  // strain along and across the axis from strain xx, yy, 2 xy
    turn << cc, ss, cs, ss, cc, -cs, -2 * cs, 2 * cs, cc - ss;
    return turn.transpose() * stiffness * turn;
}

LayeredElasticity layered(const PlaneElasticity& isotropic) {
    const auto& [l, m] = isotropic;
    const double a = 1.0 / (l + 2.0 * m);
    LayeredElasticity wood;
    wood.coefficients << 4.0 * m * (l + m) * a, l * a, a, 1.0 / m, 0, 0;
    return wood;
}

LayeredElasticity layered(const Eigen::Matrix3d& stiffness, const Vec2& normal) {
    const Eigen::Matrix3d C = in_axes(stiffness, normal);
    const double det = C(0, 0) * C(2, 2) - C(0, 2) * C(0, 2);
    const double a = C(2, 2) / det, b = C(0, 0) / det, c = -C(0, 2) / det;
    const double r = a * C(0, 1) + c * C(1, 2);
    const double p = c * C(0, 1) + b * C(1, 2);
    LayeredElasticity wood;
    wood.coefficients << C(1, 1) - r * C(0, 1) - p * C(1, 2), r, a, b, p, c;
    wood.normal = normal;
    return wood;
}

Eigen::Matrix3d LayeredElasticity::stiffness() const {
    const auto& [e, r, a, b, p, c] =
        std::tuple(coefficients[0], coefficients[1], coefficients[2], coefficients[3], coefficients[4], coefficients[5]);
    const double det = a * b - c * c;
    const double nn = b / det, ns_ns = a / det, nn_ns = -c / det;
    const double nn_ss = nn * r + nn_ns * p;
    const double ss_ns = nn_ns * r + ns_ns * p;
    Eigen::Matrix3d across;  // in n, s
    across << nn, nn_ss, nn_ns, nn_ss, e + r * nn_ss + p * ss_ns, ss_ns, nn_ns, ss_ns, ns_ns;
    return from_axes(across, normal);
}

Vec2 uniaxial_moduli(const Eigen::Matrix3d& stiffness) { return stiffness.inverse().diagonal().head<2>().cwiseInverse(); }

double rayleigh_speed(const Eigen::Matrix3d& stiffness, double density) {
    const double c11 = stiffness(0, 0), c22 = stiffness(1, 1), c12 = stiffness(0, 1), c66 = stiffness(2, 2);
    const auto secular = [&](double x) {  // x is density times speed squared; falls through its only root
        return std::sqrt(c66 - x) * (c11 * c22 - c12 * c12 - c22 * x) - x * std::sqrt(c22 * c66 * (c11 - x));
    };
    double low = 0.0, high = std::min(c66, c11);
    for (int k = 0; k < 40; ++k) {
        const double middle = 0.5 * (low + high);
        (secular(middle) > 0.0 ? low : high) = middle;
    }
    return std::sqrt(low / density);
}

}  // namespace crampfit

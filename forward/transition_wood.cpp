#include "forward/transition_wood.hpp"

#include <cmath>

namespace crampfit {

namespace {

OrthotropicElasticity orthotropic(const Material& wood) {
    if (wood.orthotropic) return *wood.orthotropic;
    const double E = wood.youngs_modulus, nu = wood.poisson_ratio;
    return {E, E, 0.5 * E / (1.0 + nu), nu, E, nu, nu};
}

// How far along its way from one end to the other a constant is.
class DensityLaw {
  public:
    DensityLaw(double first, double second, double grade)
        : span_(std::log(second / first)), here_(std::log((first + grade * (second - first)) / first)), grade_(grade) {}

    // Linear in density^exponent; without one the power of density through both ends. Ends of equal density leave the grade
    // itself.
    double between(double first, double second, const std::optional<double>& exponent) const {
        const bool level = std::abs(span_) < 1e-12;
        if (!exponent) return first * std::pow(second / first, level ? grade_ : here_ / span_);
        return first + (second - first) * (level ? grade_ : std::expm1(*exponent * here_) / std::expm1(*exponent * span_));
    }

    double ratio(double first, double second) const { return first + grade_ * (second - first); }

  private:
    double span_;  // log of the ratio of densities
    double here_;
    double grade_;
};

}  // namespace

Material transition_wood(const Material& first, const Material& second, const DensityExponents& exponents, double grade) {
    const DensityLaw law(first.density, second.density, grade);
    Material wood;
    wood.density = first.density + grade * (second.density - first.density);
    wood.toughness = law.between(first.toughness, second.toughness, exponents.toughness);
    if (!first.orthotropic && !second.orthotropic) {
        wood.youngs_modulus = law.between(first.youngs_modulus, second.youngs_modulus, exponents.E);
        wood.poisson_ratio = law.ratio(first.poisson_ratio, second.poisson_ratio);
        return wood;
    }
    const OrthotropicElasticity a = orthotropic(first), b = orthotropic(second);
    wood.orthotropic = {law.between(a.E_R, b.E_R, exponents.E_R),
                        law.between(a.E_T, b.E_T, exponents.E_T),
                        law.between(a.G_RT, b.G_RT, exponents.G_RT),
                        law.ratio(a.nu_RT, b.nu_RT),
                        law.between(a.E_L, b.E_L, exponents.E_L),
                        law.ratio(a.nu_LR, b.nu_LR),
                        law.ratio(a.nu_LT, b.nu_LT)};
    return wood;
}

}  // namespace crampfit

#pragma once

#include "datasets/scene.hpp"

#include <variant>
#include <vector>

namespace crampfit {

// Laws of wood whose stress hangs on the way to a strain. What they remember is a row of numbers a point, which a step takes from
// `before` to `now`. Strains are those of the frame that turns with the point, so that turning alone changes nothing.

/// Stress or strain at a point: xx, yy, zz, xy; of a strain the last is twice the shear.
using Tensor = Eigen::Vector4d;

struct IsotropicModuli {
    double bulk = 0;   // K [Pa]
    double shear = 0;  // G [Pa]

    static IsotropicModuli of(const Material& material);
    Tensor stress(const Tensor& strain) const;
    Eigen::Matrix4d stiffness() const;
};

/// Stress at the end of a step, and its derivative by the strain there.
struct Response {
    Tensor stress;            // [Pa]
    Eigen::Matrix4d tangent;  // symmetric [Pa]
};

/// A spring beside Maxwell elements, a spring and a dashpot in line each. With the strain going evenly over a step the strain a
/// of an element's spring is exactly
///     a' = exp(-x) a + (1 - exp(-x)) / x (strain' - strain),   x = step / tau
/// (Taylor, Pister and Goudreau 1970, eq. 12; Simo and Hughes 1998, sec. 10.3).
/// Remembers: strain zz, xx, yy, 2 xy; what the dashpots have taken [J/m^3]; a of each element.
class ViscoelasticLaw {
  public:
    explicit ViscoelasticLaw(const Material& material);

    int variables() const { return 5 + 4 * static_cast<int>(elements_.size()); }
    void prepare(double step);  // [s]
    Response respond(const Tensor& strain, const double* before, double* now) const;
    Tensor stress(const Tensor& strain, const double* state) const;
    double stored(const Tensor& strain, const double* state) const;  // in the springs [J/m^3]
    double dissipated(const double* state) const { return state[4]; }
    double stiffness() const { return instantaneous_; }

  private:
    struct Element {
        IsotropicModuli moduli;
        double tau;                      // [s]
        double left = 1.0, taken = 1.0;  // of a before the step, and of the strain's change in it
        std::array<double, 3> lost{};  // of the quadratic form of moduli: by a with a, a with the change, the change with itself
    };
    IsotropicModuli lasting_;
    double instantaneous_;  // K + 4/3 G [Pa]
    std::vector<Element> elements_;
    Eigen::Matrix4d tangent_;  // the same for all points
};

/// J2 plasticity by radial return (Simo and Taylor 1985; Simo and Hughes 1998, box 3.2), rate-independent.
/// Remembers: strain zz; plastic strain xx, yy, 2 xy; equivalent plastic strain.
class PlasticLaw {
  public:
    explicit PlasticLaw(const Material& material);

    int variables() const { return 5; }
    void prepare(double) {}
    Response respond(const Tensor& strain, const double* before, double* now) const;
    Tensor stress(const Tensor& strain, const double* state) const;
    double stored(const Tensor& strain, const double* state) const;  // elastic [J/m^3]

    /// All plastic work, int flow stress d(equivalent plastic strain): what hardening stores does not come back either.
    double dissipated(const double* state) const;
    double stiffness() const { return moduli_.bulk + 4.0 / 3.0 * moduli_.shear; }

  private:
    double flow_stress(double plastic_strain) const;  // [Pa]
    double hardening(double plastic_strain) const;    // its slope [Pa]

    IsotropicModuli moduli_;
    Plasticity plasticity_;
};

/// Stress xx, yy, xy in plane strain or plane stress, and its derivative by strain xx, yy, 2 xy.
struct PlaneResponse {
    Eigen::Vector3d stress;   // [Pa]
    Eigen::Matrix3d tangent;  // [Pa]
};

class MemoryLaw {
  public:
    MemoryLaw(const Material& material, PlaneCondition plane);

    int variables() const;
    void prepare(double step);  // how long the next steps are [s]

    /// In plane stress the strain zz that leaves no stress zz is found by Newton's method.
    PlaneResponse respond(const Eigen::Vector3d& strain, const double* before, double* now) const;

    // Of a state that a step has led to, with the strain xx, yy, 2 xy there.
    Tensor stress(const Eigen::Vector3d& strain, const double* state) const;  // [Pa]
    double stored(const Eigen::Vector3d& strain, const double* state) const;  // [J/m^3]
    double dissipated(const double* state) const;                             // [J/m^3]

  private:
    std::variant<ViscoelasticLaw, PlasticLaw> law_;
    bool plane_stress_;
};

}  // namespace crampfit

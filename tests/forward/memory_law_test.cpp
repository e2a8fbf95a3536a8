// Laws of wood that remembers, against closed forms.
#include "forward/deformation.hpp"
#include "forward/elasticity.hpp"
#include "forward/memory_law.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdio>
#include <numbers>

namespace crampfit::test {
namespace {

using std::numbers::pi;
using Strain = Eigen::Vector3d;

Material viscoelastic() {
    Material wood{40e6, 0.33, 300.0, 100.0};
    wood.viscoelastic = Viscoelasticity{{{0.3, 0.1, 0.5}, {0.4, 0.0, 7.0}}};
    return wood;
}

Material plastic(double hardening = 2e6) {
    Material wood{40e6, 0.33, 300.0, 100.0};
    wood.plastic = Plasticity{1e6, hardening, Plasticity::Saturation{1.6e6, 0.02}};
    return wood;
}

/// A law and what it remembers.
struct Point {
    Point(const Material& material, PlaneCondition plane) : law(material, plane), state(law.variables(), 0.0) {}

    PlaneResponse go(const Strain& strain, double step) {
        law.prepare(step);
        std::vector<double> next(state.size());
        const PlaneResponse response = law.respond(strain, state.data(), next.data());
        state = next;
        return response;
    }

    MemoryLaw law;
    std::vector<double> state;
};

double shear_modulus(const Material& m) { return m.youngs_modulus / (2 * (1 + m.poisson_ratio)); }
double bulk_modulus(const Material& m) { return m.youngs_modulus / (3 * (1 - 2 * m.poisson_ratio)); }

/// int_0^t M(s) ds of M(t) = M0 [1 - sum m_i (1 - exp(-t / tau_i))], so that a strain that goes evenly from 0 has this stress per
/// rate.
template <class Share>
double integrated(double modulus, const Material& material, double t, const Share& share) {
    double sum = t;
    for (const PronyTerm& term : material.viscoelastic->prony) sum -= share(term) * (t + term.tau * std::expm1(-t / term.tau));
    return modulus * sum;
}

// The recursion is exact where strain goes evenly between the ends of steps, whatever their length: a ramp, then a hold, in
// uneven steps, against the convolution of the moduli.
TEST(VerificationMemoryLaw, RampAndHoldAreTheConvolution) {
    const Material wood = viscoelastic();
    const Strain full(0.01, -0.004, 0.006);
    const double ramp = 2.0;
    Point point(wood, PlaneCondition::strain);
    double time = 0.0, worst = 0.0;
    for (const double step : {0.3, 1e-7, 1.1, 0.5999999, 0.01, 3.0, 40.0}) {
        time += step;
        const PlaneResponse found = point.go(std::min(1.0, time / ramp) * full, step);
        const auto both = [&](double modulus, auto share) {
            return (integrated(modulus, wood, time, share) - integrated(modulus, wood, std::max(0.0, time - ramp), share)) / ramp;
        };
        const double shear = both(shear_modulus(wood), [](const PronyTerm& t) { return t.g; });
        const double bulk = both(bulk_modulus(wood), [](const PronyTerm& t) { return t.k; });
        const double mean = (full[0] + full[1]) / 3;
        const Strain expected(3 * bulk * mean + 2 * shear * (full[0] - mean), 3 * bulk * mean + 2 * shear * (full[1] - mean),
                              shear * full[2]);
        worst = std::max(worst, (found.stress - expected).norm() / expected.norm());
    }
    std::printf("ramp and hold: worst error %.1e\n", worst);
    EXPECT_LT(worst, 1e-13);
}

// In a closed cycle of small strain the dashpots take pi E'' e0^2, with the loss modulus of the series (Ferry 1980, eq. 3.27);
// stress and strain leave a loss angle atan(E'' / E').
TEST(VerificationMemoryLaw, HarmonicLoss) {
    const Material wood = viscoelastic();
    const double omega = 1.3, e0 = 0.01;
    std::complex<double> modulus = shear_modulus(wood);
    for (const PronyTerm& term : wood.viscoelastic->prony)
        modulus -= shear_modulus(wood) * term.g / std::complex<double>(1.0, omega * term.tau);
    for (const int steps : {40, 80}) {
        Point point(wood, PlaneCondition::strain);
        const int cycles = 30;  // the longest relaxation is 1.4 of them
        double before = 0.0, sine = 0.0, cosine = 0.0;
        for (int k = 1; k <= cycles * steps; ++k) {
            if (k == (cycles - 1) * steps + 1) before = point.law.dissipated(point.state.data());
            const double angle = 2 * pi * k / steps;
            const PlaneResponse found = point.go({0.0, 0.0, e0 * std::sin(angle)}, 2 * pi / omega / steps);
            if (k <= (cycles - 1) * steps) continue;
            sine += 2.0 / steps * found.stress[2] * std::sin(angle);
            cosine += 2.0 / steps * found.stress[2] * std::cos(angle);
        }
        const double lost = point.law.dissipated(point.state.data()) - before;
        std::printf("%d steps a cycle: loss angle %.6f (exact %.6f), energy lost off by %.2e\n", steps, std::atan2(cosine, sine),
                    std::arg(modulus), lost / (pi * modulus.imag() * e0 * e0) - 1);
        // The strain is taken for straight lines between points of a sine, which miss it by (pi / steps)^2 / 2 in the middle.
        const double missed = 0.5 * pi * pi / (steps * steps);
        EXPECT_NEAR(std::atan2(cosine, sine), std::arg(modulus), missed * std::arg(modulus));
        EXPECT_NEAR(lost / (pi * modulus.imag() * e0 * e0), 1.0, 2 * missed);
    }
}

// Work = stored + dissipated: of a ramp, with the work from the convolution's exact integral int s de = rate^2 int_0^T (T - t)
// M(t) dt.
TEST(VerificationMemoryLaw, ViscousWorkIsStoredOrDissipated) {
    const Material wood = viscoelastic();
    const double T = 3.0, rate = 0.01;
    double work = 0.5 * T * T;
    for (const PronyTerm& term : wood.viscoelastic->prony)
        work -= term.g * (0.5 * T * T - term.tau * T - term.tau * term.tau * std::expm1(-T / term.tau));
    work *= shear_modulus(wood) * rate * rate;
    for (const int steps : {1, 7}) {
        Point point(wood, PlaneCondition::strain);
        for (int k = 1; k <= steps; ++k) point.go({0.0, 0.0, rate * T * k / steps}, T / steps);
        const double kept = point.law.stored({0.0, 0.0, rate * T}, point.state.data()) + point.law.dissipated(point.state.data());
        EXPECT_NEAR(kept, work, 1e-12 * work);
    }
}

// Uniaxial stress in plane stress, yielding and back: bilinear with E H / (E + H), unloading with E (isotropic hardening, no
// saturation).
TEST(VerificationMemoryLaw, BarYieldsUnloadsYieldsAgain) {
    Material wood = plastic(8e6);
    wood.plastic->saturation.reset();
    const double E = wood.youngs_modulus, H = 8e6, Y = 1e6;
    const double tangent = E * H / (E + H);
    Point point(wood, PlaneCondition::stress);
    double across = 0.0, worst = 0.0;
    const auto pull = [&](double strain) {
        PlaneResponse found;
        const std::vector<double> before = point.state;
        for (int k = 0; k < 50; ++k) {  // the strain across that leaves no stress there
            point.state = before;
            found = point.go({strain, across, 0.0}, 0.0);
            if (std::abs(found.stress[1]) < 1e-12 * E) break;
            across -= found.stress[1] / found.tangent(1, 1);
        }
        return found.stress[0];
    };
    const double first = 0.06, back = 0.02, last = 0.1;
    const double at_first = Y + tangent * (first - Y / E);
    for (double e = 0.005; e <= first; e += 0.005)
        worst = std::max(worst, std::abs(pull(e) - std::min(E * e, Y + tangent * (e - Y / E))));
    worst = std::max(worst, std::abs(pull(back) - (at_first - E * (first - back))));
    worst = std::max(worst, std::abs(pull(first) - at_first));
    worst = std::max(worst, std::abs(pull(last) - (at_first + tangent * (last - first))));
    std::printf("bar: worst stress off by %.1e of the yield stress\n", worst / Y);
    EXPECT_LT(worst, 1e-9 * Y);
}

// Pure shear flows at the flow stress over sqrt(3), whatever the plane, with the hardening of Voce.
TEST(VerificationMemoryLaw, ShearFollowsVoce) {
    const Material wood = plastic();
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        Point point(wood, plane);
        double stress = 0.0, shear = 0.0;
        for (int k = 1; k <= 40; ++k) stress = point.go({0.0, 0.0, shear = 0.005 * k}, 0.0).stress[2];
        const double a = (shear - stress / shear_modulus(wood)) / std::sqrt(3.0);  // equivalent plastic strain
        const double flow = 1e6 + 2e6 * a + 0.6e6 * (1 - std::exp(-a / 0.02));
        EXPECT_NEAR(stress, flow / std::sqrt(3.0), 1e-10 * flow);
        EXPECT_NEAR(point.state[4], a, 1e-12);
        const double work = 1e6 * a + 1e6 * a * a + 0.6e6 * (a - 0.02 * (1 - std::exp(-a / 0.02)));
        EXPECT_NEAR(point.law.dissipated(point.state.data()), work, 1e-10 * work);
    }
}

TEST(GradientMemoryLaw, TangentIsTheSlopeOfTheStress) {
    for (const Material& wood : {viscoelastic(), plastic(), plastic(0.0)})
        for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
            Point start(wood, plane);
            start.go({0.04, -0.01, 0.05}, 1.0);
            const Strain here(0.07, 0.01, -0.02);
            const Eigen::Matrix3d tangent = Point(start).go(here, 0.7).tangent;
            Eigen::Matrix3d differences;
            const double h = 1e-6;
            for (int k = 0; k < 3; ++k)
                differences.col(k) = (Point(start).go(here + h * Strain::Unit(k), 0.7).stress -
                                      Point(start).go(here - h * Strain::Unit(k), 0.7).stress) /
                                     (2 * h);
            EXPECT_LT((tangent - differences).norm(), 1e-7 * tangent.norm());
            EXPECT_LT((tangent - tangent.transpose()).norm(), 1e-12 * tangent.norm());
        }
}

TEST(UnitMemoryLaw, PlaneStressLeavesNoStressOutOfThePlane) {
    for (const Material& wood : {viscoelastic(), plastic(), plastic(0.0)})
        for (const double nu : {-0.5, 0.0, 0.33, 0.49}) {
            Material other = wood;
            other.poisson_ratio = nu;
            Point point(other, PlaneCondition::stress);
            for (const Strain& strain : {Strain(0.02, 0.0, 0.03), Strain(0.3, -0.2, 0.1), Strain(-0.1, 0.05, 0.0)}) {
                point.go(strain, 0.4);
                EXPECT_LT(std::abs(point.law.stress(strain, point.state.data())[2]), 1e-11 * other.youngs_modulus);
            }
        }
}

// At once, before anything has relaxed or flowed, both laws are elastic with E and nu.
TEST(UnitMemoryLaw, IsElasticAtOnce) {
    for (const Material& wood : {viscoelastic(), plastic()})
        for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
            const Strain strain(0.003, -0.001, 0.002);
            const Eigen::Matrix3d C = plane_stiffness(Material{40e6, 0.33, 300.0, 100.0}, plane);
            const PlaneResponse found = Point(wood, plane).go(strain, 0.0);
            EXPECT_LT((found.stress - C * strain).norm(), 1e-12 * (C * strain).norm());
            EXPECT_LT((found.tangent - C).norm(), 1e-12 * C.norm());
        }
}

// Simple shear that turns the axes of strain, then a turn by 90 degrees and by ten turns as a whole: the stress turns with the
// point.
TEST(VerificationMemoryLaw, TurningLeavesTheStress) {
    for (const Material& wood : {viscoelastic(), plastic()}) {
        Point point(wood, PlaneCondition::strain);
        Mat2 shear = Mat2::Zero();
        const auto go = [&](const Mat2& gradient, double step) {
            return state_with(gradient, true, [&](const Strain& strain) { return point.go(strain, step).stress; }).stress;
        };
        for (int k = 1; k <= 20; ++k) {
            shear(0, 1) = 0.02 * k;
            go(shear, 0.1);
        }
        const std::vector<double> state = point.state;
        const double taken = point.law.dissipated(state.data());
        const Mat2 before = go(shear, 0.0);
        for (const double angle : {0.5 * pi, 20.0 * pi}) {
            Mat2 turn;
            turn << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
            const Mat2 after = go(turn * (Mat2::Identity() + shear) - Mat2::Identity(), 0.0);
            EXPECT_LT((after - turn * before).norm(), 1e-11 * before.norm());
        }
        EXPECT_NEAR(point.law.dissipated(point.state.data()), taken, 1e-12 * taken);
    }
}

}  // namespace
}  // namespace crampfit::test

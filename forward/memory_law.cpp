#include "forward/memory_law.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

namespace {

constexpr double rounding = 1e-13;

const Tensor unit(1.0, 1.0, 1.0, 0.0);

double trace(const Tensor& t) { return t[0] + t[1] + t[2]; }

Tensor deviator(const Tensor& stress) { return stress - trace(stress) / 3.0 * unit; }

double contract(const Tensor& stress, const Tensor& strain) {
    return stress.dot(strain);
}  // the shear counts twice in the strain

// Of a stress deviator, by von Mises.
double equivalent(const Tensor& s) { return std::sqrt(1.5 * (s.head<3>().squaredNorm() + 2.0 * s[3] * s[3])); }

// The strain whose zz comes first in what is remembered.
Tensor remembered_strain(const double* state) { return {state[1], state[2], state[0], state[3]}; }

}  // namespace

IsotropicModuli IsotropicModuli::of(const Material& material) {
    const double E = material.youngs_modulus, nu = material.poisson_ratio;
    return {E / (3.0 * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))};
}

Tensor IsotropicModuli::stress(const Tensor& strain) const {
    Tensor s = (bulk - 2.0 / 3.0 * shear) * trace(strain) * unit + 2.0 * shear * strain;
    s[3] = shear * strain[3];
    return s;
}

Eigen::Matrix4d IsotropicModuli::stiffness() const {
    Eigen::Matrix4d C = (bulk - 2.0 / 3.0 * shear) * unit * unit.transpose();
    C.diagonal() += Tensor(2.0, 2.0, 2.0, 1.0) * shear;
    return C;
}

ViscoelasticLaw::ViscoelasticLaw(const Material& material) : lasting_(IsotropicModuli::of(material)) {
    const IsotropicModuli all = lasting_;
    instantaneous_ = all.bulk + 4.0 / 3.0 * all.shear;
    for (const PronyTerm& term : material.viscoelastic->prony) {
        const IsotropicModuli moduli{term.k * all.bulk, term.g * all.shear};
        elements_.push_back({moduli, term.tau});
        lasting_.bulk -= moduli.bulk;
        lasting_.shear -= moduli.shear;
    }
    prepare(0.0);
}

// While the strain goes evenly a(t) = b + (a - b) exp(-t / tau) with b = change / x, and the dashpot takes int a C a dt / tau, a
// sum of three products of a and the change with the factors `lost`; the last one is a small difference where x is small, and a
// series there.
void ViscoelasticLaw::prepare(double step) {
    constexpr double small = 0.01;
    tangent_ = lasting_.stiffness();
    for (Element& e : elements_) {
        const double x = step / e.tau;
        const double gone = -std::expm1(-x);  // 1 - exp(-x)
        e.left = 1.0 - gone;
        e.taken = x > 0.0 ? gone / x : 1.0;
        e.lost = {0.5 * gone * (1.0 + e.left), x > 0.0 ? gone * gone / x : 0.0,
                  x > small ? (x - 0.5 * gone * (3.0 - e.left)) / (x * x) : x * (1.0 / 3.0 - x * (0.25 - x * 7.0 / 60.0))};
        tangent_ += e.taken * e.moduli.stiffness();
    }
}

Response ViscoelasticLaw::respond(const Tensor& strain, const double* before, double* now) const {
    const Tensor change = strain - remembered_strain(before);
    now[1] = strain[0];
    now[2] = strain[1];
    now[3] = strain[3];
    now[4] = before[4];
    Response response{lasting_.stress(strain), tangent_};
    for (std::size_t k = 0; k < elements_.size(); ++k) {
        const Element& e = elements_[k];
        const Eigen::Map<const Tensor> a(before + 5 + 4 * k);
        const Tensor pull = e.moduli.stress(change);
        now[4] +=
            e.lost[0] * contract(e.moduli.stress(a), a) + e.lost[1] * contract(pull, a) + e.lost[2] * contract(pull, change);
        const Tensor spring = e.left * a + e.taken * change;
        Eigen::Map<Tensor>(now + 5 + 4 * k) = spring;
        response.stress += e.moduli.stress(spring);
    }
    return response;
}

Tensor ViscoelasticLaw::stress(const Tensor& strain, const double* state) const {
    Tensor sum = lasting_.stress(strain);
    for (std::size_t k = 0; k < elements_.size(); ++k)
        sum += elements_[k].moduli.stress(Eigen::Map<const Tensor>(state + 5 + 4 * k));
    return sum;
}

double ViscoelasticLaw::stored(const Tensor& strain, const double* state) const {
    double sum = 0.5 * contract(lasting_.stress(strain), strain);
    for (std::size_t k = 0; k < elements_.size(); ++k) {
        const Tensor a = Eigen::Map<const Tensor>(state + 5 + 4 * k);
        sum += 0.5 * contract(elements_[k].moduli.stress(a), a);
    }
    return sum;
}

PlasticLaw::PlasticLaw(const Material& material) : moduli_(IsotropicModuli::of(material)), plasticity_(*material.plastic) {}

double PlasticLaw::flow_stress(double a) const {
    double stress = plasticity_.yield_stress + plasticity_.hardening * a;
    if (const auto& limit = plasticity_.saturation)
        stress -= (limit->stress - plasticity_.yield_stress) * std::expm1(-a / limit->strain);
    return stress;
}

double PlasticLaw::hardening(double a) const {
    double slope = plasticity_.hardening;
    if (const auto& limit = plasticity_.saturation)
        slope += (limit->stress - plasticity_.yield_stress) / limit->strain * std::exp(-a / limit->strain);
    return slope;
}

Tensor PlasticLaw::stress(const Tensor& strain, const double* state) const {
    return moduli_.stress(strain - Tensor(state[1], state[2], -state[1] - state[2], state[3]));
}

double PlasticLaw::stored(const Tensor& strain, const double* state) const {
    const Tensor elastic = strain - Tensor(state[1], state[2], -state[1] - state[2], state[3]);
    return 0.5 * contract(moduli_.stress(elastic), elastic);
}

double PlasticLaw::dissipated(const double* state) const {
    const double a = state[4];
    double work = plasticity_.yield_stress * a + 0.5 * plasticity_.hardening * a * a;
    if (const auto& limit = plasticity_.saturation)
        work += (limit->stress - plasticity_.yield_stress) * (a + limit->strain * std::expm1(-a / limit->strain));
    return work;
}

Response PlasticLaw::respond(const Tensor& strain, const double* before, double* now) const {
    std::copy_n(before + 1, 4, now + 1);
    Response response{stress(strain, before), moduli_.stiffness()};
    const Tensor trial = deviator(response.stress);
    const double size = equivalent(trial);
    const double excess = size - flow_stress(before[4]);
    if (excess <= 0.0) return response;
    // size - 3 G da = flow stress(a + da): the left side less the right falls, and is convex as hardening wears off, so that
    // Newton's method comes to da from below.
    double da = 0.0;
    for (double off = excess; off > rounding * size;) {
        const double next = da + off / (3.0 * moduli_.shear + hardening(before[4] + da));
        if (!(next > da)) break;
        da = next;
        off = size - 3.0 * moduli_.shear * da - flow_stress(before[4] + da);
    }
    const Tensor normal = 1.5 / size * trial;  // of the equivalent stress: plastic strain goes this way, its shear twice
    now[1] += da * normal[0];
    now[2] += da * normal[1];
    now[3] += 2.0 * da * normal[3];
    now[4] += da;
    response.stress -= 2.0 * moduli_.shear * da * normal;
    // d(da) = normal . 2 G d(strain) / (3 G + H), and the normal itself turns.
    const double G = moduli_.shear;
    const double turning = 2.0 * G * da / size;  // times 3/2 (I - ...) of the change of the trial deviator
    const IsotropicModuli kept{moduli_.bulk, G * (1.0 - 1.5 * turning)};
    response.tangent =
        kept.stiffness() - 4.0 * G * G * (1.0 / (3.0 * G + hardening(now[4])) - da / size) * normal * normal.transpose();
    return response;
}

namespace {

// The same with no stress zz.
template <class Law>
PlaneResponse without_stress_zz(const Law& law, const Eigen::Vector3d& in_plane, const double* before, double* now) {
    constexpr int most = 60;
    Tensor strain(in_plane[0], in_plane[1], before[0], in_plane[2]);
    Response response = law.respond(strain, before, now);
    for (int k = 0; k < most && std::abs(response.stress[2]) > rounding * law.stiffness() * strain.norm(); ++k) {
        const double off = response.stress[2];
        double step = -off / response.tangent(2, 2);
        strain[2] += step;
        response = law.respond(strain, before, now);
        for (int halved = 0; std::abs(response.stress[2]) > std::abs(off) && halved < most; ++halved) {
            step *= 0.5;
            strain[2] -= step;
            response = law.respond(strain, before, now);
        }
    }
    now[0] = strain[2];
    const Eigen::Matrix4d& C = response.tangent;
    const Eigen::Vector3d across(C(0, 2), C(1, 2), C(3, 2));
    PlaneResponse plane;
    plane.stress << response.stress[0], response.stress[1], response.stress[3];
    plane.tangent << C(0, 0), C(0, 1), C(0, 3), C(1, 0), C(1, 1), C(1, 3), C(3, 0), C(3, 1), C(3, 3);
    plane.tangent -= across * across.transpose() / C(2, 2);
    return plane;
}

template <class Law>
PlaneResponse without_strain_zz(const Law& law, const Eigen::Vector3d& in_plane, const double* before, double* now) {
    const Response response = law.respond({in_plane[0], in_plane[1], 0.0, in_plane[2]}, before, now);
    now[0] = 0.0;
    const Eigen::Matrix4d& C = response.tangent;
    PlaneResponse plane;
    plane.stress << response.stress[0], response.stress[1], response.stress[3];
    plane.tangent << C(0, 0), C(0, 1), C(0, 3), C(1, 0), C(1, 1), C(1, 3), C(3, 0), C(3, 1), C(3, 3);
    return plane;
}

Tensor with_zz(const Eigen::Vector3d& in_plane, const double* state) { return {in_plane[0], in_plane[1], state[0], in_plane[2]}; }

std::variant<ViscoelasticLaw, PlasticLaw> law_of(const Material& material) {
    if (material.viscoelastic) return ViscoelasticLaw(material);
    return PlasticLaw(material);
}

}  // namespace

MemoryLaw::MemoryLaw(const Material& material, PlaneCondition plane)
    : law_(law_of(material)), plane_stress_(plane == PlaneCondition::stress) {}

int MemoryLaw::variables() const {
    return std::visit([](const auto& law) { return law.variables(); }, law_);
}

void MemoryLaw::prepare(double step) {
    std::visit([&](auto& law) { law.prepare(step); }, law_);
}

PlaneResponse MemoryLaw::respond(const Eigen::Vector3d& strain, const double* before, double* now) const {
    return std::visit(
        [&](const auto& law) {
            return plane_stress_ ? without_stress_zz(law, strain, before, now) : without_strain_zz(law, strain, before, now);
        },
        law_);
}

Tensor MemoryLaw::stress(const Eigen::Vector3d& strain, const double* state) const {
    return std::visit([&](const auto& law) { return law.stress(with_zz(strain, state), state); }, law_);
}

double MemoryLaw::stored(const Eigen::Vector3d& strain, const double* state) const {
    return std::visit([&](const auto& law) { return law.stored(with_zz(strain, state), state); }, law_);
}

double MemoryLaw::dissipated(const double* state) const {
    return std::visit([&](const auto& law) { return law.dissipated(state); }, law_);
}

}  // namespace crampfit

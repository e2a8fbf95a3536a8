#include "forward/history.hpp"

#include "forward/energy_release.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

namespace {

// Of tractions on layers that should be the same, over stiffness times strain.
constexpr double rounding = 1e-12;
constexpr int most_iterations = 60;

// Of the stiffest layer: layers that all flow along their boundary leave none there.
constexpr double least_stiffness = 1e-13;

// Strain xx, yy, 2 xy per jump a: the symmetric part of a (x) n. Its transpose takes a stress to the traction on a face across n.
Eigen::Matrix<double, 3, 2> strain_per_jump(const Vec2& n) {
    Eigen::Matrix<double, 3, 2> M;
    M << n.x(), 0.0, 0.0, n.y(), n.y(), n.x();
    return M;
}

}  // namespace

History::History(const MaterialMap& materials, const Discretisation& body, PlaneCondition plane)
    : body_(body), plane_strain_(plane == PlaneCondition::strain), cell_(body.layout.cells(), -1) {
    std::vector<int> laws;  // by material
    for (const Material& material : materials.materials()) {
        laws.push_back(material.remembers() ? static_cast<int>(laws_.size()) : -1);
        if (material.remembers()) laws_.emplace_back(material, plane);
    }
    for (int c = 0; c < body.layout.cells(); ++c)
        if (body.points.first_of_cell[c] < body.points.first_of_cell[c + 1]) add_wood(materials, laws, plane, c);
    now_ = before_;
}

void History::add_wood(const MaterialMap& materials, const std::vector<int>& laws, PlaneCondition plane, int c) {
    const Vec2 half = 0.5 * body_.layout.cell;
    const std::vector<double> shares = materials.shares(body_.layout.cell_corner(c) + half, half);
    Wood wood{c, {}, body_.wood_of_cell(materials, c).elasticity.normal, 0, false, before_.size()};
    Layer elastic{-1, 0.0, 0.0, 0, 0, Eigen::Matrix3d::Zero(), 0.0};  // all elastic wood together
    LayeredElasticity mean;
    mean.normal = wood.normal;
    for (std::size_t k = 0; k < shares.size(); ++k) {
        if (shares[k] == 0.0) continue;
        if (laws[k] >= 0) {
            wood.layers.push_back({laws[k], shares[k], 0.0, wood.row, 0, {}, 0.0});
            wood.row += laws_[laws[k]].variables();
            wood.flows = wood.flows || (plane_strain_ && materials.materials()[k].plastic);
        } else {
            const Material& material = materials.materials()[k];
            elastic.share += shares[k];
            elastic.poisson_ratio += shares[k] * material.poisson_ratio;
            mean.coefficients +=
                shares[k] * layered(plane_elasticity(material.youngs_modulus, material.poisson_ratio, plane)).coefficients;
        }
    }
    if (wood.layers.empty()) return;
    if (elastic.share > 0.0) {
        elastic.poisson_ratio /= elastic.share;
        mean.coefficients /= elastic.share;
        elastic.elastic = mean.stiffness();
        wood.layers.push_back(elastic);
    }
    double rest = 0.0;
    for (auto layer = wood.layers.rbegin(); layer != wood.layers.rend(); ++layer) {
        rest += layer->share;
        layer->rest = layer->share / rest;
        if (layer == wood.layers.rbegin()) continue;
        layer->jump = wood.row;
        wood.row += 2;
    }
    cell_[c] = static_cast<int>(woods_.size());
    const int points = body_.points.first_of_cell[c + 1] - body_.points.first_of_cell[c];
    before_.resize(before_.size() + static_cast<std::size_t>(points) * wood.row, 0.0);
    woods_.push_back(std::move(wood));
}

void History::forget_unknown(TipLoad& load, const Vec2& tip, const EnergyReleaseOptions& options) const {
    bool near = false;
    body_.for_cells_near(tip, (options.outer + options.margin) * body_.layout.cell.maxCoeff(),
                         [&](int c) { near = near || is_in(c); });
    if (near) load.G = load.K_I = load.K_II = std::numeric_limits<double>::quiet_NaN();
}

void History::go_to(double time) {
    next_time_ = time;
    for (MemoryLaw& law : laws_) law.prepare(time - time_);
}

PlaneResponse History::respond(int point, const Eigen::Vector3d& strain) {
    const std::size_t row = row_of(point);
    return respond(wood_of(point), 0, strain, &before_[row], &now_[row]);
}

PlaneResponse History::respond(const Layer& layer, const Eigen::Vector3d& strain, const double* before, double* now) const {
    if (layer.law < 0) return {layer.elastic * strain, layer.elastic};
    return laws_[layer.law].respond(strain, before + layer.first, now + layer.first);
}

// Of a layer and those after it, which together are one layer to it. With M a the strain of the jump a, strain + (1 - f) M a and
// strain - f M a are those of a layer of share f and the rest; M^T (difference of stresses) = 0 gives a by Newton's method, and
// d stress / d strain by eliminating it.
PlaneResponse History::respond(const Wood& wood, std::size_t number, const Eigen::Vector3d& strain, const double* before,
                               double* now) const {
    const Layer& layer = wood.layers[number];
    if (number + 1 == wood.layers.size()) return respond(layer, strain, before, now);
    const auto M = strain_per_jump(wood.normal);
    const double f = layer.rest, g = 1.0 - f;
    PlaneResponse own, others;
    const auto off = [&](const Vec2& a) -> Vec2 {
        own = respond(layer, strain + g * M * a, before, now);
        others = respond(wood, number + 1, strain - f * M * a, before, now);
        return M.transpose() * (own.stress - others.stress);
    };
    Vec2 a(before[layer.jump], before[layer.jump + 1]);
    Vec2 residual = off(a);
    Eigen::Matrix2d stiffness = Eigen::Matrix2d::Zero();
    for (int k = 0; k < most_iterations; ++k) {
        const double stiffest = own.tangent.norm() + others.tangent.norm();
        stiffness = M.transpose() * (g * own.tangent + f * others.tangent) * M;
        stiffness.diagonal().array() += least_stiffness * stiffest;
        if (residual.norm() <= rounding * stiffest * (strain.norm() + a.norm())) break;
        Vec2 step = -stiffness.inverse() * residual;
        const double size = residual.norm();
        residual = off(a + step);
        for (int halved = 0; residual.norm() > size && halved < most_iterations; ++halved) {
            step *= 0.5;
            residual = off(a + step);
        }
        a += step;
    }
    now[layer.jump] = a.x();
    now[layer.jump + 1] = a.y();
    const Eigen::Matrix<double, 3, 2> difference = (own.tangent - others.tangent) * M;
    PlaneResponse all;
    all.stress = f * own.stress + g * others.stress;
    all.tangent = f * own.tangent + g * others.tangent - f * g * difference * stiffness.inverse() * difference.transpose();
    return all;
}

void History::settle() {
    before_.swap(now_);
    time_ = next_time_;
}

// Calls visit(layer, its strain, its values or null).
template <class Visit>
void History::for_layers(int point, const Eigen::Vector3d& strain, const Visit& visit) const {
    const Wood& wood = wood_of(point);
    const auto M = strain_per_jump(wood.normal);
    const double* row = &before_[row_of(point)];
    Eigen::Vector3d rest = strain;
    for (const Layer& layer : wood.layers) {
        Eigen::Vector3d own = rest;
        if (&layer != &wood.layers.back()) {
            const Vec2 a(row[layer.jump], row[layer.jump + 1]);
            own += (1.0 - layer.rest) * M * a;
            rest -= layer.rest * M * a;
        }
        visit(layer, own, row + layer.first);
    }
}

Tensor History::stress(int point, const Eigen::Vector3d& strain) const {
    Tensor sum = Tensor::Zero();
    for_layers(point, strain, [&](const Layer& layer, const Eigen::Vector3d& own, const double* values) {
        if (layer.law >= 0) {
            sum += layer.share * laws_[layer.law].stress(own, values);
            return;
        }
        const Eigen::Vector3d s = layer.elastic * own;
        sum += layer.share * Tensor(s[0], s[1], plane_strain_ ? layer.poisson_ratio * (s[0] + s[1]) : 0.0, s[2]);
    });
    return sum;
}

double History::stored(int point, const Eigen::Vector3d& strain) const {
    double sum = 0.0;
    for_layers(point, strain, [&](const Layer& layer, const Eigen::Vector3d& own, const double* values) {
        sum += layer.share * (layer.law >= 0 ? laws_[layer.law].stored(own, values) : 0.5 * own.dot(layer.elastic * own));
    });
    return sum;
}

double History::dissipated() const {
    const Points& points = body_.points;
    double sum = 0.0;
    for (const Wood& wood : woods_)
        for (int p = points.first_of_cell[wood.cell]; p < points.first_of_cell[wood.cell + 1]; ++p)
            for (const Layer& layer : wood.layers)
                if (layer.law >= 0)
                    sum += points.volume[p] * layer.share * laws_[layer.law].dissipated(&before_[row_of(p) + layer.first]);
    return sum;
}

void History::restore(const State& state) {
    time_ = state.time;
    go_to(time_);
    if (state.values.empty()) std::fill(before_.begin(), before_.end(), 0.0);
    else before_ = state.values;
}

}  // namespace crampfit

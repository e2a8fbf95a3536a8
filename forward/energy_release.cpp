#include "forward/energy_release.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

// How the wood changes at a point, by central differences over the neighbouring points: along each line of points they add up
// to the whole jump at a boundary.
//
// At a sharp boundary with normal n the strain e_nn jumps, so that the explicit derivative of W(strain) has no meaning there.
// Its Legendre transform in what the boundary leaves continuous (e_ss, s_nn, s_ns),
//     Y = W - s_nn e_nn - s_ns g_ns = 1/2 [E' e_ss^2 + 2 r s_nn e_ss - a s_nn^2 - b s_ns^2]
// (LayeredElasticity) has the same explicit derivative where the wood is smooth, and gives Eshelby's jump [W] - t.[u,n] where it
// is not.
class WoodGradient {
  public:
    WoodGradient(const Discretisation& body, int p) {
        const Points& points = body.points;
        for (int axis = 0; axis < 2; ++axis) {
            int before = body.neighbour(p, axis == 0 ? -1 : 0, axis == 0 ? 0 : -1);
            int after = body.neighbour(p, axis == 0 ? 1 : 0, axis == 0 ? 0 : 1);
            const int steps = (before >= 0) + (after >= 0);
            if (steps == 0) continue;
            if (before < 0) before = p;
            if (after < 0) after = p;
            const Eigen::Vector4d change = points.layers[after] - points.layers[before];
            coefficients_.col(axis) = change / (steps * body.layout.point_size()[axis]);
            density[axis] = (points.density(after) - points.density(before)) / (steps * body.layout.point_size()[axis]);
        }
    }

    Vec2 density = Vec2::Zero();  // [kg/m^4]

    // Explicit gradient of the strain energy density [J/m^4].
    Vec2 of_energy(const PointState& state) const {
        const Vec2 steepest = coefficients_.row(0).transpose();
        if (steepest.isZero()) return Vec2::Zero();
        const Vec2 n = steepest.normalized();
        const Vec2 s = left_of(n);
        const double e_ss = s.dot(state.strain * s);
        const double s_nn = n.dot(state.stress * n);
        const double s_ns = s.dot(state.stress * n);
        const Eigen::Vector4d factors(0.5 * e_ss * e_ss, s_nn * e_ss, -0.5 * s_nn * s_nn, -0.5 * s_ns * s_ns);
        return coefficients_.transpose() * factors;
    }

  private:
    Eigen::Matrix<double, 4, 2> coefficients_ = Eigen::Matrix<double, 4, 2>::Zero();  // [per m]
};

// The virtual extension at the nodes of one cell, and how far it reaches.
class Extension {
  public:
    Extension(const Discretisation& body, const CrackLine& line, bool at_end, const EnergyReleaseOptions& options)
        : body_(body), line_(line), at_end_(at_end) {
        const double h = body.layout.cell.maxCoeff();
        outer = std::max(options.least_outer * h, std::min(options.outer * h, distance_to_other_wood(options.outer * h)));
        inner = std::max(options.least_inner * h, outer - (options.outer - options.inner) * h);
    }

    double inner, outer;  // [m]

    // Unit at the tip, along the crack behind it; nothing on the specimen's outline, which stays where it is.
    Vec2 at(int node) const {
        const Layout& layout = body_.layout;
        const Vec2 x = layout.node_position(node);
        const double distance = (x - line_.tip(at_end_).position).norm();
        if (distance >= outer || on_outline(node)) return Vec2::Zero();
        const double size = distance <= inner ? 1.0 : (outer - distance) / (outer - inner);
        return size * line_.direction_near(at_end_, x);
    }

  private:
    // From the tip to the nearest point where the wood changes, as far as `reach` [m].
    double distance_to_other_wood(double reach) const {
        if (body_.points.changes.empty()) return reach;
        const Vec2 tip = line_.tip(at_end_).position;
        double nearest = reach;
        body_.for_cells_near(tip, reach, [&](int c) {
            for (int p = body_.points.first_of_cell[c]; p < body_.points.first_of_cell[c + 1]; ++p)
                if (body_.points.changes[p]) nearest = std::min(nearest, (body_.points.position[p] - tip).norm());
        });
        return nearest;
    }

    bool on_outline(int node) const {
        const Layout& layout = body_.layout;
        const int i = node % (layout.cells_x + 1);
        const int j = node / (layout.cells_x + 1);
        if (i == 0 || j == 0 || i == layout.cells_x || j == layout.cells_y) return true;
        for (const auto& [di, dj] : {std::pair{-1, -1}, {0, -1}, {-1, 0}, {0, 0}})
            if (!body_.cell_is_full(layout.cell_index(i + di, j + dj))) return true;
        return false;
    }

    const Discretisation& body_;
    const CrackLine& line_;
    bool at_end_;
};

double energy_release_rate(const Discretisation& body, const CrackLine& line, bool at_end, const NodalState& nodal,
                           const EnergyReleaseOptions& options) {
    const Points& points = body.points;
    const Extension extension(body, line, at_end, options);
    double sum = 0.0;
    body.for_cells_near(line.tip(at_end).position, extension.outer, [&](int c) {
        const std::array<int, 4> nodes = body.layout.cell_nodes(c);
        std::array<Vec2, 4> q_node;
        for (int k = 0; k < 4; ++k) q_node[k] = extension.at(nodes[k]);
        if (std::all_of(q_node.begin(), q_node.end(), [](const Vec2& q) { return q.isZero(); })) return;
        for (int p = points.first_of_cell[c]; p < points.first_of_cell[c + 1]; ++p) {
            const CellWeights& w = body.weights[points.slot[p]];
            Vec2 q = Vec2::Zero();
            Mat2 q_gradient = Mat2::Zero();
            for (int k = 0; k < 4; ++k) {
                q += w.value[k] * q_node[k];
                q_gradient += q_node[k] * Vec2(w.slope_x[k], w.slope_y[k]).transpose();
            }
            const Mat2 u_gradient = gradient_at(body, p, nodal.displacement);
            const PointState state = elastic_state(u_gradient, points.stiffness_of(p), options.rotates);
            const Vec2 v = value_at(body, p, nodal.velocity);
            const Vec2 a = value_at(body, p, nodal.acceleration);
            const Mat2 v_gradient = gradient_at(body, p, nodal.velocity);
            const double density = points.density(p);
            double integrand = (state.stress.transpose() * u_gradient).cwiseProduct(q_gradient.transpose()).sum() -
                               (state.energy + 0.5 * density * v.squaredNorm()) * q_gradient.trace() +
                               density * (a.dot(u_gradient * q) - v.dot(v_gradient * q));
            if (!points.changes.empty() && points.changes[p]) {
                const WoodGradient wood(body, p);
                integrand -= (wood.of_energy(state) + 0.5 * v.squaredNorm() * wood.density).dot(q);
            }
            sum += integrand * points.volume[p];
        }
    });
    return sum / body.layout.thickness;
}

} // namespace

TipLoad tip_load(const Discretisation& body, const CrackFields& cracks, const MaterialMap& materials, int crack, bool at_end,
                 const NodalState& state, const EnergyReleaseOptions& options) {
    const CrackLine& line = cracks.lines[crack];
    const CrackTip& tip = line.tip(at_end);
    const double h = body.layout.cell.maxCoeff();
    const LocalWood wood = materials.average(tip.position, 0.5 * body.layout.point_size());

    TipLoad load;
    load.toughness = wood.toughness;
    load.G = energy_release_rate(body, line, at_end, state, options);
    load.opening = cracks.opening(crack, line.behind(at_end, 1.5 * h), state.displacement);

    // Seen from the tip the left face of the line is the upper one at its end, the lower one at its start.
    const Vec2 upward = at_end ? load.opening : Vec2(-load.opening);
    const double open = upward.dot(left_of(tip.direction));
    const double slide = upward.dot(tip.direction);
    const double size = std::hypot(open, slide);
    const double K = std::sqrt(std::max(0.0, load.G) * wood.plane_modulus());
    if (size > 0.0) {
        load.K_I = K * std::max(0.0, open) / size;
        load.K_II = K * slide / size;
    }
    return load;
}

} // namespace crampfit

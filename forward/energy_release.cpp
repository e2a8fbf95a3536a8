#include "forward/energy_release.hpp"

#include "forward/face_pieces.hpp"
#include "forward/near_tip_field.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace crampfit {

namespace {

// How the wood changes at a point, by central differences over the neighbouring points: along each line of points they add up
// to the whole jump at a boundary.
//
// At a sharp boundary with normal n the strain e_nn jumps, so that the explicit derivative of W(strain) has no meaning there.
// Its Legendre transform in what the boundary leaves continuous (e_ss, s_nn, s_ns),
//     Y = W - s_nn e_nn - s_ns g_ns
// (LayeredElasticity), has the same explicit derivative where the wood is smooth, and gives Eshelby's jump [W] - t.[u,n] where it
// is not. The coefficients of isotropic wood are the same for all n, those of orthotropic wood are found for the n at hand.
class WoodGradient {
  public:
    WoodGradient(const Discretisation& body, int p) {
        const Points& points = body.points;
        std::array<std::array<int, 2>, 2> sides;  // behind and ahead along x and y
        Vec2 distance = Vec2::Zero();
        for (int axis = 0; axis < 2; ++axis) {
            int before = body.neighbour(p, axis == 0 ? -1 : 0, axis == 0 ? 0 : -1);
            int after = body.neighbour(p, axis == 0 ? 1 : 0, axis == 0 ? 0 : 1);
            const int steps = (before >= 0) + (after >= 0);
            if (before < 0) before = p;
            if (after < 0) after = p;
            sides[axis] = {before, after};
            distance[axis] = std::max(steps, 1) * body.layout.point_size()[axis];
            density[axis] = (points.density(after) - points.density(before)) / distance[axis];
        }
        const auto differences = [&](const auto& value) {
            for (int axis = 0; axis < 2; ++axis)
                coefficients_.col(axis) = (value(sides[axis][1]) - value(sides[axis][0])) / distance[axis];
        };
        if (!points.layers.empty()) {
            differences([&](int q) {
                LayeredElasticity::Coefficients c = LayeredElasticity::Coefficients::Zero();
                c.head<4>() = points.layers[q];
                return c;
            });
            const Vec2 steepest = coefficients_.row(0).transpose();
            if (!steepest.isZero()) normal_ = steepest.normalized();
        } else {
            std::array<Eigen::Matrix3d, 2> slope;
            for (int axis = 0; axis < 2; ++axis)
                slope[axis] = (points.stiffness_of(sides[axis][1]) - points.stiffness_of(sides[axis][0])) / distance[axis];
            const auto product = [&](int i, int j) { return slope[i].cwiseProduct(slope[j]).sum(); };
            const double angle = 0.5 * std::atan2(2.0 * product(0, 1), product(0, 0) - product(1, 1));
            normal_ = {std::cos(angle), std::sin(angle)};
            differences([&](int q) { return layered(points.stiffness_of(q), normal_).coefficients; });
        }
    }

    Vec2 density = Vec2::Zero();  // [kg/m^4]

    // Explicit gradient of the strain energy density [J/m^4].
    Vec2 of_energy(const PointState& state) const {
        const Vec2 s = left_of(normal_);
        const double e_ss = s.dot(state.strain * s);
        const double s_nn = normal_.dot(state.stress * normal_);
        const double s_ns = s.dot(state.stress * normal_);
        LayeredElasticity::Coefficients factors;
        factors << 0.5 * e_ss * e_ss, s_nn * e_ss, -0.5 * s_nn * s_nn, -0.5 * s_ns * s_ns, s_ns * e_ss, -s_nn * s_ns;
        return coefficients_.transpose() * factors;
    }

  private:
    Eigen::Matrix<double, 6, 2> coefficients_ = Eigen::Matrix<double, 6, 2>::Zero();  // [per m]
    Vec2 normal_ = Vec2::UnitX();                                                     // in which the wood changes most
};

// The virtual extension at the corners of the grid's cells, and how far it reaches. It is linear between them, whatever the shape
// functions of the motion.
class Extension {
  public:
    // It keeps off other wood, or not.
    Extension(const Discretisation& body, const CrackFields& cracks, int crack, bool at_end, const EnergyReleaseOptions& options,
              bool keeps_off)
        : corners(body.layout), body_(body), line_(cracks.lines[crack]), at_end_(at_end) {
        corners.degree = 1;
        const double h = body.layout.cell.maxCoeff();
        const double near = (options.outer + options.margin) * h;
        const double clear = keeps_off ? distance_to_other_wood(near) : near;
        const double alone = distance_to_other_cracks(cracks, crack);
        outer = std::max(options.least_outer * h, std::min(options.outer * h, clear));
        outer = std::max(options.least_outer_at_cracks * h, std::min(outer, alone));
        meets_other_wood = clear < near;
        inner = std::max(options.least_inner * h, outer - (options.outer - options.inner) * h);
    }

    double inner, outer;            // [m]
    bool meets_other_wood = false;  // the domain cannot keep clear of it

    // Unit at the tip, along the crack behind it; nothing on the specimen's outline, which stays where it is.
    Vec2 at(int corner) const {
        const Vec2 x = corners.node_position(corner);
        const double size = size_at(x);
        if (size == 0.0 || on_outline(corner)) return Vec2::Zero();
        return size * line_.direction_near(at_end_, x);
    }

    double size_at(const Vec2& x) const {
        const double distance = (x - line_.tip(at_end_).position).norm();
        return std::clamp((outer - distance) / (outer - inner), 0.0, 1.0);
    }

    Layout corners;  // as nodes

  private:
    // From the tip to the nearest point where the wood changes, as far as `reach` [m].
    double distance_to_other_wood(double reach) const {
        if (body_.points.changes.empty()) return reach;
        const Vec2 tip = line_.tip(at_end_).position;
        double nearest = reach;
        body_.for_cells_near(tip, reach, [&](int c) {
            for (int p = body_.points.first_of_cell[c]; p < body_.points.first_of_cell[c + 1]; ++p)
                if (body_.points.changes[p] == Change::wood) nearest = std::min(nearest, (body_.points.position[p] - tip).norm());
        });
        return nearest;
    }

    // From the tip to the nearest other crack, which the extension must not move [m].
    double distance_to_other_cracks(const CrackFields& cracks, int crack) const {
        const Vec2 tip = line_.tip(at_end_).position;
        double nearest = std::numeric_limits<double>::infinity();
        for (int k = 0; k < static_cast<int>(cracks.lines.size()); ++k) {
            const auto& points = cracks.lines[k].points;
            for (std::size_t i = 0; i + 1 < points.size() && k != crack; ++i) {
                const Vec2 along = points[i + 1] - points[i];
                nearest = std::min(nearest, (tip - points[i] - nearest_on_segment(points[i], points[i + 1], tip) * along).norm());
            }
        }
        return nearest;
    }

    bool on_outline(int corner) const {
        const Layout& layout = corners;
        const int i = corner % layout.nodes_x();
        const int j = corner / layout.nodes_x();
        if (i == 0 || j == 0 || i == layout.cells_x || j == layout.cells_y) return true;
        for (const auto& [di, dj] : {std::pair{-1, -1}, {0, -1}, {-1, 0}, {0, 0}})
            if (!body_.cell_is_full(layout.cell_index(i + di, j + dj))) return true;
        return false;
    }

    const Discretisation& body_;
    const CrackLine& line_;
    bool at_end_;
};

// Wood about one place: a point's, what a crack leaves of it, or what it cuts off.
struct Spot {
    int point;
    Vec2 position;
    double volume;         // [m^3]
    const Sliver* sliver;  // null: the point as it is
    bool is_sliver;

    std::span<const int> node(const Discretisation& body) const {
        return is_sliver ? std::span<const int>(sliver->node) : body.points.node[point];
    }

    Mat2 gradient(const Discretisation& body, const std::vector<Vec2>& field) const {
        if (!sliver) return gradient_at(body, point, field);
        const auto slopes = body.slopes_at(body.points.cell[point], position);
        const auto fields = node(body);
        Mat2 sum = Mat2::Zero();
        for (int k = 0; k < 4; ++k) sum += field[fields[k]] * slopes[k].transpose();
        return sum;
    }

    Mat2 seen_gradient(const Discretisation& body, const std::vector<Vec2>& displacement, bool rotates) const {
        return sliver ? gradient(body, displacement) : seen_gradient_at(body, point, displacement, rotates);
    }

    Vec2 value(const Discretisation& body, const std::vector<Vec2>& field) const {
        if (!sliver) return value_at(body, point, field);
        const auto values = body.values_at(body.points.cell[point], position);
        const auto fields = node(body);
        Vec2 sum = Vec2::Zero();
        for (int k = 0; k < 4; ++k) sum += values[k] * field[fields[k]];
        return sum;
    }
};

// Calls visit(spot, q, gradient of q) for all wood that the virtual extension moves or strains.
template <class Visit>
void for_points_in(const Discretisation& body, const Vec2& tip, const Extension& extension, Visit visit) {
    body.for_cells_near(tip, extension.outer, [&](int c) {
        const auto corners = extension.corners.cell_nodes(c);
        std::array<Vec2, 4> q_corner;
        for (int k = 0; k < 4; ++k) q_corner[k] = extension.at(corners[k]);
        if (std::all_of(q_corner.begin(), q_corner.end(), [](const Vec2& q) { return q.isZero(); })) return;
        const auto visit_with = [&](const Spot& spot, const auto& value, const auto& slope) {
            Vec2 q = Vec2::Zero();
            Mat2 q_gradient = Mat2::Zero();
            for (int k = 0; k < 4; ++k) {
                q += value[k] * q_corner[k];
                q_gradient += q_corner[k] * slope(k).transpose();
            }
            visit(spot, q, q_gradient);
        };
        const std::span<const Sliver> slivers = body.slivers_of(c, c + 1);
        for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p) {
            const Vec2& middle = body.points.position[p];
            const double volume = body.points.volume[p];
            const auto cut = std::ranges::find(slivers, p, &Sliver::point);
            if (cut == slivers.end()) {
                const CellWeights& w = body.corner_weights[body.place_of(p)];
                visit_with({p, middle, volume, nullptr, false}, w.value, [&](int k) { return Vec2(w.slope_x[k], w.slope_y[k]); });
                continue;
            }
            for (const Spot& spot : {Spot{p, cut->middle_of_rest(middle), (1.0 - cut->share) * volume, &*cut, false},
                                     Spot{p, cut->position, cut->share * volume, &*cut, true}}) {
                const auto slopes = body.slopes_at(c, spot.position);
                visit_with(spot, body.values_at(c, spot.position), [&](int k) { return slopes[k]; });
            }
        }
    });
}

struct ReleaseRate {
    double G;             // [J/m^2]
    bool beside_changes;  // the wood changes across the crack's way only, not along it
};

// Part of the wood's change that may go along the crack's way for that.
constexpr double little_change = 0.1;

// Of the wood about the tip: how fast it goes as a whole must not count.
Vec2 mean_velocity(const Discretisation& body, const Vec2& tip, const Extension& extension, const NodalState& nodal) {
    Vec2 sum = Vec2::Zero();
    double mass = 0.0;
    for_points_in(body, tip, extension, [&](const Spot& spot, const Vec2&, const Mat2&) {
        const double here = body.points.density(spot.point) * spot.volume;
        sum += here * spot.value(body, nodal.velocity);
        mass += here;
    });
    return mass > 0.0 ? Vec2(sum / mass) : sum;
}

// How the wood around the tip has turned as a whole.
Mat2 mean_turn(const Discretisation& body, const Vec2& tip, const Extension& extension, const NodalState& nodal) {
    Mat2 sum = Mat2::Zero();
    int count = 0;
    for_points_in(body, tip, extension, [&](const Spot& spot, const Vec2&, const Mat2&) {
        if (spot.is_sliver) return;
        sum += gradient_at(body, spot.point, nodal.displacement);
        ++count;
    });
    return Polar(sum / count).turn;
}

ReleaseRate energy_release_rate(const Discretisation& body, const Vec2& tip, const Extension& extension, const NodalState& nodal,
                                bool rotates) {
    const Points& points = body.points;
    const Vec2 as_a_whole = mean_velocity(body, tip, extension, nodal);
    // Nor must how it has turned: by the balance of momentum that part of the integral is nil, but not on a grid.
    Mat2 turn_as_a_whole = Mat2::Zero();
    if (rotates) turn_as_a_whole = mean_turn(body, tip, extension, nodal) - Mat2::Identity();
    double sum = 0.0;
    double change_along = 0.0, change = 0.0;  // explicit gradients of the energy [J/m]
    for_points_in(body, tip, extension, [&](const Spot& spot, const Vec2& q, const Mat2& q_gradient) {
        const int p = spot.point;
        const Mat2 u_gradient = spot.seen_gradient(body, nodal.displacement, rotates);
        const PointState state = elastic_state(u_gradient, points.stiffness_of(p), rotates);
        const Mat2 own_gradient = u_gradient - turn_as_a_whole;
        const Vec2 v = spot.value(body, nodal.velocity) - as_a_whole;
        const Vec2 a = spot.value(body, nodal.acceleration);
        const Mat2 v_gradient = spot.gradient(body, nodal.velocity);
        const double density = points.density(p);
        double integrand = (state.stress.transpose() * own_gradient).cwiseProduct(q_gradient.transpose()).sum() -
                           (state.energy + 0.5 * density * v.squaredNorm()) * q_gradient.trace() +
                           density * (a.dot(own_gradient * q) - v.dot(v_gradient * q));
        if (!points.changes.empty() && points.changes[p] != Change::none) {
            const WoodGradient wood(body, p);
            const Vec2 gradient = wood.of_energy(state) + 0.5 * v.squaredNorm() * wood.density;
            integrand -= gradient.dot(q);
            change_along += std::abs(gradient.dot(q)) * spot.volume;
            change += gradient.norm() * q.norm() * spot.volume;
        }
        sum += integrand * spot.volume;
    });
    return {sum / body.layout.thickness, change_along < little_change * change};
}

// What the tractions on faces take of that: - int t_i [u_i],k q_k ds. Along a piece [u],k q_k is taken for even, with q in the
// middle. Faces that press have no jump across them for the pressure to work on: what the grid shows there, where one of two rows
// of nodes beside the crack presses, would take up to 5 % off near mode II.
double taken_by_faces(const std::vector<FacePiece>& pieces, const CrackFields& cracks, int crack, bool at_end,
                      const Extension& extension, const std::vector<Vec2>& displacement, const Mat2& turn, double thickness) {
    const CrackLine& line = cracks.lines[crack];
    double sum = 0.0;
    for (const FacePiece& piece : pieces) {
        const Vec2 middle = line.behind(at_end, 0.5 * (piece.near + piece.far));
        const double size = extension.size_at(middle);
        if (size == 0.0 || piece.far <= piece.near) continue;
        const auto jump = [&](double behind) {
            return Vec2((at_end ? 1.0 : -1.0) * cracks.opening(crack, line.behind(at_end, behind), displacement));
        };
        const Vec2 at_near = piece.near > 0.0 ? jump(piece.near) : Vec2(Vec2::Zero());
        const Vec2 across = turn * left_of(line.direction_near(at_end, middle));
        const Vec2 force = piece.force - std::max(0.0, piece.force.dot(across)) * across;
        sum += force.dot(at_near - jump(piece.far)) / (piece.far - piece.near) * size;
    }
    return -sum / thickness;
}

// What the ties at the tip take of that where the wood changes along the way: they go along with the tip, and their energy with
// the modulus that they are made for. Without it G in wood that gets stiffer was off with the first power of the cell. Where the
// modulus changes by more than itself from cell to cell, as at a sharp boundary, that first power says nothing: it fades out.
double taken_by_ties(const Discretisation& body, const CrackFields& cracks, const MaterialMap& materials, int crack, bool at_end,
                     const Extension& extension, std::span<const double> ties) {
    constexpr double step_in_cells = 0.1;
    const CrackTip& tip = cracks.lines[crack].tip(at_end);
    const Vec2 step = step_in_cells * body.layout.cell.minCoeff() * tip.direction;
    double sum = 0.0;
    for (std::size_t k = 0; k < ties.size(); ++k) {
        const FieldPair& pair = cracks.pairs[k];
        const double size = extension.size_at(pair.freed_at);
        if (pair.crack != crack || ties[k] == 0.0 || size == 0.0) continue;
        const auto modulus = [&](const Vec2& at) { return opening_modulus(materials, at, 0.5 * body.layout.cell, pair.along); };
        const double behind = modulus(pair.freed_at - step), ahead = modulus(pair.freed_at + step);
        const double change = (ahead - behind) / (2.0 * step_in_cells * pair.plane_modulus);  // over a cell
        sum += size * ties[k] * change / (1.0 + std::pow(change, 4)) / body.layout.cell.minCoeff();
    }
    return -sum / body.layout.thickness;
}

// On the left of the crack, seen toward the tip. What lies on it counts as left of the way from start to end, as its fields do.
bool is_left_of(const CrackLine& line, bool at_end, const Vec2& x) {
    double nearest = std::numeric_limits<double>::infinity();
    double side = 0.0;
    for (std::size_t k = 0; k + 1 < line.points.size(); ++k) {
        const Vec2 along = line.points[k + 1] - line.points[k];
        const Vec2 arm = x - line.points[k] - nearest_on_segment(line.points[k], line.points[k + 1], x) * along;
        const double here = cross(along.normalized(), arm);
        const double distance = arm.norm();
        // Nearest to a corner: the segment that x stands off farther knows the side.
        const bool as_near = distance < nearest * (1.0 + 1e-9);
        if (distance < nearest * (1.0 - 1e-9) || (as_near && std::abs(here) > std::abs(side))) side = here;
        nearest = std::min(nearest, distance);
    }
    const double rounding = 1e-10 * line.length;
    return at_end == (side >= -rounding);
}

// Angle of a place seen from the tip, counted from the direction ahead [rad]: up to pi on the left of the crack and down to -pi
// on its right, or a little beyond where the crack bends.
double angle_from_tip(const CrackLine& line, bool at_end, const Vec2& x) {
    const CrackTip& tip = line.tip(at_end);
    const Vec2 arm = x - tip.position;
    const double angle = std::atan2(cross(tip.direction, arm), tip.direction.dot(arm));
    if (std::abs(angle) < 0.5 * std::numbers::pi) return angle;
    const bool left = is_left_of(line, at_end, x);
    if (left == (angle > 0.0)) return angle;
    return angle + (left ? 2.0 : -2.0) * std::numbers::pi;
}

// What a point adds to the interaction integral, as seen in some axes.
struct Seen {
    Mat2 gradient;  // of the displacement
    Mat2 stress;    // [Pa]
    Mat2 strain;
    Vec2 inertia;     // density times acceleration [N/m^3]
    Vec2 q;           // virtual extension
    Mat2 q_gradient;  // [1/m]

    Seen in(const Mat2& axes) const {
        const Mat2 back = axes.transpose();
        return {back * gradient * axes,  back * stress * axes, back * strain * axes, back * inertia, back * q,
                back * q_gradient * axes};
    }
};

// What a point's stress is more than that of its cell's mean wood: in a whole cell of several woods q pulls on the stiffer ones
// more on one side than on the other (`Unevenness`) [Pa].
Mat2 stress_of_unevenness(const Discretisation& body, int p, const std::vector<Vec2>& displacement, const Mat2& turn) {
    const Unevenness* uneven = body.unevenness_of_whole(body.points.cell[p]);
    if (!uneven) return Mat2::Zero();
    const auto node = body.points.node[p];
    Vec2 q = Vec2::Zero();
    for (int k = 0; k < 4; ++k) q += crosswise_sign[k] / body.layout.cell.prod() * displacement[node[k]];
    const Eigen::Vector3d s = uneven->coupling * (turn.transpose() * q);
    return turn * (Mat2() << s[0], s[2], s[2], s[1]).finished();
}

// From the frame that has turned with the wood around the tip.
Seen seen_at(const Discretisation& body, const Spot& spot, const NodalState& nodal, const Mat2& turn, bool rotates) {
    const int p = spot.point;
    const Mat2 gradient = spot.seen_gradient(body, nodal.displacement, rotates);
    PointState state = elastic_state(gradient, body.points.stiffness_of(p), rotates);
    state.stress += stress_of_unevenness(body, p, nodal.displacement, turn);
    Seen seen;
    seen.strain = state.strain;
    seen.inertia = body.points.density(p) * spot.value(body, nodal.acceleration);
    if (rotates) {
        const Mat2 back = turn.transpose();
        seen.gradient = back * (Mat2::Identity() + gradient) - Mat2::Identity();
        seen.stress = back * state.stress;
        seen.inertia = back * seen.inertia;
    } else {
        seen.gradient = gradient - 0.5 * (turn - turn.transpose());
        seen.stress = state.stress;
    }
    return seen;
}

// What the near-tip stress t puts on the faces of a crack that bends within the domain, in the interaction integral of both
// modes: - int t_ij m_j u_i,k q_k ds along both faces, m their outward normal. A straight crack's faces are free of t.
Vec2 work_on_bent_faces(const CrackFields& cracks, const CrackLine& line, bool at_end, const NearTipField& field,
                        const Extension& extension, const std::vector<Vec2>& displacement, const Mat2& turn, bool rotates,
                        double step) {
    const CrackTip& tip = line.tip(at_end);
    const Vec2& ahead = tip.direction;
    Mat2 axes;
    axes << ahead, left_of(ahead);
    Vec2 sum = Vec2::Zero();
    for (std::size_t k = 0; k + 1 < line.points.size(); ++k) {
        const Vec2& far = at_end ? line.points[k] : line.points[k + 1];
        const Vec2& near = at_end ? line.points[k + 1] : line.points[k];
        const Vec2 along = (near - far).normalized();
        if (std::abs(cross(ahead, along)) < 1e-9 && std::abs(cross(ahead, near - tip.position)) < 1e-9 * step) continue;
        const int pieces = static_cast<int>(std::ceil((near - far).norm() / step - 1e-6));
        for (int piece = 0; piece < pieces; ++piece) {
            const Vec2 a = far + (near - far) * piece / pieces, b = far + (near - far) * (piece + 1) / pieces;
            const Vec2 arm = 0.5 * (a + b) - tip.position;
            const double size = extension.size_at(tip.position + arm);
            if (size == 0.0) continue;
            for (const bool left : {true, false}) {
                const Vec2 outward = (left ? -1.0 : 1.0) * left_of(along);
                double angle = std::atan2(cross(ahead, arm), ahead.dot(arm));
                if (ahead.dot(arm) < 0.0 && left != (angle > 0.0)) angle += (left ? 2.0 : -2.0) * std::numbers::pi;
                const auto at = [&](const Vec2& x) { return cracks.displacement_at(x - 1e-6 * step * outward, displacement); };
                const Vec2 stretch = at(b) - at(a);
                const Vec2 seen = rotates ? Vec2(turn.transpose() * (b - a + stretch) - (b - a))
                                          : Vec2(stretch - 0.5 * (turn - turn.transpose()) * (b - a));
                const auto modes = field.at(arm.norm(), angle);
                for (int mode = 0; mode < 2; ++mode)
                    sum[mode] -= size * (axes.transpose() * seen).dot(modes[mode].stress * (axes.transpose() * outward));
            }
        }
    }
    return sum;
}

// K_I and K_II by the interaction integral (Yau, Wang and Corten 1980), in the incompatibility form for wood that changes from
// place to place (Dolbow and Gosz 2002; Kim and Paulino 2005):
//     M = int [ (s_ij a_i,k + t_ij u_i,k - t_mn e_mn d_kj) q_k,j + (S_ijmn s_mn t_ij,k - e_ij t_ij,k + rho u_i,tt a_i,k) q_k ] dA
// with a, t the near-tip displacement and stress of unit K in wood of compliance S, that at the tip; G = K^T H K gives
// K = H^-1 M / 2. No derivative of the wood's constants is in it, so that it holds across sharp boundaries too (Yu et al. 2009).
// Seen from the frame that has turned with the wood around the tip the displacement gradients are small, in finite rotation as
// well. Tractions on pressed faces take - int t_i [a_i],k q_k ds off, in which [a],1 goes with r^-1/2. Left out: the speed of a
// running tip in a and t.
Vec2 intensity_factors(const Discretisation& body, const CrackFields& cracks, const CrackLine& line, bool at_end,
                       const NearTipField& field, const Extension& extension, const NodalState& nodal,
                       const std::vector<FacePiece>& pieces, bool rotates) {
    const Points& points = body.points;
    const CrackTip& tip = line.tip(at_end);
    const Mat2 turn = mean_turn(body, tip.position, extension, nodal);
    const double closest = 0.25 * body.layout.point_size().minCoeff();  // a point may lie on the tip itself
    Mat2 axes;
    axes << tip.direction, left_of(tip.direction);
    Vec2 sum = Vec2::Zero();
    for_points_in(body, tip.position, extension, [&](const Spot& spot, const Vec2& q, const Mat2& q_gradient) {
        Seen fixed = seen_at(body, spot, nodal, turn, rotates);
        if (points.changes.empty() && q_gradient.isZero() && fixed.inertia.isZero()) return;
        fixed.q = q;
        fixed.q_gradient = q_gradient;
        const Seen s = fixed.in(axes);
        const double r = std::max(closest, (spot.position - tip.position).norm());
        const double angle = angle_from_tip(line, at_end, spot.position);
        const Eigen::Vector3d there = field.strain(s.stress);
        Mat2 other_wood;
        other_wood << there[0], 0.5 * there[2], 0.5 * there[2], there[1];
        other_wood -= s.strain;
        const std::array<NearTipField::Mode, 2> modes = field.at(r, angle);
        for (int mode = 0; mode < 2; ++mode) {
            const NearTipField::Mode& near = modes[mode];
            const Mat2 works = near.gradient.transpose() * s.stress + s.gradient.transpose() * near.stress;
            double integrand = works.cwiseProduct(s.q_gradient).sum() -
                               near.stress.cwiseProduct(s.strain).sum() * s.q_gradient.trace() +
                               s.inertia.dot(near.gradient * s.q);
            if (!points.changes.empty())
                for (int k = 0; k < 2; ++k) integrand += s.q[k] * other_wood.cwiseProduct(near.stress_slope[k]).sum();
            sum[mode] += integrand * spot.volume;
        }
    });
    sum += body.layout.thickness * work_on_bent_faces(cracks, line, at_end, field, extension, nodal.displacement, turn, rotates,
                                                      0.5 * body.layout.cell.minCoeff());
    const auto left = field.at(1.0, std::numbers::pi), right = field.at(1.0, -std::numbers::pi);
    for (const FacePiece& piece : pieces) {
        const double size = extension.size_at(line.behind(at_end, 0.5 * (piece.near + piece.far)));
        if (size == 0.0) continue;
        const Vec2 force = (turn * axes).transpose() * piece.force;
        const double mean_root = 2.0 / (std::sqrt(piece.near) + std::sqrt(piece.far));  // of r^-1/2 along the piece
        for (int mode = 0; mode < 2; ++mode)
            sum[mode] -= force.dot(left[mode].gradient.col(0) - right[mode].gradient.col(0)) * mean_root * size;
    }
    return 0.5 / body.layout.thickness * field.release().inverse() * sum;
}

// True where the cell that holds x, on a line of the grid each that has it, is made of the wood at x alone. Grain that turns
// within it is no other wood.
bool in_one_wood(const Discretisation& body, const MaterialMap& materials, const Vec2& x) {
    const Vec2 half = 0.5 * body.layout.cell;
    const Vec2 hair = 1e-6 * body.layout.cell;
    const Eigen::Matrix3d here = materials.at(x).elasticity.stiffness();
    const double same = (materials.orthotropic() ? 0.05 : 1e-6) * here.norm();
    int last = -1;
    for (const Vec2& side : {Vec2(-1.0, -1.0), Vec2(1.0, -1.0), Vec2(-1.0, 1.0), Vec2(1.0, 1.0)}) {
        const int c = body.layout.cell_at(x + hair.cwiseProduct(side));
        if (c == last) continue;
        last = c;
        const LocalWood average = materials.average(body.layout.cell_corner(c) + half, half);
        if ((average.elasticity.stiffness() - here).norm() > same) return false;
    }
    return true;
}

}  // namespace

Mat2 turn_about(const Discretisation& body, const CrackTip& tip, const std::vector<Vec2>& displacement) {
    constexpr double reach_in_cells = 3.0;
    const Vec2 reach = reach_in_cells * body.layout.cell;
    return Polar(mean_gradient(body, {tip.position - reach, tip.position + reach}, displacement)).turn;
}

Vec2 opening_behind(const Discretisation& body, const CrackFields& cracks, int crack, bool at_end,
                    const std::vector<Vec2>& displacement) {
    const Vec2 behind = cracks.lines[crack].behind(at_end, 1.5 * body.layout.cell.maxCoeff());
    return cracks.opening(crack, behind, displacement);
}

Vec2 opening_in_own_frame(const Discretisation& body, const CrackFields& cracks, int crack, bool at_end,
                          const std::vector<Vec2>& displacement, bool rotates) {
    const Vec2 jump = opening_behind(body, cracks, crack, at_end, displacement);
    return rotates ? Vec2(turn_about(body, cracks.lines[crack].tip(at_end), displacement).transpose() * jump) : jump;
}

TipLoad tip_load(const Discretisation& body, const CrackFields& cracks, const MaterialMap& materials, int crack, bool at_end,
                 const NodalState& state, const EnergyReleaseOptions& options) {
    const CrackLine& line = cracks.lines[crack];
    const CrackTip& tip = line.tip(at_end);
    const double h = body.layout.cell.maxCoeff();
    const LocalWood wood = materials.average(tip.position, 0.5 * body.layout.point_size());
    const Extension extension(body, cracks, crack, at_end, options, true);
    const Extension anywhere(body, cracks, crack, at_end, options, false);

    TipLoad load;
    load.toughness = wood.toughness;
    const ReleaseRate J = energy_release_rate(body, tip.position, extension, state, options.rotates);
    const std::vector<FacePiece> pieces = face_pieces(cracks, crack, at_end, state.faces, body.layout);
    const Mat2 turn = options.rotates ? turn_about(body, tip, state.displacement) : Mat2(Mat2::Identity());
    load.G = J.G + taken_by_faces(pieces, cracks, crack, at_end, extension, state.displacement, turn, body.layout.thickness);
    if (!body.points.changes.empty()) load.G += taken_by_ties(body, cracks, materials, crack, at_end, extension, state.ties);
    load.opening = turn.transpose() * opening_behind(body, cracks, crack, at_end, state.displacement);

    const NearTipField field = near_tip_field(wood.elasticity.stiffness(), tip.direction);
    const Vec2 K = intensity_factors(body, cracks, line, at_end, field, anywhere, state, pieces, options.rotates);
    // Faces that press on each other behind the tip leave no mode I. Near mode II the grid lets those of the tip's own cell press
    // where the crack is open, and B-splines farther off: where mode I prevails it is open.
    const bool press =
        K[0] <= std::abs(K[1]) && std::any_of(pieces.begin(), pieces.end(), [&](const FacePiece& piece) {
            return piece.near < 2.0 * h && piece.far > 1.5 * h && piece.force.dot(turn * left_of(tip.direction)) > 0.0;
        });
    const Vec2 seen(press ? 0.0 : std::max(0.0, K[0]), K[1]);
    load.K_I = seen[0];
    load.K_II = seen[1];
    // Where J's domain cannot keep clear of other wood, but the tip lies in a cell of one wood, the near-tip field knows better:
    // it holds across boundaries, with a domain as wide as elsewhere. With the tip 4 cells off a boundary J, whose domain is
    // small then, is 3 % low, and K^2 / E' is within 0.4 % from 2 cells on (`VerificationBoundary`).
    // Beside a boundary J needs no gradient term and is as good as in one wood, and K means nothing on the boundary itself.
    const bool runs_into_wood = extension.meets_other_wood && !J.beside_changes;
    if (runs_into_wood && in_one_wood(body, materials, tip.position)) {
        const Mat2 H = near_tip_field(materials.at(tip.position).elasticity.stiffness(), tip.direction).release();
        load.G = seen.dot(H * seen);
    } else if ((runs_into_wood || (options.sizes_K_by_J && options.rotates)) && !press && load.G > 0.0) {
        // The interaction integral sees all of its domain in one frame. Where that has turned much from end to end, as in thin
        // arms, it tells the modes apart, and J how large they are. So too in transition wood, where it knows nothing of ties.
        const double told = seen.dot(field.release() * seen);
        const double size = told > 0.0 ? std::sqrt(load.G / told) : 1.0;
        load.K_I *= size;
        load.K_II *= size;
    }
    return load;
}

}  // namespace crampfit

#include "forward/internal_force.hpp"

#include "forward/deformation.hpp"

#include <algorithm>
#include <numeric>

namespace crampfit {

namespace {

// What is alone on its fields has second moments of so much of a cell's at least, times their volumes: a sliver in a corner
// hardly moves with the node across, and would spoil the condition of the stiffness. In motion that much on a point that an
// outline leaves little of would shorten the time step.
constexpr double least_crosswise = 1e-3;

Eigen::Matrix3d matrix_of(const std::array<double, 6>& C) {
    return (Eigen::Matrix3d() << C[0], C[1], C[4], C[1], C[2], C[5], C[4], C[5], C[3]).finished();
}

}  // namespace

InternalForce::InternalForce(const Discretisation& body, const MaterialMap& materials, bool rotates, History* history,
                             bool in_motion)
    : body_(body), rotates_(rotates), history_(history), least_crosswise_(in_motion ? 0.0 : least_crosswise),
      uneven_(body, materials, rotates, history), strips_(body.layout) {
    sort_cells();
}

void InternalForce::sort_cells() {
    const Layout& layout = body_.layout;
    const Points& points = body_.points;
    whole_cells_.clear();
    loose_points_.clear();
    shortened_.clear();
    alone_.clear();
    remembering_.clear();
    first_of_strip_.clear();
    uneven_.sort();
    for (int c = 0; c < layout.cells(); ++c) {
        if (c == strips_.first_cell(static_cast<int>(first_of_strip_.size())))
            first_of_strip_.push_back(
                {whole_cells_.size(), loose_points_.size(), shortened_.size(), alone_.size(), remembering_.size()});
        const int first = points.first_of_cell[c];
        const int last = points.first_of_cell[c + 1];
        const std::span<const Sliver> slivers = body_.slivers_of(c, c + 1);
        const auto is_alone = [&](std::span<const int> fields) {
            int count = 0;
            for (int q = first; q < last; ++q) count += std::ranges::equal(fields, points.node[q]);
            for (const Sliver& sliver : slivers) count += std::ranges::equal(fields, sliver.node);
            return count == 1;
        };
        const bool remembers = history_ && history_->is_in(c);
        if (!remembers && body_.cell_is_whole(c)) {
            whole_cells_.push_back(c);
        } else if (const auto rest = body_.rest_of_cell(c)) {
            shortened_.push_back({c, *rest});
        } else {
            for (int p = first; p < last; ++p) {
                if (!remembers) loose_points_.push_back(p);
                if (layout.degree == 1 && is_alone(points.node[p])) add_alone(p);
            }
            if (remembers) for_groups(points, c, [&](const PointGroup& group) { remembering_.push_back(group); });
        }
        for (const Sliver& sliver : slivers)
            if (is_alone(sliver.node)) add_alone(c, sliver.node, sliver.share * points.volume[sliver.point], sliver.moments);
    }
    first_of_strip_.push_back({whole_cells_.size(), loose_points_.size(), shortened_.size(), alone_.size(), remembering_.size()});
}

double InternalForce::crosswise_stiffness(const Alone& alone, const Eigen::Matrix3d& stiffness) const {
    // The energy of q is V/2 [(I_y C_xx + I_x C_ss) q_x^2 + (I_x C_yy + I_y C_ss) q_y^2], shear coupling aside.
    const Vec2& moment = alone.moments;
    const double both = moment.y() * stiffness(0, 0) + moment.x() * stiffness(1, 1) + moment.sum() * stiffness(2, 2);
    const double area = body_.layout.cell.prod();
    return 0.5 * alone.volume * both / (area * area);
}

void InternalForce::add_alone(int p) {
    const Points& points = body_.points;
    Vec2 moments = body_.layout.point_size().cwiseAbs2() / 12.0;
    double left = 1.0;
    for (const Sliver& sliver : body_.slivers_of(points.cell[p], points.cell[p] + 1)) {
        if (sliver.point != p) continue;
        const Vec2& middle = points.position[p];
        left -= sliver.share;
        moments -= sliver.share * (sliver.moments + (sliver.position - middle).cwiseAbs2());
        moments = moments / left - (sliver.middle_of_rest(middle) - middle).cwiseAbs2();
    }
    add_alone(points.cell[p], points.node[p], left * points.volume[p], moments);
}

void InternalForce::add_alone(int cell, std::span<const int> fields, double volume, const Vec2& moments) {
    const Vec2& size = body_.layout.cell;
    const Vec2 least = least_crosswise_ * size.prod() * body_.layout.thickness / volume * size.cwiseAbs2();
    Alone alone{cell, {fields[0], fields[1], fields[2], fields[3]}, volume, moments.cwiseMax(least), 0.0};
    alone.stiffness = crosswise_stiffness(alone, body_.points.stiffness_of(body_.points.first_of_cell[cell]));
    alone_.push_back(alone);
}

// The wood as it is, and its slope by a number.
struct InternalForce::OwnWood {
    const Discretisation& body;
    const std::array<double, 6>& stiffness(int cell) const { return body.points.stiffness[cell]; }
    const Vec2& moduli(int cell) const { return body.points.moduli[cell]; }
    const Unevenness& unevenness(const UnevenCells::Piece& piece) const { return *piece.wood; }
    double of_alone(const Alone& alone) const { return alone.stiffness; }
    static constexpr bool has(int) { return true; }
};

struct InternalForce::ChangeOfWood {
    const InternalForce& force;
    const MaterialSlope& number;
    std::array<double, 6> stiffness(int cell) const {
        const Eigen::Matrix3d& C = number.stiffness(cell);
        return {C(0, 0), C(0, 1), C(1, 1), C(2, 2), C(0, 2), C(1, 2)};
    }
    const Vec2& moduli(int cell) const { return number.moduli(cell); }
    const Unevenness& unevenness(const UnevenCells::Piece& piece) const { return number.unevenness(piece.cell, piece.box); }
    double of_alone(const Alone& alone) const { return force.crosswise_stiffness(alone, number.stiffness(alone.cell)); }
    bool has(int cell) const { return !number.stiffness(cell).isZero(0.0); }
};

// Of a whole cell, by d = h_x h_y q [N/m].
Vec2 InternalForce::bending_stiffness(const Vec2& moduli) const {
    const Vec2& cell = body_.layout.cell;
    return body_.layout.thickness / 12.0 * Vec2(cell.y() / cell.x() * moduli.x(), cell.x() / cell.y() * moduli.y());
}

// `BilinearPiece` without coupling, written out.
template <bool Rotates, class Wood>
double InternalForce::visit_whole_cells(std::span<const int> cells, const Wood& wood, const std::vector<Vec2>& displacement,
                                        Wanted wanted, std::vector<Vec2>* force) const {
    const Points& points = body_.points;
    const Vec2 half_slope = 0.5 * body_.layout.cell.cwiseInverse();
    const double volume = body_.layout.cell.prod() * body_.layout.thickness;
    double energy = 0.0;
    for (const int c : cells) {
        if (!wood.has(c)) continue;
        const auto node = points.node[points.first_of_cell[c]];
        const Vec2 &u0 = displacement[node[0]], &u1 = displacement[node[1]], &u2 = displacement[node[2]],
                   &u3 = displacement[node[3]];
        const Vec2 rising = u3 - u0, falling = u1 - u2;
        const Vec2 by_x = half_slope.x() * (rising + falling), by_y = half_slope.y() * (rising - falling);  // du_i / dX_j
        Vec2 d = u0 - u1 - u2 + u3;
        double strain_xx = by_x.x(), strain_yy = by_y.y(), shear = by_x.y() + by_y.x(), cosine = 1.0, sine = 0.0, scale = 0.0;
        if constexpr (Rotates) {
            const double c_part = 2.0 + by_x.x() + by_y.y();
            const double s_part = by_x.y() - by_y.x();
            scale = 1.0 / std::sqrt(c_part * c_part + s_part * s_part);
            cosine = c_part * scale;
            sine = s_part * scale;
            strain_xx = cosine * (1.0 + by_x.x()) + sine * by_x.y() - 1.0;
            strain_yy = cosine * (1.0 + by_y.y()) - sine * by_y.x() - 1.0;
            shear = 2.0 * (cosine * by_y.x() + sine * (1.0 + by_y.y()));
            d = {cosine * d.x() + sine * d.y(), cosine * d.y() - sine * d.x()};
        }
        const auto& C = wood.stiffness(c);
        const double local_xx = volume * (C[0] * strain_xx + C[1] * strain_yy + C[4] * shear);
        const double local_yy = volume * (C[1] * strain_xx + C[2] * strain_yy + C[5] * shear);
        const double local_xy = volume * (C[4] * strain_xx + C[5] * strain_yy + C[3] * shear);
        Vec2 pull = bending_stiffness(wood.moduli(c)).cwiseProduct(d);
        if (wanted != Wanted::forces)
            energy += 0.5 * (local_xx * strain_xx + local_yy * strain_yy + local_xy * shear + pull.dot(d));
        if (wanted == Wanted::energy) continue;
        Vec2 along_x(local_xx, local_xy), along_y(local_xy, local_yy);  // columns of the stress
        if constexpr (Rotates) {
            const double skew = scale * (0.5 * shear * (local_yy - local_xx) + (strain_xx - strain_yy) * local_xy +
                                         pull.y() * d.x() - pull.x() * d.y());
            const double upper = local_xy + skew, lower = local_xy - skew;
            along_x = {cosine * local_xx - sine * lower, sine * local_xx + cosine * lower};
            along_y = {cosine * upper - sine * local_yy, sine * upper + cosine * local_yy};
            pull = {cosine * pull.x() - sine * pull.y(), sine * pull.x() + cosine * pull.y()};
        }
        along_x *= half_slope.x();
        along_y *= half_slope.y();
        const Vec2 sum = along_x + along_y, difference = along_x - along_y;
        (*force)[node[0]] -= pull - sum;
        (*force)[node[1]] -= difference - pull;
        (*force)[node[2]] += difference + pull;
        (*force)[node[3]] -= pull + sum;
    }
    return energy;
}

template <int PointsPerCell, bool Rotates, class Wood>
double InternalForce::visit_splines(std::span<const int> cells, const Wood& wood, const std::vector<Vec2>& displacement,
                                    Wanted wanted, std::vector<Vec2>* force) const {
    constexpr int Nodes = 9;
    using Lane = Eigen::Array<double, PointsPerCell, 1>;  // the cell's points side by side
    const Points& points = body_.points;
    std::array<Lane, Nodes> slope_x, slope_y;
    slope_x.fill(Lane::Zero());
    slope_y.fill(Lane::Zero());
    const double volume = body_.layout.cell.prod() * body_.layout.thickness / PointsPerCell;
    int known = -1;  // the first of the slots whose slopes these are
    double energy = 0.0;
    for (const int c : cells) {
        if (!wood.has(c)) continue;
        const int first = points.first_of_cell[c];
        if (const int slot = points.slot[first]; slot != known) {
            known = slot;
            for (int k = 0; k < Nodes; ++k) {
                for (int place = 0; place < PointsPerCell; ++place) {
                    slope_x[k][place] = body_.weights[slot + place].slope_x[k];
                    slope_y[k][place] = body_.weights[slot + place].slope_y[k];
                }
            }
        }
        const auto node = points.node[first];
        Lane xx = Lane::Zero(), xy = Lane::Zero(), yx = Lane::Zero(), yy = Lane::Zero();  // du_i / dX_j
        for (int k = 0; k < Nodes; ++k) {
            const Vec2 u = displacement[node[k]];
            xx += u.x() * slope_x[k];
            xy += u.x() * slope_y[k];
            yx += u.y() * slope_x[k];
            yy += u.y() * slope_y[k];
        }
        const std::array<double, 6>& C = wood.stiffness(c);
        Lane cosine, sine, scale, strain_xx, strain_yy, shear;
        if constexpr (Rotates) {  // elastic_state, written out for many points at once
            const Lane c_part = 2.0 + xx + yy;
            const Lane s_part = yx - xy;
            scale = 1.0 / (c_part * c_part + s_part * s_part).sqrt();
            cosine = c_part * scale;
            sine = s_part * scale;
            strain_xx = cosine * (1.0 + xx) + sine * yx - 1.0;
            strain_yy = cosine * (1.0 + yy) - sine * xy - 1.0;
            shear = 2.0 * (cosine * xy + sine * (1.0 + yy));
        } else {
            strain_xx = xx;
            strain_yy = yy;
            shear = xy + yx;
        }
        const Lane local_xx = volume * (C[0] * strain_xx + C[1] * strain_yy + C[4] * shear);
        const Lane local_yy = volume * (C[1] * strain_xx + C[2] * strain_yy + C[5] * shear);
        const Lane local_xy = volume * (C[4] * strain_xx + C[5] * strain_yy + C[3] * shear);
        if (wanted != Wanted::forces) energy += 0.5 * (local_xx * strain_xx + local_yy * strain_yy + local_xy * shear).sum();
        if (wanted == Wanted::energy) continue;
        Lane P_xx = local_xx, P_xy = local_xy, P_yx = local_xy, P_yy = local_yy;
        if constexpr (Rotates) {  // B^T s of Polar::strain_slope, turned
            const Lane skew = scale * (0.5 * shear * (local_yy - local_xx) + (strain_xx - strain_yy) * local_xy);
            const Lane upper = local_xy + skew;
            const Lane lower = local_xy - skew;
            P_xx = cosine * local_xx - sine * lower;
            P_xy = cosine * upper - sine * local_yy;
            P_yx = sine * local_xx + cosine * lower;
            P_yy = sine * upper + cosine * local_yy;
        }
        for (int k = 0; k < Nodes; ++k) {
            (*force)[node[k]].x() -= (P_xx * slope_x[k] + P_xy * slope_y[k]).sum();
            (*force)[node[k]].y() -= (P_yx * slope_x[k] + P_yy * slope_y[k]).sum();
        }
    }
    return energy;
}

template <class Wood>
double InternalForce::visit_cells(std::span<const int> cells, const Wood& wood, const std::vector<Vec2>& displacement,
                                  Wanted wanted, std::vector<Vec2>* force) const {
    if (body_.layout.degree == 1)
        return rotates_ ? visit_whole_cells<true>(cells, wood, displacement, wanted, force)
                        : visit_whole_cells<false>(cells, wood, displacement, wanted, force);
    const auto with = [&]<int PointsPerCell>() {
        return rotates_ ? visit_splines<PointsPerCell, true>(cells, wood, displacement, wanted, force)
                        : visit_splines<PointsPerCell, false>(cells, wood, displacement, wanted, force);
    };
    switch (body_.layout.per_side) {
    case 1:
        return with.template operator()<1>();
    case 2:
        return with.template operator()<4>();
    case 3:
        return with.template operator()<9>();
    case 4:
        return with.template operator()<16>();
    default:
        return with.template operator()<25>();
    }
}

template <int Count>
Eigen::Matrix<double, 8, 8> InternalForce::tangent_of(std::span<const int> group, const std::vector<Vec2>& displacement,
                                                      bool geometric) const {
    using Lane = Eigen::Array<double, Count, 1>;
    const Points& points = body_.points;
    const auto node = points.node[group[0]];
    std::array<Lane, 4> slope_x, slope_y;
    std::array<Lane, 4> gradient;
    gradient.fill(Lane::Zero());
    for (int k = 0; k < 4; ++k) {
        for (int i = 0; i < Count; ++i) {
            const CellWeights& w = body_.weights[points.slot[group[i]]];
            slope_x[k][i] = w.slope_x[k];
            slope_y[k][i] = w.slope_y[k];
        }
        if (!rotates_) continue;
        const Vec2 u = displacement[node[k]];
        gradient[0] += u.x() * slope_x[k];
        gradient[1] += u.x() * slope_y[k];
        gradient[2] += u.y() * slope_x[k];
        gradient[3] += u.y() * slope_y[k];
    }
    Lane volume;
    for (int i = 0; i < Count; ++i) volume[i] = points.volume[group[i]];
    std::array<Lane, 6> C;
    for (int k = 0; k < 6; ++k) C[k] = volume * points.stiffness[points.cell[group[0]]][k];
    const std::array<std::array<Lane, 4>, 4> A = elastic_tangent(gradient, C, rotates_, geometric);
    Eigen::Matrix<double, 8, 8> sum;
    for (int b = 0; b < 4; ++b) {
        for (int k = 0; k < 2; ++k) {
            std::array<Lane, 4> stress;  // per displacement
            for (int i = 0; i < 4; ++i) stress[i] = slope_x[b] * A[i][2 * k] + slope_y[b] * A[i][2 * k + 1];
            for (int a = b; a < 4; ++a) {
                sum(2 * a, 2 * b + k) = (stress[0] * slope_x[a] + stress[1] * slope_y[a]).sum();
                sum(2 * a + 1, 2 * b + k) = (stress[2] * slope_x[a] + stress[3] * slope_y[a]).sum();
            }
        }
    }
    for (int b = 1; b < 4; ++b)
        for (int a = 0; a < b; ++a) sum.block<2, 2>(2 * a, 2 * b) = sum.block<2, 2>(2 * b, 2 * a).transpose();
    return sum;
}

// With B the strain's slope by the nodes' displacements, as the law sees it, and C the law's tangent: sum of V B^T C B, and what
// the stress, shared as the strain is, puts on the change of B as it is.
Eigen::Matrix<double, 8, 8> InternalForce::remembering_tangent(const PointGroup& group, const std::vector<Vec2>& displacement,
                                                               bool geometric) const {
    using Slope = Eigen::Matrix<double, 3, 8>;
    using Gradients = Eigen::Matrix<double, 4, 8>;
    const SeenStrains seen(body_, *history_, group, displacement, rotates_);
    std::array<Gradients, most_in_group> gradients;  // xx, xy, yx, yy by the nodes' displacements
    std::array<Slope, most_in_group> slopes;
    std::array<Eigen::Vector3d, most_in_group> stresses;
    std::array<Eigen::Matrix3d, most_in_group> tangents;
    for (int i = 0; i < group.count; ++i) {
        const CellWeights& w = body_.weights[body_.points.slot[group.point[i]]];
        gradients[i].setZero();
        for (int k = 0; k < 4; ++k)
            for (int axis = 0; axis < 2; ++axis) gradients[i].block<2, 1>(2 * axis, 2 * k + axis) << w.slope_x[k], w.slope_y[k];
        if (rotates_) {
            const Polar polar(seen.gradient[i]);
            Eigen::Matrix4d back = Eigen::Matrix4d::Zero();  // R^T dF of dF
            for (int a = 0; a < 2; ++a)
                for (int b = 0; b < 2; ++b) back.block<2, 2>(2 * a, 2 * b).diagonal().setConstant(polar.turn(b, a));
            slopes[i] = polar.strain_slope() * back * gradients[i];
        } else {
            slopes[i] << gradients[i].row(0), gradients[i].row(3), gradients[i].row(1) + gradients[i].row(2);
        }
        const PlaneResponse response = history_->respond(group.point[i], seen.strain[i]);
        stresses[i] = response.stress;
        tangents[i] = response.tangent;
    }
    seen.share(slopes);
    seen.share(stresses);
    Eigen::Matrix<double, 8, 8> sum = Eigen::Matrix<double, 8, 8>::Zero();
    for (int i = 0; i < group.count; ++i) {
        const double volume = body_.points.volume[group.point[i]];
        sum += volume * slopes[i].transpose() * tangents[i] * slopes[i];
        if (!rotates_ || !geometric) continue;
        const Mat2& G = seen.gradient[i];
        const auto stress = [&](double, double, double) { return std::array{stresses[i][0], stresses[i][1], stresses[i][2]}; };
        const auto A = tangent_with<double>({G(0, 0), G(0, 1), G(1, 0), G(1, 1)}, {}, stress, true, true);
        Eigen::Matrix4d turning;
        for (int a = 0; a < 4; ++a)
            for (int b = 0; b < 4; ++b) turning(a, b) = A[a][b];
        sum += volume * gradients[i].transpose() * turning * gradients[i];
    }
    return sum;
}

Eigen::Matrix<double, 8, 8> InternalForce::tangent(const PointGroup& group, const std::vector<Vec2>& displacement,
                                                   bool geometric) const {
    const int first = group.point[0], cell = body_.points.cell[first];
    if (history_ && history_->is_in(cell)) return remembering_tangent(group, displacement, geometric);
    if (body_.layout.degree == 1 && body_.cell_is_whole(cell)) return whole_tangent(cell, displacement, geometric);
    const Shortened* rest = shortened(cell);
    Eigen::Matrix<double, 8, 8> sum =
        rest ? rest_of(*rest, body_.points.stiffness_of(first), body_.points.moduli[cell], displacement).tangent(geometric)
             : elastic_tangent_of(group.points(), displacement, geometric);
    for (const UnevenCells::Piece& piece : uneven_.pieces(cell, cell + 1))
        if (!piece.is_sliver && body_.points.node.same(piece.point, first))
            sum += uneven_.tangent(piece, displacement, geometric);
    return sum;
}

BilinearPiece InternalForce::rest_of(const Shortened& cell, const Eigen::Matrix3d& stiffness, const Vec2& moduli,
                                     const std::vector<Vec2>& displacement) const {
    const Layout& layout = body_.layout;
    BilinearPiece::Wood wood;
    wood.S = cell.rest.share * layout.thickness * layout.cell.prod() * stiffness;
    wood.H = (cell.rest.share * bending_stiffness(moduli)).asDiagonal();
    return {wood,         cell.rest.middle, layout.cell, body_.points.node[body_.points.first_of_cell[cell.cell]],
            displacement, rotates_};
}

const InternalForce::Shortened* InternalForce::shortened(int c) const {
    const auto found = std::ranges::lower_bound(shortened_, c, {}, &Shortened::cell);
    return found != shortened_.end() && found->cell == c ? &*found : nullptr;
}

// The sliver itself, what is left of the point, and less the point as it would be without.
std::array<InternalForce::Corners, 3> InternalForce::changes_by(const Sliver& sliver) const {
    const Points& points = body_.points;
    const int p = sliver.point, c = points.cell[p];
    const auto node = points.node[p];
    const std::array<int, 4> own{node[0], node[1], node[2], node[3]};
    const double volume = points.volume[p];
    const CellWeights& w = body_.weights[points.slot[p]];
    Corners whole{own, {}, -volume};
    for (int k = 0; k < 4; ++k) whole.slope[k] = {w.slope_x[k], w.slope_y[k]};
    if (shortened(c)) return {{{sliver.node, body_.slopes_at(c, sliver.position), sliver.share * volume}}};
    return {{{sliver.node, body_.slopes_at(c, sliver.position), sliver.share * volume},
             {own, body_.slopes_at(c, sliver.middle_of_rest(points.position[p])), (1.0 - sliver.share) * volume},
             whole}};
}

Mat2 InternalForce::Corners::gradient(const std::vector<Vec2>& displacement) const {
    Mat2 sum = Mat2::Zero();
    for (int k = 0; k < 4; ++k) sum += displacement[node[k]] * slope[k].transpose();
    return sum;
}

std::array<Eigen::Matrix<double, 8, 8>, 2> InternalForce::tangents(const Sliver& sliver, const std::vector<Vec2>& displacement,
                                                                   bool geometric) const {
    const auto tangent = [&](const Corners& at) {
        std::array<double, 6> C = body_.points.stiffness[body_.points.cell[sliver.point]];
        for (double& c : C) c *= at.volume;
        const Mat2 G = at.gradient(displacement);
        const auto A = elastic_tangent<double>({G(0, 0), G(0, 1), G(1, 0), G(1, 1)}, C, rotates_, geometric);
        Eigen::Matrix4d second;  // by the gradient's xx, xy, yx, yy
        for (int a = 0; a < 4; ++a)
            for (int b = 0; b < 4; ++b) second(a, b) = A[a][b];
        Eigen::Matrix<double, 4, 8> slopes = Eigen::Matrix<double, 4, 8>::Zero();
        for (int k = 0; k < 4; ++k)
            for (int axis = 0; axis < 2; ++axis) slopes.block<2, 1>(2 * axis, 2 * k + axis) = at.slope[k];
        return Eigen::Matrix<double, 8, 8>(slopes.transpose() * second * slopes);
    };
    const auto [own, rest, whole] = changes_by(sliver);
    std::array<Eigen::Matrix<double, 8, 8>, 2> both{tangent(own), Eigen::Matrix<double, 8, 8>::Zero()};
    if (rest.volume > 0.0) both[1] = tangent(rest) + tangent(whole);
    const int c = body_.points.cell[sliver.point];
    for (const UnevenCells::Piece& piece : uneven_.pieces(c, c + 1))
        if (piece.is_sliver && piece.point == sliver.point) both[0] += uneven_.tangent(piece, displacement, geometric);
    return both;
}

Eigen::Matrix<double, 8, 8> InternalForce::whole_tangent(int cell, const std::vector<Vec2>& displacement, bool geometric) const {
    const Layout& layout = body_.layout;
    const int first = body_.points.first_of_cell[cell];
    const double area = layout.cell.prod();
    BilinearPiece::Wood wood;
    wood.S = layout.thickness * area * body_.points.stiffness_of(first);
    wood.H = bending_stiffness(body_.points.moduli[cell]).asDiagonal();
    for (const UnevenCells::Piece& piece : uneven_.pieces(cell, cell + 1)) {
        wood.G += layout.thickness * piece.wood->coupling;
        wood.H += layout.thickness / area * piece.wood->bending;
    }
    return BilinearPiece(wood, Vec2::Constant(0.5), layout.cell, body_.points.node[first], displacement, rotates_)
        .tangent(geometric);
}

Eigen::Matrix<double, 8, 8> InternalForce::elastic_tangent_of(std::span<const int> group, const std::vector<Vec2>& displacement,
                                                              bool geometric) const {
    switch (group.size()) {
    case 1:
        return tangent_of<1>(group, displacement, geometric);
    case 4:
        return tangent_of<4>(group, displacement, geometric);
    case 9:
        return tangent_of<9>(group, displacement, geometric);
    case 16:
        return tangent_of<16>(group, displacement, geometric);
    case 25:
        return tangent_of<25>(group, displacement, geometric);
    default:
        return elastic_tangent_of(group.first(1), displacement, geometric) +
               elastic_tangent_of(group.subspan(1), displacement, geometric);
    }
}

void InternalForce::add_stress(int p, const Mat2& stress, std::vector<Vec2>& force) const {
    const CellWeights& w = body_.weights[body_.points.slot[p]];
    const auto node = body_.points.node[p];
    for (std::size_t k = 0; k < node.size(); ++k)
        force[node[k]] -= body_.points.volume[p] * (stress * Vec2(w.slope_x[k], w.slope_y[k]));
}

double InternalForce::visit_remembering(std::span<const PointGroup> groups, const std::vector<Vec2>& displacement, Wanted wanted,
                                        std::vector<Vec2>* force) const {
    double energy = 0.0;
    for (const PointGroup& group : groups) {
        const SeenStrains seen(body_, *history_, group, displacement, rotates_);
        std::array<Eigen::Vector3d, most_in_group> stresses;
        for (int i = 0; i < group.count; ++i) {
            const int p = group.point[i];
            if (wanted != Wanted::energy) stresses[i] = history_->respond(p, seen.strain[i]).stress;
            if (wanted != Wanted::forces) energy += body_.points.volume[p] * history_->stored(p, seen.strain[i]);
        }
        if (wanted == Wanted::energy) continue;
        seen.share(stresses);
        for (int i = 0; i < group.count; ++i) {
            const auto stress = [&](const Eigen::Vector3d&) { return stresses[i]; };
            add_stress(group.point[i], state_with(seen.gradient[i], rotates_, stress).stress, *force);
        }
    }
    return energy;
}

template <class Wood>
double InternalForce::visit(int strip, const Wood& wood, const std::vector<Vec2>& displacement, Wanted wanted,
                            std::vector<Vec2>* force) const {
    const Points& points = body_.points;
    const Place& from = first_of_strip_[strip];
    const Place& to = first_of_strip_[strip + 1];
    const bool forces = wanted != Wanted::energy;
    const std::span<const int> cells(whole_cells_.data() + from.whole_cell, to.whole_cell - from.whole_cell);
    double energy = visit_cells(cells, wood, displacement, wanted, force);
    for (std::size_t i = from.shortened; i < to.shortened; ++i) {
        const int c = shortened_[i].cell;
        if (!wood.has(c)) continue;
        const auto node = points.node[points.first_of_cell[c]];
        const BilinearPiece piece = rest_of(shortened_[i], matrix_of(wood.stiffness(c)), wood.moduli(c), displacement);
        energy += piece.energy();
        if (!forces) continue;
        const Eigen::Matrix<double, 8, 1> pull = piece.force();
        for (int k = 0; k < 4; ++k) (*force)[node[k]] -= pull.segment<2>(2 * k);
    }
    for (std::size_t i = from.loose_point; i < to.loose_point; ++i) {
        const int p = loose_points_[i];
        if (!wood.has(points.cell[p])) continue;
        const auto& C = wood.stiffness(points.cell[p]);
        const PointState state = elastic_state(gradient_at(body_, p, displacement), matrix_of(C), rotates_);
        energy += points.volume[p] * state.energy;
        if (forces) add_stress(p, state.stress, *force);
    }
    for (const Sliver& sliver : body_.slivers_of(strips_.first_cell(strip), strips_.first_cell(strip + 1))) {
        const int p = sliver.point, c = points.cell[p];
        if (!wood.has(c)) continue;
        const Eigen::Matrix3d stiffness = matrix_of(wood.stiffness(c));
        for (const Corners& at : changes_by(sliver)) {
            if (at.volume == 0.0) continue;
            const PointState state = elastic_state(at.gradient(displacement), stiffness, rotates_);
            energy += at.volume * state.energy;
            for (int k = 0; k < 4 && forces; ++k) (*force)[at.node[k]] -= at.volume * (state.stress * at.slope[k]);
        }
    }
    for (const UnevenCells::Piece& piece : uneven_.pieces(strips_.first_cell(strip), strips_.first_cell(strip + 1))) {
        if (!wood.has(piece.cell)) continue;
        const UnevenCells::State state = uneven_.state(piece, wood.unevenness(piece), displacement);
        energy += state.energy;
        for (int k = 0; k < 4 && forces; ++k) (*force)[piece.node[k]] -= state.force.segment<2>(2 * k);
    }
    for (std::size_t i = from.alone; i < to.alone; ++i) {
        const double stiffness = wood.of_alone(alone_[i]);
        const auto& node = alone_[i].node;
        Vec2 apart = Vec2::Zero();  // u_0 - u_1 - u_2 + u_3
        for (int k = 0; k < 4; ++k) apart += crosswise_sign[k] * displacement[node[k]];
        energy += 0.5 * stiffness * apart.squaredNorm();
        for (int k = 0; k < 4 && forces; ++k) (*force)[node[k]] -= crosswise_sign[k] * stiffness * apart;
    }
    return energy;
}

void InternalForce::add(const std::vector<Vec2>& displacement, std::vector<Vec2>& force, Team& team) const {
    strips_.each(team, [&](int strip) {
        visit(strip, OwnWood{body_}, displacement, Wanted::forces, &force);
        visit_remembering(remembering_of(strip), displacement, Wanted::forces, &force);
    });
}

double InternalForce::add_with_energy(const std::vector<Vec2>& displacement, std::vector<Vec2>& force, bool side_by_side) const {
    std::vector<double> energy(strips_.count());
    strips_.each(side_by_side, [&](int strip) {
        energy[strip] = visit(strip, OwnWood{body_}, displacement, Wanted::both, &force) +
                        visit_remembering(remembering_of(strip), displacement, Wanted::both, &force);
    });
    return std::accumulate(energy.begin(), energy.end(), 0.0);
}

double InternalForce::add_slope(const MaterialSlope& number, const std::vector<Vec2>& displacement,
                                std::vector<Vec2>& force) const {
    double sum = 0.0;
    for (int strip = 0; strip < strips_.count(); ++strip)
        sum += visit(strip, ChangeOfWood{*this, number}, displacement, Wanted::both, &force);
    return sum;
}

double InternalForce::energy(const std::vector<Vec2>& displacement) const {
    double sum = 0.0;
    for (int strip = 0; strip < strips_.count(); ++strip) {
        sum += visit(strip, OwnWood{body_}, displacement, Wanted::energy, nullptr);
        sum += visit_remembering(remembering_of(strip), displacement, Wanted::energy, nullptr);
    }
    return sum;
}

}  // namespace crampfit

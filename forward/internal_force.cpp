#include "forward/internal_force.hpp"

#include "forward/deformation.hpp"

#include <algorithm>

namespace crampfit {

InternalForce::InternalForce(const Discretisation& body, bool rotates) : body_(body), rotates_(rotates) { sort_cells(); }

void InternalForce::sort_cells() {
    const Points& points = body_.points;
    whole_cells_.clear();
    loose_points_.clear();
    alone_.clear();
    for (int c = 0; c < body_.layout.cells(); ++c) {
        const int first = points.first_of_cell[c];
        const int last = points.first_of_cell[c + 1];
        const auto same = [&](const std::array<int, 4>& node) { return node == points.node[first]; };
        if (body_.cell_is_full(c) && std::all_of(points.node.begin() + first, points.node.begin() + last, same))
            whole_cells_.push_back(c);
        else
            for (int p = first; p < last; ++p) {
                loose_points_.push_back(p);
                if (std::count(points.node.begin() + first, points.node.begin() + last, points.node[p]) == 1)
                    alone_.push_back({p, crosswise_stiffness(p, points.stiffness_of(p))});
            }
    }
}

double InternalForce::crosswise_stiffness(int point, const Eigen::Matrix3d& stiffness) const {
    // With the second moments of the domain, side^2 / 12, the energy of q is V/2 [(I_y C_xx + I_x C_ss) q_x^2 + (I_x C_yy + I_y C_ss)
    // q_y^2], shear coupling aside.
    const Points& points = body_.points;
    const Vec2 moment = body_.layout.point_size().cwiseAbs2() / 12.0;
    const double both = moment.y() * stiffness(0, 0) + moment.x() * stiffness(1, 1) + moment.sum() * stiffness(2, 2);
    const double area = body_.layout.cell.prod();
    return 0.5 * points.volume[point] * both / (area * area);
}

Vec2 InternalForce::crosswise(int point, const std::vector<Vec2>& displacement) const {
    Vec2 sum = Vec2::Zero();
    for (int k = 0; k < 4; ++k) sum += crosswise_sign[k] * displacement[body_.points.node[point][k]];
    return sum;
}

template <int PointsPerCell, bool Rotates>
double InternalForce::visit_whole_cells(const std::vector<Vec2>& displacement, std::vector<Vec2>* force) const {
    using Lane = Eigen::Array<double, PointsPerCell, 1>;  // the cell's points side by side
    const Points& points = body_.points;
    std::array<Lane, 4> slope_x, slope_y;
    for (int k = 0; k < 4; ++k) {
        for (int slot = 0; slot < PointsPerCell; ++slot) {
            slope_x[k][slot] = body_.weights[slot].slope_x[k];
            slope_y[k][slot] = body_.weights[slot].slope_y[k];
        }
    }
    double energy = 0.0;
    for (const int c : whole_cells_) {
        const int first = points.first_of_cell[c];
        const std::array<int, 4>& node = points.node[first];
        Lane xx = Lane::Zero(), xy = Lane::Zero(), yx = Lane::Zero(), yy = Lane::Zero();  // du_i / dX_j
        for (int k = 0; k < 4; ++k) {
            const Vec2 u = displacement[node[k]];
            xx += u.x() * slope_x[k];
            xy += u.x() * slope_y[k];
            yx += u.y() * slope_x[k];
            yy += u.y() * slope_y[k];
        }
        const Lane volume = Eigen::Map<const Lane>(&points.volume[first]);
        const auto C = [&](int k) { return Eigen::Map<const Lane>(&points.stiffness[k][first]); };
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
        const Lane local_xx = volume * (C(0) * strain_xx + C(1) * strain_yy + C(4) * shear);
        const Lane local_yy = volume * (C(1) * strain_xx + C(2) * strain_yy + C(5) * shear);
        const Lane local_xy = volume * (C(4) * strain_xx + C(5) * strain_yy + C(3) * shear);
        if (!force) {
            energy += 0.5 * (local_xx * strain_xx + local_yy * strain_yy + local_xy * shear).sum();
            continue;
        }
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
        for (int k = 0; k < 4; ++k) {
            (*force)[node[k]].x() -= (P_xx * slope_x[k] + P_xy * slope_y[k]).sum();
            (*force)[node[k]].y() -= (P_yx * slope_x[k] + P_yy * slope_y[k]).sum();
        }
    }
    return energy;
}

double InternalForce::visit_whole_cells(const std::vector<Vec2>& displacement, std::vector<Vec2>* force) const {
    const auto visit = [&]<int N>() {
        return rotates_ ? visit_whole_cells<N, true>(displacement, force) : visit_whole_cells<N, false>(displacement, force);
    };
    switch (body_.layout.per_side) {
        case 1: return visit.template operator()<1>();
        case 2: return visit.template operator()<4>();
        case 3: return visit.template operator()<9>();
        case 4: return visit.template operator()<16>();
        default: return visit.template operator()<25>();
    }
}

template <int Count>
Eigen::Matrix<double, 8, 8> InternalForce::tangent_of(int first, const std::vector<Vec2>& displacement, bool geometric) const {
    using Lane = Eigen::Array<double, Count, 1>;
    const Points& points = body_.points;
    const std::array<int, 4>& node = points.node[first];
    std::array<Lane, 4> slope_x, slope_y;
    std::array<Lane, 4> gradient;
    gradient.fill(Lane::Zero());
    for (int k = 0; k < 4; ++k) {
        for (int i = 0; i < Count; ++i) {
            const CellWeights& w = body_.weights[points.slot[first + i]];
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
    const Lane volume = Eigen::Map<const Lane>(&points.volume[first]);
    std::array<Lane, 6> C;
    for (int k = 0; k < 6; ++k) C[k] = volume * Eigen::Map<const Lane>(&points.stiffness[k][first]);
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

Eigen::Matrix<double, 8, 8> InternalForce::tangent(int first, int count, const std::vector<Vec2>& displacement, bool geometric) const {
    switch (count) {
        case 1: return tangent_of<1>(first, displacement, geometric);
        case 4: return tangent_of<4>(first, displacement, geometric);
        case 9: return tangent_of<9>(first, displacement, geometric);
        case 16: return tangent_of<16>(first, displacement, geometric);
        case 25: return tangent_of<25>(first, displacement, geometric);
        default: return tangent(first, 1, displacement, geometric) + tangent(first + 1, count - 1, displacement, geometric);
    }
}

void InternalForce::add(const std::vector<Vec2>& displacement, std::vector<Vec2>& force) const {
    visit_whole_cells(displacement, &force);
    const Points& points = body_.points;
    for (const int p : loose_points_) {
        const PointState state = elastic_state(gradient_at(body_, p, displacement), points.stiffness_of(p), rotates_);
        const CellWeights& w = body_.weights[points.slot[p]];
        for (int k = 0; k < 4; ++k)
            force[points.node[p][k]] -= points.volume[p] * (state.stress * Vec2(w.slope_x[k], w.slope_y[k]));
    }
    for (const Alone& a : alone_) {
        const Vec2 pull = a.stiffness * crosswise(a.point, displacement);
        for (int k = 0; k < 4; ++k) force[points.node[a.point][k]] -= crosswise_sign[k] * pull;
    }
}

double InternalForce::energy(const std::vector<Vec2>& displacement) const {
    const Points& points = body_.points;
    double sum = visit_whole_cells(displacement, nullptr);
    for (const int p : loose_points_)
        sum += points.volume[p] *
               elastic_state(gradient_at(body_, p, displacement), points.stiffness_of(p), rotates_).energy;
    for (const Alone& a : alone_) sum += 0.5 * a.stiffness * crosswise(a.point, displacement).squaredNorm();
    return sum;
}

} // namespace crampfit

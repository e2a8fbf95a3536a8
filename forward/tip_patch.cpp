#include "forward/tip_patch.hpp"

#include "forward/deformation.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SparseCholesky>

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

using Sparse = Eigen::SparseMatrix<double>;

// Half width of the patch: so many advances, and so many cells at least.
constexpr double advances_in_reach = 8.0;
constexpr double least_cells_in_reach = 10.0;

// The held outline takes up what a longer crack would pass on to the rest of the specimen: in one wood, where the rate should
// stay as it is, it falls by this much times the way over the half width (`VerificationTipPatch.OneWood`).
constexpr double fall_in_one_wood = 1.62;

// Of the largest stiffness, added everywhere: a field with hardly any wood is loose otherwise.
constexpr double least_stiffness = 1e-9;

// A pair is never taken for stiffer, or softer, than by this.
constexpr double least_softness = 0.05;

// Strain-displacement matrix of a point, xx, yy, 2 xy.
Eigen::Matrix<double, 3, Eigen::Dynamic> strains(const CellWeights& w, int nodes) {
    Eigen::Matrix<double, 3, Eigen::Dynamic> B(3, 2 * nodes);
    for (int k = 0; k < nodes; ++k) B.block<3, 2>(0, 2 * k) << w.slope_x[k], 0, 0, w.slope_y[k], w.slope_y[k], w.slope_x[k];
    return B;
}

}  // namespace

TipPatch::TipPatch(Discretisation& body, const CrackFields& cracks, const Boundary& boundary, int crack, bool at_end,
                   double advance, double slack) {
    const CrackTip tip = cracks.lines[crack].tip(at_end);
    cell_ = way_past_a_node(tip.direction, body.layout.cell);
    // The crack as it will be, as far as that is wood.
    const double h = body.layout.cell.maxCoeff();
    double way = advance + slack;
    if (const auto out = exit_distance(tip.position, tip.direction, {Vec2::Zero(), body.layout.size()}))
        way = std::min(way, *out - 1e-3 * h);
    advance_ = std::min(advance, way - slack);
    if (advance_ <= 0.0) return;  // no more than the next cell is left
    const auto points_before = body.points.node;
    CrackFields ahead = cracks;
    ahead.grow(crack, at_end, tip.position + way * tip.direction);
    reach_ = std::max(advances_in_reach * advance, least_cells_in_reach * h);

    // Whether fields belong to the patch, and whether to wood beyond it too.
    const int fields = ahead.fields();
    std::vector<bool> within(fields, false), beyond(fields, false);
    std::vector<int> cells;
    body.for_cells_near(tip.position, reach_, [&](int c) { cells.push_back(c); });
    std::vector<bool> taken(body.layout.cells(), false);
    for (const int c : cells) taken[c] = true;
    body.for_cells_near(tip.position, reach_ + 1.5 * h, [&](int c) {
        for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p)
            for (const int f : body.points.node[p]) (taken[c] ? within : beyond)[f] = taken[c] || f < cracks.fields();
    });
    std::vector<int> equation(2 * fields, -1), column(2 * fields, -1);
    int equations = 0;
    std::vector<bool> prescribed(2 * fields, false);
    for (const Boundary::Held& held : boundary.held) prescribed[2 * held.field + held.axis] = true;
    for (int f = 0; f < fields; ++f) {
        if (!within[f]) continue;
        const bool any_held = beyond[f] || prescribed[2 * f] || prescribed[2 * f + 1];
        if (any_held) held_.push_back(f), place_.push_back(body.layout.node_position(ahead.node_of_field[f]));
        for (int axis = 0; axis < 2; ++axis) {
            if (beyond[f] || prescribed[2 * f + axis]) column[2 * f + axis] = 2 * static_cast<int>(held_.size()) - 2 + axis;
            else equation[2 * f + axis] = equations++;
        }
    }

    // Stiffness between the free, and between them and the held.
    std::vector<Eigen::Triplet<double>> inner, outer;
    double stiffest = 0.0;
    for (const int c : cells) {
        for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p) {
            const auto B = strains(body.weights[body.points.slot[p]], body.layout.nodes_per_cell());
            const Eigen::MatrixXd K = body.points.volume[p] * B.transpose() * body.points.stiffness_of(p) * B;
            const auto dof = [&](int i) { return 2 * body.points.node[p][i / 2] + i % 2; };
            for (int i = 0; i < K.rows(); ++i) {
                const int row = equation[dof(i)];
                if (row < 0) continue;
                stiffest = std::max(stiffest, K(i, i));
                for (int j = 0; j < K.cols(); ++j) {
                    if (equation[dof(j)] >= 0) inner.emplace_back(row, equation[dof(j)], K(i, j));
                    else outer.emplace_back(row, column[dof(j)], K(i, j));
                }
            }
        }
    }
    // The pairs on the way; the ties of all others stay as they are.
    const std::vector<double> mass = field_masses(body, fields);
    std::vector<const FieldPair*> asked;
    for (const FieldPair& pair : ahead.pairs) {
        if (!within[pair.left] || !within[pair.right] || mass[pair.left] == 0.0 || mass[pair.right] == 0.0) continue;
        const double freed = share_freed(body.layout.node_position(pair.node), tip, body.layout);
        if (pair.crack == crack && std::isfinite(pair.compliance) && freed < 1.0 && freed + way / cell_ > 0.0) {
            const double left = mass[pair.left], right = mass[pair.right];
            asked.push_back(&pair);
            freed_.push_back(freed);
            compliance_.push_back(pair.compliance / tie_share(left, right));
            continue;
        }
        if (pair.freed >= 1.0) continue;
        const double k = shared_tie(pair, mass);
        for (int axis = 0; axis < 2; ++axis) {
            const int l = equation[2 * pair.left + axis], r = equation[2 * pair.right + axis];
            if (l < 0 || r < 0) continue;
            inner.emplace_back(l, l, k), inner.emplace_back(r, r, k), inner.emplace_back(l, r, -k), inner.emplace_back(r, l, -k);
        }
    }
    body.points.node = points_before;
    for (int e = 0; e < equations; ++e) inner.emplace_back(e, e, least_stiffness * stiffest);
    Sparse K(equations, equations), to_held(equations, 2 * static_cast<int>(held_.size()));
    K.setFromTriplets(inner.begin(), inner.end());
    to_held.setFromTriplets(outer.begin(), outer.end());

    const int jumps = 2 * static_cast<int>(asked.size());
    Eigen::MatrixXd apart = Eigen::MatrixXd::Zero(equations, jumps);
    for (int j = 0; j < jumps; ++j) {
        const FieldPair& pair = *asked[j / 2];
        if (equation[2 * pair.left + j % 2] >= 0) apart(equation[2 * pair.left + j % 2], j) += 1.0;
        if (equation[2 * pair.right + j % 2] >= 0) apart(equation[2 * pair.right + j % 2], j) -= 1.0;
    }
    const Eigen::SimplicialLLT<Sparse> factor(K);
    const Eigen::MatrixXd moved = factor.solve(apart);
    flexibility_ = apart.transpose() * moved;
    by_held_ = -moved.transpose() * to_held;
}

Eigen::VectorXd TipPatch::free_jumps(const std::vector<Vec2>& displacement) const {
    // The turn of the patch as a whole, by the best fit of a linear field to what is held.
    Vec2 middle = Vec2::Zero(), mean = Vec2::Zero();
    for (std::size_t i = 0; i < held_.size(); ++i) middle += place_[i], mean += displacement[held_[i]];
    middle /= static_cast<double>(held_.size());
    mean /= static_cast<double>(held_.size());
    Mat2 spread = Mat2::Zero(), arms = Mat2::Zero();
    for (std::size_t i = 0; i < held_.size(); ++i) {
        const Vec2 arm = place_[i] - middle;
        spread += (displacement[held_[i]] - mean) * arm.transpose();
        arms += arm * arm.transpose();
    }
    const Mat2 turn = Polar(spread * arms.inverse()).turn;
    Eigen::VectorXd held(2 * held_.size());
    for (std::size_t i = 0; i < held_.size(); ++i) {
        const Vec2 arm = place_[i] - middle;
        held.segment<2>(2 * i) = turn.transpose() * (arm + displacement[held_[i]] - mean) - arm;
    }
    return by_held_ * held;
}

// Less that without ties [J].
double TipPatch::potential(double at, double softness, const Eigen::VectorXd& jumps) const {
    std::vector<int> tied;
    std::vector<double> tie_compliance;
    for (std::size_t k = 0; k < freed_.size(); ++k) {
        const double f = std::max(0.0, freed_[k] + at / cell_);
        if (f >= 1.0) continue;
        for (int axis = 0; axis < 2; ++axis) {
            tied.push_back(2 * static_cast<int>(k) + axis);
            tie_compliance.push_back(f * softness * compliance_[k] / (1.0 - f));
        }
    }
    const auto n = static_cast<Eigen::Index>(tied.size());
    Eigen::MatrixXd C(n, n);
    Eigen::VectorXd w(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        w[i] = jumps[tied[i]];
        for (Eigen::Index j = 0; j < n; ++j) C(i, j) = flexibility_(tied[i], tied[j]) + (i == j ? tie_compliance[i] : 0.0);
    }
    return 0.5 * w.dot(C.ldlt().solve(w));
}

double TipPatch::softness_for(double gone, const Eigen::VectorXd& jumps) const {
    if (freed_.empty() || jumps.isZero()) return 1.0;
    double next = cell_;  // until the tip is at the next pair
    for (const double freed : freed_) {
        const double until = -(freed * cell_ + gone);
        if (until >= -0.05 * cell_) next = std::min(next, std::max(0.0, until));
    }
    const double from = gone + next;
    const double middle = 0.5 * (potential(from, 1.0, jumps) + potential(from + cell_, 1.0, jumps));
    double low = std::log(least_softness), high = -low;
    for (int k = 0; k < 12; ++k) {
        const double trial = 0.5 * (low + high);
        (potential(from + 0.5 * cell_, std::exp(trial), jumps) > middle ? low : high) = trial;
    }
    return std::exp(0.5 * (low + high));
}

double TipPatch::local_share(double gone, const std::vector<Vec2>& displacement) const {
    if (advance_ <= cell_ || held_.empty()) return 1.0;
    const Eigen::VectorXd jumps = free_jumps(displacement);
    const double softness = softness_for(gone, jumps);
    const double here = potential(gone, softness, jumps);
    const auto rate_over = [&](double way) {
        return (here - potential(gone + way, softness, jumps)) / (way * (1.0 - 0.5 * fall_in_one_wood * way / reach_));
    };
    const double mean = rate_over(advance_);
    return mean > 0.0 ? rate_over(cell_) / mean : 1.0;
}

}  // namespace crampfit

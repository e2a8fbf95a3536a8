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
// Patches go on to sides of the specimen within so many times that: nothing holds those.
constexpr double side_in_reach = 1.5;
// A beam is so many times as long as high.
constexpr double least_length_of_beam = 2.0;

// Of the largest stiffness, added everywhere: a field with hardly any wood is loose otherwise.
constexpr double least_stiffness = 1e-9;

// Pairs so far beyond the next advance count too: how soft a pair is hangs on what the next two give up.
constexpr double cells_beyond = 2.0;

// From cell to cell the rate changes by this part of it at most in one wood.
constexpr double most_bend = 0.25;

// A pair is never taken for stiffer, or softer, than by this.
constexpr double least_softness = 0.05;

// In so many parts of its slack finer cells are asked. What the grid misses goes up and down within a cell.
constexpr std::size_t legs = 4;

// What finer cells give up is never taken for less than this part of what the patch does.
constexpr double least_share = 0.05;

// A rate is what a tip gives up over this part of a cell, or up to where it begins to free the next pair: across a boundary that
// may give up many times as much.
constexpr double little = 0.02, least_way = 1e-3;

// Of a point that sees B-splines, by its fields [N/m].
Eigen::MatrixXd stiffness_of(const Discretisation& body, int p) {
    const CellWeights& w = body.weights[body.points.slot[p]];
    const int nodes = body.layout.nodes_per_cell();
    Eigen::Matrix<double, 3, Eigen::Dynamic> B(3, 2 * nodes);  // strain xx, yy, 2 xy
    for (int k = 0; k < nodes; ++k) B.block<3, 2>(0, 2 * k) << w.slope_x[k], 0, 0, w.slope_y[k], w.slope_y[k], w.slope_x[k];
    return body.points.volume[p] * B.transpose() * body.points.stiffness_of(p) * B;
}

}  // namespace

TipPatch::TipPatch(Discretisation& body, InternalForce& internal_force, const CrackFields& cracks, const Boundary& boundary,
                   int crack, bool at_end, double advance, double slack, double held_at) {
    const CrackTip tip = cracks.lines[crack].tip(at_end);
    cell_ = way_past_a_node(tip.direction, body.layout.cell);
    // The crack as it will be, as far as that is wood.
    const double h = body.layout.cell.maxCoeff();
    way_ = advance + slack + cells_beyond * cell_;
    if (const auto out = exit_distance(tip.position, tip.direction, {Vec2::Zero(), body.layout.size()}))
        way_ = std::min(way_, *out - 1e-3 * h);
    advance_ = std::min(advance, way_ - slack);
    slack_ = slack;
    held_at_ = held_at;
    if (advance_ <= 0.0) return;
    const auto points_before = body.points.node;
    CrackFields ahead = cracks;
    ahead.grow(crack, at_end, tip.position + way_ * tip.direction);
    internal_force.sort_cells();

    reach_ = std::max(advances_in_reach * advance, least_cells_in_reach * h);
    const std::vector<double> mass = field_masses(body, ahead.fields());
    std::vector<std::size_t> passed;
    for (std::size_t k = 0; k < ahead.pairs.size(); ++k) {
        const FieldPair& pair = ahead.pairs[k];
        const double left = mass[pair.left], right = mass[pair.right];
        if (pair.crack != crack || !std::isfinite(pair.compliance) || left == 0.0 || right == 0.0) continue;
        const Vec2 place = body.layout.node_position(pair.node);
        const double freed = share_freed(place, tip, body.layout);
        const bool is_near = (place - tip.position).cwiseAbs().maxCoeff() < 0.5 * reach_ - h;  // a crack may come back on itself
        if (!is_near || freed >= 1.0 || freed + way_ / cell_ <= 0.0) continue;
        passed.push_back(k);
        pairs_.push_back({pair.node, freed, pair.compliance / tie_share(left, right)});
    }
    const auto goes_on_to = [&](double reach, int axis, bool high) {
        const double side = high ? body.layout.size()[axis] - tip.position[axis] : tip.position[axis];
        return side <= side_in_reach * reach;
    };
    const auto box_of = [&](double reach) {
        Box box{tip.position.array() - reach, tip.position.array() + reach};
        for (int axis = 0; axis < 2; ++axis) {
            if (goes_on_to(std::max(reach, reach_), axis, false)) box.low[axis] = 0.0;
            if (goes_on_to(std::max(reach, reach_), axis, true)) box.high[axis] = body.layout.size()[axis];
        }
        return box;
    };
    bool in_beam = false;
    for (int axis = 0; axis < 2; ++axis) {
        const bool is_long = body.layout.size()[1 - axis] >= least_length_of_beam * body.layout.size()[axis];
        in_beam |= is_long && goes_on_to(2.0 * reach_, axis, false) && goes_on_to(2.0 * reach_, axis, true);
    }
    other_reach_ = in_beam ? 2.0 * reach_ : 0.5 * reach_;
    box_ = box_of(reach_);
    for (const Box& box : {box_, box_of(other_reach_)})
        woods_.push_back(cut_out(body, internal_force, ahead, cracks.fields(), boundary, box, passed));
    body.points.node = points_before;
}

TipPatch::Wood TipPatch::cut_out(const Discretisation& body, const InternalForce& internal_force, const CrackFields& ahead,
                                 int fields_now, const Boundary& boundary, const Box& box,
                                 const std::vector<std::size_t>& passed) const {
    // Whether fields belong to the patch, and whether to wood beyond it too.
    Wood wood{};
    const int fields = ahead.fields();
    std::vector<bool> within(fields, false), beyond(fields, false);
    std::vector<int> cells;
    body.for_cells_in(box, [&](int c) { cells.push_back(c); });
    std::vector<bool> taken(body.layout.cells(), false);
    for (const int c : cells) taken[c] = true;
    const Vec2 beside = Vec2::Constant(1.5 * body.layout.cell.maxCoeff());
    body.for_cells_in({box.low - beside, box.high + beside}, [&](int c) {
        for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p)
            for (const int f : body.points.node[p]) (taken[c] ? within : beyond)[f] = taken[c] || f < fields_now;
    });
    std::vector<int> equation(2 * fields, -1), column(2 * fields, -1);
    int equations = 0;
    std::vector<bool> prescribed(2 * fields, false);
    for (const Boundary::Held& held : boundary.held) prescribed[2 * held.field + held.axis] = true;
    wood.is_whole = true;
    for (int f = 0; f < fields; ++f) {
        if (!within[f]) continue;
        wood.is_whole &= !beyond[f];
        const bool any_held = beyond[f] || prescribed[2 * f] || prescribed[2 * f + 1];
        if (any_held) wood.held.push_back(f), wood.place.push_back(body.layout.node_position(ahead.node_of_field[f]));
        for (int axis = 0; axis < 2; ++axis) {
            if (beyond[f] || prescribed[2 * f + axis]) column[2 * f + axis] = 2 * static_cast<int>(wood.held.size()) - 2 + axis;
            else equation[2 * f + axis] = equations++;
        }
    }

    // Stiffness between the free, and between them and the held.
    std::vector<Eigen::Triplet<double>> inner, outer;
    double stiffest = 0.0;
    const auto add = [&](std::span<const int> of, const Eigen::MatrixXd& K) {
        const auto dof = [&](int i) { return 2 * of[i / 2] + i % 2; };
        for (int i = 0; i < K.rows(); ++i) {
            const int row = equation[dof(i)];
            if (row < 0) continue;
            stiffest = std::max(stiffest, K(i, i));
            for (int j = 0; j < K.cols(); ++j) {
                if (equation[dof(j)] >= 0) inner.emplace_back(row, equation[dof(j)], K(i, j));
                else outer.emplace_back(row, column[dof(j)], K(i, j));
            }
        }
    };
    const std::vector<Vec2> at_rest(fields, Vec2::Zero());
    for (const int c : cells) {
        for_groups(body.points, c, [&](const PointGroup& group) {
            const auto of = body.points.node[group.point[0]];
            if (body.layout.degree == 1) add(of, internal_force.tangent(group, at_rest, false));
            else
                for (const int p : group.points()) add(of, stiffness_of(body, p));
        });
        for (const InternalForce::Alone& alone :
             std::ranges::equal_range(internal_force.alone(), c, {}, &InternalForce::Alone::cell)) {
            Eigen::Matrix<double, 2, 8> apart;
            for (int k = 0; k < 4; ++k) apart.block<2, 2>(0, 2 * k) = crosswise_sign[k] * Mat2::Identity();
            add(alone.node, alone.stiffness * apart.transpose() * apart);
        }
    }
    // The ties of all pairs but those on the way stay as they are.
    const std::vector<double> mass = field_masses(body, fields);
    for (std::size_t k = 0; k < ahead.pairs.size(); ++k) {
        const FieldPair& pair = ahead.pairs[k];
        const bool is_within = within[pair.left] && within[pair.right] && mass[pair.left] > 0.0 && mass[pair.right] > 0.0;
        if (!is_within || pair.freed >= 1.0 || std::ranges::binary_search(passed, k)) continue;
        const double tie = shared_tie(pair, mass);
        for (int axis = 0; axis < 2; ++axis) {
            const int l = equation[2 * pair.left + axis], r = equation[2 * pair.right + axis];
            if (l < 0 || r < 0) continue;
            inner.emplace_back(l, l, tie), inner.emplace_back(r, r, tie);
            inner.emplace_back(l, r, -tie), inner.emplace_back(r, l, -tie);
        }
    }
    for (int e = 0; e < equations; ++e) inner.emplace_back(e, e, least_stiffness * stiffest);
    Sparse K(equations, equations), to_held(equations, 2 * static_cast<int>(wood.held.size()));
    K.setFromTriplets(inner.begin(), inner.end());
    to_held.setFromTriplets(outer.begin(), outer.end());

    const auto jumps = static_cast<Eigen::Index>(2 * passed.size());
    Eigen::MatrixXd apart = Eigen::MatrixXd::Zero(equations, jumps);
    for (Eigen::Index j = 0; j < jumps; ++j) {
        const FieldPair& pair = ahead.pairs[passed[j / 2]];
        if (const int e = equation[2 * pair.left + j % 2]; e >= 0) apart(e, j) += 1.0;
        if (const int e = equation[2 * pair.right + j % 2]; e >= 0) apart(e, j) -= 1.0;
    }
    const Eigen::SimplicialLLT<Sparse> factor(K);
    const Eigen::MatrixXd moved = factor.solve(apart);
    wood.flexibility = apart.transpose() * moved;
    wood.by_held = -moved.transpose() * to_held;
    return wood;
}

Eigen::VectorXd TipPatch::Wood::jumps_of(const std::vector<Vec2>& displacement) const {
    // The turn of the patch as a whole, by the best fit of a linear field to what is held.
    Vec2 middle = Vec2::Zero(), mean = Vec2::Zero();
    for (std::size_t i = 0; i < held.size(); ++i) middle += place[i], mean += displacement[held[i]];
    middle /= static_cast<double>(held.size());
    mean /= static_cast<double>(held.size());
    Mat2 spread = Mat2::Zero(), arms = Mat2::Zero();
    for (std::size_t i = 0; i < held.size(); ++i) {
        const Vec2 arm = place[i] - middle;
        spread += (displacement[held[i]] - mean) * arm.transpose();
        arms += arm * arm.transpose();
    }
    const Mat2 turn = Polar(spread * arms.inverse()).turn;
    Eigen::VectorXd moved(2 * held.size());
    for (std::size_t i = 0; i < held.size(); ++i) {
        const Vec2 arm = place[i] - middle;
        moved.segment<2>(2 * i) = turn.transpose() * (arm + displacement[held[i]] - mean) - arm;
    }
    return by_held * moved;
}

// Less that without ties [J].
double TipPatch::potential(const Wood& wood, double at, const std::vector<double>& softness, const Eigen::VectorXd& jumps) const {
    std::vector<int> tied;
    std::vector<double> tie_compliance;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
        const double f = std::max(0.0, pairs_[k].freed + at / cell_);
        if (f >= 1.0) continue;
        for (int axis = 0; axis < 2; ++axis) {
            tied.push_back(2 * static_cast<int>(k) + axis);
            tie_compliance.push_back(f * softness[k] * pairs_[k].compliance / (1.0 - f));
        }
    }
    const auto n = static_cast<Eigen::Index>(tied.size());
    Eigen::MatrixXd C(n, n);
    Eigen::VectorXd w(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        w[i] = jumps[tied[i]];
        for (Eigen::Index j = 0; j < n; ++j) C(i, j) = wood.flexibility(tied[i], tied[j]) + (i == j ? tie_compliance[i] : 0.0);
    }
    return 0.5 * w.dot(C.ldlt().solve(w));
}

double TipPatch::gone(std::span<const Tie> ties, double by_way) const {
    for (const Tie& tie : ties) {
        const auto pair = std::ranges::find(pairs_, tie.node, &Pair::node);
        if (pair != pairs_.end()) return (tie.freed - pair->freed) * cell_;
    }
    return by_way;
}

// How far the tip is from the next pair [m].
double TipPatch::to_next_pair(double gone) const {
    double next = cell_;
    for (const Pair& pair : pairs_) {
        const double until = -(pair.freed * cell_ + gone);
        if (until >= -0.05 * cell_) next = std::min(next, std::max(0.0, until));
    }
    return next;
}

// Over the next advance [J].
double TipPatch::given(const Wood& wood, double gone, const std::vector<double>& softness, const Eigen::VectorXd& jumps) const {
    return potential(wood, gone, softness, jumps) - potential(wood, gone + advance_, softness, jumps);
}

// Half way between two places where it begins to free a pair the potential is that of a parabola through these and the next one:
// a straight line would not know that the rate changes on the way.
double TipPatch::softness(double gone, const std::vector<Vec2>& displacement) const {
    if (is_idle()) return 1.0;
    const Wood& wood = woods_.front();
    const Eigen::VectorXd jumps = wood.jumps_of(displacement);
    if (jumps.isZero()) return 1.0;
    const auto at = [&](double place, double factor) {
        return potential(wood, place, std::vector<double>(pairs_.size(), factor), jumps);
    };
    const double from = gone + to_next_pair(gone), first = at(from, 1.0), second = at(from + cell_, 1.0);
    // Across a boundary in the wood a parabola means nothing: as much of it counts as a smooth one could have.
    const double drop = first - second, next = from + 2.0 * cell_ <= way_ ? second - at(from + 2.0 * cell_, 1.0) : drop;
    const double most = most_bend * std::max(0.0, std::min(drop, next)), bend = std::clamp(drop - next, -most, most);
    const double middle = 0.5 * (first + second) - 0.125 * bend;
    double low = std::log(least_softness), high = -low;
    for (int k = 0; k < 12; ++k) {
        const double trial = 0.5 * (low + high);
        (at(from + 0.5 * cell_, std::exp(trial)) > middle ? low : high) = trial;
    }
    return std::exp(0.5 * (low + high));
}

std::vector<double> TipPatch::factors_of(double gone, const std::vector<Vec2>& displacement, std::span<const Tie> ties) const {
    std::vector<double> factors(pairs_.size(), softness(gone, displacement));
    for (std::size_t k = 0; k < pairs_.size(); ++k)
        for (const Tie& tie : ties)
            if (tie.node == pairs_[k].node) factors[k] = tie.softness;
    return factors;
}

std::vector<double> TipPatch::ways_from(double gone) const {
    const double left = std::max(slack_ - gone, 1e-3 * slack_);
    std::vector<double> ways;
    for (const double from : {0.0, advance_})
        for (std::size_t k = 0; k <= legs; ++k) ways.push_back(from + left * static_cast<double>(k) / static_cast<double>(legs));
    return ways;
}

void TipPatch::take_in(const FineTip::Ahead& ahead, double gone, const std::vector<Vec2>& displacement,
                       std::span<const Tie> ties) {
    known_ = {gone, {}};
    if (ahead.potential.empty()) return;
    const std::vector<double> factors = factors_of(gone, displacement, ties), ways = ways_from(gone);
    const Wood& wood = woods_.front();
    const Eigen::VectorXd jumps = wood.jumps_of(displacement);
    for (std::size_t k = 0, end = legs + 1; k <= legs; ++k, ++end) {
        const double finer = ahead.potential[k] - ahead.potential[end];
        const double share = std::max(least_share, finer / given(wood, gone + ways[k], factors, jumps));
        known_.finer_share.push_back(std::lerp(1.0, share, ahead.share));
    }
}

double TipPatch::finer_share(double gone) const {
    if (known_.finer_share.empty()) return 1.0;
    const double place = std::clamp((gone - known_.from) / ways_from(known_.from)[1], 0.0, static_cast<double>(legs));
    const auto k = std::min(static_cast<std::size_t>(place), legs - 1);
    return std::lerp(known_.finer_share[k], known_.finer_share[k + 1], place - static_cast<double>(k));
}

TipPatch::Rates TipPatch::rates(double gone, const std::vector<Vec2>& displacement, std::span<const Tie> ties) const {
    if (is_idle() || advance_ <= cell_) return {};
    const std::vector<double> factors = factors_of(gone, displacement, ties);
    const double next = to_next_pair(gone), on = next > least_way * cell_ ? std::min(next, little * cell_) : little * cell_;
    struct Told {
        double now, now_over_mean;
    };
    const auto told_by = [&](const Wood& wood) {
        const Eigen::VectorXd jumps = wood.jumps_of(displacement);
        const auto at = [&](double place) { return potential(wood, place, factors, jumps); };
        const double now = (at(gone) - at(gone + on)) / on;
        return Told{now, now * advance_ / given(wood, gone, factors, jumps)};
    };
    const Told own = told_by(woods_.front()), other = told_by(woods_.back());
    const bool is_wider = other_reach_ > reach_;
    const double narrow = (is_wider ? own : other).now_over_mean, wide = (is_wider ? other : own).now_over_mean;
    const double more = woods_[is_wider].is_whole ? 0.0 : std::max(0.0, 1.0 - std::max(reach_, other_reach_) / held_at_);
    const double now_over_mean = wide + more * (wide - narrow);
    if (!(now_over_mean > 0.0)) return {};
    return {own.now, own.now / now_over_mean};
}

}  // namespace crampfit

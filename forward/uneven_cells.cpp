#include "forward/uneven_cells.hpp"

#include <algorithm>
#include <array>

namespace crampfit {

UnevenCells::UnevenCells(const Discretisation& body, const MaterialMap& materials, bool rotates, const History* history)
    : body_(body), materials_(materials), rotates_(rotates), history_(history) {
    sort();
}

const Unevenness& UnevenCells::wood_of(const Discretisation::UnevenCell& cell, const PointBox& box) {
    const int side = body_.layout.per_side;
    if (box == PointBox{0, 0, side, side}) return cell.wood;
    const auto known = cut_.find({cell.cell, box});
    if (known != cut_.end()) return known->second;
    const LocalWood average = body_.wood_of_cell(materials_, cell.cell);
    return cut_.emplace(std::pair(cell.cell, box), body_.unevenness_of(materials_, cell.cell, box, average)).first->second;
}

void UnevenCells::sort() {
    const Points& points = body_.points;
    const int side = body_.layout.per_side;
    pieces_.clear();
    std::vector<bool> taken(side * side);
    for (const Discretisation::UnevenCell& cell : body_.uneven_cells) {
        if (history_ && history_->is_in(cell.cell)) continue;
        const int first = points.first_of_cell[cell.cell];
        std::fill(taken.begin(), taken.end(), false);
        for (int start = 0; start < side * side; ++start) {
            if (taken[start]) continue;
            const auto goes_along = [&](int x, int y) {
                return !taken[y * side + x] && points.node.same(first + start, first + y * side + x);
            };
            PointBox box{start % side, start / side, start % side + 1, start / side + 1};
            while (box.to_x < side && goes_along(box.to_x, box.from_y)) ++box.to_x;
            const auto row_goes_along = [&](int y) {
                bool all = true;
                for (int x = box.from_x; x < box.to_x; ++x) all = all && goes_along(x, y);
                return all;
            };
            while (box.to_y < side && row_goes_along(box.to_y)) ++box.to_y;
            for (int y = box.from_y; y < box.to_y; ++y)
                for (int x = box.from_x; x < box.to_x; ++x) taken[y * side + x] = true;
            pieces_.push_back({cell.cell, first + start, box, &wood_of(cell, box)});
        }
    }
}

std::span<const UnevenCells::Piece> UnevenCells::pieces(int first, int last) const {
    const auto from = std::ranges::lower_bound(pieces_, first, {}, &Piece::cell);
    const auto to = std::ranges::lower_bound(from, pieces_.end(), last, {}, &Piece::cell);
    return {from, to};
}

// A piece in the frame that turns with it. Differentials go by R^T dF, counted xx, xy, yx, yy, and R^T dc.
struct UnevenCells::Local {
    Eigen::Matrix3d S;
    Eigen::Matrix<double, 3, 2> G;
    Mat2 H;
    Eigen::Vector3d strain = Eigen::Vector3d::Zero();
    Vec2 d;
    double u = 0, v = 0, w = 0, trace = 1;                 // U_xx, U_yy, U_xy per trace, and the trace, of the stretch
    Eigen::Matrix<double, 3, 4> B;                         // of strain
    Eigen::RowVector4d spin = Eigen::RowVector4d::Zero();  // of the turn
    Eigen::Vector3d s;                                     // slope of the energy by strain
    Vec2 t;                                                // by d
    double moment = 0;                                     // by the turn, which takes left_of(d) from d
    Eigen::Vector4d p;                                     // by R^T dF
    Mat2 turn = Mat2::Identity();
    std::array<Vec2, 4> slope;  // of the nodes' shape functions [1/m]
};

UnevenCells::Local UnevenCells::local(const Piece& piece, const Unevenness& wood, const std::vector<Vec2>& displacement) const {
    const Layout& layout = body_.layout;
    const Vec2 cell = layout.cell;
    const double share =
        static_cast<double>((piece.box.to_x - piece.box.from_x) * (piece.box.to_y - piece.box.from_y)) / layout.points_per_cell();
    const double x = 0.5 * (piece.box.from_x + piece.box.to_x) / layout.per_side,
                 y = 0.5 * (piece.box.from_y + piece.box.to_y) / layout.per_side;
    Local at;
    at.slope = {Vec2((y - 1.0) / cell.x(), (x - 1.0) / cell.y()), Vec2((1.0 - y) / cell.x(), -x / cell.y()),
                Vec2(-y / cell.x(), (1.0 - x) / cell.y()), Vec2(y / cell.x(), x / cell.y())};
    const auto node = body_.points.node[piece.point];
    at.S = share * layout.thickness * cell.prod() * wood.stretch;
    at.G = share * layout.thickness * wood.coupling;
    at.H = share * layout.thickness / cell.prod() * wood.bending;
    Mat2 gradient = Mat2::Zero();
    Vec2 across = Vec2::Zero();
    for (int k = 0; k < 4; ++k) {
        gradient += displacement[node[k]] * at.slope[k].transpose();
        across += crosswise_sign[k] * displacement[node[k]];
    }
    if (rotates_) {
        const Polar polar(gradient);
        at.turn = polar.turn;
        at.trace = polar.trace;
        at.strain << polar.stretch(0, 0) - 1.0, polar.stretch(1, 1) - 1.0, 2.0 * polar.stretch(0, 1);
        at.B = polar.strain_slope();
        at.spin << 0, -1.0 / at.trace, 1.0 / at.trace, 0;
        at.u = polar.stretch(0, 0) / at.trace;
        at.v = polar.stretch(1, 1) / at.trace;
        at.w = polar.stretch(0, 1) / at.trace;
    } else {
        at.strain << gradient(0, 0), gradient(1, 1), gradient(0, 1) + gradient(1, 0);
        at.B << 1, 0, 0, 0, 0, 0, 0, 1, 0, 1, 1, 0;
    }
    at.d = at.turn.transpose() * across;
    at.s = at.S * at.strain + at.G * at.d;
    at.t = at.G.transpose() * at.strain + at.H * at.d;
    at.moment = -at.t.dot(left_of(at.d));
    at.p = at.B.transpose() * at.s + at.moment * at.spin.transpose();
    return at;
}

UnevenCells::State UnevenCells::small_state(const Piece& piece, const Unevenness& wood,
                                            const std::vector<Vec2>& displacement) const {
    const Layout& layout = body_.layout;
    const Vec2 cell = layout.cell;
    const PointBox& box = piece.box;
    const double side = layout.per_side, share = (box.to_x - box.from_x) * (box.to_y - box.from_y) / (side * side);
    const double x = 0.5 * (box.from_x + box.to_x) / side, y = 0.5 * (box.from_y + box.to_y) / side;
    const auto node = body_.points.node[piece.point];
    const Vec2 &u0 = displacement[node[0]], &u1 = displacement[node[1]], &u2 = displacement[node[2]], &u3 = displacement[node[3]];
    const Vec2 across = u0 - u1 - u2 + u3;
    const Vec2 by_x = (u1 - u0 + y * across) / cell.x(), by_y = (u2 - u0 + x * across) / cell.y();
    const Eigen::Vector3d strain(by_x.x(), by_y.y(), by_x.y() + by_y.x());
    const double area = cell.prod();
    Eigen::Vector3d s = wood.coupling * across;
    if (!wood.stretch.isZero(0.0)) s += area * (wood.stretch * strain);
    const Vec2 t = wood.coupling.transpose() * strain + wood.bending * across / area;
    const double volume = share * layout.thickness;
    const Vec2 along_x = volume / cell.x() * Vec2(s[0], s[2]), along_y = volume / cell.y() * Vec2(s[2], s[1]);
    const Vec2 pull = volume * t + y * along_x + x * along_y;
    State state{0.5 * volume * (s.dot(strain) + t.dot(across)), {}};
    state.force << pull - along_x - along_y, along_x - pull, along_y - pull, pull;
    return state;
}

UnevenCells::State UnevenCells::state(const Piece& piece, const Unevenness& wood, const std::vector<Vec2>& displacement) const {
    if (!rotates_) return small_state(piece, wood, displacement);
    const Local at = local(piece, wood, displacement);
    const Mat2 P = at.turn * (Mat2() << at.p[0], at.p[1], at.p[2], at.p[3]).finished();
    const Vec2 pull = at.turn * at.t;
    State state{0.5 * (at.s.dot(at.strain) + at.t.dot(at.d)), {}};
    for (int k = 0; k < 4; ++k) state.force.segment<2>(2 * k) = P * at.slope[k] + crosswise_sign[k] * pull;
    return state;
}

Eigen::Matrix<double, 8, 8> UnevenCells::tangent(const Piece& piece, const std::vector<Vec2>& displacement,
                                                 bool geometric) const {
    const Local at = local(piece, *piece.wood, displacement);
    Eigen::Matrix<double, 3, 6> strain_slope;
    strain_slope << at.B, Eigen::Matrix<double, 3, 2>::Zero();
    Eigen::Matrix<double, 2, 6> d_slope;
    d_slope << -left_of(at.d) * at.spin, Mat2::Identity();
    Eigen::Matrix<double, 6, 6> second = strain_slope.transpose() * at.G * d_slope;
    second += second.transpose().eval();
    second += strain_slope.transpose() * at.S * strain_slope + d_slope.transpose() * at.H * d_slope;
    if (rotates_ && geometric) {
        // As in `elastic_tangent`: B and the spin change with the stretch, d turns, and so does all of the force.
        const double difference = (at.s[1] - at.s[0]) / at.trace, twice = 2.0 * at.s[2] / at.trace;
        const Eigen::RowVector4d d_u(1.0 - at.u, -at.w, at.w, -at.u), d_v(-at.v, at.w, -at.w, 1.0 - at.v),
            d_w(-at.w, at.u, at.v, -at.w);
        const Vec2 t_turned = left_of(at.t);
        const Eigen::Vector4d p_turned(-at.p[2], -at.p[3], at.p[0], at.p[1]);
        second.row(1).head<4>() += difference * d_w + twice * d_u;
        second.row(2).head<4>() += twice * d_v - difference * d_w;
        second.topLeftCorner<4, 4>() += p_turned * at.spin - at.t.dot(at.d) * at.spin.transpose() * at.spin -
                                        at.moment / at.trace * at.spin.transpose() * Eigen::RowVector4d(1, 0, 0, 1);
        second.topRightCorner<4, 2>() += at.spin.transpose() * t_turned.transpose();
        second.bottomLeftCorner<2, 4>() += t_turned * at.spin;
    }
    Eigen::Matrix<double, 6, 8> rates;  // from displacements
    for (int k = 0; k < 4; ++k) {
        rates.block<2, 2>(0, 2 * k) = at.slope[k] * at.turn.col(0).transpose();
        rates.block<2, 2>(2, 2 * k) = at.slope[k] * at.turn.col(1).transpose();
        rates.block<2, 2>(4, 2 * k) = crosswise_sign[k] * at.turn.transpose();
    }
    return rates.transpose() * second * rates;
}

}  // namespace crampfit

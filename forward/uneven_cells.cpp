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
    for (const Discretisation::UnevenCell& cell : body_.uneven_cells) {
        if (history_ && history_->is_in(cell.cell)) continue;
        const int first = points.first_of_cell[cell.cell];
        const std::span<const Sliver> slivers = body_.slivers_of(cell.cell, cell.cell + 1);
        const auto add = [&](int p, bool is_sliver, std::span<const int> node, const PointBox& box, double share,
                             const Vec2& middle) {
            const double of_cell = share * (box.to_x - box.from_x) * (box.to_y - box.from_y) / (side * side);
            pieces_.push_back(
                {cell.cell, p, is_sliver, {node[0], node[1], node[2], node[3]}, box, of_cell, middle, &wood_of(cell, box)});
        };
        const auto in_cells = [&](const Vec2& x) -> Vec2 {
            return (x - body_.layout.cell_corner(cell.cell)).cwiseQuotient(body_.layout.cell);
        };
        const auto rest = body_.rest_of_cell(cell.cell);
        if (rest) add(first, false, points.node[first], {0, 0, side, side}, rest->share, rest->middle);
        for (int k = 0; k < side * side && !slivers.empty(); ++k) {
            const int p = first + k;
            const PointBox box{k % side, k / side, k % side + 1, k / side + 1};
            const auto sliver = std::ranges::find(slivers, p, &Sliver::point);
            const bool is_cut = sliver != slivers.end();
            const Vec2& middle = points.position[p];
            if (!rest)
                add(p, false, points.node[p], box, is_cut ? 1.0 - sliver->share : 1.0,
                    in_cells(is_cut ? sliver->middle_of_rest(middle) : middle));
            // Of the only point of a cell a part is that cell's mean wood.
            if (is_cut && side > 1) add(p, true, sliver->node, box, sliver->share, in_cells(sliver->position));
        }
        if (!slivers.empty()) continue;
        for (int start = 0; start < side * side; ++start) {
            // All points on the same fields, if they are a rectangle: else each by itself, so that a mirrored scene is cut alike.
            PointBox box{side, side, 0, 0};
            int count = 0, least = side * side;
            for (int k = 0; k < side * side; ++k) {
                if (!points.node.same(first + start, first + k)) continue;
                box = {std::min(box.from_x, k % side), std::min(box.from_y, k / side), std::max(box.to_x, k % side + 1),
                       std::max(box.to_y, k / side + 1)};
                least = std::min(least, k);
                ++count;
            }
            const bool is_rectangle = count == (box.to_x - box.from_x) * (box.to_y - box.from_y);
            if (is_rectangle && start > least) continue;
            if (!is_rectangle) box = {start % side, start / side, start % side + 1, start / side + 1};
            const Vec2 middle = 0.5 / side * Vec2(box.from_x + box.to_x, box.from_y + box.to_y);
            add(first + start, false, points.node[first + start], box, 1.0, middle);
        }
    }
}

std::span<const UnevenCells::Piece> UnevenCells::pieces(int first, int last) const {
    const auto from = std::ranges::lower_bound(pieces_, first, {}, &Piece::cell);
    const auto to = std::ranges::lower_bound(from, pieces_.end(), last, {}, &Piece::cell);
    return {from, to};
}

// A piece whose energy is that of this wood.
BilinearPiece UnevenCells::bilinear(const Piece& piece, const Unevenness& wood, const std::vector<Vec2>& displacement) const {
    const Layout& layout = body_.layout;
    const double area = layout.cell.prod();
    const double volume = piece.share * layout.thickness;
    return {{volume * area * wood.stretch, volume * wood.coupling, volume / area * wood.bending},
            piece.middle,
            layout.cell,
            piece.node,
            displacement,
            rotates_};
}

UnevenCells::State UnevenCells::small_state(const Piece& piece, const Unevenness& wood,
                                            const std::vector<Vec2>& displacement) const {
    const Layout& layout = body_.layout;
    const Vec2 cell = layout.cell;
    const double x = piece.middle.x(), y = piece.middle.y();
    const auto& node = piece.node;
    const Vec2 &u0 = displacement[node[0]], &u1 = displacement[node[1]], &u2 = displacement[node[2]], &u3 = displacement[node[3]];
    const Vec2 across = u0 - u1 - u2 + u3;
    const Vec2 by_x = (u1 - u0 + y * across) / cell.x(), by_y = (u2 - u0 + x * across) / cell.y();
    const Eigen::Vector3d strain(by_x.x(), by_y.y(), by_x.y() + by_y.x());
    const double area = cell.prod();
    Eigen::Vector3d s = wood.coupling * across;
    if (!wood.stretch.isZero(0.0)) s += area * (wood.stretch * strain);
    const Vec2 t = wood.coupling.transpose() * strain + wood.bending * across / area;
    const double volume = piece.share * layout.thickness;
    const Vec2 along_x = volume / cell.x() * Vec2(s[0], s[2]), along_y = volume / cell.y() * Vec2(s[2], s[1]);
    const Vec2 pull = volume * t + y * along_x + x * along_y;
    State state{0.5 * volume * (s.dot(strain) + t.dot(across)), {}};
    state.force << pull - along_x - along_y, along_x - pull, along_y - pull, pull;
    return state;
}

UnevenCells::State UnevenCells::state(const Piece& piece, const Unevenness& wood, const std::vector<Vec2>& displacement) const {
    if (!rotates_) return small_state(piece, wood, displacement);
    const BilinearPiece at = bilinear(piece, wood, displacement);
    return {at.energy(), at.force()};
}

Eigen::Matrix<double, 8, 8> UnevenCells::tangent(const Piece& piece, const std::vector<Vec2>& displacement,
                                                 bool geometric) const {
    return bilinear(piece, *piece.wood, displacement).tangent(geometric);
}

}  // namespace crampfit

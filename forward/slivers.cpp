// What a crack cuts off the domains of points.
#include "forward/cracks.hpp"

#include <algorithm>
#include <utility>

namespace crampfit {

namespace {

// Of a point's domain, what a crack cuts off: less stays with the point, and so does more, which only a kink can cut off.
constexpr double least_sliver = 0.02, most_sliver = 0.6;

// How far ahead of its ends a crack cuts domains as if it ran on straight, in cells.
constexpr double reach_of_a_cut = 2.0;

// Within so many cells of a kink sharper than this no domain is cut, those of the integrals for K behind it: on branches of one
// or two cells K_II came out 4 % higher (`VerificationPath.KBehindASharpKink`).
constexpr double reach_of_a_kink = 8.0;
constexpr double least_cosine_at_a_kink = 0.94;  // 20 degrees

}  // namespace

// Cuts anew the domains of the points in a window.
void CrackFields::cut_domains(const Box& window) {
    const Layout& layout = body_->layout;
    const Points& points = body_->points;
    std::vector<Sliver>& slivers = body_->slivers;
    std::vector<bool> is_parted(layout.nodes(), false);  // nodes where there are fields on either side
    for (const FieldPair& pair : pairs) is_parted[pair.node] = true;
    std::vector<Sliver> found;
    std::vector<bool> is_anew(layout.cells(), false);
    body_->for_cells_in(window, [&](int c) {
        is_anew[c] = true;
        const Vec2 corner = layout.cell_corner(c);
        if (!goes_to({corner, corner + layout.cell}) || lies_at_a_kink(corner + 0.5 * layout.cell)) return;
        for (int p = points.first_of_cell[c]; p < points.first_of_cell[c + 1]; ++p)
            if (const auto sliver = cut_off(p, is_parted)) found.push_back(*sliver);
    });
    std::erase_if(slivers, [&](const Sliver& sliver) { return is_anew[points.cell[sliver.point]]; });
    slivers.insert(slivers.end(), found.begin(), found.end());
    std::ranges::sort(slivers, {}, &Sliver::point);
}

// The crack's straight pieces, both ends going on.
std::array<Vec2, 2> CrackFields::stretched(std::size_t piece) const {
    const auto& points = lines[0].points;
    std::array<Vec2, 2> ends{points[piece], points[piece + 1]};
    const Vec2 further = reach_of_a_cut * body_->layout.cell.maxCoeff() * (ends[1] - ends[0]).normalized();
    if (piece == 0) ends[0] -= further;
    if (piece + 2 == points.size()) ends[1] += further;
    return ends;
}

bool CrackFields::goes_to(const Box& box) const {
    for (std::size_t i = 0; i + 1 < lines[0].points.size(); ++i) {
        const auto [from, to] = stretched(i);
        if (box.touches({from.cwiseMin(to), from.cwiseMax(to)})) return true;
    }
    return false;
}

bool CrackFields::lies_at_a_kink(const Vec2& x) const {
    const auto& points = lines[0].points;
    const double reach = reach_of_a_kink * body_->layout.cell.maxCoeff();
    for (std::size_t k = 1; k + 1 < points.size(); ++k) {
        if ((points[k] - x).norm() > reach) continue;
        const Vec2 before = (points[k] - points[k - 1]).normalized(), after = (points[k + 1] - points[k]).normalized();
        if (before.dot(after) < least_cosine_at_a_kink) return true;
    }
    return false;
}

// What the crack cuts off a point's domain, kinks within it left out; nothing where no wood follows that could take it.
std::optional<Sliver> CrackFields::cut_off(int p, const std::vector<bool>& is_parted) {
    const Layout& layout = body_->layout;
    const Points& points = body_->points;
    const Box domain = body_->domain(p);
    std::optional<Vec2> in;
    Vec2 out;
    for (std::size_t i = 0; i + 1 < lines[0].points.size(); ++i) {
        const auto [from, to] = stretched(i);
        const auto within = part_within(from, to, domain);
        if (!within) continue;
        if (!in) in = from + (*within)[0] * (to - from);
        out = from + (*within)[1] * (to - from);
    }
    const double hair = 1e-6 * layout.point_size().minCoeff();  // a corner that is touched has no direction
    if (!in || (out - *in).norm() < hair) return std::nullopt;
    const bool left = is_left(0, points.position[p]);
    const Piece beyond = left ? left_part(domain, out, *in) : left_part(domain, *in, out);
    const double share = beyond.area / layout.point_size().prod();
    if (share < least_sliver || share > most_sliver || is_left(0, beyond.middle) == left) return std::nullopt;
    const Vec2 off = (beyond.middle - 0.5 * (domain.low + domain.high)).cwiseQuotient(layout.point_size());
    const int axis = std::abs(off.x()) > std::abs(off.y()) ? 0 : 1;
    const int step = off[axis] > 0.0 ? 1 : -1;
    const int beside = body_->neighbour(p, axis == 0 ? step : 0, axis == 1 ? step : 0);
    if (beside < 0 || is_left(0, points.position[beside]) == left) return std::nullopt;
    Sliver sliver{p, share, beyond.middle, beyond.moments, beyond.bounds.low, beyond.bounds.high, {}};
    const auto nodes = layout.cell_nodes(points.cell[p]);
    for (int k = 0; k < 4; ++k) {
        const bool is_parted_here = is_parted[nodes[k]] || freed(0, nodes[k]) >= least_freed_;
        const bool apart = is_left(0, layout.node_position(nodes[k])) == left && is_parted_here;
        sliver.node[k] = field(nodes[k], apart ? 1u : 0u, 0);
    }
    if (std::ranges::equal(sliver.node, std::as_const(points).node[p])) return std::nullopt;
    return sliver;
}

}  // namespace crampfit

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

// Nor where another crack passes within so many cells.
constexpr double reach_of_another_crack = 3.0;

}  // namespace

// Cuts anew the domains of the points in a window.
void CrackFields::cut_domains(const Box& window) {
    const Layout& layout = body_->layout;
    const Points& points = body_->points;
    std::vector<Sliver>& slivers = body_->slivers;
    std::vector<unsigned> parted(layout.nodes(), 0u);  // bit k of a node: there are fields on either side of crack k
    for (const FieldPair& pair : pairs) parted[pair.node] |= 1u << pair.crack;
    std::vector<Sliver> found;
    std::vector<bool> is_anew(layout.cells(), false);
    body_->for_cells_in(window, [&](int c) {
        is_anew[c] = true;
        const int crack = only_crack_at(c);
        if (crack < 0 || lies_at_a_kink(crack, layout.cell_corner(c) + 0.5 * layout.cell)) return;
        for (int p = points.first_of_cell[c]; p < points.first_of_cell[c + 1]; ++p)
            if (const auto sliver = cut_off(crack, p, parted)) found.push_back(*sliver);
    });
    std::erase_if(slivers, [&](const Sliver& sliver) { return is_anew[points.cell[sliver.point]]; });
    slivers.insert(slivers.end(), found.begin(), found.end());
    std::ranges::sort(slivers, {}, &Sliver::point);
}

// A crack's straight pieces, both ends going on.
std::array<Vec2, 2> CrackFields::stretched(int crack, std::size_t piece) const {
    const auto& points = lines[crack].points;
    std::array<Vec2, 2> ends{points[piece], points[piece + 1]};
    const Vec2 further = reach_of_a_cut * body_->layout.cell.maxCoeff() * (ends[1] - ends[0]).normalized();
    if (piece == 0) ends[0] -= further;
    if (piece + 2 == points.size()) ends[1] += further;
    return ends;
}

bool CrackFields::goes_to(int crack, const Box& box) const {
    for (std::size_t i = 0; i + 1 < lines[crack].points.size(); ++i) {
        const auto [from, to] = stretched(crack, i);
        if (box.touches({from.cwiseMin(to), from.cwiseMax(to)})) return true;
    }
    return false;
}

// The crack that goes to a cell, if no other comes near; else -1.
int CrackFields::only_crack_at(int c) const {
    const Vec2 corner = body_->layout.cell_corner(c), cell = body_->layout.cell;
    int found = -1;
    for (int k = 0; k < static_cast<int>(lines.size()); ++k)
        if (goes_to(k, {corner, corner + cell})) found = k;
    const Box about{corner - reach_of_another_crack * cell, corner + (1.0 + reach_of_another_crack) * cell};
    for (int k = 0; found >= 0 && k < static_cast<int>(lines.size()); ++k)
        if (k != found && goes_to(k, about)) return -1;
    return found;
}

bool CrackFields::lies_at_a_kink(int crack, const Vec2& x) const {
    const auto& points = lines[crack].points;
    const double reach = reach_of_a_kink * body_->layout.cell.maxCoeff();
    for (std::size_t k = 1; k + 1 < points.size(); ++k) {
        if ((points[k] - x).norm() > reach) continue;
        const Vec2 before = (points[k] - points[k - 1]).normalized(), after = (points[k + 1] - points[k]).normalized();
        if (before.dot(after) < least_cosine_at_a_kink) return true;
    }
    return false;
}

// What a crack cuts off a point's domain, kinks within it left out; nothing where no wood follows that could take it.
std::optional<Sliver> CrackFields::cut_off(int crack, int p, const std::vector<unsigned>& parted) {
    const Layout& layout = body_->layout;
    const Points& points = body_->points;
    const Box domain = body_->domain(p);
    std::optional<Vec2> in;
    Vec2 out;
    for (std::size_t i = 0; i + 1 < lines[crack].points.size(); ++i) {
        const auto [from, to] = stretched(crack, i);
        const auto within = part_within(from, to, domain);
        if (!within) continue;
        if (!in) in = from + (*within)[0] * (to - from);
        out = from + (*within)[1] * (to - from);
    }
    const double hair = 1e-6 * layout.point_size().minCoeff();  // a corner that is touched has no direction
    if (!in || (out - *in).norm() < hair) return std::nullopt;
    const bool left = is_left(crack, points.position[p]);
    const Piece beyond = left ? left_part(domain, out, *in) : left_part(domain, *in, out);
    const double share = beyond.area / layout.point_size().prod();
    if (share < least_sliver || share > most_sliver || is_left(crack, beyond.middle) == left) return std::nullopt;
    const Vec2 off = (beyond.middle - 0.5 * (domain.low + domain.high)).cwiseQuotient(layout.point_size());
    const int axis = std::abs(off.x()) > std::abs(off.y()) ? 0 : 1;
    const int step = off[axis] > 0.0 ? 1 : -1;
    const int beside = body_->neighbour(p, axis == 0 ? step : 0, axis == 1 ? step : 0);
    if (beside < 0 || is_left(crack, points.position[beside]) == left) return std::nullopt;
    const unsigned bit = 1u << crack;
    Sliver sliver{p, share, beyond.middle, beyond.moments, beyond.bounds.low, beyond.bounds.high, {}};
    const auto nodes = layout.cell_nodes(points.cell[p]);
    for (int k = 0; k < 4; ++k) {
        const bool is_parted_here = (parted[nodes[k]] & bit) != 0u || freed(crack, nodes[k]) >= least_freed_;
        const bool apart = is_left(crack, layout.node_position(nodes[k])) == left && is_parted_here;
        sliver.node[k] = field(nodes[k], (mask_[p][k] & ~bit) | (apart ? bit : 0u), crack);
    }
    if (std::ranges::equal(sliver.node, std::as_const(points).node[p])) return std::nullopt;
    return sliver;
}

}  // namespace crampfit

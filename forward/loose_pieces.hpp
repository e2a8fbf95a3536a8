#pragma once

#include "forward/boundary.hpp"

#include <functional>
#include <limits>

namespace crampfit {

/// Pieces that cracks have cut free.
struct LoosePieces {
    std::vector<int> holds;   // components of displacement, 2 x field + axis, to be held besides what the boundary holds
    std::vector<bool> loose;  // [fields] of a piece that nothing holds: it carries nothing

    bool is_loose(int field) const { return field < static_cast<int>(loose.size()) && loose[field]; }
};

/// Finds the pieces, if cracks cut any, and what must be held so that none of them can move as a whole: as little as there are
/// ways for it to move. What is held so feels no force, so that nothing else changes. Pieces that a traction pulls are left
/// alone: they fly off. So are those heavier than `heaviest` [kg].
LoosePieces find_loose_pieces(const Discretisation& body, const CrackFields& cracks, const Boundary& boundary,
                              const std::vector<double>& mass, double heaviest = std::numeric_limits<double>::infinity());

/// Whether the specimen can still carry load once cracks have cut it: some piece is held by two edges or bonded bodies, or by one
/// and something pushes or pulls on it, a traction or, within one of these boxes, a sliding body. Pieces that `joined` pairs of
/// fields hold together are one.
bool carries_load(const Discretisation& body, const CrackFields& cracks, const Boundary& boundary,
                  const std::vector<double>& mass, const std::vector<Vec2>& displacement, const std::vector<Box>& pushes,
                  const std::function<bool(std::size_t pair)>& joined);

}  // namespace crampfit

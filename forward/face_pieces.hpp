#pragma once

#include "forward/cracks.hpp"

#include <span>
#include <vector>

namespace crampfit {

/// A stretch of a crack whose faces press on each other, as seen toward one of its tips.
struct FacePiece {
    Vec2 force;        // on the face on the left [N]
    double near, far;  // its ends, behind the tip along the crack [m]
};

/// The stretches of a crack behind a tip, one for each pair of fields that carries such a force, which is spread over as much of
/// the crack as a cell spans; what of that lies ahead of the tip is left out. `forces` on the left field of each pair [pairs]
/// [N].
std::vector<FacePiece> face_pieces(const CrackFields& cracks, int crack, bool at_end, std::span<const Vec2> forces,
                                   const Layout& layout);

}  // namespace crampfit

#pragma once

#include "forward/cracks.hpp"
#include "forward/deformation.hpp"

#include <span>
#include <vector>

namespace crampfit {

/// Unit normals of the pairs of crack faces, from right to left, as the wood about their nodes has turned: by the polar
/// decomposition of the mean gradient of both faces' displacement, weighted with the node's shape function.
class FaceNormals {
  public:
    /// After cracks have grown. Without `rotates` they stay as they are in the undeformed specimen.
    void take_in(const Discretisation& body, const CrackFields& cracks, bool rotates);

    /// To fields that stand here [m].
    void turn(const std::vector<Vec2>& displacement);

    const Vec2& operator[](std::size_t pair) const { return turned_[pair]; }

    bool can_turn() const { return !first_share_.empty(); }

    /// How the wood about a pair has turned with fields that stand here [m].
    Polar polar(std::size_t pair, const std::vector<Vec2>& displacement) const;

    struct Share {
        int field;
        Vec2 slope;  // of the mean gradient per displacement of the field [1/m]
    };
    std::span<const Share> shares(std::size_t pair) const;

  private:
    std::vector<Vec2> undeformed_, turned_;  // [pairs]
    std::vector<Share> shares_;
    std::vector<std::size_t> first_share_;  // [pairs + 1]; empty: nothing turns
};

}  // namespace crampfit

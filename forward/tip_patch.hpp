#pragma once

#include "forward/boundary.hpp"
#include "forward/fine_tip.hpp"
#include "forward/internal_force.hpp"

#include <Eigen/Core>

#include <span>
#include <vector>

namespace crampfit {

/// The wood around a crack tip, cut out of a moving specimen and brought to rest with its outline held where it is: how the
/// energy release rate goes over the next `advance`, were the tip to go straight on.
///
/// Freeing a pair of fields there changes nothing but the force between its sides, so that one factor of the patch's stiffness,
/// with the pairs ahead all free, gives the potential for every place of the tip: with C the jumps of those pairs per force
/// between their sides, and w0 their jumps without,
///     Pi(x) = const + 1/2 w0^T (C + S(x))^-1 w0,
/// S(x) being the compliance f c / (1 - f) of their ties (CrackFields) with the tip at x. Small strain, of what is left when the
/// patch's turn as a whole is taken off.
///
/// The held outline takes up what a longer crack would pass on to the rest of the specimen, so that the rate falls on the way, by
/// a part of it that goes with the way over the patch's size: two patches, one half as wide as the other but where that ends with
/// the specimen, tell what it would be with an outline as far away as the specimen is held (Richardson 1911). In a beam, which
/// gives way otherwise than wood that goes on to all sides, the second one is twice as wide, and takes in its sides.
class TipPatch {
  public:
    /// What holds the pair at a node (TipTies).
    struct Tie {
        int node;
        double softness;
        double freed;  // of the pair
    };

    /// Leaves `body` as it was. `wood`: of small strain and without history, sorted for this patch alone. `slack` [m] is how far
    /// the tip may go on before this patch is no longer good, `held_at` [m] how far from it the specimen is held or pressed.
    TipPatch(Discretisation& body, InternalForce& wood, const CrackFields& cracks, const Boundary& boundary, int crack,
             bool at_end, double advance, double slack, double held_at);

    struct Rates {
        double now = 0;   // what the ties give up now
        double mean = 0;  // over the next `advance`
    };

    /// How far the tip has gone since the patch was made [m], by how much of the pairs that it is passing is free: one that has
    /// turned a little since then passes them elsewhere. `by_way` where it passes none.
    double gone(std::span<const Tie> ties, double by_way) const;

    /// Energy release rates [J/m], with the tip `gone` [m] beyond where it was when the patch was made and these ties at it. Nil
    /// where there is no load, or no more than the next cell is left.
    Rates rates(double gone, const std::vector<Vec2>& displacement, std::span<const Tie> ties) const;

    /// What the compliances of the next pairs must be multiplied by for the potential to go evenly while the tip passes them;
    /// the formula of `FieldPair::compliance` does not know of boundaries in the wood.
    double softness(double gone, const std::vector<Vec2>& displacement) const;

    const Box& box() const { return box_; }

    /// Ways of a tip that has `gone` so far already, at whose ends it hangs what finer cells give up [m].
    std::vector<double> ways_from(double gone) const;

    /// Takes in what these tell in these displacements (FineTip::ahead).
    void take_in(const FineTip::Ahead& ahead, double gone, const std::vector<Vec2>& displacement, std::span<const Tie> ties);

    /// What finer cells give up over the next `advance` per what the patch does, as far as that is known.
    double finer_share(double gone) const;

  private:
    struct Pair {
        int node;
        double freed;       // share when the patch was made, below 0 ahead
        double compliance;  // c [m/N]
    };
    struct Wood {
        bool is_whole;                // nothing but what is prescribed holds its outline
        std::vector<int> held;        // fields
        std::vector<Vec2> place;      // [held] [m]
        Eigen::MatrixXd by_held;      // [jumps x 2 held] of the free pairs per displacement of the held fields
        Eigen::MatrixXd flexibility;  // C [jumps x jumps] [m/N]
        Eigen::VectorXd jumps_of(const std::vector<Vec2>& displacement) const;  // w0 [m]
    };
    Wood cut_out(const Discretisation& body, const InternalForce& internal_force, const CrackFields& ahead, int fields_now,
                 const Boundary& boundary, const Box& box, const std::vector<std::size_t>& passed) const;
    double potential(const Wood& wood, double at, const std::vector<double>& softness, const Eigen::VectorXd& jumps) const;
    std::vector<double> factors_of(double gone, const std::vector<Vec2>& displacement, std::span<const Tie> ties) const;
    double given(const Wood& wood, double gone, const std::vector<double>& softness, const Eigen::VectorXd& jumps) const;
    double to_next_pair(double gone) const;
    bool is_idle() const { return woods_.empty() || pairs_.empty() || woods_.front().held.empty(); }

    double cell_ = 0;                     // way of the tip that frees a pair [m]
    double advance_ = 0;                  // what was asked for, or as far as the tip stays in the wood [m]
    double slack_ = 0;                    // [m]
    double way_ = 0;                      // of the tip whose pairs it knows [m]
    double reach_ = 0, other_reach_ = 0;  // [m]
    double held_at_ = 0;                  // [m]
    Box box_;
    struct Known {
        double from = 0;                  // how far the tip had gone [m]
        std::vector<double> finer_share;  // from there on, at the first half of its ways
    };
    Known known_;
    std::vector<Pair> pairs_;  // on the way
    std::vector<Wood> woods_;  // its own, the other one; none where no more than the next cell is left
};

}  // namespace crampfit

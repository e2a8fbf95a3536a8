#pragma once

#include "forward/boundary.hpp"

#include <Eigen/Core>

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
class TipPatch {
  public:
    /// Leaves `body` as it was. `slack` [m] is how far the tip may go on before this patch is no longer good.
    TipPatch(Discretisation& body, const CrackFields& cracks, const Boundary& boundary, int crack, bool at_end, double advance,
             double slack);

    /// Mean energy release rate over the next cell over that over the next `advance`, with the tip `gone` [m] beyond where it was
    /// when the patch was made; 1 where there is no load.
    double local_share(double gone, const std::vector<Vec2>& displacement) const;

    /// What the compliances of the next pairs must be multiplied by for the potential to go linearly while the tip passes them;
    /// the formula of `FieldPair::compliance` does not know of boundaries in the wood.
    double softness(double gone, const std::vector<Vec2>& displacement) const {
        return held_.empty() ? 1.0 : softness_for(gone, free_jumps(displacement));
    }

  private:
    double potential(double at, double softness, const Eigen::VectorXd& jumps) const;
    double softness_for(double gone, const Eigen::VectorXd& jumps) const;
    Eigen::VectorXd free_jumps(const std::vector<Vec2>& displacement) const;

    double reach_ = 0;                // half width [m]
    double cell_ = 0;                 // way of the tip that frees a pair [m]
    double advance_ = 0;              // what was asked for, or as far as the tip stays in the wood [m]
    std::vector<int> held_;           // fields
    std::vector<Vec2> place_;         // [held] [m]
    Eigen::MatrixXd by_held_;         // [jumps x 2 held] of the free pairs per displacement of the held fields
    Eigen::MatrixXd flexibility_;     // C [jumps x jumps] [m/N]
    std::vector<double> freed_;       // [pairs] share when the patch was made, below 0 ahead
    std::vector<double> compliance_;  // [pairs] c [m/N]
};

}  // namespace crampfit

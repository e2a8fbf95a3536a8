#pragma once

#include "forward/cracks.hpp"
#include "forward/deformation.hpp"

#include <span>

namespace crampfit {

/// Fields at the grid's nodes, one entry a field of CrackFields.
struct NodalState {
    const std::vector<Vec2>& displacement;  // [m]
    const std::vector<Vec2>& velocity;      // [m/s]
    const std::vector<Vec2>& acceleration;  // [m/s^2]
    std::span<const double> ties = {};  // [pairs of fields] energy of what holds them together at a tip [J]; empty: nothing does
    std::span<const Vec2> faces = {};   // [pairs of fields] what pressed crack faces put on the left one [N]; empty: none press
};

struct TipLoad {
    double G = 0;                 // energy release rate [J/m^2]
    double K_I = 0;               // [Pa sqrt(m)]
    double K_II = 0;              // [Pa sqrt(m)]
    Vec2 opening = Vec2::Zero();  // displacement jump just behind the tip in the wood's own frame [m]
    double toughness = 0;         // of the wood at the tip [J/m^2]
};

/// How the wood about a tip has turned, on the mean over some cells.
Mat2 turn_about(const Discretisation& body, const CrackTip& tip, const std::vector<Vec2>& displacement);

/// Displacement jump just behind a tip, the left face less the right [m].
Vec2 opening_behind(const Discretisation& body, const CrackFields& cracks, int crack, bool at_end,
                    const std::vector<Vec2>& displacement);

/// The same with `rotates` seen by one who has turned as the wood about the tip has: a turn of the specimen turns no crack.
Vec2 opening_in_own_frame(const Discretisation& body, const CrackFields& cracks, int crack, bool at_end,
                          const std::vector<Vec2>& displacement, bool rotates);

/// Radii of the virtual extension, in cells. It shrinks where other wood is near, so that little hangs on the gradient term,
/// and keeps off other cracks.
struct EnergyReleaseOptions {
    double inner = 2.0;        // the part that moves rigidly with the tip
    double outer = 4.5;        // beyond it nothing moves
    double margin = 1.0;       // and wood that changes so near beyond that makes J uncertain still
    double least_inner = 1.0;  // holds the tied pair at the tip
    double least_outer = 3.0;  // in other wood
    double least_outer_at_cracks = 2.0;
    bool rotates = false;
    bool sizes_K_by_J = false;  // in finite rotation, of a state that is in balance
};

/// Energy release rate of one tip: the energy that the body gives up when a patch of the grid moves on with the tip while the
/// wood stays where it is. In domain form (Nakamura, Shih and Freund 1985, eq. 8, with the inhomogeneity term of Eischen 1987
/// and a virtual extension q that follows the crack):
///     G = int [ P_ij u_i,k q_k,j - (W + T) q_k,k + rho (a_i u_i,k - v_i v_i,k) q_k - (W_,k + T_,k)|explicit q_k ] dA
///         - int t_i [u_i],k q_k ds,
/// W and T the strain and kinetic energy densities, P the first Piola-Kirchhoff stress, t the traction on the left one of faces
/// that touch or are bridged and [u] the jump from right to left: what friction and bridges take of the energy does not reach the
/// tip. In finite rotation u_i,k is what is left without the turn of the wood about the tip. K_I and K_II come from the
/// interaction integral over the same domain. K_I opens; K_II > 0 moves the face on the left, seen toward the tip, ahead, and
/// turns a crack clockwise. At small strain (K_I^2 + K_II^2) / E' = G is not imposed: both ways to G agree within the
/// discretisation error, K's is the smaller one where the crack is oblique to the grid or boundaries are near (`tips_test`). In
/// finite rotation K may be given the size that G asks for.
TipLoad tip_load(const Discretisation& body, const CrackFields& cracks, const MaterialMap& materials, int crack, bool at_end,
                 const NodalState& state, const EnergyReleaseOptions& options);

}  // namespace crampfit

#pragma once

#include "forward/strips.hpp"

#include <vector>

namespace crampfit {

/// Velocities that the points carry from step to step, as in the material point method at large. Points of the undeformed
/// specimen carry what some velocities w of the nodes give there, S w, and hand back A w, A = M^-1 S^T m S with the lumped masses
/// M: A w is smoother than w. With accelerations a over a step dt, w goes to
///     FLIP     w + a dt, or with a share s of PIC  (1 - s) (w + a dt) + s (A w + a dt);  nodes move with A w
///     XPIC(m)  w - (1 - A)^m w + a dt;                                                   nodes move with A w
///     FMPM(m)  (1 + (1 - A) + ... + (1 - A)^(m-1)) (A w + a dt);                         nodes move with w
///     PIC      FMPM(1)
/// (Hammerquist and Nairn 2017; Nairn and Hammerquist 2021; there S+ S is what A is here.) Nodes whose velocity
/// is prescribed keep it in the sums. On an undeformed grid none of this is needed: see ExplicitSolver.
class VelocityMapping {
  public:
    VelocityMapping(const SolverChoice& choice, const Discretisation& body)
        : choice_(choice), body_(body), strips_(body.layout) {}

    /// False: the nodes keep their velocities, and nothing here is called.
    bool is_used() const { return choice_.velocity_update != VelocityUpdate::automatic; }
    /// Whether nodes move with what the points carry (FMPM, PIC), or with what they hand back.
    bool nodes_carry() const {
        return choice_.velocity_update == VelocityUpdate::fmpm || choice_.velocity_update == VelocityUpdate::pic;
    }

    /// Of the fields at the nodes, one entry each.
    struct Nodes {
        const std::vector<double>& mass;        // [kg]
        const std::vector<std::uint8_t>& held;  // a bit an axis where the component is prescribed
        Team& team;
    };

    /// Of the points that carry w [J].
    double kinetic_energy(const std::vector<Vec2>& w, Team& team);

    /// FMPM, between the accelerations of a step and what then prescribes velocities: takes the nodes' velocities, w + a dt, to
    /// what FMPM makes of them. Returns the energy that is lost by that [J].
    double extrapolate(std::vector<Vec2>& velocity, const std::vector<Vec2>& acceleration, double dt, const Nodes& nodes);

    /// FLIP and XPIC, at the end of a step: takes w on by the accelerations, and the nodes' velocities, A w + a dt, to the new A
    /// w. Returns the energy that is lost by that [J].
    double carry(std::vector<Vec2>& w, std::vector<Vec2>& velocity, const std::vector<Vec2>& acceleration, double dt,
                 const Nodes& nodes);

    /// v becomes A v.
    void hand_back(std::vector<Vec2>& v, const Nodes& nodes);

  private:
    void take_out(std::vector<Vec2>& v, const Nodes& nodes);  // v becomes (1 - A) v

    const SolverChoice& choice_;
    const Discretisation& body_;
    Strips strips_;
    std::vector<Vec2> sum_, term_, extrapolated_, from_points_;  // [fields] kept between calls, to be allocated once
    std::vector<double> energy_;                                 // [strips] [J]
};

}  // namespace crampfit

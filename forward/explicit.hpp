#pragma once

#include "forward/boundary.hpp"
#include "forward/contact.hpp"
#include "forward/energy_release.hpp"
#include "forward/internal_force.hpp"
#include "forward/plan.hpp"

#include <vector>

namespace crampfit {

/// Energies of a run so far [J]. In a perfect run work = strain + kinetic + contact + fracture + damped.
struct EnergyBooks {
    double work = 0;      // done by edges and bodies
    double strain = 0;    // in the points, and in the ties at a crack tip
    double kinetic = 0;
    double contact = 0;   // in the springs of sliding contact
    double fracture = 0;  // toughness times new crack area
    double damped = 0;    // by drag, and by friction and impact of contacts
};

/// Explicit dynamics in the undeformed specimen: central differences in time (leapfrog; velocities stand half a step behind
/// displacements), lumped mass. As no point ever leaves its cell, mapping velocities to the points and back by the full mass
/// matrix would give the grid's own velocities again (FMPM of infinite order; Nairn and Hammerquist 2021), so the grid keeps them.
class ExplicitSolver {
  public:
    ExplicitSolver(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body);

    /// One time step.
    void step();

    /// Lets each growing tip advance where the energy release rate has reached the toughness.
    void grow_cracks();

    TipLoad load_at(int crack, bool at_end) const;
    EnergyBooks energies() const;
    double time() const { return time_; }
    const CrackFields& cracks() const { return cracks_; }
    const std::vector<Vec2>& displacements() const { return displacement_; }
    const std::vector<Vec2>& velocities() const { return velocity_; }  // half a step before
    const std::vector<TipLoad>& tip_loads() const { return tip_loads_; }  // latest, two a crack: start, end

    /// Force that an edge (first in the list) or a body puts on the specimen in the last step [N], and how far it has moved [m].
    const std::vector<Vec2>& reactions() const { return reaction_; }
    Vec2 moved(int driver) const { return boundary_.moved(driver, time_, displacement_); }

    bool is_finite() const;
    bool has_left(int crack, bool at_end) const { return !cracks_.lines[crack].tip(at_end).inside; }

  private:
    void place_bodies();
    void adopt(const std::vector<CrackFields::NewField>& fields);
    Vec2 mean_velocity_of(int driver) const;

    void surface_forces();
    void tie_forces();
    void advance_velocities();
    void close_crack_faces();
    void prescribe_velocities();
    void advance_displacements();
    double tie_stiffness(const FieldPair& pair) const;

    const Scene& scene_;
    const Plan& plan_;
    const MaterialMap& materials_;
    Discretisation& body_;
    CrackFields cracks_;
    Boundary boundary_;
    InternalForce internal_force_;
    std::vector<SlidingBody> sliding_;
    std::vector<int> sliding_driver_;

    // One entry a field.
    std::vector<double> mass_;        // [kg]
    std::vector<Vec2> displacement_;  // [m]
    std::vector<Vec2> velocity_;      // [m/s]
    std::vector<Vec2> acceleration_;  // [m/s^2]
    std::vector<Vec2> force_;         // [N]

    std::vector<Vec2> reaction_;      // [edges, then bodies] [N]
    std::vector<Vec2> face_force_;    // [pairs] what pressed crack faces put on the left one in the last step [N]
    std::vector<TipLoad> tip_loads_;
    std::vector<double> last_growth_; // [two a crack] [s]
    double time_ = 0.0;
    EnergyBooks books_;
};

} // namespace crampfit

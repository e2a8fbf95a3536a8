#pragma once

#include "forward/boundary.hpp"
#include "forward/bridging.hpp"
#include "forward/contact.hpp"
#include "forward/energy_release.hpp"
#include "forward/face_normals.hpp"
#include "forward/fine_tip.hpp"
#include "forward/internal_force.hpp"
#include "forward/part_contact.hpp"
#include "forward/plan.hpp"
#include "forward/tip_patch.hpp"
#include "forward/tip_ties.hpp"
#include "forward/velocity_mapping.hpp"

#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

namespace crampfit {

/// Energies of a run so far [J]. In a perfect run work = strain + kinetic + contact + fracture + damped.
struct EnergyBooks {
    double work = 0;    // done by edges and bodies
    double strain = 0;  // in the points, in the ties at a crack tip and in bridged faces
    double kinetic = 0;
    double contact = 0;   // in the springs of sliding contact
    double fracture = 0;  // what the tips have taken up: toughness times new area, by `advance`; more where waves hold a tip
                          // back; and bridged faces
    double damped = 0;    // by drag, by friction and impact of contacts, and in wood that remembers
};

/// Explicit dynamics in the undeformed specimen: central differences in time (leapfrog; velocities stand half a step behind
/// displacements), lumped mass. As no point ever leaves its cell, mapping velocities to the points and back by the full mass
/// matrix would give the grid's own velocities again (FMPM of infinite order; Nairn and Hammerquist 2021), so the grid keeps
/// them, unless the scene asks for another way (VelocityMapping). Displacements may follow velocities at the beginning of a step,
/// at its end or half and half (`stress_update`): stresses come from displacements.
class ExplicitSolver {
  public:
    /// `threads` share each step; the result does not depend on how many there are.
    ExplicitSolver(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body, int threads = 1);

    /// Starts from these displacements [m] and velocities [m/s] of the nodes, by place in the undeformed specimen, in place of
    /// rest.
    void start(const std::function<Vec2(const Vec2&)>& displacement, const std::function<Vec2(const Vec2&)>& velocity);

    /// One time step.
    void step();

    /// Lets each growing tip go on until it has taken up as much energy as the toughness asks for, but no faster than a Rayleigh
    /// wave in the wood at the tip (Freund 1990): where that holds it back it takes up all that its way releases, as wood whose
    /// toughness rises without bound toward that speed. Before every step.
    void grow_cracks();

    TipLoad load_at(int crack, bool at_end) const;
    EnergyBooks energies() const;
    double fastest_crack() const { return fastest_crack_; }  // of growing tips, over eight cells [m/s]
    double time() const { return time_; }
    const CrackFields& cracks() const { return cracks_; }
    const std::vector<Vec2>& displacements() const { return displacement_; }
    const std::vector<Vec2>& velocities() const { return velocity_; }
    const History* history() const { return history_.get(); }  // null: no wood remembers

    /// Force that an edge (first in the list) or a body puts on the specimen in the last step [N], and how far it has moved [m].
    const std::vector<Vec2>& reactions() const { return reaction_; }
    Vec2 moved(int driver) const { return boundary_.moved(driver, time_, displacement_); }

    /// Whether what cracks whose tips have all left it have made of the specimen still does, by its edges, bodies and bridges.
    bool carries_load() const;

    bool is_finite() const;
    bool has_left(int crack, bool at_end) const { return !cracks_.lines[crack].tip(at_end).inside; }

  private:
    struct Tip {
        double allowed = std::numeric_limits<double>::infinity();      // how far a Rayleigh wave leaves it to go at once [m]
        double since_turn = std::numeric_limits<double>::infinity();   // how far it has gone in its direction [m]
        double since_noted = std::numeric_limits<double>::infinity();  // how far it has gone since the last `noted_at` [m]
        double owed = 0;                                               // energy that turns have given it [J]
        Vec2 opening = Vec2::Zero();                                   // behind it, a mean over a short time [m]
        std::unique_ptr<TipPatch> patch;                               // as of some time ago
        double since_patch = 0;                                        // how far it has gone since that was made [m]
        double finer_at = 0;                                           // part of what it must that it gave up, by the patch, when
                                                                       // finer cells were asked last
        Vec2 patch_direction = Vec2::Zero();                           // then
        std::deque<double> noted_at;                                   // of the last cells that it has gone through [s]
    };
    void place_bodies();
    void start_parts();
    void list_held();
    double lag() const;
    double kinetic_energy() const;
    void adopt(const std::vector<CrackFields::NewField>& fields, const Box& changed, double softness);
    void carry_over(const std::vector<CrackFields::Move>& moves);
    Vec2 mean_velocity_of(int driver, double from, double to) const;
    Vec2 velocity_at_end_of_step(int driver) const;

    void inner_forces(double time);
    void surface_forces();
    void advance_velocities();
    void carry_velocities();
    void close_crack_faces(bool with_force);
    void prescribe_velocities();
    void advance_displacements(double share);
    void grow(int crack, bool at_end);
    TipPatch& patch_of(int crack, bool at_end);
    double softness_at(int crack, bool at_end, double way);
    double held_at(const Vec2& x) const;
    double balanced_over(int crack, const CrackTip& tip) const;
    double toughness_to_overcome(int crack, bool at_end, double here);
    FineTip::Ahead finer_ahead(int crack, bool at_end, const TipPatch& patch, double gone);
    void note_speed(Tip& state, double way);

    const Scene& scene_;
    const Plan& plan_;
    const MaterialMap& materials_;
    Discretisation& body_;
    CrackFields cracks_;
    Boundary boundary_;
    std::unique_ptr<History> history_;
    InternalForce internal_force_;
    mutable Team team_;
    TipTies ties_;
    FaceNormals normals_;
    std::optional<BridgedFaces> bridges_;
    std::optional<FaceFacets> face_facets_;  // for bodies; nothing where there are none, or no cracks
    std::vector<SlidingBody> sliding_;
    std::vector<int> sliding_driver_;
    std::optional<PartContact> part_contact_;
    mutable VelocityMapping mapping_;

    // One entry a field.
    std::vector<double> mass_;             // [kg]
    std::vector<Vec2> displacement_;       // [m]
    std::vector<Vec2> velocity_;           // [m/s]
    std::vector<Vec2> carried_;            // w of VelocityMapping where the nodes do not keep their velocities [m/s]
    std::vector<std::uint8_t> held_axes_;  // a bit an axis where the component is prescribed
    std::vector<Vec2> acceleration_;       // [m/s^2]
    std::vector<Vec2> force_;              // [N]

    std::vector<Vec2> reaction_;                // [edges, then bodies] [N]
    std::vector<Vec2> face_force_;              // [pairs] what pressed crack faces put on the left one in the last step [N]
    std::vector<double> damped_;                // [pieces of the fields] in this step [J]
    std::vector<Tip> tips_;                     // two a crack: start, end
    std::optional<InternalForce> patch_force_;  // of the wood at rest that patches are
    const std::vector<MaterialSlope> no_numbers_;
    FineTip fine_tip_;
    double fastest_crack_ = 0;  // [m/s]
    double time_ = 0.0;
    EnergyBooks books_;
    EnergyBooks half_a_step_ago_;  // books before the forces of the last step but the tractions'
    double struck_ = 0.0;          // of what closed faces lost in the last step: by its middle, beyond a half [J]
};

}  // namespace crampfit

#pragma once

#include "forward/boundary.hpp"
#include "forward/contact.hpp"
#include "forward/energy_release.hpp"
#include "forward/face_normals.hpp"
#include "forward/grid_factor.hpp"
#include "forward/internal_force.hpp"
#include "forward/loose_pieces.hpp"
#include "forward/material_slope.hpp"
#include "forward/plan.hpp"

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace crampfit {

/// Static equilibrium of points, grid, crack fields and bodies for given crack tips: the displacement that makes the potential
///     Pi(u) = sum of V W(grad u) + ties at the tips + closed crack faces + contact - work of the tractions and forces on bodies
/// stationary under what the boundary prescribes at a time, by Newton's method with the consistent tangent. In finite rotation
/// crack faces press along normals that turn with the wood about them (`FaceNormals`). Where bodies or closed crack faces rub,
/// the forces are those of Coulomb's law from the equilibrium found before on (an increment), and Pi holds what friction has
/// dissipated, so that its change is still the work of what prescribes motion. So it is with wood that remembers: an increment
/// takes its history along, and Pi holds what it has dissipated.
///
/// A free component of a body's motion is one more unknown, which borders the equations of the grid.
class Equilibrium {
  public:
    /// Equations are solved by `threads` threads, with the same bits whatever their number. `same`: an equilibrium of the same
    /// scene and wood on another such body, which knows already how the wood yields under wheels.
    Equilibrium(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body, int threads = 1,
                const Equilibrium* same = nullptr);

    enum class Outcome { solved, not_converged, mechanism };  // mechanism: something can move without resistance

    /// From where it stands, solves for what the boundary prescribes at `time`.
    Outcome solve(double time);

    /// One more correction after `solve`, with the tangent at hand, for those who read displacements: it leaves a tenth of what
    /// the method does where it ends, or less. Not with friction or wood that remembers, where a solution is an increment.
    void refine();

    /// Moves a crack tip. The displacement stays, new fields start with that of the field that they come from; `solve` next.
    /// Returns those.
    std::vector<CrackFields::NewField> grow(int crack, bool at_end, const Vec2& to);

    double time() const { return time_; }
    const CrackFields& cracks() const { return cracks_; }
    const Boundary& boundary() const { return boundary_; }
    const std::vector<Vec2>& displacements() const { return displacement_; }
    const History* history() const { return history_.get(); }  // null: no wood remembers

    double potential() const;                                         // Pi [J]
    double strain_energy() const;                                     // in the points and in the ties [J]
    double traction_work() const;                                     // of tractions and forces on bodies, times displacement [J]
    double dissipated() const;                                        // by friction and in wood that remembers so far [J]
    double measured_displacement(double time) const;                  // of the edge or body that is measured, the way it goes [m]
    const std::vector<Vec2>& reactions() const { return reaction_; }  // what each driver puts on the specimen [N]
    double negligible_work() const;                                   // of forces that count as none, on the drivers' way [J]
    double negligible_power() const;                                  // of such forces [W]
    double power() const;                                             // of what prescribes motion, dPi/dt at standing cracks [W]
    TipLoad load_at(int crack, bool at_end) const { return load_at(crack, at_end, displacement_, materials_); }
    double reciprocal_condition() const { return factor_.reciprocal_condition(); }  // of the last tangent, roughly
    int factorisations() const { return factorisations_; }

    /// The specimen as a free body.
    struct FreeBody {
        double energy;                      // stored, and dissipated by crack faces and in wood that remembers [J]
        std::vector<Vec2> external_forces;  // of bodies, edges and tractions on its fields [fields] [N]
    };
    FreeBody free_body() const;

    /// What moves while drivers do, the cracks standing, per time or per length that the drivers go.
    struct Motion {
        std::vector<Vec2> drivers;  // [drivers]
        std::vector<Vec2> fields;   // [fields]
    };

    /// The motions that such motions of the drivers bring about from here on, by the tangent at this equilibrium. None where that
    /// is not positive definite.
    std::vector<Motion> motions(const std::vector<std::vector<Vec2>>& drivers);

    /// The motion that this load on the points and facets would bring about [N].
    Motion yield_to(const std::vector<Vec2>& load) const;

    /// The displacements that such loads would bring about, both [2 x fields, any number].
    Eigen::MatrixXd yields_to(const Eigen::MatrixXd& loads) const;

    /// What such loads do on each other's motion, loads^T yields_to(loads), at half its cost.
    Eigen::MatrixXd compliance(const Eigen::SparseMatrix<double>& loads) const;

    /// Derivatives by numbers of the materials at this equilibrium.
    struct Slopes {
        Eigen::VectorXd potential;  // [numbers] [J / unit]
        Eigen::MatrixXd fields;   // [2 x fields, numbers] of the potential's slope by displacements, these as they are [N / unit]
        Eigen::MatrixXd drivers;  // [2 x drivers, numbers] and by what drivers go, of bodies that slide

        /// Of the potential's slope along a motion, as it is found anew where the number is another.
        double along(const Motion& motion, int number) const;
    };
    Slopes slopes(const std::vector<MaterialSlope>& numbers);

    /// Derivatives of the displacements by the numbers, [numbers][fields], by the tangent that `motions` has made.
    std::vector<std::vector<Vec2>> displacement_slopes(const Slopes& slopes) const;

    /// The derivative of G at a tip by a number, with that of the displacements [J/m^2 / unit].
    double release_slope(int crack, bool at_end, const MaterialSlope& number, const std::vector<Vec2>& displacement_slope);

    /// What besides the displacement and the cracks tells a state: how far bodies have come that follow a force, and what
    /// friction and wood remember. Empty: as it was at the start.
    struct Contacts {
        std::vector<Vec2> moved;                // [drivers] [m]
        std::vector<std::vector<Grip>> bodies;  // [bodies that push]
        std::vector<Grip> faces;                // [pairs]
        std::vector<double> dissipated;         // by each of those bodies, and by all crack faces [J]
        History::State history;                 // of wood that remembers
        std::vector<double> kept;               // [fields] of stiffness by that wood
        double lost_by_ties;                    // with what it did not keep [J]
        std::vector<char> slips;                // [pairs; empty: no faces stick] those that slide all the same
    };
    Contacts contacts() const;

    /// Everything that growth and solution change, to come back to.
    struct Snapshot {
        CrackFields cracks;
        PointTable<int> node;
        std::vector<Sliver> slivers;
        Boundary::Holds holds;
        LoosePieces pieces;
        std::vector<Vec2> displacement;
        double time;
        Contacts contacts = {};
    };
    Snapshot save() const;
    void restore(const Snapshot& snapshot);
    void set_displacements(const std::vector<Vec2>& displacement, double time, const Contacts& contacts = {});

    /// Slopes will not be asked for where wheels are: gives back what finds those of how the wood yields.
    void forget_yield_slopes();

    /// In a linear scene: what is held stays where `displacement` has it, all else follows. False where something is loose.
    bool relax(const std::vector<Vec2>& displacement);

    /// On the fields, those that hold them left out [N].
    const std::vector<Vec2>& out_of_balance_forces() const { return force_; }

  private:
    TipLoad load_at(int crack, bool at_end, const std::vector<Vec2>& displacement, const MaterialMap& materials) const;
    void renumber();
    void mark_moved_points(const PointTable<int>& fields_before, const std::vector<Sliver>& slivers_before);
    void mark_changes(bool geometric, double slack);
    void find_forces();
    bool factor_tangent(bool geometric, double slack = 0.0);
    bool hold_hinge();
    void drop_hinges();
    void add_hinges();
    bool moves_most(int hinge) const;
    void set_loose(bool loose);
    GridFactor::Element element(std::span<const int> fields, const Eigen::Matrix<double, 8, 8>& stiffness) const;
    void couple_fields(std::span<const int> fields, const Eigen::Matrix<double, 8, 8>& stiffness);
    void couple_points(bool geometric);
    void add_extra(int cell, std::span<const int> fields, const Eigen::Matrix<double, 8, 8>& stiffness);
    template <class Visit>
    void for_groups_of(int cell, const Visit& visit) const;
    void add_lone_points();
    void add_slivers(bool geometric);
    int cell_at(int node) const;
    void add_pairs(bool geometric);
    void add_turning(std::size_t pair, const Mat2& held, const Mat2& remainder, bool geometric);
    void add_edge_ties();
    void add_touches(bool geometric);
    void couple(std::span<const int> rows, std::span<const double> steps, const Eigen::Ref<const Eigen::MatrixXd>& stiffness);
    void add_touch(const SlidingBody& body, int driver, const SlidingBody::Touch& touch, bool geometric);
    void let_yield(SlidingBody& body, const Vec2& travel);
    void add_yield(const SlidingBody& body, int driver, const std::vector<SlidingBody::Touch>& touches);
    void add_rubbing(std::span<const int> rows, std::span<const double> steps, Eigen::MatrixXd remainder);
    bool take_in_spread();
    Eigen::VectorXd load_of(const std::vector<Vec2>& drivers);
    Motion motion_of(const std::vector<Vec2>& drivers, const Eigen::VectorXd& step) const;
    void see_what_is_kept();
    double ties_energy() const;
    double edge_ties_energy() const;
    void add_external_forces(std::vector<Vec2>& force, std::vector<Vec2>& reaction) const;
    double kept(int field) const { return field < static_cast<int>(kept_.size()) ? kept_[field] : 1.0; }
    double tie_of(const FieldPair& pair) const;
    double tie_of(const Boundary::Tied& tie) const { return kept(tie.field) * tie.stiffness; }
    bool is_whole(const FieldPair& pair) const { return mass_[pair.left] > 0.0 && mass_[pair.right] > 0.0; }
    Mat2 turn_of(std::size_t pair) const;
    Vec2 apart(std::size_t pair, const std::vector<Vec2>& displacement) const;
    template <class Add>
    void push_faces(std::size_t pair, const Vec2& push, const Add& add) const;
    bool is_closed(std::size_t pair) const;
    Mat2 face_stiffness(std::size_t pair) const;
    bool slips(std::size_t pair) const { return pair < slips_.size() && slips_[pair]; }
    bool let_slip(std::vector<char>& closed, std::vector<int>& changes);
    double closed_stiffness(const FieldPair& pair) const;
    Vec2 place_of(int driver) const { return boundary_.travel(driver, time_) + moved_[driver]; }  // how far it has come [m]
    double lag(const Boundary::Tied& tie) const { return place_of(tie.driver)[tie.axis] - displacement_[tie.field][tie.axis]; }
    bool rubs(const FieldPair& pair) const;
    Drag face_drag(std::size_t pair) const;
    bool sort_out_faces();
    std::vector<Vec2> face_forces() const;
    void find_free_bodies();
    void find_pieces(bool crumbs_only);
    void find_guides();
    int field_near(const Vec2& place) const;
    void seat(int sliding);
    void settle();
    void set_contacts(const Contacts& contacts);
    bool border_tangent();
    int row_of(int dof) const {
        return equation_[dof] >= 0 || free_of_dof_[dof] < 0 ? equation_[dof] : equations_ + free_of_dof_[dof];
    }
    int row_of_body(int driver, int axis) const;
    Eigen::VectorXd out_of_balance() const;
    Eigen::MatrixXd bordered_step(const Eigen::MatrixXd& right) const;
    Eigen::VectorXd remainder_of(const Eigen::VectorXd& step) const;
    Eigen::VectorXd tangent_step(const Eigen::VectorXd& right) const;
    double largest_residual() const;
    double slope_along(const Eigen::VectorXd& step) const;
    void move(const Eigen::VectorXd& step, double share);
    double take_step(const Eigen::VectorXd& step);
    Eigen::VectorXd newton_step(Eigen::VectorXd load) const;
    void learn(Eigen::VectorXd step, Eigen::VectorXd force);
    void prescribe(double time);
    void move_prescribed();

    const Scene& scene_;
    const Plan& plan_;
    Discretisation& body_;
    const MaterialMap& materials_;
    CrackFields cracks_;
    FaceNormals normals_;
    Boundary boundary_;
    Gauges gauges_;
    std::unique_ptr<History> history_;
    InternalForce internal_force_;
    std::optional<FaceFacets> face_facets_;  // for bodies; nothing where there are none, or no cracks
    std::vector<SlidingBody> sliding_;
    std::vector<int> sliding_driver_;

    // One entry a field.
    std::vector<double> mass_;        // [kg]
    std::vector<Vec2> displacement_;  // [m]
    std::vector<Vec2> force_;         // out of balance [N]
    std::vector<double> kept_;        // of the wood's stiffness there after the last step; empty: all
    double lost_by_ties_ = 0;         // with what was not kept [J]

    std::vector<Vec2> reaction_;               // [drivers] [N]
    double points_energy_ = 0;                 // as the forces were found [J]
    double least_force_ = 0;                   // [N]
    double contact_energy_ = 0;                // [J]
    double face_energy_ = 0;                   // [J]
    mutable std::optional<double> potential_;  // [J]; empty: not asked for since the forces were found
    double time_ = 0;                          // [s]
    double next_time_ = 0;                     // that is being solved for [s]
    std::vector<Vec2> still_to_go_;            // [drivers] until then [m]

    bool side_by_side_;  // what does not hang together
    GridFactor factor_;
    LoosePieces pieces_;         // that cracks have cut free
    std::vector<int> guides_;    // components of displacement that stay, 2 x field + axis, along which nothing holds the specimen
    std::vector<int> hinges_;    // components of displacement with a spring in the tangent, 2 x field + axis
    bool loose_ = false;         // whether weak springs hold the specimen in the tangent until bodies do
    std::vector<int> equation_;  // [2 x fields] its equation, or -1: prescribed or without points
    int equations_ = 0;
    std::vector<char> slips_;                        // [pairs, or fewer] of faces that stick, those that slide all the same
    std::vector<Mat2> pair_stiffness_;               // [pairs] as last factored [N/m]
    std::multimap<int, GridFactor::Element> extra_;  // by cell: what is not the points'
    std::vector<double> prescribed_step_;            // [2 x fields] what prescribed components still have to go [m]
    Eigen::VectorXd step_load_;                      // what that puts on the equations and the free bodies [N]
    std::vector<Mat2>
        factored_at_;  // [points] gradient at which its cell was factored; of points on the same fields the first counts
    bool factored_geometric_ = true;  // how
    std::vector<int> touched_cells_;  // by bodies, in the factor
    int factorisations_ = 0;
    struct Lesson {
        Eigen::VectorXd step;   // that was taken [m]
        Eigen::VectorXd force;  // that it needed [N]
        double work;            // their product [J]
    };
    std::vector<Lesson> lessons_;  // since the tangent was factored

    // Bodies that follow a force:
    struct Free {
        int driver, axis;
        double force;  // on the body [N]
    };
    std::vector<Free> free_;          // its equations come after the grid's
    std::vector<int> free_of_dof_;    // [2 x fields] the free one that holds it, or -1
    std::vector<Vec2> moved_;         // [drivers] beyond what is prescribed [m]
    std::vector<Vec2> seat_;          // [drivers] the same at the start
    Eigen::MatrixXd free_load_;       // [equations x free] what their unit motions put on the grid [N/m]
    Eigen::MatrixXd free_stiffness_;  // [free x free] and on themselves [N/m]
    Eigen::MatrixXd free_motion_;     // [equations x free] how the grid follows them
    Eigen::MatrixXd free_yield_;      // [free x free] how they yield to forces [m/N]

    // Round bodies push on more than a cell at a time, crack faces on all that turns the wood about them:
    struct Spread {
        std::vector<int> rows;      // equations, or -1
        Eigen::MatrixXd stiffness;  // [columns x columns] of what no cell holds, columns * stiffness * columns^T [N/m]
        Eigen::MatrixXd columns;    // [rows x any number]; empty: one a row
    };
    std::vector<Spread> spread_;

    // Friction:
    struct Rubbing {                // what the factor leaves out of the tangent at a place that rubs: it is not symmetric
        std::vector<int> rows;      // equations, those of free bodies with them, or -1
        Eigen::MatrixXd remainder;  // [N/m]
    };
    std::vector<Rubbing> rubbing_;
    std::vector<Vec2> settled_;            // displacement from which friction on crack faces counts; empty: no such faces
    std::vector<Grip> face_grips_;         // [pairs, or fewer: the others have not slid yet]
    double face_dissipated_ = 0;           // until then [J]
    static constexpr double joint = 0.01;  // stiffness of a spring between faces over that of closed ones
    bool joins_faces_ = false;             // in the tangent, faces that rub by springs whether they touch or not
};

}  // namespace crampfit

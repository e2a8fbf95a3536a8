#pragma once

#include "forward/boundary.hpp"
#include "forward/contact.hpp"
#include "forward/energy_release.hpp"
#include "forward/grid_factor.hpp"
#include "forward/internal_force.hpp"
#include "forward/loose_pieces.hpp"
#include "forward/material_slope.hpp"
#include "forward/plan.hpp"

#include <map>
#include <vector>

namespace crampfit {

/// Static equilibrium of points, grid, crack fields and bodies for given crack tips: the displacement that makes the potential
///     Pi(u) = sum of V W(grad u) + ties at the tips + closed crack faces + contact - work of the tractions
/// stationary under what the boundary prescribes at a time, by Newton's method with the consistent tangent.
class Equilibrium {
  public:
    /// Equations are solved by `threads` threads, with the same bits whatever their number.
    Equilibrium(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body, int threads = 1);

    enum class Outcome { solved, not_converged, mechanism };  // mechanism: something can move without resistance

    /// From where it stands, solves for what the boundary prescribes at `time`.
    Outcome solve(double time);

    /// Moves a crack tip. The displacement stays, new fields start with that of the field that they come from; `solve` next.
    /// Returns those.
    std::vector<CrackFields::NewField> grow(int crack, bool at_end, const Vec2& to);

    double time() const { return time_; }
    const CrackFields& cracks() const { return cracks_; }
    const Boundary& boundary() const { return boundary_; }
    const std::vector<Vec2>& displacements() const { return displacement_; }

    double potential() const;                      // Pi [J]
    double strain_energy() const;                  // in the points and in the ties [J]
    double traction_work() const;                  // traction times displacement [J]
    double measured_displacement(double time) const;  // of the edge or body that is measured, the way it goes [m]
    const std::vector<Vec2>& reactions() const { return reaction_; }  // what each driver puts on the specimen [N]
    double power() const;                          // of what prescribes motion, dPi/dt at standing cracks [W]
    TipLoad load_at(int crack, bool at_end) const { return load_at(crack, at_end, displacement_, materials_); }
    double reciprocal_condition() const { return factor_.reciprocal_condition(); }  // of the last tangent, roughly
    int factorisations() const { return factorisations_; }

    /// What moves while drivers do, the cracks standing, per time or per length that the drivers go.
    struct Motion {
        std::vector<Vec2> drivers;  // [drivers]
        std::vector<Vec2> fields;   // [fields]
    };

    /// The motions that such motions of the drivers bring about from here on, by the tangent at this equilibrium. None where that is
    /// not positive definite.
    std::vector<Motion> motions(const std::vector<std::vector<Vec2>>& drivers);

    /// The motion that this load on the points and facets would bring about [N].
    Motion yield_to(const std::vector<Vec2>& load) const;

    /// Derivatives by numbers of the materials at this equilibrium.
    struct Slopes {
        Eigen::VectorXd potential;   // [numbers] [J / unit]
        Eigen::MatrixXd fields;      // [2 x fields, numbers] of the potential's slope by displacements, these as they are [N / unit]
        Eigen::MatrixXd drivers;     // [2 x drivers, numbers] and by what drivers go, of bodies that slide

        /// Of the potential's slope along a motion, as it is found anew where the number is another.
        double along(const Motion& motion, int number) const;
    };
    Slopes slopes(const std::vector<MaterialSlope>& numbers);

    /// Derivatives of the displacements by the numbers, [numbers][fields], by the tangent that `motions` has made.
    std::vector<std::vector<Vec2>> displacement_slopes(const Slopes& slopes) const;

    /// The derivative of G at a tip by a number, with that of the displacements [J/m^2 / unit].
    double release_slope(int crack, bool at_end, const MaterialSlope& number, const std::vector<Vec2>& displacement_slope);

    /// Everything that growth and solution change, to come back to.
    struct Snapshot {
        CrackFields cracks;
        std::vector<std::array<int, 4>> node;
        std::vector<Boundary::Held> held;
        LoosePieces pieces;
        std::vector<Vec2> displacement;
        double time;
    };
    Snapshot save() const;
    void restore(const Snapshot& snapshot);
    void set_displacements(const std::vector<Vec2>& displacement, double time);

  private:
    TipLoad load_at(int crack, bool at_end, const std::vector<Vec2>& displacement, const MaterialMap& materials) const;
    void renumber();
    void mark_changes(const std::vector<std::array<int, 4>>& fields_before);
    void find_forces();
    bool factor_tangent(bool geometric);
    GridFactor::Element element(const std::array<int, 4>& fields, const Eigen::Matrix<double, 8, 8>& stiffness) const;
    void add_step_load(const std::array<int, 4>& fields, const Eigen::Matrix<double, 8, 8>& stiffness);
    void add_step_loads(bool geometric);
    void add_extra(int cell, const std::array<int, 4>& fields, const Eigen::Matrix<double, 8, 8>& stiffness);
    template <class Visit>
    void for_groups_of(int cell, const Visit& visit) const;
    void add_lone_points();
    void add_pairs();
    void add_touches(bool geometric);
    Eigen::VectorXd load_of(const std::vector<Vec2>& drivers);
    Motion motion_of(const std::vector<Vec2>& drivers, const Eigen::VectorXd& step) const;
    Mat2 pair_stiffness(const FieldPair& pair) const;
    Mat2 face_stiffness(const FieldPair& pair) const;
    double largest_residual() const;
    double slope_along(const Eigen::VectorXd& step) const;
    void move(const Eigen::VectorXd& step, double share);
    double take_step(const Eigen::VectorXd& step);
    Eigen::VectorXd forces_on_equations() const;  // out of balance [N]
    Eigen::VectorXd newton_step(Eigen::MatrixXd load) const;
    void learn(Eigen::VectorXd step, Eigen::VectorXd force);
    void prescribe(double time);
    void move_prescribed();

    const Scene& scene_;
    const Plan& plan_;
    Discretisation& body_;
    const MaterialMap& materials_;
    CrackFields cracks_;
    Boundary boundary_;
    Gauges gauges_;
    InternalForce internal_force_;
    std::vector<SlidingBody> sliding_;
    std::vector<int> sliding_driver_;

    // One entry a field.
    std::vector<double> mass_;        // [kg]
    std::vector<Vec2> displacement_;  // [m]
    std::vector<Vec2> force_;         // out of balance [N]

    std::vector<Vec2> reaction_;      // [drivers] [N]
    double least_force_ = 0;          // [N]
    double contact_energy_ = 0;       // [J]
    double face_energy_ = 0;          // [J]
    double time_ = 0;                 // [s]
    double next_time_ = 0;            // that is being solved for [s]
    std::vector<Vec2> still_to_go_;   // [drivers] until then [m]

    GridFactor factor_;
    LoosePieces pieces_;              // that cracks have cut free
    std::vector<int> equation_;       // [2 x fields] its equation, or -1: prescribed or without points
    int equations_ = 0;
    std::vector<Mat2> pair_stiffness_;  // [pairs] as last factored [N/m]
    std::multimap<int, GridFactor::Element> extra_;  // by cell: what is not the points'
    std::vector<double> prescribed_step_;  // [2 x fields] what prescribed components still have to go [m]
    Eigen::VectorXd step_load_;       // what that puts on the equations [N]
    int factorisations_ = 0;
    struct Lesson {
        Eigen::VectorXd step;         // that was taken [m]
        Eigen::VectorXd force;        // that it needed [N]
        double work;                  // their product [J]
    };
    std::vector<Lesson> lessons_;     // since the tangent was factored
};

} // namespace crampfit

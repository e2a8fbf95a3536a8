#pragma once

#include "forward/deformation.hpp"
#include "forward/geometry.hpp"

#include <Eigen/Core>

#include <functional>
#include <vector>

namespace crampfit {

/// What a place of a contact remembers between increments.
struct Grip {
    int place = 0;         // which facet or pair of crack faces
    double stretch = 0.0;  // of the spring along the surface [m]
};

/// A place where two surfaces press on each other, and how it got there from the state that was kept last.
struct Pressing {
    Vec2 normal;               // unit, the way that the contact pushes the place
    double curvature = 0.0;    // of the surfaces of equal depth, 1 / radius [1/m]
    double force = 0.0;        // along the normal [N]
    double stiffness = 0.0;    // change of that force with depth [N/m]
    double depth = 0.0;        // [m]
    double depth_before = 0;   // then; below 0: it did not touch [m]
    Vec2 gone = Vec2::Zero();  // of the place against what it touches, since then [m]
    bool in_steps = false;     // forces work over whole time steps, also over one in which the place begins to touch
};

/// Coulomb friction at such a place: a spring along the surface that slips where its force reaches `coefficient` times the normal
/// force (return mapping; Wriggers 2006, ch. 5). How far it slides counts from where it begins to touch on the way, taken for
/// straight.
struct Drag {
    Vec2 force = Vec2::Zero();    // on the place [N]
    Mat2 tangent = Mat2::Zero();  // minus its slope by the place [N/m]; not symmetric where it slides or the surface is curved
    double stiffness = 0.0;       // of the symmetric part that holds the place while it does not slide, along the surface [N/m]
    double stretch = 0.0;         // of the spring [m]
    double limit = 0.0;           // [N]
    double energy = 0.0;          // in the spring [J]
    double dissipated = 0.0;      // since the state that was kept [J]
};

/// `stiffness` of the spring in N/m.
Drag drag(const Pressing& pressing, double coefficient, double stiffness, const Grip& before);

/// A place on faces that rub, one of many that the wood joins.
struct RubbingPlace {
    Vec2 normal;
    double stiffness = 0.0;    // along the normal and the surface, of what touches [N/m]
    double coefficient = 0.0;  // of friction
    Vec2 apart;                // how far the left face is from the right one [m]
    Vec2 apart_before;         // in the state that was kept last [m]
    double stretch = 0.0;      // of the spring along the surface, then [m]
    double joint = 0.0;        // stiffness of a spring between the faces that the wood's compliance holds [N/m]

    /// On the left face when it goes on so far against the right one [N].
    Vec2 force(const Vec2& step) const;
};

/// Forces in N, [2 x places], those of the joints' springs added, that places put on their left faces where they go
/// `without` + `compliance` x forces (m; m/N), each by its own law: by going from place to place, where a small problem has a
/// solution of its own (nonlinear Gauss-Seidel; Jourdan, Alart and Jean 1998).
Eigen::VectorXd balance_of_rubbing(const std::vector<RubbingPlace>& places, const Eigen::MatrixXd& compliance,
                                   const Eigen::VectorXd& without);

/// Solves (M + E) x = right, given x -> M^-1 x and x -> E x, where E is small against M (GMRES, Saad and Schultz 1986, with M as
/// preconditioner from the right).
Eigen::VectorXd solve_with_remainder(const Eigen::VectorXd& right,
                                     const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& inverse,
                                     const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& remainder);

}  // namespace crampfit

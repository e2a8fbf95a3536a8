#pragma once

#include "forward/discretisation.hpp"

#include <vector>

namespace crampfit {

/// A rigid body that pushes on the specimen's outline without friction. Each facet inside it is pushed out along the body's
/// normal by a force that grows with the depth, with up to ten times the stiffness of a cell of the wood. It never pulls.
class SlidingBody {
  public:
    SlidingBody(const Shape& shape, const Discretisation& body);

    /// Softens the springs so that they add at most `most_frequency_squared` to the highest squared frequency [1/s^2], for fields
    /// of these masses [kg]. From then on the facets that the body may touch are searched for now and then only.
    void limit_frequency(const std::vector<double>& mass, double most_frequency_squared);

    /// Adds the contact forces to the nodes. `moved` is how far the body has gone [m]. Returns the force on the specimen [N].
    Vec2 push(const Vec2& moved, const std::vector<Vec2>& displacement, std::vector<Vec2>& force);

    /// A facet that the body pushes on.
    struct Touch {
        int facet;
        Vec2 normal;       // unit, out of the body
        double curvature;  // of the surfaces of equal depth there, 1 / radius [1/m]
        double force;      // along the normal [N]
        double stiffness;  // force per depth [N/m]
        double energy;     // [J]
    };

    /// All facets that the body, gone so far, pushes on.
    std::vector<Touch> touches(const Vec2& moved, const std::vector<Vec2>& displacement);

    double stored_energy() const { return stored_energy_; }  // in the contact's springs [J]

    /// Deepest that any facet lies in the body where it stands [m].
    double deepest(const std::vector<Vec2>& displacement) const;

  private:
    void find_near(const Vec2& moved, const std::vector<Vec2>& displacement);
    Vec2 current(const Facet& facet, const std::vector<Vec2>& displacement) const;

    Shape shape_;
    const Discretisation& body_;
    std::vector<double> stiffness_;  // [facets] [N/m]
    std::vector<int> near_;          // facets that the body may touch before the list is made anew
    int age_ = 0;
    int steps_between_searches_ = 1;
    double stored_energy_ = 0.0;
};

} // namespace crampfit

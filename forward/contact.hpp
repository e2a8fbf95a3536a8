#pragma once

#include "forward/discretisation.hpp"

#include <vector>

namespace crampfit {

/// A rigid body that pushes on the specimen's outline without friction. Each facet inside it is pushed out along the body's
/// normal by a force that grows with the depth, with up to ten times the stiffness of a cell of the wood. It never pulls.
class SlidingBody {
  public:
    /// `mass` of the fields [kg]; the springs add at most `most_frequency_squared` to the highest squared frequency [1/s^2].
    SlidingBody(const Shape& shape, const Discretisation& body, const std::vector<double>& mass, double most_frequency_squared);

    /// Adds the contact forces to the nodes. `moved` is how far the body has gone [m]. Returns the force on the specimen [N].
    Vec2 push(const Vec2& moved, const std::vector<Vec2>& displacement, std::vector<Vec2>& force);

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
    double stored_energy_ = 0.0;
};

} // namespace crampfit

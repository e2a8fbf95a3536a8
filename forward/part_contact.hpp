#pragma once

#include "forward/discretisation.hpp"
#include "forward/search_interval.hpp"

#include <vector>

namespace crampfit {

/// Parts of the specimen push on one another without friction. Each facet of one part that lies in another is pushed out of it to
/// the nearest place of its outline, by a force that grows with the depth, and that place is pushed back. Both parts of a pair do
/// this with half of the stiffness, so that the force does not depend on which is called first; it is the slope of a potential,
/// and takes no energy.
class PartContact {
  public:
    /// The springs add at most `most_frequency_squared` to the highest squared frequency [1/s^2], for fields of these masses
    /// [kg].
    PartContact(const Discretisation& body, const std::vector<double>& mass, double most_frequency_squared);

    /// Adds the contact forces to the nodes.
    void push(const std::vector<Vec2>& displacement, std::vector<Vec2>& force);

    double stored_energy() const { return stored_energy_; }  // in the springs [J]

  private:
    // A facet as it lies now, from one end to the other with the wood on its left.
    struct Segment {
        std::array<std::array<double, most_nodes>, 2> weight;  // of the nodes that its cell sees, for both ends
        std::array<Vec2, 2> end;                               // [m]
        double stiffness;                                      // force per depth of its middle [N/m]
        int part;
        Vec2 at_search;                   // its first end at the last search [m]
        std::array<int, 2> next{-1, -1};  // facets that go on from its ends; -1: none does
    };
    struct Candidate {
        int facet;
        int nearest;  // of another part's facets, as last seen
    };

    void find_neighbours();
    Vec2 outward(int facet, double along) const;
    void soften(const std::vector<double>& mass, double most_frequency_squared);
    void move(int facet, const std::vector<Vec2>& displacement);
    void find_candidates();
    void touch(Candidate& candidate, std::vector<Vec2>& force);
    double distance_squared(int facet, const Vec2& x, double& along) const;

    const Discretisation& body_;
    std::vector<Segment> segments_;  // [facets]
    std::vector<Box> box_;           // [parts]
    std::vector<int> near_;          // facets in another part's box, or nearly
    std::vector<Candidate> candidates_;
    SearchInterval search_;
    double stored_energy_ = 0.0;
};

}  // namespace crampfit

#pragma once

#include "forward/cracks.hpp"

#include <array>
#include <vector>

namespace crampfit {

/// Whether a scene has cracks, and bodies that slide: those push on faces.
bool slides_on_faces(const Scene& scene);

/// Short pieces of both faces of the cracks, on which bodies push as they do on the outline's. None is given up: a number stands
/// for one piece as long as cracks go on.
class FaceFacets {
  public:
    /// The scene, the discretisation and the cracks must outlive this.
    FaceFacets(const Scene& scene, const Discretisation& body, const CrackFields& cracks);

    /// After cracks have grown within a box. What is shorter than a piece at a tip is left until it has gone on.
    void take_in(const Box& changed);

    const std::vector<Facet>& all() const { return facets_; }

    /// That which goes on from a facet on the same face, toward the crack's end or its start; -1: none.
    int next(int facet, bool to_end) const { return next_[facet][to_end]; }

  private:
    void cover(int crack, bool at_end);
    void add_piece(int crack, bool at_end, const Vec2& from, const Vec2& to);
    int point_of(int crack, bool left, const Vec2& x) const;

    const SpecimenPlan& specimen_;
    const Discretisation& body_;
    const CrackFields& cracks_;
    struct Of {
        int crack;
        bool left;
    };
    struct Covered {
        Vec2 to;                          // a crack has facets up to there [m]
        std::array<int, 2> last{-1, -1};  // on the right and on the left
    };
    std::vector<Facet> facets_;
    std::vector<Of> of_;                           // [facets]
    std::vector<std::array<int, 2>> next_;         // [facets] toward the crack's start and its end
    std::vector<std::array<Covered, 2>> covered_;  // [cracks] toward its start and its end
};

}  // namespace crampfit

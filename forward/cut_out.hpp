#pragma once

#include "forward/equilibrium.hpp"

#include <optional>
#include <vector>

namespace crampfit {

/// A grid, or a part of one, with the displacements of its fields.
struct GridView {
    const Discretisation& body;
    const CrackFields& cracks;
    const std::vector<Vec2>& displacement;
    Vec2 origin;  // of its lower left corner in the specimen [m]
    int crack;    // its number there

    /// The point nearest to a place on the same side of the crack; -1: none near it is.
    int point_beside(const Vec2& x) const;
};

/// A box cut out of the specimen, in cells of its own, with one of its cracks; its outline is held where another grid has it. Its wood is
/// taken once, for all places of the tip.
class CutOut {
  public:
    /// `whole`, `plan` and `numbers`, those of the materials by which slopes may be asked for, must outlive this.
    CutOut(const Scene& whole, const Plan& plan, const MaterialMap& wood, const std::vector<MaterialSlope>& numbers, const Box& place, double cell);

    bool is(const Box& place, double cell) const { return place.low == box_.low && place.high == box_.high && cell == scene_.model.cell; }

    /// Solves with this crack. False where the other grid does not know the outline.
    bool solve(const CrackLine& line, int crack, const GridView& from);

    double potential() const { return equilibrium_->potential(); }  // [J]
    GridView view() const { return {cracked_, equilibrium_->cracks(), equilibrium_->displacements(), box_.low, 0}; }

    /// Slope of the energy by the displacements of the other grid, with `inner` that of what is cut out of this one by its
    /// displacements [N]. Adds `sign` times the slopes by the numbers.
    std::vector<Vec2> slope_by(const GridView& from, const std::vector<Vec2>& inner, double sign, std::vector<double>& by_number);

  private:
    void hold_outline(const Vec2& size);

    struct Hold {
        int field;
        std::array<int, most_nodes> from;  // fields of the other grid
        std::array<double, most_nodes> weight;
    };

    const Scene& whole_;
    const Plan& plan_;
    const std::vector<MaterialSlope>& numbers_;
    Box box_;                              // in the specimen
    Scene scene_;                          // of what is cut out and the crack
    MaterialMap materials_;
    Discretisation body_, cracked_;        // without the crack and with it
    std::vector<MaterialSlope> slopes_;    // of the numbers here; empty: not asked for yet
    std::optional<Equilibrium> equilibrium_;
    std::vector<Hold> outline_;
};

} // namespace crampfit

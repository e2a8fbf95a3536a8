#pragma once

#include "forward/equilibrium.hpp"

#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace crampfit {

/// A grid, or a part of one, with the displacements of its fields.
struct GridView {
    const Discretisation& body;
    const CrackFields& cracks;
    const std::vector<Vec2>& displacement;
    Vec2 origin;  // of its lower left corner in the specimen [m]
    int crack;    // its number there

    /// What of the wood moves together, by its cell and the fields there.
    struct Wood {
        int cell;
        std::span<const int> fields;
    };

    /// That in which a place lies, if it is on the same side of the crack.
    std::optional<Wood> wood_about(const Vec2& x) const;

    /// That of the points nearest to a place on the same side of the crack, those first whose cell holds a node or is nearest to
    /// it. More than one where they are as near, none where none is.
    std::vector<Wood> wood_beside(const Vec2& x, const Vec2& node) const;
};

/// The wood of a box of the specimen in cells of its own, without a crack: found once for all cracks there.
struct CutOutWood {
    CutOutWood(const Scene& whole, const MaterialMap& wood, const Box& place, const Vec2& width);

    bool is(const Box& place, const Vec2& width) const { return place.low == box.low && place.high == box.high && width == cell; }
    const std::vector<MaterialSlope>& slopes_by(const std::vector<MaterialSlope>& numbers);

    Box box;      // in the specimen
    Vec2 cell;    // that were asked for [m]
    Scene scene;  // of what is cut out; its outline is held where the specimen goes on
    MaterialMap materials;
    Discretisation body;

  private:
    std::vector<MaterialSlope> slopes_;  // of the numbers here; empty: not asked for yet
};

/// A box cut out of the specimen with one of its cracks; its outline is held where another grid has it. A crack that goes on
/// takes along what it leaves as it is: its fields and most of the factor.
class CutOut {
  public:
    /// `whole`, `plan` and `numbers`, those of the materials by which slopes may be asked for, must outlive this.
    CutOut(const Scene& whole, const Plan& plan, const std::vector<MaterialSlope>& numbers, std::shared_ptr<CutOutWood> wood);

    const std::shared_ptr<CutOutWood>& wood() const { return wood_; }

    /// Where the tip goes from the crack that was solved for last to this one [m]: nowhere if that is the same. None where it is
    /// another.
    std::optional<std::vector<Vec2>> way_to(const CrackLine& line, int crack, bool at_end) const;

    /// Solves with this crack. False where the other grid does not know the outline. `solved_there`: in the same cells, so that
    /// what the other grid has there is the solution.
    bool solve(const CrackLine& line, int crack, bool at_end, const GridView& from, bool solved_there);

    double potential() const { return equilibrium_->potential(); }  // [J]
    GridView view() const { return {cracked_, equilibrium_->cracks(), equilibrium_->displacements(), wood_->box.low, 0}; }

    /// Slope of the energy by the displacements of the other grid, with `inner` that of what is cut out of this one by its
    /// displacements [N], empty where nothing is cut out. Adds `sign` times the slopes by the numbers.
    std::vector<Vec2> slope_by(const GridView& from, const std::vector<Vec2>& inner, double sign, std::vector<double>& by_number);

  private:
    bool take_over(const GridView& from, bool solved_there);

    struct Hold {
        int field;
        std::array<int, most_nodes> from;  // fields of the other grid
        std::array<double, most_nodes> weight;
    };

    const Scene& whole_;
    const Plan& plan_;
    const std::vector<MaterialSlope>& numbers_;
    std::shared_ptr<CutOutWood> wood_;
    Scene scene_;  // with the crack
    Discretisation cracked_;
    std::optional<Equilibrium> equilibrium_;
    int crack_ = -1;            // that it holds, by its number in the specimen; -1: none yet
    std::vector<Vec2> points_;  // of that crack, in the specimen [m]
    std::vector<Hold> taken_;   // the outline, or all that is solved there
    bool solved_there_ = false;
};

}  // namespace crampfit

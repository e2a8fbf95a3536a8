#pragma once

#include "forward/cut_out.hpp"

#include <deque>
#include <memory>
#include <optional>
#include <span>

namespace crampfit {

/// What the grid misses of the potential at a crack tip that passes a sharp boundary between woods.
struct MissedEnergy {
    double energy = 0;              // to be added to the potential [J]
    std::vector<double> by_number;  // its slope by the numbers, the grid's displacements as they are [J / unit]
    std::vector<Vec2>
        by_displacement;  // and by the displacements of the grid's fields [N]; empty like `by_number` where none is asked for
};

/// The way of a crack's tip over an advance.
struct TipWay {
    int crack;
    Vec2 from, to;
};

/// Boxes about the way of a tip over an advance, one within the other.
struct TipBoxes {
    std::vector<Box> boxes;
    double share = 0;  // of what is missed there that counts

    /// Whether a tip lies as deep in them as it needs to.
    bool hold(const Vec2& tip, const Vec2& cell) const;
};

/// Boxes about the tip of a crack.
struct TipPlace {
    const TipBoxes& boxes;
    int crack;
    bool at_end;
};

/// The energy of a crack in one wood is right to some parts in a thousand of G times a cell, wherever its tip lies in a cell:
/// `tip_lag` and the ties see to that. Where the tip passes into wood many times as stiff, G falls to nothing and rises again
/// within a cell, and the grid gives up to twice the energy that the next cells release. So the wood around the tip is cut out
/// with its outline held where the grid has it, and solved with cells as they are and half as wide; within that a smaller box is,
/// with cells a quarter as wide, and where an end of the way is close to the boundary one more. The differences add up to what is
/// missed, to first order in them (the fast adaptive composite idea of McCormick 1984, one way down).
///
/// The finer cells see the same wood otherwise averaged, whatever the tip does. That is as much in the same boxes before an
/// advance and after it, and takes no part in what the advance releases; in boxes that follow the tip it would.
class FineTip {
  public:
    /// All must outlive this. `numbers`: of the materials, by which slopes may be asked for. `side_by_side`: several places are
    /// solved in a thread each, to the same bits.
    FineTip(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
            const std::vector<MaterialSlope>& numbers, bool side_by_side = false);

    /// Boxes for a tip on the way from one place to another. None where no sharp boundary lies within 4 cells of the way, nor
    /// where there is no room for them among bodies, other cracks and the ways of their tips.
    std::optional<TipBoxes> about(const CrackFields& cracks, const TipWay& way, std::span<const TipWay> others = {}) const;

    /// What is missed at each place with the cracks as the equilibrium has them; of a closed tip nothing, nor where another crack
    /// has come into the boxes. With its slopes by the numbers, or without. Places that share no box may be solved side by side.
    std::vector<MissedEnergy> missed(const std::vector<TipPlace>& places, const Equilibrium& equilibrium, bool with_slopes);

    struct Ahead {
        double share = 0;               // that counts, as of what is missed
        std::vector<double> potential;  // [J]
    };

    /// Around a tip of a specimen in motion: the potential of the wood in a box, brought to rest with its outline held where it
    /// is and seen with finer cells at the tip, with that so far straight on as each of the rising `ways` says, from nil on [m].
    /// None where `about` has no boxes or something else acts in that wood, nor where the crack is closed.
    Ahead ahead(const CrackFields& cracks, int crack, bool at_end, const std::vector<Vec2>& displacement,
                const std::vector<double>& ways, const Box& box);

  private:
    struct Parts {
        std::vector<std::shared_ptr<CutOut>> coarse, fine;  // [boxes]
    };
    using Woods = std::vector<std::shared_ptr<CutOutWood>>;
    Woods make_woods(std::span<const TipBoxes* const> places) const;
    std::shared_ptr<CutOut> cut(const Box& box, const Vec2& cell, const CrackLine& line, int crack, bool at_end,
                                const CutOut* in_use, const Woods& made);
    bool counts(const TipPlace& place, const Equilibrium& equilibrium) const;
    Parts parts_of(const TipPlace& place, const CrackLine& line, const Woods& made);
    MissedEnergy missed(const TipPlace& tip, const Parts& parts, const Equilibrium& equilibrium, bool with_slopes) const;
    std::optional<double> go_down(const TipPlace& tip, const Parts& parts, const CrackLine& line, bool at_rest,
                                  std::vector<GridView>& views) const;

    const Scene& scene_;
    const MaterialMap& materials_;
    const Discretisation& body_;
    const std::vector<MaterialSlope>& numbers_;
    bool rotates_, side_by_side_;
    Plan small_;                                // small strain, linear
    std::deque<std::shared_ptr<CutOut>> kept_;  // those asked for last, the last one first: neighbouring places share them
};

}  // namespace crampfit

#pragma once

#include "forward/equilibrium.hpp"

#include <vector>

namespace crampfit {

/// What the grid misses of the potential at a crack tip that passes a sharp boundary between woods.
struct MissedEnergy {
    double energy = 0;                  // to be added to the potential [J]
    std::vector<double> by_number;      // its slope by the numbers, the grid's displacements as they are [J / unit]
    std::vector<Vec2> by_displacement;  // and by the displacements of the grid's fields [N]; empty like `by_number` where none is asked for
};

/// The energy of a crack in one wood is right to some parts in a thousand of G times a cell, wherever its tip lies in a cell: `tip_lag`
/// and the ties see to that. Where the tip passes into wood many times as stiff, G falls to nothing and rises again within a cell, and
/// the grid gives up to twice the energy that the next cells release. So the wood around the tip is cut out with its outline held where the
/// grid has it, and solved with cells as they are and half as wide; within that a smaller box is, with cells a quarter as wide. The
/// differences add up to what is missed, to first order in them (the fast adaptive composite idea of McCormick 1984, one way down).
///
/// Nothing is missed where no sharp boundary lies within 4 cells of the tip; nor is it told where the box meets anything that holds or
/// loads the specimen, or another crack.
///
/// `numbers`: of the materials, by which slopes are asked for.
MissedEnergy energy_missed_at_tip(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                                  const Equilibrium& equilibrium, int crack, bool at_end, const std::vector<MaterialSlope>& numbers = {});

} // namespace crampfit

#pragma once

#include "datasets/scene.hpp"

#include <string>

namespace crampfit {

/// The coarsest grid on which a scene at equilibrium is expected to meet an error that is asked for.
struct GridChoice {
    double cell = 0;       // [m]
    double error = 0;      // estimated, relative, of the quantity that has the largest
    std::string quantity;  // that one
    double seconds = 0;    // that a run on it will take, estimated from those made
    double seconds_spent = 0;
    std::string text;  // the same for a person
};

/// Runs the scene on grids each half as wide as the one before and looks at what they change: force over displacement before the
/// crack moves, G at a crack that stands, the displacement at which one that grows moves first, and the largest force. Of each
/// the error is taken to go as a power of the cell, and that of the finest to be 1.25 d / (2^p - 1), d its change from the grid
/// before, p the power that the two changes show, between 1/2 and 2 (the grid convergence index; Roache 1994, eq. 3 and 8).
/// Where a crack kinks, p is 1 at most, d no less than half of the change before, and the grid is chosen as fine as it takes to
/// be as near to the finest one tried. Throws InputError naming model.error where the scene is not at equilibrium or no grid of a
/// bearable size meets it.
GridChoice choose_grid(const Scene& scene, double error);

}  // namespace crampfit

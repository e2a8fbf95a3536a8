#pragma once

#include "forward/energy_release.hpp"

namespace crampfit {

/// Angles are counted counter-clockwise from the direction of the crack ahead [rad].

/// Where the hoop stress around a tip in isotropic wood is largest; 0 for a tip without load.
double hoop_stress_angle(double K_I, double K_II);

/// K_I and K_II at the tip of a short straight branch that leaves a tip with these at an angle of up to 80 degrees [Pa sqrt(m)].
Vec2 branch_intensities(double angle, double K_I, double K_II);

/// Whether K_I and K_II steer a crack.
bool steered_by_intensities(GrowthDirection criterion);

/// How far a crack that they steer goes straight after its last turn, in cells: a shorter leg is one that the grid hardly sees.
/// After a turn by 40 degrees in mode I, K_II is 0.70 K_0 half a cell on, 0.46 a cell on, and 0.41 a cell and a half on, where a
/// branch has 0.30 to 0.40 (Amestoy and Leblond 1992): a crack that heeds it turns back by more than it should, from leg to leg.
/// After turns of up to 20 degrees a cell will do, where these are 0.29, 0.23, 0.22 and 0.17 to 0.22.
double least_leg_in_cells(const CrackLine& line, bool at_end);

/// Which way a crack tip goes on: a unit vector. The next `increment` [m] is what "energy release rate" weighs toughness over.
/// Where the wood is much stiffer or softer about so far away, ahead, behind or to a side, a crack that K_I and K_II steer goes
/// as in pure mode I: they mean little at a boundary. "normal to opening" takes the opening that they tell, as far as they are
/// known (not a number: unknown), and near such wood the one that is seen. Between, both have a share. Where K_I and K_II may not
/// turn the crack, as so soon after its last turn, they let it go straight.
Vec2 growth_direction(GrowthDirection criterion, const CrackTip& tip, TipLoad load, const MaterialMap& materials,
                      double increment, bool may_turn = true);

}  // namespace crampfit

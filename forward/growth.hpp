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

/// They say how it goes on once it has gone straight for so many cells: a shorter leg is one that the grid hardly sees. After a
/// turn by 40 degrees in mode I, K_II is 0.70 K_0 half a cell on and 0.46 a cell on, where a short branch has 0.30 and one of
/// that length 0.39 (Amestoy and Leblond 1992): a crack that heeds it turns back by more than it should, from leg to leg.
inline constexpr double least_leg_in_cells = 1.5;

/// Which way a crack tip goes on: a unit vector. The next `increment` [m] is what "energy release rate" weighs toughness over.
Vec2 growth_direction(GrowthDirection criterion, const CrackTip& tip, const TipLoad& load, const MaterialMap& materials,
                      double increment);

}  // namespace crampfit

#pragma once

#include "forward/energy_release.hpp"

namespace crampfit {

/// Angles are counted counter-clockwise from the direction of the crack ahead [rad].

/// Where the hoop stress around a tip in isotropic wood is largest; 0 for a tip without load.
double hoop_stress_angle(double K_I, double K_II);

/// K_I and K_II at the tip of a short straight branch that leaves a tip with these at an angle of up to 80 degrees [Pa sqrt(m)].
Vec2 branch_intensities(double angle, double K_I, double K_II);

/// Which way a crack tip goes on: a unit vector. The next `increment` [m] is what "energy release rate" weighs toughness over.
Vec2 growth_direction(GrowthDirection criterion, const CrackTip& tip, const TipLoad& load, const MaterialMap& materials,
                      double increment);

}  // namespace crampfit

#pragma once

#include "datasets/record.hpp"
#include "datasets/scene.hpp"

#include <string>
#include <vector>

namespace crampfit {

/// A scene at equilibrium that is loaded by given displacements alone has no stress but that of its materials: with every
/// stiffness and every toughness so many times as large, displacements stay as they are, cracks grow alike, and forces and
/// energies are so many times as large. A record of one such scene is one of all, but for the unit of stress.

/// Keys of a scene's stiffnesses [Pa]; none where other stress or force has a say too.
std::vector<std::string> stress_keys(const Scene& scene);

/// Every stiffness and toughness of the scene times a factor, which is above 0.
void multiply_stress(Scene& scene, double factor);

/// All forces and energies of the record times a factor, and what goes with them.
void multiply_stress(Record& record, double factor);

}  // namespace crampfit

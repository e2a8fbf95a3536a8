#pragma once

#include "forward/cracks.hpp"

#include <string>
#include <vector>

namespace crampfit {

/// What the contact models do not hold for, in a state of a specimen: bodies that lie over the faces of a crack, or over wood
/// that they, bonded, do not hold; faces that press and have slid along each other by more than a cell. Each begins
/// with "; ", empty where there is nothing to say. `moved`: how far each body of the scene has gone [m].
std::string beyond_contact(const Scene& scene, const Discretisation& body, const CrackFields& cracks,
                           const std::vector<Vec2>& displacement, const std::vector<Vec2>& moved);

}  // namespace crampfit

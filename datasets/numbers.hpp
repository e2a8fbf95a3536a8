#pragma once

#include "datasets/limits.hpp"
#include "datasets/scene.hpp"

#include <string>

namespace crampfit {

/// A number of a scene that a fit may adjust.
struct SceneNumber {
    const double* value;  // in the scene, SI
    NumberRule rule;
};

/// Finds a number by its dotted key, such as materials.EW.toughness, cracks.0.advance or edges.top.velocity.1; members
/// of a list by name or by number from 0. Throws InputError, which names `file` and `value`, for a key that is no
/// number of this scene.
SceneNumber find_number(const Scene& scene, const std::string& key, const std::string& file, const std::string& value);

}  // namespace crampfit

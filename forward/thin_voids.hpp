#pragma once

#include "forward/plan.hpp"

#include <optional>

namespace crampfit {

/// Wood on both sides of a void that is thinner than two cells has nodes in common: where that is so, but for the root of a
/// notch.
std::optional<Plan::Choice> thin_voids(const Scene& scene, const Discretisation& body);

}  // namespace crampfit

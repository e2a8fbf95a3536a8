#pragma once

#include "forward/plan.hpp"

#include <vector>

namespace crampfit {

/// What crack faces that a traction pulls together cannot be taken for. Throws InputError naming the key.
void check_bridging(const Scene& scene, bool quasistatic, const MaterialMap& materials, const Discretisation& body);

/// For `crampfit explain`.
std::vector<Plan::Choice> bridging_choices(const Scene& scene, const MaterialMap& materials, const Discretisation& body);

}  // namespace crampfit

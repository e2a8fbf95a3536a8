#pragma once

#include "forward/discretisation.hpp"

namespace crampfit {

/// Throws InputError for what wood that remembers leaves undefined or would only seem to do: growth at equilibrium and in plastic
/// wood, growth by `advance` or K, tips in wood that relaxes as they pass; and for time steps where there are none to choose.
void check_memory(const Scene& scene, bool quasistatic, const MaterialMap& materials, const Discretisation& body);

}  // namespace crampfit

#pragma once

#include "datasets/record.hpp"
#include "forward/plan.hpp"

#include <functional>
#include <vector>

namespace crampfit {

/// The times at which equilibrium is found where wood remembers [s]: from 0, or the first step, to the end of the run. Even steps
/// where the scene gives one. Else steps of a hundredth of the run at most, which begin with a twentieth of the shortest
/// relaxation time at the start and wherever an edge or body stops, and grow from there by a quarter each. What stops, frames and
/// probes have times of their own among them.
std::vector<double> march_times(const Scene& scene, const Plan& plan, const MaterialMap& materials);

/// Follows a scene whose wood remembers and whose cracks stand from equilibrium to equilibrium in real time; a row of the series
/// each, or every so many where there would be more than twice `output.samples`. `go_on(time)` may end it. A load that acts from
/// the start on is brought up to there so slowly that nothing moves, and so fast that nothing relaxes: that work is in the first
/// row's.
Record march(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body, int threads,
             const std::function<bool(double)>& go_on);

}  // namespace crampfit

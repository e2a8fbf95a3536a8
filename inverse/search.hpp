#pragma once

#include "datasets/experiment.hpp"
#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <functional>
#include <string>

namespace crampfit {

/// How a search ended; its best point is the objective's.
struct SearchResult {
    bool converged = false;
    std::string method;  // what did the work, and why it was chosen
};

/// Starts that `auto` takes where residuals stay above two sigma, if the study does not ask for more.
inline constexpr int least_starts_where_unexplained = 4;

/// Searches the unit cube as a study asks: from `initial` and `starts - 1` further Sobol points of the box.
/// Local methods descend from each of them, side by side; global ones have the box for themselves and two runs of three, the
/// rest is for a descent from the best that they find (from the best at once where the objective has runs); `auto` runs each of
/// them once, descends from the best, and from others only as long as the noise does not explain the misfit. `stage` is
/// told what is going on.
/// `is_explained` says of the best run whether what it leaves looks like noise.
SearchResult search(Objective& objective, const OptimizerChoice& choice, const Eigen::VectorXd& initial, unsigned seed,
                    const std::function<bool(const Evaluation&)>& is_explained,
                    const std::function<void(const std::string&)>& stage);

}  // namespace crampfit

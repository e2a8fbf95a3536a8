#pragma once

#include "datasets/experiment.hpp"
#include "datasets/fit.hpp"
#include "inverse/close_look.hpp"
#include "inverse/ensemble.hpp"
#include "inverse/objective.hpp"
#include "inverse/profile.hpp"
#include "inverse/uncertainty.hpp"
#include "inverse/unit_box.hpp"

#include <functional>
#include <string>
#include <vector>

namespace crampfit {

/// What the study asks to know about the surroundings of the best point, beyond its covariance.
struct Exploration {
    std::vector<Profile> profiles;  // [parameters], of the box; empty where not asked for
    std::vector<Run> seen;          // on all their ways, of the box; empty where runs nearby are not exact
    Ensemble posterior;             // the same
    std::string message;
};

/// Profiles and posterior about the best run, on runs of the model where `cheap`, through a `close` look where there is one, and
/// else on a quadratic model of the residuals about it. `data_residuals` come first in an evaluation's residuals, priors follow;
/// the likelihood of the data is tempered by uncertainty.temperature, as the covariance is.
Exploration explore(Objective& objective, CloseLook* close, const Uncertainty& uncertainty, const UncertaintyChoice& choice,
                    int data_residuals, bool cheap, unsigned seed, const std::function<void(const std::string&)>& stage);

/// Puts profile intervals in the place of those of the covariance, and fills in the tables.
void fill_exploration(Fit& fit, const UnitBox& box, const Uncertainty& uncertainty, const Exploration& exploration);

}  // namespace crampfit

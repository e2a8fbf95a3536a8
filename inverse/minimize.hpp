#pragma once

#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace crampfit {

/// A minimizer by name: "auto" for steps on models of the residuals, "ceres", or bobyqa, sbplx, cobyla, neldermead,
/// crs2, isres, direct, mlsl of NLopt.
struct Method {
    std::string name;
    unsigned seed = 1;  // of the methods that draw
};

/// How a minimizer ended. The least misfit ever seen is `objective.best()`, whatever point the minimizer itself holds
/// best.
struct Solution {
    bool converged = false;  // it ended by its own criterion, and not for lack of runs, failed runs or a stop
    std::string message;     // what it said
};

const std::vector<std::string>& method_names();
bool is_global(const Method& method);  // searches the whole box and does not care for the start

/// Lessens the sum of squared residuals within the unit cube, from `start` [parameters].
/// A failed run is a step not taken; runs end with the objective's budget or stop.
Solution minimize(Objective& objective, const Eigen::VectorXd& start, const Method& method);

Solution minimize_on_models(Objective& objective, const Eigen::VectorXd& start);
Solution minimize_with_ceres(Objective& objective, const Eigen::VectorXd& start);
Solution minimize_with_nlopt(Objective& objective, const Eigen::VectorXd& start, const Method& method);

}  // namespace crampfit

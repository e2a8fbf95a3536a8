#pragma once

#include "datasets/experiment.hpp"
#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <functional>
#include <optional>
#include <vector>

namespace crampfit {

/// Derivatives of what a study gives by its parameters, seen from either side: where they differ there is a kink.
struct WalkSlopes {
    Eigen::MatrixXd from_below;  // [results x parameters], for each SI unit of a parameter
    Eigen::MatrixXd from_above;

    Eigen::MatrixXd mean() const { return 0.5 * (from_below + from_above); }
};

/// `near` is the study near the point `values`, exact or to first order (KeptWalks::near), so that small steps give its
/// derivatives. Absent where a run failed.
std::optional<WalkSlopes> walk_slopes(const std::function<Evaluation(const Eigen::VectorXd&)>& near,
                                      const Eigen::VectorXd& values, const std::vector<Parameter>& parameters);

}  // namespace crampfit

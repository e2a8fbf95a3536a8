#pragma once

#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <optional>
#include <utility>
#include <vector>

namespace crampfit {

/// How far the misfit can be lowered by all other parameters while one is held: points of the unit cube by that parameter's
/// coordinate, rising, the best run's among them.
struct Profile {
    std::vector<double> x;                // of the parameter that is held, 0..1
    std::vector<double> misfit;           // least sum of squares there
    std::vector<Eigen::VectorXd> lowest;  // where that is
};

/// The profile of parameter j about the best run, outwards in steps of about a fourth of the `half_width` that its interval is
/// expected to have, until the misfit has risen by `rise` or the bound is reached. Each point takes a descent of the others from
/// where the one before ended, or where they are at the best run, and is no higher than there; a point at which all runs fail
/// ends its side. Venzon and Moolgavkar (1988), A method for computing profile-likelihood-based confidence intervals, Applied
/// Statistics 37. `alone` [parameters], alone_j = 1: how the others go with coordinate j while what they stand for stays; empty:
/// they stay.
Profile profile_likelihood(Objective& objective, const Run& best, Eigen::Index j, double half_width, double rise,
                           const Eigen::VectorXd& alone = {});

/// Where the profile comes up to `rise` above `least` below and above its lowest point: between two of its points as the square
/// root of the rise goes, which is a straight line in a linear problem. A side that does not come up to it: its end's 0 or 1.
std::pair<double, double> interval(const Profile& profile, double least, double rise);

/// Where the profile of parameter j comes up to `rise` above `least` on one side of the best run, `side` -1 or 1: how far off, as
/// a parabola has it or farther. Looked for from the parabola's end, `distance` along its `valley` [parameters], valley_j = 1,
/// and not followed from the best run on. Absent where it does not come up within the cube, or no run was usable.
std::optional<double> profile_end(Objective& objective, const Run& best, Eigen::Index j, int side, double distance,
                                  const Eigen::VectorXd& valley, double least, double rise, const Eigen::VectorXd& alone = {});

}  // namespace crampfit

#pragma once

#include "inverse/objective.hpp"
#include "inverse/uncertainty.hpp"
#include "inverse/window.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace crampfit {

/// How sure a point is, seen through a window about it: the objective is that of the window as a unit cube.
struct CloseLook {
    Window window;
    Objective objective;
    Uncertainty uncertainty;
    Objective::Evaluate near;  // of the box
    bool is_exact;             // those

    /// What a profile of a parameter goes through: a window about the same place as wide, whose first axis is the only one to
    /// change it. Points outside the box stand for the nearest one within.
    struct Along {
        Window window;
        Objective objective;
        Run best;                    // of the window
        Eigen::MatrixXd covariance;  // the same
        Eigen::VectorXd alone;       // how its coordinates go with the first while the other parameters stay
        bool is_exact;

        /// Its usable runs so far, in the box; none where they are not exact.
        std::vector<Run> seen() const;
    };
    Along along(Eigen::Index parameter) const;
};

/// An interval of parameter j that holds what runs, of any parameter's profile, have found to be within `rise` of the least
/// misfit.
std::pair<double, double> holding(const std::vector<Run>& runs, double least, double rise, Eigen::Index j, double lower,
                                  double upper);

/// Cheap runs near a point of the box.
struct NearRuns {
    Objective::Evaluate run;
    bool exact;   // else to first order in some parameters
    int threads;  // side by side; 1 where each depends on the one before in its last digits
    /// What runs find lowest with one parameter held where a start has it; absent where they have failed or been used up. May be
    /// empty where `exact`.
    std::function<std::optional<Run>(const Eigen::VectorXd& start, Eigen::Index held)> lowest_held = {};
};

/// Intervals about a point x [parameters] where runs nearby, `near`, are cheap. The window is as wide as the misfit says, so that
/// its differences span what the intervals do: a curve with jumps has kinks that a derivative at a point does not see, and wide
/// differences are blunt where the data are sharp. It lies along the principal axes of the covariance, found by turns: where
/// parameters stand in for one another, as a tough wood for a stiff one, along no axis of the box do differences stay in the
/// valley and yet go as far as its intervals. The intervals take in those of the profile likelihood, as at the edge of a jump
/// the misfit is no parabola; where that does not end and differences see no slope, the parameters cannot be told.
/// Where `near` is not exact, runs that `objective` makes at the ends of such a profile confirm it; if they do not, runs go along
/// with what cannot be told to its bounds, and the intervals of all that has to follow go as far. `objective` says when to stop,
/// too: nothing comes back where that is before the first run. `curves` and `names` as in `estimate_uncertainty`.
std::optional<CloseLook> look_close(Objective& objective, const NearRuns& near, const Eigen::VectorXd& x,
                                    const MeasuredCurves& curves, const std::vector<std::string>& names, unsigned seed);

/// Whether a run is lower than another by more than what is as good as the same, with what is said `about` the place.
bool is_lower(const Run& one, const Run& other, const Uncertainty& about);

/// `look`s about the best run. Where runs nearby promise a lower point and a run there confirms it, that is the best one; if it
/// is more than a standard error away, the objective `descend`s from there and has another look, some times at most. What they
/// promise and no run confirms counts as an error: covariance and intervals, which are those about the promised point, take in
/// the way to the best run.
std::optional<CloseLook> look_and_descend(Objective& objective, const std::function<std::optional<CloseLook>()>& look,
                                          const std::function<void()>& descend);

}  // namespace crampfit

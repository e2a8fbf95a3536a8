#pragma once

#include "inverse/objective.hpp"
#include "inverse/search.hpp"
#include "inverse/window.hpp"

#include <functional>
#include <optional>
#include <vector>

namespace crampfit {

/// The study near a point [parameters], cheap: exact in some parameters, to first order in the others.
using Near = std::function<Objective::Evaluate(const Eigen::VectorXd& point)>;

/// The lowest point of a cheap model.
struct Lowest {
    Eigen::VectorXd x;  // [parameters]
    double misfit;
};

/// Whether a descent may end early, after a step, at its best run.
using Enough = std::function<bool(const Evaluation& best)>;

/// What a run leaves behind: a cheap model of the runs nearby.
struct Nearby {
    Near near;
    Near rough;               // the same from what is known already, at no equilibria; for a search that `near` or a run confirms
    std::vector<bool> exact;  // [parameters] in which they are; in the others to first order
    bool ways_differ;         // with every parameter from point to point, which they do not see
    /// Parameters that turn the ways, where runs nearby hang on no others; of those that turn nothing together all but one, so
    /// that these meet every way.
    std::vector<Eigen::Index> turning = {};
    /// The lowest point in a window about `point`: what the search finds, or has found before. May be empty.
    std::function<Lowest(const Eigen::VectorXd& point, const Window& window, bool rough, const std::function<Lowest()>& search)>
        recall = {};
};

/// Least squares where a run leaves behind a cheap model of the runs nearby: each step searches that model within a trust
/// region, runs the study where the model is lowest, and goes on from there if that is lower (Conn, Gould and Toint 2000,
/// algorithm 6.1.1). The model is searched from several points, so that a curve with jumps does not easily catch it in a side
/// valley. The search asks `rough`; where that promises nothing more, `near` has the last word. It starts from `initial`, and
/// from further Sobol points of the box, up to `starts`, as long as the noise does not explain the misfit (residuals above two
/// sigma). Where ways differ it starts from the lowest of some more such points anyway.
SearchResult descend_by_walks(Objective& objective, const Nearby& nearby, int starts, const Enough& enough,
                              const Eigen::VectorXd& initial, unsigned seed,
                              const std::function<void(const std::string&)>& stage);

/// Goes on from the best run to the lowest point about it where ways turn: runs nearby know nothing of that. Others a little
/// aside in each parameter that turns the way do, to first order. Whether it ended by its own criterion.
bool close_in(Objective& objective, const Nearby& nearby, unsigned seed);

/// Looks at ways on both sides of the best run's, as far as `reach` in each parameter that turns them [of the box]: a run goes
/// each way, and the lowest point of what lies nearby is tried; none where that would take more than half of the runs left.
/// Whether one was lower.
bool look_for_ways(Objective& objective, const Nearby& nearby, double reach, unsigned seed);

/// The lowest point that is found from `start` on with one parameter held where it is; `start` itself where nothing is lower.
/// Absent where the run there fails.
std::optional<Run> descend_held(Objective& objective, const Nearby& nearby, const Eigen::VectorXd& start, Eigen::Index held,
                                unsigned seed);

/// One step beside the best run, to the lowest point of what lies nearby, however little lower that is but for `least` of the
/// misfit. Whether a run there was lower.
bool step_beside(Objective& objective, const Nearby& nearby, double least, unsigned seed);

/// One more such descent from the best run, after runs have been weighed anew. Whether it ended by its own criterion, or early.
bool descend_again(Objective& objective, const Nearby& nearby, const Enough& enough, unsigned seed);

}  // namespace crampfit

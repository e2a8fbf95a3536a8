#pragma once

#include "inverse/objective.hpp"
#include "inverse/uncertainty.hpp"
#include "inverse/window.hpp"

#include <optional>
#include <string>
#include <vector>

namespace crampfit {

/// How sure a point is, seen through a window about it: objective and uncertainty are those of the window as a unit cube.
struct CloseLook {
    Window window;
    Objective objective;
    Uncertainty uncertainty;

    Uncertainty in_box() const;  // of the whole unit cube
};

/// Intervals about a point x [parameters] where runs nearby, `near`, are cheap. The window is as wide as the misfit says, so that
/// its differences span what the intervals do: a curve with jumps has kinks that a derivative at a point does not see, and wide
/// differences are blunt where the data are sharp. The intervals take in those of the profile likelihood, as at the edge of a
/// jump the misfit is no parabola; where that does not end and differences see no slope, the parameters cannot be told.
/// `objective` says how many threads there are and when to stop: nothing comes back where that is before the first run;
/// `curve_lengths` and `names` as in `estimate_uncertainty`.
std::optional<CloseLook> look_close(const Objective& objective, const Objective::Evaluate& near, const Eigen::VectorXd& x,
                                    const std::vector<int>& curve_lengths, const std::vector<std::string>& names, unsigned seed);

}  // namespace crampfit

#pragma once

#include "inverse/objective.hpp"
#include "inverse/uncertainty.hpp"
#include "inverse/window.hpp"

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

/// Intervals about a point x [parameters] where runs nearby, `near`, are cheap. The window is so many standard errors wide that its
/// differences span what the intervals do: a curve with jumps has kinks that a derivative at a point does not see, and wide
/// differences are blunt where the data are sharp. Where a wide window hides a slope, a narrower one finds it. `objective` says how
/// many threads there are and when to stop; `curve_lengths` and `names` as in `estimate_uncertainty`.
CloseLook look_close(const Objective& objective, const Objective::Evaluate& near, const Eigen::VectorXd& x,
                     const std::vector<int>& curve_lengths, const std::vector<std::string>& names, unsigned seed);

}  // namespace crampfit

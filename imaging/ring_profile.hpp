#pragma once

#include "imaging/border_edges.hpp"

#include <cstddef>
#include <utility>
#include <vector>

namespace crampfit {

/// Gray of a ring across it as it would be without the picture's blur.
struct SharpProfile {
    double earlywood = 0, latewood = 0;  // its brightest and its darkest
    double latewood_fraction = 0;        // share of the ring beyond half way between these (the half-range rule)
};

/// Mean gray of a ring, or of a stretch of it, from its inner border to the outer, in steps of about a pixel.
class RingProfile {
  public:
    /// `width` of the ring [pixels].
    explicit RingProfile(double width);

    /// `place` is 0 at the inner border, 1 at the outer.
    void add(double place, double gray);
    /// Another stretch of the same ring, of as many steps.
    void add(const RingProfile& stretch);

    /// Its brightest and darkest mean over a few steps, or what the means tend to at its ends where that is more. The LW
    /// fraction is that of the means.
    SharpProfile seen() const;

    /// Takes out a blur (Gaussian, standard deviation in pixels). Gray between the borders is straight from step to step, beyond
    /// them it is the LW of the inner border and the EW of the outer; of all profiles that are as near to the means as their
    /// noise lets the true one be (Morozov 1966) this is the one with the least sum of bends (trend filtering: Kim et al. 2009),
    /// which keeps plateaus, ramps and sharp steps as they are.
    /// What is `seen` where the border has no jump.
    SharpProfile sharpened(double blur, const BorderGrays& inner, const BorderGrays& outer) const;

    /// How gray there goes with that here, `gray there = first + second * gray here`, by least squares over the steps; {0, 1}
    /// where this cannot be told.
    std::pair<double, double> line_to(const RingProfile& there) const;

  private:
    double mean(std::size_t step) const { return sum_[step] / count_[step]; }

    double width_;
    std::vector<double> sum_, squares_;  // of each step
    std::vector<int> count_;
    double scatter_ = 0;  // sum of squares about the means of each stretch that was added
    long freedom_ = 0;    // of it
};

}  // namespace crampfit

#pragma once

#include "imaging/ring_coordinate.hpp"

#include <opencv2/core.hpp>

#include <vector>

namespace crampfit {

/// A ring's outer border in the growth frame: one place a column, from column `first` on.
struct BorderLine {
    int first = 0;
    std::vector<double> v;  // [pixels]
    double support = 1;     // share of the places looked at where the border itself was seen, 0..1

    int end() const { return first + static_cast<int>(v.size()); }
    bool covers(int u) const { return u >= first && u < end(); }
    double at(int u) const { return v[static_cast<std::size_t>(u - first)]; }
};

/// Gray and what of it counts, straightened and blurred along the rings, beyond which rings are one row each.
struct StraightPicture {
    cv::Mat gray;   // [straight rows x columns] float, mean of what counts
    cv::Mat known;  // same size, share of what counts, 0..1
};

/// Wood straightened once, to be blurred as far as each use of it needs.
class StraightWood {
  public:
    /// `gray` and `valid` (0 or 1) are float pictures in the frame.
    StraightWood(const cv::Mat& gray, const cv::Mat& valid, const RingCoordinate& rings)
        : gray_(rings.straighten(gray.mul(valid))), known_(rings.straighten(valid)) {}

    /// By a Gaussian of this standard deviation [pixels].
    StraightPicture blurred_along(double sigma) const;

  private:
    cv::Mat gray_, known_;
};

/// Where LW ends and the EW of the next ring begins: the sharp rise of gray with the growth. Rises are found in profiles
/// across the rings by their prominence against the contrast around them, joined from profile to profile along the ring
/// coordinate, kept where at least half of the profiles show them, and laid through the steepest places by dynamic
/// programming. From the pith outward. `blank` is 255 where nothing is photographed (`find_blank`). `ring_width` [pixels] is a guess, or 0
/// for none.
std::vector<BorderLine> find_ring_borders(const StraightWood& wood, const cv::Mat& valid, const cv::Mat& blank, const RingCoordinate& rings,
                                          double ring_width);

/// Median distance of neighbouring borders along the growth [pixels]; 0 for less than two borders.
double typical_ring_width(const std::vector<BorderLine>& borders);

}  // namespace crampfit

#pragma once

#include "imaging/ring_coordinate.hpp"

#include <opencv2/core.hpp>

namespace crampfit {

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

/// Rows of the straightened picture.
struct RowRange {
    double first = 0, last = 0;
    bool holds(double row, double margin = 0) const { return row >= first + margin && row <= last - margin; }
};

/// The rows at which what is photographed in a column begins and ends, none where first > last: `blank` is 255 elsewhere
/// (`find_blank`).
RowRange photographed_rows(const RingCoordinate& rings, const cv::Mat& blank, int column);

}  // namespace crampfit

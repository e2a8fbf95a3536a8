#pragma once

#include "imaging/border_edges.hpp"
#include "imaging/ring_borders.hpp"

#include <opencv2/core.hpp>

#include <vector>

namespace crampfit {

/// Gray of pure EW and pure LW.
struct WoodLevels {
    double earlywood = 1;
    double latewood = 0;
    double darkest = latewood;  // of a picture: LW of the rings where it is darkest

    double contrast() const { return earlywood - latewood; }
};

/// How far the wood at each pixel of the frame has gone from EW (0) to LW (1) by its gray, each ring measured against its
/// own brightest and darkest wood, which changes along the ring (the half-range rule: half way is 0.5), as they are without the
/// blur that `edges` tell; half way is where as much of the ring lies beyond it as does in its profile. Where there is
/// no whole ring, Otsu's threshold (1979) is half way and the means on its two sides are the ends. Beyond 0 and 1 where
/// gray is. `pixels` and `valid` (0 or 1) are float, in the frame; `range` gets what most of the wood's grays lie between.
cv::Mat density_degree(const StraightWood& wood, const cv::Mat& pixels, const cv::Mat& valid, const RingCoordinate& rings,
                       const std::vector<BorderLine>& borders, const BorderEdges& edges, double ring_width, WoodLevels& range);

/// Number of the ring that each pixel of the frame lies in: i up to border i, borders.size() beyond the last.
cv::Mat ring_numbers(const std::vector<BorderLine>& borders, cv::Size frame);

/// Classes by the degree, without specks: 0 is EW, the last is LW. Two classes part at a half; three at the thresholds
/// of Otsu's multi-level form.
cv::Mat classify(const cv::Mat& degree, int classes, double ring_width);

}  // namespace crampfit

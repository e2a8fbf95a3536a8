#pragma once

#include "imaging/straight_wood.hpp"

#include <opencv2/core.hpp>

#include <cmath>
#include <vector>

namespace crampfit {

/// A ring's outer border in the growth frame: one place a column, from column `first` on. Where the border leaves what is
/// photographed and comes back, v is infinite in between: minus towards the pith, plus towards the bark.
struct BorderLine {
    int first = 0;
    std::vector<double> v;  // [pixels]
    double support = 1;     // share of the places looked at where the border itself was seen, 0..1

    int end() const { return first + static_cast<int>(v.size()); }
    bool covers(int u) const { return u >= first && u < end() && std::isfinite(at(u)); }
    double at(int u) const { return v[static_cast<std::size_t>(u - first)]; }
    /// Along its normal, towards the bark [pixels]; what would leave the frame of so many rows stays at its edge.
    void move(double distance, int rows);
};

/// With the growth, over the columns that both cover; 0 for none [pixels].
double mean_distance(const BorderLine& inner, const BorderLine& outer);

/// About where a border runs.
struct BorderGuess {
    std::vector<double> row;  // of the straightened picture, one a column
    double room = 0;          // to the nearest other border [rows]
    double support = 0;       // of the line
};

/// Lays borders through the steepest rises of gray near their guesses, by dynamic programming. What leaves what is photographed,
/// or runs where nothing counts, is cut off. `valid` (0 or 1, float) and `blank` (255 where nothing is photographed) are in the
/// frame.
std::vector<BorderLine> lay_borders(const StraightWood& wood, const cv::Mat& valid, const cv::Mat& blank,
                                    const RingCoordinate& rings, const std::vector<BorderGuess>& guesses);

}  // namespace crampfit

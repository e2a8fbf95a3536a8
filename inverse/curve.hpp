#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace crampfit {

/// A piecewise linear curve y(x). Units are the caller's.
class Curve {
  public:
    /// From rows in any order: rows with a NaN are skipped. Rows at the same x are a step there, from the mean of the first half
    /// of them to that of the second: were a jump's two ends one point, it would lie half a row aside, wherever rows happen to
    /// be. At least one row must be left.
    Curve(std::span<const double> x, std::span<const double> y);

    /// Value that the curve has after its last node, instead of the last node's value.
    void continue_with(double value) { after_ = value; }

    double at(double x) const;                  // the first value continues to the left
    double mean(double from, double to) const;  // average over an interval; of no width: the value there

    // Of a curve that was not smoothed, where each row has an error of its own, with a standard deviation of one:
    double rows(double from, double to) const;           // that its nodes in [from, to) are the mean of
    double error(std::size_t node) const;                // standard deviation of a node's value
    double usual_error() const;                          // their median
    double error_of_mean(double from, double to) const;  // standard deviation of the average
    double
    off_line(std::size_t node) const;  // how far it lies off the line between its neighbours, in standard deviations of that

    /// Median of how many rows stand at one place.
    int usual_rows() const;

    /// A step that noise of the rows, one sigma, explains within two sigmas is none: both its nodes become the mean of its rows.
    void level_steps(double noise);

    /// From here on more rows than that at one place count as that many.
    void count_at_most(int rows);

    /// Whether a node and the next stand at one place.
    bool is_step(std::size_t node) const;

    /// The widest step from node to node that lies at least partly within an interval; 0 where there is none.
    double widest_step(double from, double to) const;

    /// The same nodes, and those where a window comes up to a step and leaves it, each with the average over a window about it.
    /// Near an end the window shrinks from both sides alike, so that a straight line stays what it is.
    Curve smoothed(double window) const;

    /// Where the curve comes up to `level`: so that it is above for as long before as it is below after, which for a rising curve
    /// is one place. A noisy one has no bias towards early arrival, and a row that is far off counts as one row. Absent when the
    /// level is never reached.
    std::optional<double> arrival(double level) const;

    const std::vector<double>& x() const { return x_; }
    const std::vector<double>& y() const { return y_; }

  private:
    double area(double x) const;  // integral from the first node
    void integrate();
    double variance(std::size_t node) const;                            // where each row has one of one
    double covariance_with_next(std::size_t node) const;                // the same, of a step
    std::vector<double> weights_of_mean(double from, double to) const;  // [nodes]

    std::vector<double> x_;  // strictly rising
    std::vector<double> y_;
    std::vector<double> area_;                         // integral from the first node to each
    std::vector<int> rows_;                            // at each node's place; empty for a smoothed curve
    std::vector<double> means_;                        // of them
    std::vector<bool> level_;                          // whether the node is that mean
    int most_rows_ = std::numeric_limits<int>::max();  // that count at one place
    double after_ = 0;
};

}  // namespace crampfit

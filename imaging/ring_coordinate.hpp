#pragma once

#include "imaging/growth_frame.hpp"
#include "imaging/orientation.hpp"

#include <opencv2/core.hpp>

namespace crampfit {

/// A coordinate that is about constant along each ring and rises with the growth, about one a pixel: its level lines
/// follow the rings. In each column of the growth frame it rises without end, so a picture can be straightened and bent
/// back column by column.
class RingCoordinate {
  public:
    /// Least squares over the frame: mean of coherency^2 [(t . grad psi)^2 + 0.02 (n . grad psi - 1)^2], t along the
    /// rings, n across them; linear triangles.
    RingCoordinate(const OrientationField& field, const GrowthFrame& frame);

    double psi(double u, double v) const;  // at a place in the frame; linear beyond its upper and lower edge
    double v(double u, double psi) const;  // the row of a column at which psi has this value
    double lowest() const { return lowest_; }
    double highest() const { return highest_; }

    /// Rows of `straight` are at psi = lowest() + row. What lies beyond the frame is 0.
    cv::Mat straighten(const cv::Mat& in_frame) const;

    /// The other way: a straightened picture in the frame again.
    cv::Mat bend(const cv::Mat& straight) const;
    /// psi at each pixel of the frame, float, from 0 on.
    cv::Mat map() const;
    int straight_rows() const { return static_cast<int>(highest_ - lowest_) + 1; }

  private:
    double knot(double u, int row) const;
    void straighten_columns(const cv::Mat& in_frame, int first, int count, cv::Mat& straight) const;

    cv::Mat values_;                        // [knot rows x knot columns] double
    double spacing_u_ = 1, spacing_v_ = 1;  // of knots [pixels]
    cv::Size frame_;
    double lowest_ = 0, highest_ = 0;
};

}  // namespace crampfit

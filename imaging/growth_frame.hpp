#pragma once

#include "imaging/growth_axis.hpp"

#include <opencv2/core.hpp>

namespace crampfit {

/// A picture turned or mirrored by whole pixels so that the wood grows down the rows: column u runs along the rings, row
/// v with the growth. Everything about rings is done in this frame.
class GrowthFrame {
  public:
    GrowthFrame(GrowthAxis growth, cv::Size picture) : growth_(growth), picture_(picture) {}

    bool across() const { return growth_ == GrowthAxis::right || growth_ == GrowthAxis::left; }
    cv::Size size() const { return across() ? cv::Size(picture_.height, picture_.width) : picture_; }
    cv::Size picture() const { return picture_; }

    /// The pixels in the frame, and in the picture again. Always a copy or the very pixels, never changed in place.
    cv::Mat turn(const cv::Mat& picture) const { return flip(transpose(picture)); }
    cv::Mat turn_back(const cv::Mat& pixels) const { return transpose(flip(pixels)); }

    /// A place in the frame from one in the picture [pixels, centre of the first at 0,0], and back.
    cv::Point2d from_picture(const cv::Point2d& p) const {
        const double u = across() ? p.y : p.x, v = across() ? p.x : p.y;
        return {u, backward() ? size().height - 1 - v : v};
    }
    cv::Point2d to_picture(const cv::Point2d& q) const {
        const double v = backward() ? size().height - 1 - q.y : q.y;
        return across() ? cv::Point2d(v, q.x) : cv::Point2d(q.x, v);
    }

    /// A direction in the frame from one in the picture (x right, y down).
    cv::Point2d direction(const cv::Point2d& d) const {
        const double v = across() ? d.x : d.y;
        return {across() ? d.y : d.x, backward() ? -v : v};
    }

  private:
    bool backward() const { return growth_ == GrowthAxis::left || growth_ == GrowthAxis::up; }

    cv::Mat transpose(const cv::Mat& pixels) const {
        cv::Mat turned;
        if (across()) cv::transpose(pixels, turned);
        return across() ? turned : pixels;
    }
    cv::Mat flip(const cv::Mat& pixels) const {
        cv::Mat turned;
        if (backward()) cv::flip(pixels, turned, 0);
        return backward() ? turned : pixels;
    }

    GrowthAxis growth_;
    cv::Size picture_;
};

}  // namespace crampfit

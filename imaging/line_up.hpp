#pragma once

#include <opencv2/core.hpp>

namespace crampfit {

/// How one picture lies over another: image place = shift + matrix * reference place [px], image gray = (light[0] + light[1] x +
/// light[2] y)
/// * reference gray + light[3], with x and y the reference place over half the picture's size, from its middle.
struct Alignment {
    cv::Matx23d map{1, 0, 0, 0, 1, 0};  // [matrix | shift]
    cv::Vec4d light{1, 0, 0, 0};
    double residual = 0;  // robust standard deviation of what is left [gray]

    cv::Point2d to_image(const cv::Point2d& p) const;
    cv::Point2d to_reference(const cv::Point2d& q) const;
};

/// Lines an image up with the reference: Gauss-Newton over an affine motion and the light, from a coarse copy of both to the fine
/// ones (Lucas and Kanade 1981), Tukey's weights against what moved otherwise. `weight` [float, as large] says how much each
/// pixel counts; empty: all alike. Motions that the pictures do not show, as along straight rings, are left as in `start`; the
/// others are held to it as by a measurement of `likely` pixels' shift over the picture.
Alignment line_up(const cv::Mat& reference, const cv::Mat& image, const cv::Mat& weight, const Alignment& start, double likely);

/// The image as it would be seen in the reference's place and light.
cv::Mat seen_as_reference(const cv::Mat& image, const Alignment& alignment, cv::Size size);

/// 255 where the image shows a reference place, 0 where that lies beyond its border.
cv::Mat shown_of_reference(cv::Size image, const Alignment& alignment, cv::Size size);

}  // namespace crampfit

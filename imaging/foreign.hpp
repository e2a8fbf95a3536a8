#pragma once

#include "datasets/specimen.hpp"
#include "imaging/wood_classes.hpp"

#include <opencv2/core.hpp>

namespace crampfit {

/// What to tell other things from wood by, all in the growth frame.
struct WoodView {
    const cv::Mat& gray;        // float, 0..1
    const cv::Mat& bgr;         // blue, green, red, float, 0..1; empty: the picture is gray
    const cv::Mat& around;      // gray of the same ring on both sides, float
    const cv::Mat& coordinate;  // the ring coordinate, float [pixels]
    WoodLevels levels;
    double ring_width;  // [pixels]
};

/// 255 where the picture shows an even black or white that reaches in from one of its corners: what lies around a specimen on a
/// scanner or a table. Where as much of the picture's inside is as plain, rings are drawn so. Known before anything about the
/// wood is. `gray` and `bgr` as in a view; `black` is the brightest black, of the picture's brightest; `noise` the standard
/// deviation of a camera's pixels there.
cv::Mat find_blank(const cv::Mat& gray, const cv::Mat& bgr, double black = 0.08, double noise = 0.0);

/// 255 where an even black reaches in from one of the picture's sides and is wide, at least 17 pixels and an eighth of its
/// length: a notch in a specimen that fills the picture. A crack is slender. None where the picture has more of such black
/// elsewhere, as drawn rings do.
cv::Mat find_notches(const cv::Mat& gray, double black, double noise);

/// Standard deviation of the pixels where it is black (as above): that of the most even tenth, which an even ground has of noise
/// alone.
double noise_of_black(const cv::Mat& gray, double black);

/// 255 where the picture shows a ground of any one gray, as even as noise, that reaches in from at least three of its corners.
/// Rings show the same gray within, too, and no even one where the light on them is not. `gray` as in a view.
cv::Mat find_ground(const cv::Mat& gray);

/// What in a picture is no plain wood, as a map of `Feature` numbers:
/// - background: too dark for wood, or green or blue, and connected to the picture's edge; islands in it, too
/// - crack: a line across the rings, up to a fifth of a ring thick and darker than its ring around it by half the contrast of LW
///   to EW, or of any thickness and too dark; or one that runs any way and is darker than LW by half the contrast
/// - ray: the same, lighter by a third
/// - resin canal: a round spot that is lighter by a third, up to a fifth of a ring wide
/// - mark: other patches that are too dark, or blue or green: ink, holes, dirt
/// Too dark is darker than LW, where that is darkest, by a quarter of the contrast.
cv::Mat find_foreign(const WoodView& view);

/// 1 where a pixel is wood that counts (float): not foreign, and not right beside it.
cv::Mat countable(const cv::Mat& features);

}  // namespace crampfit

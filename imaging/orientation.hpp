#pragma once

#include <opencv2/core.hpp>

namespace crampfit {

/// The direction in which gray varies most, on a square lattice over a picture. Angles belong to the picture as it is
/// stored (x right, y down) and are doubled: a direction and its opposite are the same.
struct OrientationField {
    cv::Mat cos2, sin2;  // [lattice rows x lattice columns] float, a unit vector
    cv::Mat coherency;   // same size, 0 (no direction) to 1 (all gradients parallel), before anything was filled in
    double step = 1;     // lattice spacing [pixels]; node (i, j) stands at step * (i + 1/2) - 1/2

    /// Maps as large as the picture, by bilinear interpolation of the doubled vector.
    cv::Mat full(const cv::Mat& lattice, cv::Size picture) const;
};

struct OrientationScale {
    double derivative = 2;         // standard deviation of the Gaussian under the derivative [pixels]
    cv::Size2d window = {20, 20};  // of the window over which gradients are gathered, along x and y [pixels]
};

/// Structure tensor (Bigun & Granlund 1987) with Scharr's derivative filters (Scharr 2000), fitted to first order: the
/// doubled direction is taken as linear in place within the window (normalised convolution, Knutsson & Westin 1993), so
/// that neither the picture's edge nor curved rings bend it. Two rounds: the second trusts gradients by how well they
/// agree with the first, so that rays and cracks, which run across the rings, drop out. Where coherency is low the
/// direction is filled in from around. `gray` is float; `valid` is 0 where a pixel must not count, or empty.
OrientationField measure_orientation(const cv::Mat& gray, const cv::Mat& valid, const OrientationScale& scale);

/// Whether radial directions turn once all around along the picture's edge: then the pith lies in the picture, and no
/// axis is with the growth everywhere.
bool holds_pith(const OrientationField& field);

}  // namespace crampfit

#pragma once

#include "datasets/displacement_field.hpp"
#include "imaging/spline_picture.hpp"

#include <Eigen/Core>
#include <Eigen/LU>

#include <array>
#include <optional>
#include <vector>

namespace crampfit {

/// Displacement within a subset as polynomials of xi = (x - centre) / half and eta likewise, both -1 .. 1:
/// u = u[0] + u[1] xi + u[2] eta + u[3] xi^2 + u[4] xi eta + u[5] eta^2, and v likewise [px]. A warp of first order has
/// three terms, its others are 0.
struct Warp {
    std::array<double, 6> u{};
    std::array<double, 6> v{};
};

/// The reference picture, made ready to take subsets from.
struct ReferencePicture {
    /// `smoothing` is the radius (standard deviation) of a Gaussian, 0 for none [px]; where left out, what the pattern asks for.
    ReferencePicture(FinePicture fine, std::optional<double> smoothing);

    FinePicture picture;
    SplinePicture::Slopes slopes;
    SplinePicture::Slopes smooth_slopes;  // of the smoothed picture
    // What noise of variance 1 in the gray adds to the mean of products along one axis [1/px^2].
    double noise_in_tangent;  // of a smooth slope with a slope
    double noise_in_descent;  // of a smooth slope with itself
    // Subsets whose gray has a smaller standard deviation are flat [gray]: half of the step between neighbouring grays, rounding
    // to which gives 0.29 of it. The step is 1 in pictures of 8 bits, and less in those of more.
    double least_deviation;
};

/// The radius of the Gaussian with which `details_kept` of the mean square wave number is left in a picture's slopes, 2.5 px at
/// most. That mean, each wave counting by its slope's power, is what errors of the camera's sampling go with (SubsetMatcher); the
/// scatter by noise grows the more is taken off. A pattern of finer spots so is smoothed less.
double smoothing_for(const FinePicture& picture);

/// Motion within a subset that its warp does not follow and that tells that it reaches over a crack: root mean square [px].
inline constexpr double most_apart = 0.1;

/// What was found for a subset. `status` is ok, no_contrast, no_convergence, left_picture or low_correlation.
struct SubsetMatch {
    PointStatus status = PointStatus::no_convergence;
    Warp warp;
    double zncc = 0;      // zero-normalised correlation coefficient
    double residual = 0;  // variance of what is left of the grays [gray^2]
    double apart = 0;  // the same without the few pixels that are worst: what hot pixels and reflections do is no motion [gray^2]
    double slope = 0;  // mean square of the reference's slope along x or y [gray^2/px^2]
    double sigma = 0;  // standard error of u[0] and v[0] (root mean square of the two), by the noise of the pictures [px]
};

/// Follows a square subset of the reference into an image by inverse-compositional Gauss-Newton: Pan, Li and Tong
/// (2013) for the first order, Gao et al. (2015) for the second. What is made small is the sum over the subset of
/// ((f - mean f) / |f - mean f| - (g - mean g) / |g - mean g|)^2, f the gray of the reference and g that of the image
/// at the warped place (ZNSSD). It holds its working memory: one for each thread.
///
/// Where the derivative of that sum vanishes, the slopes of f are at right angles to what is left of the grays. Ours
/// differs: the slopes of the smoothed f are. Coarse features so weigh more than the finest, which cameras get wrong: a
/// picture that was resampled by linear interpolation (as raw colour mosaics and rectified pictures are) at a fraction
/// t of a pixel shows details of wave length L moved by about t (1 - t) (1 - 2 t) / 6 (2 pi / L)^2 px more than the
/// rest. To smooth both pictures does the same for translations (Pan 2013, "Bias error reduction of digital image
/// correlation using Gaussian pre-filtering"), but not where one of them is stretched, and it mixes the two faces of a
/// crack.
template <int Order>
class SubsetMatcher {
  public:
    /// `subset` is odd. The pictures must outlive the matcher.
    SubsetMatcher(const ReferencePicture& reference, const SplinePicture& image, int subset);

    /// Follows the subset about the pixel (x, y), which must lie within the reference, from a first guess that is
    /// within some two pixels of the truth.
    SubsetMatch match(int x, int y, const Warp& guess);

  private:
    static constexpr int terms = Order == 1 ? 3 : 6;
    static constexpr int width = 16;  // pixels that are worked on at once
    static_assert(width <= SplinePicture::overrun);
    using Lanes = Eigen::Array<float, width, 1>;
    using Parameters = Eigen::Matrix<double, 2 * terms, 1>;
    using Square = Eigen::Matrix<double, 2 * terms, 2 * terms>;

    /// Sums over the subset of the image's gray, less `mean_`, by itself and by what the reference has there.
    struct Sums {
        double gray = 0;
        double squared = 0;
        double by_reference = 0;
        Parameters by_descent = Parameters::Zero();
    };

    bool take_subset(int x, int y);
    void make_matrices();
    double standard_error(double residual_variance) const;
    double residual_of_most(int x, int y, const Warp& warp, double mean, double gain);
    bool stays_inside(int x, int y, const Warp& warp) const;
    void sample_row(int x, int y, const Warp& warp, int row);
    Sums sample(int x, int y, const Warp& warp);

    const ReferencePicture& reference_;
    const SplinePicture& image_;
    int half_;
    int blocks_;                                    // of `width` pixels in a row; what sticks out has slope and gray 0
    std::vector<Lanes> xi_;                         // [blocks]
    std::vector<Lanes> inside_;                     // [blocks] 1 in the subset, 0 beyond its edge
    std::vector<Lanes> gray_;                       // reference, less its mean [rows x blocks]
    std::vector<Lanes> by_x_, by_y_;                // slopes of the reference [rows x blocks]
    std::vector<Lanes> smooth_by_x_, smooth_by_y_;  // of the smoothed reference [rows x blocks]
    std::vector<float> sampled_;                    // gray of the image at the warped places of one row
    double mean_ = 0;                               // of the reference's gray
    double norm_ = 0;                               // root of the sum of squares of `gray_`
    double slope_ = 0;                              // mean square of the reference's slope along x or y [gray^2/px^2]
    Parameters descent_;                            // sum of the smooth steepest descents
    Parameters descent_by_gray_;                    // sum of the smooth steepest descents times `gray_`
    double smooth_slope_ = 0;                       // mean of the smooth slope times the slope, along x or y [gray^2/px^2]
    Eigen::PartialPivLU<Square> tangent_;           // smooth steepest descents by steepest descents
    Square noise_;                                  // smooth steepest descents by themselves
    Square even_ = Square::Zero();                  // both where all slopes are 1 along x and along y, by themselves
};

extern template class SubsetMatcher<1>;
extern template class SubsetMatcher<2>;

}  // namespace crampfit

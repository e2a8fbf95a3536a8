#pragma once

#include "datasets/displacement_field.hpp"
#include "imaging/gray_picture.hpp"
#include "imaging/subset.hpp"

#include <optional>
#include <vector>

namespace crampfit {

struct CorrelateOptions {
    int subset = 31;  // edge of a subset, odd [px]
    int step = 10;    // between points [px]
    int order = 1;    // of the warp within a subset: 1 or 2
    // Radius of the Gaussian that smooths the reference's slopes, 0 for none; where left out, as its pattern asks for
    // (subset.hpp) [px].
    std::optional<double> smoothing = {};
    int threads = 1;

    /// Throws InputError naming the option, its value and the rule that it breaks.
    void validate() const;
};

/// Whether a picture shows nothing, as a frame that a camera dropped.
bool has_one_gray(const FinePicture& picture);

/// Displacement fields of images against one reference, by digital image correlation: each image is worked on by
/// itself, and the same pictures give the same bits for any number of threads.
class Correlator {
  public:
    /// `mask` is empty or, a pixel of the reference each, 0 where nothing is to be followed: no subset reaches over
    /// such a pixel. Options must be valid; `name` is what errors call the reference. Throws InputError for a reference
    /// that is smaller than one subset with a border, or has one gray only.
    Correlator(FinePicture reference, const std::vector<std::uint8_t>& mask, const CorrelateOptions& options,
               const std::string& name);

    const PointLattice& lattice() const { return lattice_; }

    /// Throws InputError, calling the image `name`, for one of another size than the reference.
    void check(const FinePicture& image, const std::string& name) const;

    /// `image` must have passed `check`. In one of one gray only all points are lost for want of contrast.
    DisplacementField field(const FinePicture& image) const;

  private:
    CorrelateOptions options_;
    ReferencePicture reference_;
    PointLattice lattice_;
    std::vector<PointStatus> at_start_;  // of each point: not_reached, or why it cannot be followed in any image
};

}  // namespace crampfit

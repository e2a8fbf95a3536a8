#pragma once

#include "datasets/crack_track.hpp"
#include "imaging/gray_picture.hpp"

#include <memory>
#include <vector>

namespace crampfit {

/// The tip of a crack that opens as a dark line, in plain pictures without a pattern to correlate. Each image is lined up with
/// the reference, which shows no crack or a shorter one; what has darkened is followed from its mouth; along it the share of the
/// light that is missing across the line measures the opening, down to small parts of a pixel, and the tip is where that opening
/// begins.
class GrayTracker {
  public:
    /// `mask` is empty or, a pixel of the reference each, 0 where nothing is to be looked for.
    GrayTracker(const FinePicture& reference, const std::vector<std::uint8_t>& mask);
    ~GrayTracker();

    /// The image must be as large as the reference. Its crack's length is along its way, straight on to the picture's border.
    CrackTip tip(const FinePicture& image) const;

  private:
    struct State;
    std::unique_ptr<const State> state_;
};

}  // namespace crampfit

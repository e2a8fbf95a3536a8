#pragma once

#include "datasets/scene.hpp"
#include "imaging/gray_picture.hpp"

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

namespace crampfit {

/// A speckled specimen and the camera that looks at it. Lengths are pixels; x runs to the right and y down.
struct VirtualCameraOptions {
    int columns = 512;
    int rows = 512;
    double spot_radius = 1.6;  // standard deviation of a Gaussian spot, the lens's blur included [px]
    double mean = 128;         // gray
    double contrast = 35;      // standard deviation of the pattern's gray
    double noise = 1;          // standard deviation of each pixel's gray, anew in each picture
    double gap_gray = 10;      // where a crack lets one see through
    double blur = 0;           // of the lens, standard deviation of a Gaussian [px]
    // A side of the square that a pixel's gray is the mean of; a narrow gap darkens a pixel by its share only with some.
    int samples = 1;
    std::uint64_t seed = 1;

    /// Throws InputError naming the option, its value and the rule that it breaks.
    void validate() const;
};

/// Displacement of the material point that lies at a place of the reference picture [px].
using PlaneDisplacement = std::function<Vec2(const Vec2&)>;

/// Whether there is material at a place of the reference picture [px]; empty: everywhere.
using Coverage = std::function<bool(const Vec2&)>;

/// Gray of the surface at a place of the reference picture [px], 0..255.
using Surface = std::function<double(const Vec2&)>;

/// Photographs a surface that moves with a given displacement: a speckle pattern, if no other is given. The pattern is a sum of
/// Gaussian spots at random places, known everywhere and not at pixels alone, so that what a picture shows is exact up to the
/// camera's noise and the rounding to whole grays.
class VirtualCamera {
  public:
    /// Throws InputError for bad options.
    explicit VirtualCamera(const VirtualCameraOptions& options, Surface surface = {});

    /// The picture of the pattern at rest; `shot` numbers the picture: another number, other noise.
    GrayPicture photograph(std::uint64_t shot) const;

    /// The picture of the displaced pattern. A displacement may jump across a crack; its gradient must stay below 1. Places of
    /// the reference that `covered` says no to are no material, and show `gap_gray`.
    GrayPicture photograph(const PlaneDisplacement& displacement, std::uint64_t shot, const Coverage& covered = {}) const;

  private:
    struct Spot {
        float x, y, strength;  // [px], gray
    };
    using Origins = std::vector<std::optional<Vec2>>;  // [rows x columns] of what each pixel's middle shows; none in a gap

    double pattern(const Vec2& place) const;
    double gray_of(const std::optional<Vec2>& origin, const Coverage& covered) const;
    double mean_gray(int x, int y, const Origins& origins, const PlaneDisplacement& displacement, const Coverage& covered) const;

    VirtualCameraOptions options_;
    Surface surface_;
    double cell_;  // edge of a square that holds one spot [px]
    int cells_across_ = 0;
    std::vector<Spot> spots_;  // [cells down x cells across], from `border` outside the picture on
};

}  // namespace crampfit

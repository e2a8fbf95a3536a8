#pragma once

#include "datasets/scene.hpp"
#include "datasets/specimen.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace crampfit {

using Bgr = std::array<double, 3>;  // blue, green, red, 0..255

/// What synthetic end grain to grow. Coordinates are those of the block: origin at its lower left corner, x to the
/// right. The defaults are a softwood block whose radial direction is about +x.
struct EndGrainOptions {
    Vec2 size{10e-3, 10e-3};  // of the block [m], a whole number of pixels
    double pixel = 25e-6;     // [m]
    Vec2 pith{-20e-3, 5e-3};  // wood grows outward from here; may be far outside the block [m]

    double period = 2.2e-3;               // mean width of a ring [m]
    double period_sd = 0.26e-3;           // from ring to ring, log-normal [m]
    double latewood_fraction = 0.25;      // mean part of a ring's width that is LW, 0..1
    double latewood_fraction_sd = 0.025;  // from ring to ring, uniform about the mean
    double transition = 0.3e-3;           // over this before LW, density rises linearly from EW to LW [m]
    double onset_roughness = 20e-6;       // standard deviation of where LW begins, along a ring [m]
    double waviness = 0.04e-3;            // root mean square distance from a circle, at the outermost ring [m]
    double waviness_length = 4e-3;        // typical wavelength along the outermost ring [m]

    double ray_spacing = 0.5e-3;  // mean, along the ring [m]
    double ray_width = 30e-6;     // [m]
    double ray_length = 1.5e-3;   // over about this a ray stays in the plane of the cut [m]
    double ray_contrast = 0.3;    // 0 is unseen, 1 is a line of `ray` colour
    Bgr earlywood{166, 208, 226};
    Bgr latewood{50, 78, 132};
    Bgr ray{186, 220, 236};
    double cell_size = 35e-6;    // tangential width of a tracheid; radially the texture is three times as long [m]
    double texture = 3.0;        // standard deviation of the cells' brightness [grays]
    double mottle = 1.5;         // standard deviation of brightness in patches of some forty cells [grays]
    double noise = 1.5;          // standard deviation of each pixel's each colour [grays]
    double illumination = 0.02;  // relative change of brightness across the block, left to right
    std::uint64_t seed = 1;

    /// Throws InputError naming the option, its value and the rule that it breaks.
    void validate() const;
};

/// One growth ring as it was drawn. Radii are means along the ring: waviness moves it to and fro about them.
struct GrowthRing {
    double inner_radius = 0;       // sharp border to the LW of the ring before [m]
    double outer_radius = 0;       // sharp border to the EW of the next ring [m]
    double latewood_fraction = 0;  // 0..1
    double transition = 0;         // as asked, or all of the ring's EW where that is less [m]
};

/// A stretch of a ring's outer border that lies within the block.
struct RingBorder {
    int ring = 0;              // index into `EndGrain::rings`
    std::vector<Vec2> points;  // [m]
};

/// A picture of synthetic end grain, and the truth that it was drawn from.
struct EndGrain {
    int columns = 0;
    int rows = 0;
    std::vector<std::uint8_t> bgr;   // [rows x columns x 3], row 0 at the top
    std::vector<std::uint8_t> gray;  // [rows x columns], BT.601 weights
    std::vector<float> degree;       // [rows x columns] mean density degree over the pixel, 0 (EW) to 1 (LW)
    Specimen truth;                  // `degree` as classes EW and LW with their grade, and the radial direction: the normal
                                     // to the rings
    std::vector<GrowthRing> rings;   // from the inside out
    std::vector<RingBorder> borders;
};

/// Grows end grain outward from the pith: in each ring EW, a gradual rise to LW, and a sharp end. Rings are level lines
/// of a warped radius that rises monotonically along every radius, so they never cross. The same options give the same
/// picture on every machine whose doubles are IEEE 754: every random number is a hash, and another mathematical
/// library's last digit only shows where it moves a value of some 1e2 across the half that it is rounded at, by some
/// 1e-14. Throws InputError for bad options.
EndGrain grow_end_grain(const EndGrainOptions& options);

}  // namespace crampfit

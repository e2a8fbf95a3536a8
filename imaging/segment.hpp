#pragma once

#include "datasets/density_table.hpp"
#include "datasets/scene.hpp"
#include "datasets/specimen.hpp"
#include "imaging/growth_axis.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace crampfit {

struct SegmentOptions {
    double pixel = 0;                    // edge of a pixel [m]; 0: from the file's resolution tag, where there is one
    std::string pixel_from = "--pixel";  // what it was told by, for the notes
    int classes = 2;                     // 2: EW, LW; 3: EW, transition, LW
    std::optional<GrowthAxis> growth = std::nullopt;  // from pith to bark; none: told from the picture
    std::vector<BorderPolyline> borders = {};         // corrected by hand; empty: found
    std::vector<GrayClass> gray = {};  // classes by the picture's own gray; empty: by each ring's; grays in no range are void
    std::optional<DensityTable> density = std::nullopt;  // what the picture's own gray stands for
    int threads = 0;                                     // of OpenCV in this process; 0: as they are
    // Picture of the same wood, as large, that the radial direction is seen in; empty: the same.
    std::filesystem::path direction = {};
    bool fit_pith = false;                    // radial directions away from the place that they fit best
    std::optional<Vec2> pith = std::nullopt;  // or away from here [pixels]

    /// Throws InputError for anything out of range.
    void validate() const;
};

struct Segmentation {
    Specimen specimen;
    std::vector<std::string> notes;  // what was assumed and found, a line each
};

/// Picture to specimen: classes, ring borders and figures, radial direction. Rings are found twice: the first round gives
/// the ring width, which sets every scale of the second, and the levels of EW and LW, which tell what is no wood. Throws
/// InputError for a picture that cannot be read, is smaller than 16 pixels, larger than 2^26, or shows no contrast.
Segmentation segment(const std::filesystem::path& image, const SegmentOptions& options);

}  // namespace crampfit

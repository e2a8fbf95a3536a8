#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace crampfit {

/// A pixel as a file states it.
struct PixelTag {
    double width = 0, height = 0;  // [m]

    bool square() const;
    /// In the usual unit, as in "1200 x 1200 dpi".
    std::string dots() const;
};

/// By PNG's pHYs, BMP's header, JPEG's JFIF segment or TIFF's XResolution with a unit; none where there is none.
std::optional<PixelTag> pixel_by_tag(const std::filesystem::path& image);

/// Whether a TIFF of gray counts from white to black (PhotometricInterpretation 0), as some scanners write it.
bool white_is_zero(const std::filesystem::path& image);

}  // namespace crampfit

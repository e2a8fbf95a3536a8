#pragma once

#include <filesystem>

namespace crampfit {

/// Edge of a pixel by the resolution that the file states [m]: PNG's pHYs, BMP's header, JPEG's JFIF segment, TIFF's
/// XResolution with a unit. 0 where there is none, or different ones for x and y.
double pixel_by_tag(const std::filesystem::path& image);

}  // namespace crampfit

#pragma once

#include "datasets/specimen.hpp"

#include <filesystem>
#include <vector>

namespace crampfit {

/// Ring borders as `crampfit csv SPECIMEN.h5 borders` prints them, perhaps corrected by hand: the columns ring, x_px and
/// y_px in any order, one row a vertex; the rows of one ring are its polyline, in their order. Sorted by ring. Throws
/// InputError with the line.
std::vector<BorderPolyline> read_borders(const std::filesystem::path& file);

}  // namespace crampfit

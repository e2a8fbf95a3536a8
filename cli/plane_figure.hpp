#pragma once

#include "cli/chart.hpp"
#include "datasets/scene.hpp"

#include <cstdint>
#include <string>
#include <vector>

/// Charts of the specimen's plane.
namespace crampfit::cli {

/// x and y in mm, to the same scale.
Chart plane_chart(const std::string& title);

/// A crack's vertices [m] as a line.
ChartSeries path_line(const std::vector<Vec2>& path, const char* ink, int frame = always);

/// A PNG between two corners of the plane, lower left and upper right [m].
ChartPicture picture_between(const Vec2& low, const Vec2& high, const std::vector<std::uint8_t>& png, int frame = always);

}  // namespace crampfit::cli

#pragma once

#include "cli/chart.hpp"
#include "datasets/scene.hpp"

#include <opencv2/core.hpp>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

/// Charts of the specimen's plane and of pictures, and their colours.
namespace crampfit::cli {

/// x and y in mm, to the same scale.
Chart plane_chart(const std::string& title);

/// x and y in pixels, y down.
Chart pixel_chart(const std::string& title);

/// A crack's vertices [m] as a line.
ChartSeries path_line(const std::vector<Vec2>& path, const char* ink, int frame = always);

/// A PNG between two corners of the plane, lower left and upper right [m].
ChartPicture picture_between(const Vec2& low, const Vec2& high, const std::vector<std::uint8_t>& png, int frame = always);

/// As small as it gets.
std::vector<std::uint8_t> png_of(const cv::Mat& picture);

/// A picture whose sides are by that factor shorter, where it is below 1, and a pixel at least.
cv::Mat shrunk(const cv::Mat& picture, double factor);

using Colour = cv::Vec3b;  // blue, green, red

/// From pale earlywood, 0, to dark latewood, 1.
Colour wood_colour(double latewood);

/// The colours of wood under the names of their ends.
std::string wood_bar(const std::string& low, const std::string& high);

/// On a scale of a few colours, which compress well; what is no number has the lowest.
Colour scale_colour(double value, double low, double high);

/// That scale under a text.
std::string scale_bar(const std::string& text, double low, double high);

/// The range of all but the 1 % at each end, which a crack tip stretches without bound; what is not finite is left out.
std::pair<double, double> most_of(const std::vector<std::vector<double>>& values);

}  // namespace crampfit::cli

#pragma once

#include <string>
#include <vector>

/// Charts as inline SVG.
namespace crampfit::cli {

// Okabe and Ito's colours, told apart by colour-blind readers too.
namespace colour {
inline constexpr const char* black = "#000000";
inline constexpr const char* orange = "#E69F00";
inline constexpr const char* green = "#009E73";
inline constexpr const char* blue = "#0072B2";
inline constexpr const char* vermillion = "#D55E00";
inline constexpr const char* purple = "#CC79A7";
inline constexpr const char* gray = "#777777";
}  // namespace colour

/// What is seen only while the slider stands on its frame; `always` stands for none.
inline constexpr int always = -1;

/// Pairs of numbers, drawn one way. What is not finite is left out, and breaks a line.
struct ChartSeries {
    enum class Kind { line, dashed, points, bars };
    std::string label{};  // in the legend; empty: not there
    const char* colour = colour::black;
    Kind kind = Kind::line;
    std::vector<double> x{}, y{};
    std::vector<double> x_error{}, y_error{};  // half widths, or empty
    int frame = always;
};

/// A picture under the series, over this rectangle of the axes.
struct ChartPicture {
    std::string address{};
    double left = 0, right = 0, bottom = 0, top = 0;
    int frame = always;
};

struct Chart {
    std::string title{};
    std::string x_label{}, y_label{};  // with units
    std::string caption{};             // what a reader must know besides
    std::vector<ChartSeries> series{};
    std::vector<ChartPicture> pictures{};
    std::vector<double> x_levels{}, y_levels{};  // thin lines across, within the range
    bool log_y = false;
    bool equal_scales = false;  // a length along x is as long along y
    bool y_down = false;        // as pixels are counted
    int last_frame = always;
    std::string legend_markup{};  // below it
};

/// A <figure> with the chart; empty when no series has anything to draw and there is no picture.
std::string draw(const Chart& chart);

/// Factor and symbol of a unit.
struct ScaledUnit {
    double factor;  // SI units in one
    const char* symbol;
};

/// The largest of these units, which fall, in which the largest of these numbers is at least 1.
ScaledUnit unit_for(const std::vector<double>& values, const std::vector<ScaledUnit>& choices);

namespace units {
inline const std::vector<ScaledUnit> time{{1, "s"}, {1e-3, "ms"}, {1e-6, "µs"}};
inline const std::vector<ScaledUnit> length{{1e-3, "mm"}};
inline const std::vector<ScaledUnit> force{{1e3, "kN"}, {1, "N"}, {1e-3, "mN"}};
inline const std::vector<ScaledUnit> energy{{1, "J"}, {1e-3, "mJ"}, {1e-6, "µJ"}};
inline const std::vector<ScaledUnit> stress{{1e6, "MPa"}, {1e3, "kPa"}, {1, "Pa"}};
inline const std::vector<ScaledUnit> stress_intensity{{1e6, "MPa √m"}, {1e3, "kPa √m"}, {1, "Pa √m"}};
}  // namespace units

std::vector<double> scaled(std::vector<double> values, const ScaledUnit& unit);

}  // namespace crampfit::cli

#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <string>
#include <vector>

namespace crampfit {

/// What a pixel shows besides EW and LW.
enum class Feature : std::uint8_t { wood = 0, background = 1, crack = 2, mark = 3, ray = 4, resin_canal = 5 };

/// Where one ring ends and the next begins, as a polyline in the picture.
struct BorderPolyline {
    std::int64_t ring = 0;                // of the ring that ends here; rings count from the pith outward
    std::vector<Eigen::Vector2d> points;  // x, y [pixels], from the upper left corner, centre of the first at 0,0
};

/// A ring between two borders.
struct RingFigures {
    std::int64_t ring = 0;
    double width = 0;              // mean distance of its two borders, across the ring [pixels]
    double latewood_fraction = 0;  // of its area, 0..1
};

/// A picture of wood as material classes. Maps are stored as the picture is: row 0 at the top, `columns` values a row.
struct Specimen {
    static constexpr std::uint8_t void_label = 255;

    int columns = 0;
    int rows = 0;
    double pixel = 0.0;                   // edge of a pixel [m]; 0: not known
    std::vector<std::string> classes;     // material names; classes that grade into one another stand side by side
    std::vector<std::uint8_t> label;      // [rows x columns] index into `classes`, or void_label
    std::vector<float> grade;             // [rows x columns] or empty: 0 is class `label`, 1 is class `label + 1`, between
                                          // them transition wood, linear in density
    std::vector<float> density;           // [rows x columns] or empty [kg/m^3]
    std::vector<float> orientation;       // [rows x columns] or empty: radial direction, counter-clockwise from +x [rad]
    std::vector<float> coherency;         // [rows x columns] or empty: how plainly the picture shows it, 0..1
    std::vector<std::uint8_t> feature;    // [rows x columns] or empty: a `Feature`
    std::vector<BorderPolyline> borders;  // from the pith outward
    std::vector<RingFigures> rings;       // from the pith outward
    std::string source;                   // where the picture came from
};

}  // namespace crampfit

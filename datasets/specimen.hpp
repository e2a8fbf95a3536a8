#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace crampfit {

/// A picture of wood as material classes. Maps are stored as the picture is: row 0 at the top, `columns` values a row.
struct Specimen {
    static constexpr std::uint8_t void_label = 255;

    int columns = 0;
    int rows = 0;
    double pixel = 0.0;                // edge of a pixel [m]
    std::vector<std::string> classes;  // material names; classes that grade into one another stand side by side
    std::vector<std::uint8_t> label;   // [rows x columns] index into `classes`, or void_label
    std::vector<float> grade;          // [rows x columns] or empty: 0 is class `label`, 1 is class `label + 1`, between
                                       // them transition wood, linear in density
    std::vector<float> density;        // [rows x columns] or empty [kg/m^3]
    std::vector<float> orientation;    // [rows x columns] or empty: radial direction, counter-clockwise from +x [rad]
    std::string source;                // where the picture came from
};

} // namespace crampfit

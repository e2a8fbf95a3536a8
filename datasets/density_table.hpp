#pragma once

#include <filesystem>
#include <vector>

namespace crampfit {

/// What density a gray stands for, as from a step wedge beside the wood in an X-ray picture.
struct DensityTable {
    std::vector<double> gray;     // rising, 0..255; 16-bit pictures count by 257 a step
    std::vector<double> density;  // [kg/m^3]

    /// Linear between the rows; beyond them that of the nearest row.
    double at(double gray_value) const;
};

/// Reads a table with the columns gray and density [kg/m^3], in any unit of density. Throws InputError for anything else, for
/// fewer than two rows, for grays that do not rise from row to row, and for densities that rise and fall.
DensityTable read_density_table(const std::filesystem::path& file);

}  // namespace crampfit

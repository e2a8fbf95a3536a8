#pragma once

#include "datasets/crack_paths.hpp"
#include "datasets/hdf5.hpp"

#include <vector>

namespace crampfit {

/// The group `crack paths` of a fit's file. Both throw InputError.
void write_crack_paths(hdf5::Group& root, const std::vector<CrackPaths>& paths);
std::vector<CrackPaths> read_crack_paths(const hdf5::Group& root);

}  // namespace crampfit

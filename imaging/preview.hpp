#pragma once

#include "datasets/specimen.hpp"

#include <filesystem>

namespace crampfit {

/// Writes a picture to check a specimen by eye: the photograph with the ring borders and their numbers, the radial
/// directions, what is no wood in colours; beside or below it the classes. The name's ending says which format. Throws
/// InputError, which names --preview, when it cannot be written.
void write_preview(const std::filesystem::path& image, const Specimen& specimen, const std::filesystem::path& preview);

/// Throws InputError unless the name ends as a picture's does.
void check_preview_name(const std::filesystem::path& preview);

}  // namespace crampfit

#pragma once

#include "datasets/crack_track.hpp"
#include "datasets/displacement_field.hpp"
#include "imaging/gray_picture.hpp"

#include <filesystem>

namespace crampfit {

/// Throws InputError unless the file's name ends as that of a picture that can be written and it could be written now.
void require_picture_name(const std::filesystem::path& file, const std::string& option);

/// Draws a displacement field over the reference: u on the left, v on the right, in colours with their scale, lost
/// points as crosses. Throws InputError when the file cannot be written.
void draw_field(const FinePicture& reference, const PointLattice& lattice, const DisplacementField& field,
                const std::filesystem::path& file);

/// Draws the tips of a series over the image of the last, at the places that their material has in the reference, and
/// the crack's line behind the last. Throws InputError when the file cannot be written.
void draw_track(const FinePicture& image, const std::vector<CrackTip>& tips, const std::filesystem::path& file);

}  // namespace crampfit

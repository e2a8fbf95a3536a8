#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace crampfit {

struct GrayPicture {
    int columns = 0;
    int rows = 0;
    std::vector<std::uint8_t> gray;  // [rows x columns], row 0 at the top
};

/// Gray as finely as the file has it: 16 bit keep their fractions of the 8-bit scale.
struct FinePicture {
    int columns = 0;
    int rows = 0;
    std::vector<float> gray;  // [rows x columns], 0..255, row 0 at the top
};

/// The key that names a picture, and the file it stands in: what an InputError points at.
struct PictureKey {
    std::string file;
    std::string key;
};

/// Reads any format that OpenCV reads, 8 or 16 bit. A photograph's own note of its rotation is obeyed and transparency
/// is dropped, colour becomes gray with the weights of ITU-R BT.601, 16 bit become 8 as value / 257, rounded. Throws
/// InputError for a file that is missing, empty, cut short, no picture, of another depth, or of more than 2^28 pixels;
/// memory stays bounded by that.
GrayPicture read_gray(const std::filesystem::path& file, const PictureKey& asked_by);

/// The same, without the rounding of 16 bit to 8.
FinePicture read_fine_gray(const std::filesystem::path& file, const PictureKey& asked_by);

}  // namespace crampfit

#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace crampfit {

/// What became of a point of a displacement field.
enum class PointStatus : std::uint8_t {
    ok,
    masked,           // its own pixel is left out by the mask
    across_mask,      // its subset would reach over a masked pixel
    no_contrast,      // its subset is flat, in the reference or in the image
    not_reached,      // no neighbour was found from which to start
    no_convergence,   // the iteration did not settle
    left_picture,     // its subset lies partly outside the image
    low_correlation,  // what was found looks different
    moved_apart,      // parts of its subset went different ways, as across a crack
};

inline constexpr std::size_t point_status_count = 9;

/// In words, as the table `points` prints it; "ok" for a point that was followed.
const char* name(PointStatus status);

/// The points that are followed: a regular lattice of the reference's pixels.
struct PointLattice {
    int columns = 0;
    int rows = 0;
    int first_x = 0;  // of the first column, from the picture's left [px]
    int first_y = 0;  // of the first row, from the picture's top [px]
    int step = 1;     // between neighbours [px]

    int count() const { return columns * rows; }
    int x(int point) const { return first_x + step * (point % columns); }
    int y(int point) const { return first_y + step * (point / columns); }
};

/// Displacement and strain of one image against the reference. A value per point, row by row from the top; x and u run
/// to the right and y and v down the picture. Values of a lost point are not a number.
struct DisplacementField {
    std::vector<double> u, v;  // [px]
    std::vector<double> exx, eyy,
        exy;                    // du/dx, dv/dy, (du/dy + dv/dx) / 2; not a number too where neighbours are missing
    std::vector<double> zncc;   // zero-normalised correlation coefficient, 1 is the same picture
    std::vector<double> sigma;  // standard error of u and v by the noise of the pictures [px]
    std::vector<PointStatus> status;
};

/// What all fields of a series have in common.
struct FieldSeries {
    std::string reference;            // file
    std::vector<std::string> images;  // files; an image's number is its place here, from 0
    PointLattice lattice;
    int subset = 0;                    // edge of a subset [px]
    int order = 1;                     // of the warp within a subset
    std::optional<double> pixel;       // edge of a pixel, where it was told [m]
    int columns = 0, rows = 0;         // of the pictures [px]; 0: not known
    std::vector<double> time;          // of each image, or empty [s]
    std::vector<double> displacement;  // of the loading at each image, or empty [m]
};

/// Writes a field file, kind "field". `field_of` gives the field of an image by its number; it is called once for each,
/// in order, and each is written before the next is asked for. Where it gives none the file ends with the image before:
/// `series` then names those that are there. Throws InputError when the file cannot be written.
void write_fields(const FieldSeries& series, const std::function<std::optional<DisplacementField>(int)>& field_of,
                  const std::filesystem::path& file);

/// Reads what a field file's fields have in common. Throws InputError.
FieldSeries read_field_series(const std::filesystem::path& file);

/// Reads a field file and gives the fields one after the other to `take`. Throws InputError.
void read_fields(const std::filesystem::path& file,
                 const std::function<void(const FieldSeries&, int image, const DisplacementField&)>& take);

}  // namespace crampfit

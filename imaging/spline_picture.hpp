#pragma once

#include "imaging/gray_picture.hpp"

#include <vector>

namespace crampfit {

/// The bicubic B-spline that goes through every pixel of a picture. The picture goes on beyond its borders as its
/// mirror image about the outermost pixels' centres.
class SplinePicture {
  public:
    /// Works with rows that are read this far past a row's end.
    static constexpr int overrun = 16;

    explicit SplinePicture(const FinePicture& picture);

    int columns() const { return columns_; }
    int rows() const { return rows_; }
    int stride() const { return stride_; }

    /// The coefficient of a pixel; column and row may lie `margin` pixels outside the picture.
    const float* at(int column, int row) const { return coefficients_.data() + index(column, row); }

    /// Gray at any place [px]; beyond the picture that of the mirror image.
    double gray(double x, double y) const;

    /// Gray and its slopes at all pixels [rows x columns].
    struct Slopes {
        std::vector<float> by_x, by_y;  // [gray/px]
    };
    Slopes slopes() const;

  private:
    static constexpr int margin = 3;

    std::size_t index(int column, int row) const {
        return static_cast<std::size_t>(row + margin) * static_cast<std::size_t>(stride_) +
               static_cast<std::size_t>(column + margin);
    }
    void mirror_margins();

    int columns_;
    int rows_;
    int stride_;  // coefficients from a row to the next
    std::vector<float> coefficients_;
};

}  // namespace crampfit

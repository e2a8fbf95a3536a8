#include "imaging/spline_picture.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace crampfit {
namespace {

// Unser (1999), "Splines: a perfect fit for signal and image processing", box 2: the recursive filter that turns
// samples into cubic B-spline coefficients, with mirror boundaries. Its gain of 6 in each direction is put onto the
// samples before.
const float pole = static_cast<float>(std::sqrt(3.0) - 2.0);
constexpr float gain = 36.0f;
constexpr int horizon = 16;  // pole^16 is below a float's last digit

int mirrored(int i, int count) {
    if (count == 1) return 0;
    const int period = 2 * (count - 1);
    i = ((i % period) + period) % period;
    return i < count ? i : period - i;
}

/// Filters `count` lines that lie `step` apart, each `width` samples wide, across the lines.
void filter(float* samples, int count, std::size_t step, std::size_t width) {
    const auto line = [&](int i) { return samples + static_cast<std::size_t>(i) * step; };
    const auto combine = [&](float* here, float own, const float* other, float share) {
        for (std::size_t j = 0; j < width; ++j) here[j] = own * here[j] + share * other[j];
    };
    std::vector<float> first(width, 0.0f);
    float power = 1.0f;
    for (int k = 0; k < horizon; ++k, power *= pole) combine(first.data(), 1.0f, line(mirrored(k, count)), power);
    std::copy(first.begin(), first.end(), line(0));
    for (int i = 1; i < count; ++i) combine(line(i), 1.0f, line(i - 1), pole);
    const float end = pole / (pole * pole - 1.0f);
    combine(line(count - 1), end, line(mirrored(count - 2, count)), end * pole);
    for (int i = count - 2; i >= 0; --i) combine(line(i), -pole, line(i + 1), pole);
}

}  // namespace

SplinePicture::SplinePicture(const FinePicture& picture)
    : columns_(picture.columns), rows_(picture.rows), stride_(picture.columns + 2 * margin),
      coefficients_(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(rows_ + 2 * margin) + overrun) {
    for (int row = 0; row < rows_; ++row) {
        float* line = coefficients_.data() + index(0, row);
        const float* gray = picture.gray.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
        std::transform(gray, gray + columns_, line, [](float value) { return gain * value; });
        filter(line, columns_, 1, 1);
    }
    filter(coefficients_.data() + index(0, 0), rows_, static_cast<std::size_t>(stride_), static_cast<std::size_t>(columns_));
    mirror_margins();
}

void SplinePicture::mirror_margins() {
    for (int row = 0; row < rows_; ++row)
        for (int beyond = 1; beyond <= margin; ++beyond) {
            coefficients_[index(-beyond, row)] = coefficients_[index(mirrored(-beyond, columns_), row)];
            coefficients_[index(columns_ - 1 + beyond, row)] =
                coefficients_[index(mirrored(columns_ - 1 + beyond, columns_), row)];
        }
    for (int beyond = 1; beyond <= margin; ++beyond)
        for (const int row : {-beyond, rows_ - 1 + beyond})
            std::copy_n(coefficients_.data() + index(-margin, mirrored(row, rows_)), stride_,
                        coefficients_.data() + index(-margin, row));
}

double SplinePicture::gray(double x, double y) const {
    const auto inside = [](double at, int count) {
        const double end = std::max(count - 1, 1), turned = std::fmod(std::abs(at), 2 * end);
        return turned <= end ? turned : 2 * end - turned;
    };
    const double xi = inside(x, columns_), yi = inside(y, rows_);
    const int column = static_cast<int>(xi), row = static_cast<int>(yi);
    // Weights of the four coefficients about a place, t beyond the second of them (Unser 1999, eq. 4).
    const auto weights = [](double t) {
        const double s = 1 - t;
        return std::array{s * s * s / 6, 2.0 / 3 - t * t * (2 - t) / 2, 2.0 / 3 - s * s * (2 - s) / 2, t * t * t / 6};
    };
    const auto across = weights(xi - column), down = weights(yi - row);
    double sum = 0;
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) sum += down[j] * across[i] * static_cast<double>(*at(column - 1 + i, row - 1 + j));
    return sum;
}

SplinePicture::Slopes SplinePicture::slopes() const {
    Slopes slopes;
    const auto count = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
    slopes.by_x.reserve(count);
    slopes.by_y.reserve(count);
    for (int row = 0; row < rows_; ++row) {
        const float* above = at(0, row - 1);
        const float* here = at(0, row);
        const float* below = at(0, row + 1);
        // At a pixel the spline has weights 1/6, 4/6, 1/6 and its slope -1/2, 0, 1/2.
        const auto down = [&](int i) { return (above[i] + 4.0f * here[i] + below[i]) / 12.0f; };
        const auto step = [&](int i) { return (below[i] - above[i]) / 12.0f; };
        for (int i = 0; i < columns_; ++i) {
            slopes.by_x.push_back(down(i + 1) - down(i - 1));
            slopes.by_y.push_back(step(i - 1) + 4.0f * step(i) + step(i + 1));
        }
    }
    return slopes;
}

}  // namespace crampfit

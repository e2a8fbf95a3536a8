#include "imaging/straight_wood.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

/// Three running means in a row (Wells 1986) are a Gaussian whose cost does not grow with its width: their variances (w^2 - 1) /
/// 12 add up to sigma^2 within 1 %.
cv::Mat running_means(const cv::Mat& values, double sigma) {
    constexpr int means = 3;
    const int narrow = 2 * static_cast<int>((std::sqrt(12 * sigma * sigma / means + 1) - 1) / 2) + 1;
    const double left = 12 * sigma * sigma - means * (narrow * narrow - 1.0);
    const auto wider = std::clamp(std::lround(left / (4.0 * narrow + 4)), 0l, static_cast<long>(means));
    const int beyond = means * (narrow / 2 + 1);  // what a mean puts beyond the ends comes back with the next
    cv::Mat out;
    cv::copyMakeBorder(values, out, 0, 0, beyond, beyond, cv::BORDER_CONSTANT, 0);
    for (int i = 0; i < means; ++i) cv::blur(out, out, {i < wider ? narrow + 2 : narrow, 1}, {-1, -1}, cv::BORDER_CONSTANT);
    return out.colRange(beyond, beyond + values.cols);
}

/// Gaussian along the rows; nothing beyond their ends.
cv::Mat blur_along(const cv::Mat& values, double sigma) {
    constexpr int band = 32;  // rows at a time: they stay in the cache
    const int size = 2 * static_cast<int>(std::ceil(3 * sigma)) + 1;
    cv::Mat out(values.size(), CV_32F);
    cv::parallel_for_({0, (values.rows + band - 1) / band}, [&](const cv::Range& bands) {
        for (int i = bands.start; i < bands.end; ++i) {
            const cv::Range rows(band * i, std::min(values.rows, band * (i + 1)));
            cv::Mat blurred;
            if (sigma < 8)
                cv::sepFilter2D(values.rowRange(rows), blurred, CV_32F, cv::getGaussianKernel(size, sigma, CV_32F),
                                cv::Mat::ones(1, 1, CV_32F), {-1, -1}, 0, cv::BORDER_CONSTANT);
            else blurred = running_means(values.rowRange(rows), sigma);
            blurred.copyTo(out.rowRange(rows));
        }
    });
    return out;
}

}  // namespace

StraightPicture StraightWood::blurred_along(double sigma) const {
    StraightPicture straight;
    straight.known = blur_along(known_, sigma);
    straight.gray = blur_along(gray_, sigma) / cv::max(straight.known, 1e-6);
    return straight;
}

RowRange photographed_rows(const RingCoordinate& rings, const cv::Mat& blank, int column) {
    int top = 0, bottom = blank.rows - 1;
    while (top < blank.rows && blank.at<std::uint8_t>(top, column)) ++top;
    while (bottom > top && blank.at<std::uint8_t>(bottom, column)) --bottom;
    return {rings.psi(column, top) - rings.lowest(), rings.psi(column, bottom) - rings.lowest()};
}

}  // namespace crampfit

#include "imaging/flatten.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace crampfit {
namespace {

constexpr int terms = 6;          // of the light
constexpr double darkest = 0.02;  // log of less would follow noise

using Terms = Eigen::Matrix<double, terms, 1>;
using WithLate = Eigen::Matrix<double, terms + 1, 1>;

Terms terms_at(int x, int y, cv::Size size) {
    const double a = 2.0 * x / size.width - 1, b = 2.0 * y / size.height - 1;
    Terms all;
    all << 1, a, b, a * a, a * b, b * b;
    return all;
}

}  // namespace

cv::Mat flatten(const cv::Mat& gray, const cv::Mat& valid, const cv::Mat& late) {
    // Some 10^5 places say as much as all.
    const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(gray.total()) / 1e5)));
    Eigen::Matrix<double, terms + 1, terms + 1> normal = 1e-9 * Eigen::Matrix<double, terms + 1, terms + 1>::Identity();
    WithLate right = WithLate::Zero();
    for (int y = 0; y < gray.rows; y += step) {
        for (int x = 0; x < gray.cols; x += step) {
            if (!valid.empty() && valid.at<float>(y, x) == 0) continue;
            WithLate here;
            here << terms_at(x, y, gray.size()), late.at<std::uint8_t>(y, x) != 0;
            normal += here * here.transpose();
            right += here * std::log(std::max<double>(gray.at<float>(y, x), darkest));
        }
    }
    Terms light = normal.ldlt().solve(right).head<terms>();
    light[0] = -(light[3] + light[5]) / 3;  // the mean of a^2 and of b^2 over the picture is 1/3
    cv::Mat flat(gray.size(), CV_32F);
    cv::parallel_for_({0, gray.rows}, [&](const cv::Range& rows) {
        for (int y = rows.start; y < rows.end; ++y)
            for (int x = 0; x < gray.cols; ++x)
                flat.at<float>(y, x) =
                    gray.at<float>(y, x) * static_cast<float>(std::exp(-light.dot(terms_at(x, y, gray.size()))));
    });
    return flat;
}

}  // namespace crampfit

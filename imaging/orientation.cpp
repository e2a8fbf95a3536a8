#include "imaging/orientation.hpp"

#include <Eigen/Dense>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace crampfit {
namespace {

/// Per pixel: squared gradient length, and the same times cosine and sine of its doubled angle.
struct Tensor {
    cv::Mat energy, cos2, sin2;
};

Tensor gradients(const cv::Mat& gray, const cv::Mat& valid, double sigma) {
    cv::Mat smooth, gx, gy;
    cv::GaussianBlur(gray, smooth, {}, sigma, sigma, cv::BORDER_REFLECT_101);
    cv::Scharr(smooth, gx, CV_32F, 1, 0, 1.0 / 32, 0, cv::BORDER_REFLECT_101);
    cv::Scharr(smooth, gy, CV_32F, 0, 1, 1.0 / 32, 0, cv::BORDER_REFLECT_101);
    Tensor tensor;
    tensor.energy = gx.mul(gx) + gy.mul(gy);
    tensor.cos2 = gx.mul(gx) - gy.mul(gy);
    tensor.sin2 = 2 * gx.mul(gy);
    // Near the picture's edge, and near what must not count, the smoothed gray is not the wood's.
    const int reach = std::max(1, static_cast<int>(std::lround(2 * sigma)));
    cv::Mat trusted = valid.empty() ? cv::Mat(gray.size(), CV_8U, cv::Scalar(255)) : valid;
    const cv::Mat disk = cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * reach + 1, 2 * reach + 1});
    cv::erode(trusted, trusted, disk, {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    // Beyond some strength an edge is an edge: ink and the specimen's outline are no better than a ring.
    const double strong = 4 * cv::mean(tensor.energy, trusted)[0];
    cv::Mat weight = 1.0 / (tensor.energy + std::max(strong, 1e-30));
    weight.setTo(0, trusted == 0);
    for (cv::Mat* part : {&tensor.energy, &tensor.cos2, &tensor.sin2}) *part = part->mul(weight);
    return tensor;
}

/// Means over rectangles of `step` pixels; what hangs over the edge counts as 0.
cv::Mat reduced(const cv::Mat& pixels, cv::Size step) {
    if (step == cv::Size(1, 1)) return pixels;
    const int right = (step.width - pixels.cols % step.width) % step.width,
              bottom = (step.height - pixels.rows % step.height) % step.height;
    cv::Mat padded, small;
    cv::copyMakeBorder(pixels, padded, 0, bottom, 0, right, cv::BORDER_CONSTANT, cv::Scalar(0));
    cv::resize(padded, small, {padded.cols / step.width, padded.rows / step.height}, 0, 0, cv::INTER_AREA);
    return small;
}

/// Gaussian-weighted moments of order up to 2 about each point, but for a factor common to all.
class Moments {
  public:
    /// Standard deviations along x and y [nodes].
    explicit Moments(cv::Size2d sigma)
        : step_(step_for(sigma.width), step_for(sigma.height)), x_(kernels(sigma.width / step_.width)),
          y_(kernels(sigma.height / step_.height)) {}

    /// Of x^a y^b, lengths in units of their sigma.
    cv::Mat operator()(const cv::Mat& values, int a, int b) const {
        const cv::Mat small = reduced(values, step_);
        cv::Mat out;
        cv::sepFilter2D(small, out, CV_32F, x_[a], y_[b], {-1, -1}, 0, cv::BORDER_CONSTANT);
        if (step_ == cv::Size(1, 1)) return out;
        cv::resize(out, out, {step_.width * out.cols, step_.height * out.rows}, 0, 0, cv::INTER_LINEAR);
        return out(cv::Rect(0, 0, values.cols, values.rows));
    }

  private:
    /// Nodes at a time: an eighth of a window tells as much.
    static int step_for(double sigma) { return std::max(1, static_cast<int>(sigma / 8)); }

    static std::array<cv::Mat, 3> kernels(double sigma) {
        const int half = static_cast<int>(std::ceil(3 * sigma));
        std::array<cv::Mat, 3> all;
        for (int order = 0; order < 3; ++order) {
            all[order].create(1, 2 * half + 1, CV_32F);
            for (int i = -half; i <= half; ++i)
                all[order].at<float>(i + half) =
                    static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma)) * std::pow(i / sigma, order));
        }
        return all;
    }

    cv::Size step_;
    std::array<cv::Mat, 3> x_, y_;
};

int step_for(cv::Size2d window) { return std::max(1, static_cast<int>(std::min(window.width, window.height) / 4)); }

/// Length of the mean doubled vector, against the mean of its length.
cv::Mat coherency_of(const Tensor& tensor, cv::Size2d window) {
    const int step = step_for(window);
    const Moments moments(window * (1.0 / step));
    const cv::Mat energy = moments(reduced(tensor.energy, {step, step}), 0, 0),
                  c = moments(reduced(tensor.cos2, {step, step}), 0, 0), s = moments(reduced(tensor.sin2, {step, step}), 0, 0);
    cv::Mat length, coherency;
    cv::magnitude(c, s, length);
    coherency = length / cv::max(energy, 1e-12);
    cv::min(coherency, 1.0, coherency);
    return coherency;
}

/// The first-order fit of the doubled vector at each lattice node.
OrientationField fit(const Tensor& tensor, cv::Size2d window) {
    OrientationField field;
    const int step = step_for(window);
    field.step = step;
    const cv::Mat energy = reduced(tensor.energy, {step, step}), c = reduced(tensor.cos2, {step, step}),
                  s = reduced(tensor.sin2, {step, step});
    const Moments moments(window * (1.0 / step));
    const cv::Mat m00 = moments(energy, 0, 0), m10 = moments(energy, 1, 0), m01 = moments(energy, 0, 1),
                  m20 = moments(energy, 2, 0), m11 = moments(energy, 1, 1), m02 = moments(energy, 0, 2);
    const cv::Mat c0 = moments(c, 0, 0), c1 = moments(c, 1, 0), c2 = moments(c, 0, 1);
    const cv::Mat s0 = moments(s, 0, 0), s1 = moments(s, 1, 0), s2 = moments(s, 0, 1);
    for (cv::Mat* map : {&field.cos2, &field.sin2}) *map = cv::Mat::zeros(energy.size(), CV_32F);
    field.coherency = coherency_of(tensor, window);
    for (int j = 0; j < energy.rows; ++j) {
        for (int i = 0; i < energy.cols; ++i) {
            const auto at = [i, j](const cv::Mat& map) { return static_cast<double>(map.at<float>(j, i)); };
            const double mass = at(m00);
            if (!(mass > 1e-12)) continue;
            // A slope that the window hardly sees stays small: a hundredth of the mass stands against it.
            const double ridge = 0.01 * mass;
            Eigen::Matrix3d normal;
            normal << mass, at(m10), at(m01), at(m10), at(m20) + ridge, at(m11), at(m01), at(m11), at(m02) + ridge;
            Eigen::Matrix<double, 3, 2> right;
            right << at(c0), at(s0), at(c1), at(s1), at(c2), at(s2);
            const Eigen::RowVector2d vector = normal.ldlt().solve(right).row(0);
            const double length = vector.norm();
            if (!(length > 1e-9)) continue;
            field.cos2.at<float>(j, i) = static_cast<float>(vector.x() / length);
            field.sin2.at<float>(j, i) = static_cast<float>(vector.y() / length);
        }
    }
    return field;
}

/// Where gradients disagree the doubled vector of around is taken, weighted by coherency.
void fill_in(OrientationField& field, cv::Size2d window) {
    const Moments around_each(window * (2 / field.step));
    const cv::Mat sum_c = around_each(field.cos2.mul(field.coherency), 0, 0),
                  sum_s = around_each(field.sin2.mul(field.coherency), 0, 0);
    const double all_c = cv::sum(field.cos2.mul(field.coherency))[0], all_s = cv::sum(field.sin2.mul(field.coherency))[0];
    const double all = std::hypot(all_c, all_s);
    for (int j = 0; j < sum_c.rows; ++j) {
        for (int i = 0; i < sum_c.cols; ++i) {
            float &c = field.cos2.at<float>(j, i), &s = field.sin2.at<float>(j, i);
            double around_c = sum_c.at<float>(j, i), around_s = sum_s.at<float>(j, i);
            double around = std::hypot(around_c, around_s);
            if (!(around > 1e-6)) {
                around_c = all > 0 ? all_c : 1;
                around_s = all > 0 ? all_s : 0;
                around = all > 0 ? all : 1;
            }
            const double own = std::clamp((field.coherency.at<float>(j, i) - 0.1) / 0.2, 0.0, 1.0);
            const double x = own * c + (1 - own) * around_c / around, y = own * s + (1 - own) * around_s / around;
            const double length = std::max(std::hypot(x, y), 1e-12);
            c = static_cast<float>(x / length);
            s = static_cast<float>(y / length);
        }
    }
}

/// Weighs each gradient by cos^4 of its angle to a direction known before.
void trust_agreeing(Tensor& tensor, const OrientationField& before) {
    const cv::Mat c = before.full(before.cos2, tensor.energy.size()), s = before.full(before.sin2, tensor.energy.size());
    cv::Mat length;
    cv::max(tensor.energy, 1e-30, length);
    cv::Mat trust = 0.5 + 0.5 * (tensor.cos2.mul(c) + tensor.sin2.mul(s)) / length;
    trust = trust.mul(trust);
    for (cv::Mat* part : {&tensor.energy, &tensor.cos2, &tensor.sin2}) *part = part->mul(trust);
}

}  // namespace

cv::Mat OrientationField::full(const cv::Mat& lattice, cv::Size picture) const {
    // The lattice's last squares may hang over the picture's edge.
    const cv::Mat map = (cv::Mat_<double>(2, 3) << step, 0, 0.5 * (step - 1), 0, step, 0.5 * (step - 1));
    cv::Mat large;
    cv::warpAffine(lattice, large, map, picture, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    return large;
}

OrientationField measure_orientation(const cv::Mat& gray, const cv::Mat& valid, const OrientationScale& scale) {
    Tensor tensor = gradients(gray, valid, scale.derivative);
    OrientationField field = fit(tensor, scale.window * 2.0);
    fill_in(field, scale.window * 2.0);
    const cv::Mat coherency = coherency_of(tensor, scale.window);
    trust_agreeing(tensor, field);
    field = fit(tensor, scale.window);
    fill_in(field, scale.window);
    field.coherency = coherency;  // of what the picture shows, not of what was trusted
    return field;
}

bool holds_pith(const OrientationField& field) {
    const int right = field.cos2.cols - 1, bottom = field.cos2.rows - 1;
    std::vector<cv::Point> round;  // the lattice's outermost nodes, once around
    for (int i = 0; i < right; ++i) round.emplace_back(i, 0);
    for (int j = 0; j < bottom; ++j) round.emplace_back(right, j);
    for (int i = right; i > 0; --i) round.emplace_back(i, bottom);
    for (int j = bottom; j > 0; --j) round.emplace_back(0, j);
    const auto angle = [&](std::size_t k) {
        const cv::Point at = round[k % round.size()];
        return std::atan2(field.sin2.at<float>(at), field.cos2.at<float>(at));
    };
    double turned = 0;
    for (std::size_t k = 0; k < round.size(); ++k) turned += std::remainder(angle(k + 1) - angle(k), 2 * std::numbers::pi);
    return std::lround(std::abs(turned) / (2 * std::numbers::pi)) == 2;
}

}  // namespace crampfit

#include "imaging/ring_coordinate.hpp"

#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace crampfit {
namespace {

constexpr double along_growth = 0.02;  // weight of "one a pixel" against "constant along the ring"
constexpr double least_slope = 0.05;   // of psi down a column
constexpr double least_trust = 0.01;   // of a direction that the picture hardly shows

struct Direction {
    cv::Point2d normal;  // unit, in the frame, with the growth
    double trust;
};

/// Directions at places of the frame.
class Directions {
  public:
    Directions(const OrientationField& field, const GrowthFrame& frame) : field_(field), frame_(frame) {}

    Direction at(double u, double v) const {
        const cv::Point2d p = frame_.to_picture({u, v});
        const double x = (p.x + 0.5) / field_.step - 0.5, y = (p.y + 0.5) / field_.step - 0.5;
        const double angle = 0.5 * std::atan2(sample(field_.sin2, x, y), sample(field_.cos2, x, y));
        cv::Point2d normal = frame_.direction({std::cos(angle), std::sin(angle)});
        if (normal.y < 0) normal = -normal;
        const double coherency = sample(field_.coherency, x, y);
        return {normal, std::max(coherency * coherency, least_trust)};
    }

  private:
    static double sample(const cv::Mat& lattice, double x, double y) {
        x = std::clamp(x, 0.0, lattice.cols - 1.0);
        y = std::clamp(y, 0.0, lattice.rows - 1.0);
        const int i = std::min(static_cast<int>(x), std::max(lattice.cols - 2, 0));
        const int j = std::min(static_cast<int>(y), std::max(lattice.rows - 2, 0));
        const int right = std::min(i + 1, lattice.cols - 1), below = std::min(j + 1, lattice.rows - 1);
        const double a = x - i, b = y - j;
        return (1 - b) * ((1 - a) * lattice.at<float>(j, i) + a * lattice.at<float>(j, right)) +
               b * ((1 - a) * lattice.at<float>(below, i) + a * lattice.at<float>(below, right));
    }

    const OrientationField& field_;
    const GrowthFrame& frame_;
};

/// Gradients of a linear triangle's three shape functions.
std::array<cv::Point2d, 3> shape_gradients(const std::array<cv::Point2d, 3>& x) {
    const double twice_area = (x[1] - x[0]).cross(x[2] - x[0]);
    std::array<cv::Point2d, 3> gradients;
    for (int a = 0; a < 3; ++a) {
        const cv::Point2d edge = x[(a + 2) % 3] - x[(a + 1) % 3];
        gradients[a] = cv::Point2d(-edge.y, edge.x) / twice_area;
    }
    return gradients;
}

}  // namespace

RingCoordinate::RingCoordinate(const OrientationField& field, const GrowthFrame& frame) : frame_(frame.size()) {
    // About the lattice of the directions, but not more than some 10,000 knots.
    const double wish = std::max({field.step, std::sqrt(frame_.area() / 1e4), 1.0});
    const auto knots = [&](int length) { return std::max(2, static_cast<int>(std::lround((length - 1) / wish)) + 1); };
    const int columns = knots(frame_.width), rows = knots(frame_.height);
    spacing_u_ = (frame_.width - 1.0) / (columns - 1);
    spacing_v_ = (frame_.height - 1.0) / (rows - 1);

    const Directions directions(field, frame);
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(columns * rows);
    const auto add_triangle = [&](const std::array<cv::Point, 3>& corner) {
        std::array<cv::Point2d, 3> place;
        for (int a = 0; a < 3; ++a) place[a] = {corner[a].x * spacing_u_, corner[a].y * spacing_v_};
        const cv::Point2d middle = (place[0] + place[1] + place[2]) / 3;
        const auto [n, trust] = directions.at(middle.x, middle.y);
        const cv::Point2d t(-n.y, n.x);
        const auto slopes = shape_gradients(place);
        for (int a = 0; a < 3; ++a) {
            const int row = corner[a].y * columns + corner[a].x;
            right[row] += trust * along_growth * n.dot(slopes[a]);
            for (int b = 0; b < 3; ++b)
                entries.emplace_back(
                    row, corner[b].y * columns + corner[b].x,
                    trust * (t.dot(slopes[a]) * t.dot(slopes[b]) + along_growth * n.dot(slopes[a]) * n.dot(slopes[b])));
        }
    };
    for (int j = 0; j + 1 < rows; ++j) {
        for (int i = 0; i + 1 < columns; ++i) {
            add_triangle({cv::Point(i, j), {i + 1, j}, {i + 1, j + 1}});
            add_triangle({cv::Point(i, j), {i + 1, j + 1}, {i, j + 1}});
        }
    }
    entries.emplace_back(0, 0, 1e-3);  // psi is free up to a constant
    Eigen::SparseMatrix<double> matrix(columns * rows, columns * rows);
    matrix.setFromTriplets(entries.begin(), entries.end());
    const Eigen::VectorXd psi = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(right);

    values_.create(rows, columns, CV_64F);
    for (int j = 0; j < rows; ++j)
        for (int i = 0; i < columns; ++i) {
            const double free = psi[j * columns + i];
            values_.at<double>(j, i) = j == 0 ? free : std::max(free, values_.at<double>(j - 1, i) + least_slope * spacing_v_);
        }
    cv::minMaxLoc(values_, &lowest_, &highest_);
}

double RingCoordinate::knot(double u, int row) const {
    const double x = std::clamp(u / spacing_u_, 0.0, values_.cols - 1.0);
    const int i = std::min(static_cast<int>(x), values_.cols - 2);
    const double a = x - i;
    return (1 - a) * values_.at<double>(row, i) + a * values_.at<double>(row, i + 1);
}

double RingCoordinate::psi(double u, double v) const {
    const double y = v / spacing_v_;
    const int j = std::clamp(static_cast<int>(std::floor(y)), 0, values_.rows - 2);
    const double above = knot(u, j), below = knot(u, j + 1);
    return above + (y - j) * (below - above);
}

double RingCoordinate::v(double u, double psi) const {
    int low = 0, high = values_.rows - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        (knot(u, middle) <= psi ? low : high) = middle;
    }
    const double above = knot(u, low), below = knot(u, high);
    return spacing_v_ * (low + (psi - above) / (below - above));
}

void RingCoordinate::straighten_columns(const cv::Mat& in_frame, int first, int count, cv::Mat& straight) const {
    cv::Mat knots(count, values_.rows, CV_64F);
    for (int i = 0; i < count; ++i)
        for (int j = 0; j < values_.rows; ++j) knots.at<double>(i, j) = knot(first + i, j);
    std::vector<int> lows(count, 0);
    for (int row = 0; row < straight.rows; ++row) {
        const double psi = lowest_ + row;
        for (int i = 0; i < count; ++i) {
            const double* at = knots.ptr<double>(i);
            int& low = lows[i];
            while (low + 2 < values_.rows && at[low + 1] <= psi) ++low;
            const double place = spacing_v_ * (low + (psi - at[low]) / (at[low + 1] - at[low]));
            if (place < 0 || place > in_frame.rows - 1) continue;
            const int u = first + i, j = std::min(static_cast<int>(place), in_frame.rows - 2);
            const auto a = static_cast<float>(place - j);
            straight.at<float>(row, u) = (1 - a) * in_frame.at<float>(j, u) + a * in_frame.at<float>(j + 1, u);
        }
    }
}

cv::Mat RingCoordinate::straighten(const cv::Mat& in_frame) const {
    CV_Assert(in_frame.type() == CV_32F && in_frame.size() == frame_);
    constexpr int strip = 64;  // columns that go down the rows together: one by itself would touch a line of cache for each pixel
    cv::Mat straight = cv::Mat::zeros(straight_rows(), in_frame.cols, CV_32F);
    cv::parallel_for_({0, (in_frame.cols + strip - 1) / strip}, [&](const cv::Range& strips) {
        for (int first = strip * strips.start; first < std::min(in_frame.cols, strip * strips.end); first += strip)
            straighten_columns(in_frame, first, std::min(strip, in_frame.cols - first), straight);
    });
    return straight;
}

cv::Mat RingCoordinate::map() const {
    cv::Mat rows(straight_rows(), frame_.width, CV_32F);
    for (int row = 0; row < rows.rows; ++row) rows.row(row) = static_cast<float>(row);
    return bend(rows);
}

cv::Mat RingCoordinate::bend(const cv::Mat& straight) const {
    CV_Assert(straight.type() == CV_32F && straight.cols == frame_.width);
    cv::Mat in_frame(frame_, CV_32F);
    cv::parallel_for_({0, frame_.height}, [&](const cv::Range& rows) {
        std::vector<double> above(frame_.width), below(frame_.width);  // psi at the knots' rows to either side
        int knots = -1;
        for (int v = rows.start; v < rows.end; ++v) {
            const double y = v / spacing_v_;
            const int upper = std::clamp(static_cast<int>(std::floor(y)), 0, values_.rows - 2);
            if (upper != knots)
                for (int u = 0; u < frame_.width; ++u) {
                    above[u] = knot(u, upper);
                    below[u] = knot(u, upper + 1);
                }
            knots = upper;
            for (int u = 0; u < frame_.width; ++u) {
                const double psi = above[u] + (y - upper) * (below[u] - above[u]);
                const double row = std::clamp(psi - lowest_, 0.0, straight.rows - 1.0);
                const int j = std::min(static_cast<int>(row), straight.rows - 2);
                const auto a = static_cast<float>(row - j);
                in_frame.at<float>(v, u) = (1 - a) * straight.at<float>(j, u) + a * straight.at<float>(j + 1, u);
            }
        }
    });
    return in_frame;
}

}  // namespace crampfit

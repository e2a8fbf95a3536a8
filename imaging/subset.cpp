#include "imaging/subset.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace crampfit {
namespace {

constexpr double least_zncc = 0.8;
constexpr int most_iterations = 30;
constexpr double few = 1.0 / 32;  // of a subset's pixels; a crack that counts has an eighth of them beyond it
constexpr double settled = 5e-4;  // last step anywhere at the subset's edge [px]: what is left is a tenth of it

/// Powers of xi and eta in the terms of a warp.
constexpr std::array<std::array<std::size_t, 2>, 6> powers{{{0, 0}, {1, 0}, {0, 1}, {2, 0}, {1, 1}, {0, 2}}};

template <class Lanes, std::size_t Count>
void clear(std::array<Lanes, Count>& sums) {
    for (Lanes& sum : sums) sum.setZero();
}

/// Adds each of `values` times 1, xi, xi^2, ... to its sums.
template <class Lanes, std::size_t Count, std::size_t Kinds>
void add_by_powers(std::array<std::array<Lanes, Count>, Kinds>& sums, const Lanes& xi, std::array<Lanes, Kinds> values) {
    for (std::size_t power = 0; power < Count; ++power)
        for (std::size_t kind = 0; kind < Kinds; ++kind) {
            sums[kind][power] += values[kind];
            values[kind] *= xi;
        }
}

/// The warp as a matrix that acts on monomials of the place in the subset, so that one warp after another is a product:
/// on (xi, eta, 1) for the first order, Pan et al. (2013) eq. 9; on (xi^2, xi eta, eta^2, xi, eta, 1), less what is of
/// higher order, for the second, Gao et al. (2015) eq. 12. `half` is that of the subset, whose edges are at 1 here.
Eigen::Matrix3d as_matrix(const Warp& warp, double half, std::integral_constant<int, 1>) {
    const auto& [u, v] = warp;
    Eigen::Matrix3d matrix;
    matrix << 1 + u[1] / half, u[2] / half, u[0] / half,  //
        v[1] / half, 1 + v[2] / half, v[0] / half,        //
        0, 0, 1;
    return matrix;
}

Eigen::Matrix<double, 6, 6> as_matrix(const Warp& warp, double half, std::integral_constant<int, 2>) {
    // xi' = a xi + b eta + c + d xi^2 + e xi eta + f eta^2, and eta' likewise with the second of each.
    const auto a = std::array{1 + warp.u[1] / half, warp.v[1] / half};
    const auto b = std::array{warp.u[2] / half, 1 + warp.v[2] / half};
    const auto c = std::array{warp.u[0] / half, warp.v[0] / half};
    const auto d = std::array{warp.u[3] / half, warp.v[3] / half};
    const auto e = std::array{warp.u[4] / half, warp.v[4] / half};
    const auto f = std::array{warp.u[5] / half, warp.v[5] / half};
    Eigen::Matrix<double, 6, 6> matrix;
    const auto product = [&](int row, int i, int j) {  // of the warped coordinates i and j
        matrix.row(row) << a[i] * a[j] + c[i] * d[j] + d[i] * c[j], a[i] * b[j] + b[i] * a[j] + c[i] * e[j] + e[i] * c[j],
            b[i] * b[j] + c[i] * f[j] + f[i] * c[j], a[i] * c[j] + c[i] * a[j], b[i] * c[j] + c[i] * b[j], c[i] * c[j];
    };
    product(0, 0, 0);
    product(1, 0, 1);
    product(2, 1, 1);
    matrix.row(3) << d[0], e[0], f[0], a[0], b[0], c[0];
    matrix.row(4) << d[1], e[1], f[1], a[1], b[1], c[1];
    matrix.row(5) << 0, 0, 0, 0, 0, 1;
    return matrix;
}

void set_warp(Warp& warp, const Eigen::Matrix3d& matrix, double half) {
    warp.u = {matrix(0, 2) * half, (matrix(0, 0) - 1) * half, matrix(0, 1) * half};
    warp.v = {matrix(1, 2) * half, matrix(1, 0) * half, (matrix(1, 1) - 1) * half};
}

void set_warp(Warp& warp, const Eigen::Matrix<double, 6, 6>& m, double half) {
    warp.u = {m(3, 5) * half, (m(3, 3) - 1) * half, m(3, 4) * half, m(3, 0) * half, m(3, 1) * half, m(3, 2) * half};
    warp.v = {m(4, 5) * half, m(4, 3) * half, (m(4, 4) - 1) * half, m(4, 0) * half, m(4, 1) * half, m(4, 2) * half};
}

/// The warp that comes of undoing `step` first and then doing `warp`.
template <int Order>
void compose_inverse(Warp& warp, const Warp& step, double half) {
    constexpr std::integral_constant<int, Order> order;
    const auto now = as_matrix(warp, half, order);
    set_warp(warp, (now * as_matrix(step, half, order).inverse()).eval(), half);
}

/// Bounds the displacement that a warp can give anywhere in its subset [px].
double reach_of(const std::array<double, 6>& terms) {
    double sum = 0;
    for (const double term : terms) sum += std::abs(term);
    return sum;
}

// Of the smoothing that the pattern asks for.
constexpr double details_kept =
    0.55;  // brings what linear interpolation of a picture does below 0.005 px (PublicShiftedPictures)
constexpr double most_smoothing = 2.5;     // [px]
constexpr int tile = 64, most_tiles = 16;  // edge of a piece whose spectrum is taken [px]; pieces along a side

/// Power of a picture's waves, the mean over pieces of it (Welch 1967), by wave numbers of a discrete Fourier transform.
cv::Mat mean_power(const FinePicture& picture) {
    const cv::Mat gray(picture.rows, picture.columns, CV_32F, const_cast<float*>(picture.gray.data()));
    const cv::Size size(std::min(tile, gray.cols), std::min(tile, gray.rows));
    cv::Mat window, power = cv::Mat::zeros(size, CV_32F);
    cv::createHanningWindow(window, size, CV_32F);
    const int across = std::clamp(gray.cols / size.width, 1, most_tiles),
              down = std::clamp(gray.rows / size.height, 1, most_tiles);
    for (int j = 0; j < down; ++j)
        for (int i = 0; i < across; ++i) {
            const cv::Point at((gray.cols - size.width) * (2 * i + 1) / (2 * across),
                               (gray.rows - size.height) * (2 * j + 1) / (2 * down));
            const cv::Mat piece = gray(cv::Rect(at, size));
            cv::Mat waves, parts[2];
            cv::dft((piece - cv::mean(piece)).mul(window), waves, cv::DFT_COMPLEX_OUTPUT);
            cv::split(waves, parts);
            power += parts[0].mul(parts[0]) + parts[1].mul(parts[1]);
        }
    return power;
}

/// Standard deviation of gray below which there is none but rounding: half of the median step between neighbouring grays.
double half_a_step(const FinePicture& picture) {
    constexpr std::size_t enough = 1 << 18;  // pixels to know the grays by
    std::vector<float> grays;
    const std::size_t every = (picture.gray.size() + enough - 1) / enough;
    for (std::size_t i = 0; i < picture.gray.size(); i += every) grays.push_back(picture.gray[i]);
    std::ranges::sort(grays);
    std::vector<float> steps;
    for (std::size_t i = 1; i < grays.size(); ++i)
        if (grays[i] > grays[i - 1]) steps.push_back(grays[i] - grays[i - 1]);
    if (steps.empty()) return 0.5;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::ranges::nth_element(steps, middle);
    return 0.5 * std::min(1.0, static_cast<double>(*middle));
}

FinePicture smooth(FinePicture picture, double radius) {
    const cv::Mat kernel = cv::getGaussianKernel(2 * static_cast<int>(std::ceil(3 * radius)) + 1, radius, CV_32F);
    cv::Mat gray(picture.rows, picture.columns, CV_32F, picture.gray.data());
    cv::sepFilter2D(gray.clone(), gray, CV_32F, kernel, kernel, {-1, -1}, 0, cv::BORDER_REFLECT_101);
    return picture;
}

SplinePicture::Slopes smooth_slopes_of(const FinePicture& picture, double radius) {
    return radius == 0 ? SplinePicture(picture).slopes() : SplinePicture(smooth(picture, radius)).slopes();
}

/// Spline values at `width` places: lane i lies (tx, ty) from the coefficient `at` + i.
template <class Lanes>
Lanes interpolate(const float* at, std::ptrdiff_t stride, const Lanes& tx, const Lanes& ty) {
    const auto weights = [](const Lanes& t) {
        const Lanes s = 1.0f - t, tt = t * t, ss = s * s;
        return std::array<Lanes, 4>{ss * s * (1.0f / 6), 2.0f / 3 - tt * (1.0f - 0.5f * t), 2.0f / 3 - ss * (1.0f - 0.5f * s),
                                    tt * t * (1.0f / 6)};
    };
    const std::array<Lanes, 4> wx = weights(tx), wy = weights(ty);
    Lanes value = Lanes::Zero();
    for (int j = 0; j < 4; ++j) {
        const float* line = at + (j - 1) * stride - 1;
        Lanes along = wx[0] * Eigen::Map<const Lanes>(line);
        along += wx[1] * Eigen::Map<const Lanes>(line + 1);
        along += wx[2] * Eigen::Map<const Lanes>(line + 2);
        along += wx[3] * Eigen::Map<const Lanes>(line + 3);
        value += wy[static_cast<std::size_t>(j)] * along;
    }
    return value;
}

}  // namespace

ReferencePicture::ReferencePicture(FinePicture fine, std::optional<double> smoothing)
    : picture(std::move(fine)), slopes(smooth_slopes_of(picture, 0)), least_deviation(half_a_step(picture)) {
    const double radius = smoothing ? *smoothing : smoothing_for(picture);
    smooth_slopes = smooth_slopes_of(picture, radius);

    const int far = 10 + static_cast<int>(std::ceil(4 * radius)), size = 2 * far + 1;
    FinePicture one_pixel{size, size, std::vector<float>(static_cast<std::size_t>(size * size), 0.0f)};
    one_pixel.gray[static_cast<std::size_t>(far * size + far)] = 1.0f;
    const std::vector<float> sharp = smooth_slopes_of(one_pixel, 0).by_x, soft = smooth_slopes_of(one_pixel, radius).by_x;
    noise_in_tangent = std::inner_product(soft.begin(), soft.end(), sharp.begin(), 0.0);
    noise_in_descent = std::inner_product(soft.begin(), soft.end(), soft.begin(), 0.0);
}

double smoothing_for(const FinePicture& picture) {
    const cv::Mat power = mean_power(picture);
    const auto wave_number = [](int i, int count) { return 2 * std::numbers::pi * std::min(i, count - i) / count; };
    // Of the spline's slope at pixels: that of the wave but for the finest details, where it falls to none.
    const auto slope = [](double k) { return 3 * std::sin(k) / (2 + std::cos(k)); };
    const auto mean_square = [&](double radius) {
        double sum = 0, mass = 0;
        for (int j = 0; j < power.rows; ++j)
            for (int i = 0; i < power.cols; ++i) {
                const double kx = wave_number(i, power.cols), ky = wave_number(j, power.rows);
                const double squared = slope(kx) * slope(kx) + slope(ky) * slope(ky);
                const double weight =
                    std::exp(-0.5 * radius * radius * (kx * kx + ky * ky)) * static_cast<double>(power.at<float>(j, i)) * squared;
                sum += weight * squared;
                mass += weight;
            }
        return sum / mass;
    };
    const double wanted = details_kept * mean_square(0);
    double low = 0, high = most_smoothing;
    while (high - low > 0.01) {
        const double middle = (low + high) / 2;
        (mean_square(middle) > wanted ? low : high) = middle;
    }
    return high;
}

template <int Order>
SubsetMatcher<Order>::SubsetMatcher(const ReferencePicture& reference, const SplinePicture& image, int subset)
    : reference_(reference), image_(image), half_(subset / 2), blocks_((subset + width - 1) / width) {
    const auto blocks = static_cast<std::size_t>(blocks_);
    const std::size_t count = blocks * static_cast<std::size_t>(subset);
    for (int block = 0; block < blocks_; ++block) {
        const Lanes from_left =
            Lanes::LinSpaced(static_cast<float>(block * width), static_cast<float>(block * width + width - 1));
        inside_.push_back((from_left < static_cast<float>(subset)).template cast<float>());
        xi_.push_back((from_left - static_cast<float>(half_)) / static_cast<float>(half_));
    }
    for (std::vector<Lanes>* lanes : {&gray_, &by_x_, &by_y_, &smooth_by_x_, &smooth_by_y_}) lanes->assign(count, Lanes::Zero());
    sampled_.assign(blocks * width, 0.0f);
    const auto moment = [this](std::size_t power) {
        double sum = 0;
        for (int i = -half_; i <= half_; ++i) sum += std::pow(static_cast<double>(i) / half_, static_cast<double>(power));
        return sum;
    };
    for (std::size_t m = 0; m < terms; ++m)
        for (std::size_t n = 0; n < terms; ++n) {
            const auto i = static_cast<Eigen::Index>(m), j = static_cast<Eigen::Index>(n);
            even_(i, j) = even_(terms + i, terms + j) = moment(powers[m][0] + powers[n][0]) * moment(powers[m][1] + powers[n][1]);
        }
}

/// False when the subset is flat.
template <int Order>
bool SubsetMatcher<Order>::take_subset(int x, int y) {
    const int columns = reference_.picture.columns;
    const int subset = 2 * half_ + 1;
    const auto copy = [&](const std::vector<float>& from, std::vector<Lanes>& to) {
        for (int row = 0; row < subset; ++row) {
            const float* source = from.data() + static_cast<std::ptrdiff_t>(y - half_ + row) * columns + (x - half_);
            std::copy_n(source, subset, to[static_cast<std::size_t>(row * blocks_)].data());
        }
    };
    copy(reference_.picture.gray, gray_);
    copy(reference_.slopes.by_x, by_x_);
    copy(reference_.slopes.by_y, by_y_);
    copy(reference_.smooth_slopes.by_x, smooth_by_x_);
    copy(reference_.smooth_slopes.by_y, smooth_by_y_);

    const double count = subset * subset;
    Lanes sum = Lanes::Zero();
    for (std::size_t i = 0; i < gray_.size(); ++i) sum += gray_[i] * inside_[i % static_cast<std::size_t>(blocks_)];
    mean_ = static_cast<double>(sum.sum()) / count;
    Lanes squares = Lanes::Zero();
    for (std::size_t i = 0; i < gray_.size(); ++i) {
        gray_[i] = (gray_[i] - static_cast<float>(mean_)) * inside_[i % static_cast<std::size_t>(blocks_)];
        squares += gray_[i].square();
    }
    norm_ = std::sqrt(static_cast<double>(squares.sum()));
    Lanes slopes = Lanes::Zero();
    for (std::size_t i = 0; i < by_x_.size(); ++i) slopes += by_x_[i].square() + by_y_[i].square();
    slope_ = static_cast<double>(slopes.sum()) / (2 * count);
    return norm_ >= reference_.least_deviation * std::sqrt(count);
}

// The steepest descents are the slopes times the monomials of the warp. Sums of products of two of them are moments of
// slope products: sum of fx fx xi^a eta^b and so on, a + b up to twice the order. The gray's offset and gain are free
// in ZNSSD, and what of the descents they can make up for is taken off: descents less their mean and less their part
// along the reference's gray.
template <int Order>
void SubsetMatcher<Order>::make_matrices() {
    constexpr int degree = 2 * Order;
    std::array<std::array<std::array<double, degree + 1>, degree + 1>, 7> moments{};
    std::array<std::array<double, terms>, 8> sums{};  // of the smooth slopes and the slopes, by x and y, alone and times the gray
    for (int row = 0; row <= 2 * half_; ++row) {
        std::array<std::array<Lanes, degree + 1>, 7> along;
        std::array<std::array<Lanes, Order + 1>, 8> first;
        for (auto& lanes : along) clear(lanes);
        for (auto& lanes : first) clear(lanes);
        for (int block = 0; block < blocks_; ++block) {
            const auto at = static_cast<std::size_t>(row * blocks_ + block);
            const Lanes &xi = xi_[static_cast<std::size_t>(block)], &f = gray_[at];
            const Lanes &fx = by_x_[at], &fy = by_y_[at], &sx = smooth_by_x_[at], &sy = smooth_by_y_[at];
            add_by_powers(along, xi, {sx * fx, sx * fy, sy * fx, sy * fy, sx * sx, sx * sy, sy * sy});
            add_by_powers(first, xi, {sx, sy, sx * f, sy * f, fx, fy, fx * f, fy * f});
        }
        const double eta = static_cast<double>(row - half_) / half_;
        for (std::size_t kind = 0; kind < moments.size(); ++kind)
            for (std::size_t a = 0; a <= degree; ++a) {
                double sum = static_cast<double>(along[kind][a].sum());
                for (std::size_t b = 0; a + b <= degree; ++b, sum *= eta) moments[kind][a][b] += sum;
            }
        const std::array<double, 3> by_eta{1, eta, eta * eta};
        for (std::size_t kind = 0; kind < sums.size(); ++kind)
            for (std::size_t m = 0; m < terms; ++m)
                sums[kind][m] += by_eta[powers[m][1]] * static_cast<double>(first[kind][powers[m][0]].sum());
    }
    Square tangent;
    for (std::size_t m = 0; m < terms; ++m)
        for (std::size_t n = 0; n < terms; ++n) {
            const auto moment = [&](std::size_t kind) {
                return moments[kind][powers[m][0] + powers[n][0]][powers[m][1] + powers[n][1]];
            };
            const auto i = static_cast<Eigen::Index>(m), j = static_cast<Eigen::Index>(n);
            tangent(i, j) = moment(0);
            tangent(i, terms + j) = moment(1);
            tangent(terms + i, j) = moment(2);
            tangent(terms + i, terms + j) = moment(3);
            noise_(i, j) = moment(4);
            noise_(i, terms + j) = noise_(terms + j, i) = moment(5);
            noise_(terms + i, terms + j) = moment(6);
        }
    const auto both = [&](std::size_t kind) {  // by x, then by y
        Parameters parameters;
        parameters << Eigen::Map<const Eigen::Vector<double, terms>>(sums[kind].data()),
            Eigen::Map<const Eigen::Vector<double, terms>>(sums[kind + 1].data());
        return parameters;
    };
    descent_ = both(0);
    descent_by_gray_ = both(2);
    const double count = (2 * half_ + 1) * (2 * half_ + 1), squares = norm_ * norm_;
    smooth_slope_ = (moments[0][0][0] + moments[3][0][0]) / (2 * count);
    tangent -= descent_ * both(4).transpose() / count + descent_by_gray_ * both(6).transpose() / squares;
    noise_ -= descent_ * descent_.transpose() / count + descent_by_gray_ * descent_by_gray_.transpose() / squares;
    tangent_.compute(tangent);
}

/// White noise of variance s^2 in what is left of the grays moves the parameters by covariance s^2 A^-1 B A^-T, A the
/// tangent and B the smooth descents by themselves; without smoothing both are the Hessian H, and it is s^2 H^-1. The reference's
/// noise, half of s^2, is in its slopes, too: A is that without it, as it is not the image's; and of B the half that goes with
/// the reference's own noise is, as slopes of noise times that noise add up to nothing.
template <int Order>
double SubsetMatcher<Order>::standard_error(double residual_variance) const {
    constexpr double most = 0.8;  // of the slopes, where what is left is more than noise
    const double in_tangent = std::min(0.5 * residual_variance * reference_.noise_in_tangent, most * smooth_slope_);
    const double in_descent = in_tangent * reference_.noise_in_descent / reference_.noise_in_tangent;
    const Square inverse = (tangent_.reconstructedMatrix() - in_tangent * even_).inverse();
    const Square descents = noise_ - 0.5 * in_descent * even_;
    const auto variance = [&](int i) { return inverse.row(i).dot(inverse.row(i) * descents); };
    return std::sqrt(residual_variance * (variance(0) + variance(terms)) / 2);
}

template <int Order>
bool SubsetMatcher<Order>::stays_inside(int x, int y, const Warp& warp) const {
    const auto inside = [&](int centre, const std::array<double, 6>& terms_of, std::size_t along, int count) {
        const double spread =
            std::abs(half_ + terms_of[along]) + reach_of(terms_of) - std::abs(terms_of[0]) - std::abs(terms_of[along]);
        const double place = centre + terms_of[0];
        return place - spread >= 0 && place + spread <= count - 1;
    };
    return inside(x, warp.u, 1, image_.columns()) && inside(y, warp.v, 2, image_.rows());
}

/// Fills `sampled_` with the image's gray at the warped places of one row.
template <int Order>
void SubsetMatcher<Order>::sample_row(int x, int y, const Warp& warp, int row) {
    // Whole pixels of the centre's displacement are kept apart: what is left is small, and exact enough in single
    // precision.
    const double whole_u = std::floor(warp.u[0]), whole_v = std::floor(warp.v[0]);
    const auto eta = static_cast<float>(static_cast<double>(row - half_) / half_);
    const auto along = [&](const std::array<double, 6>& t, double whole) {  // coefficients of 1, xi, xi^2
        const auto f = [](double value) { return static_cast<float>(value); };
        return std::array<float, 3>{f(t[0] - whole) + eta * (f(t[2]) + eta * f(t[5])), f(t[1]) + eta * f(t[4]), f(t[3])};
    };
    const std::array<float, 3> u = along(warp.u, whole_u), v = along(warp.v, whole_v);
    const float* origin = image_.at(x - half_ + static_cast<int>(whole_u), y - half_ + row + static_cast<int>(whole_v));
    for (int block = 0; block < blocks_; ++block) {
        const Lanes& xi = xi_[static_cast<std::size_t>(block)];
        Lanes dx = u[0] + xi * u[1], dy = v[0] + xi * v[1];
        if constexpr (Order == 2) {
            dx += xi.square() * u[2];
            dy += xi.square() * v[2];
        }
        const Lanes left = dx.floor(), above = dy.floor();
        dx -= left;
        dy -= above;
        // Neighbouring pixels mostly stay neighbours, so that their coefficients lie side by side. Where the warp has
        // drifted a whole pixel a new run begins; it overwrites what the run before has left beyond its end.
        const auto run = [&](int begin) {
            const float* at = origin + block * width + static_cast<std::ptrdiff_t>(left[begin]) +
                              static_cast<std::ptrdiff_t>(above[begin]) * image_.stride();
            return interpolate<Lanes>(at, image_.stride(), dx, dy);
        };
        Lanes value = run(0);
        if (((left - left[0]).abs() + (above - above[0]).abs()).sum() != 0) {
            const int end = std::min(width, 2 * half_ + 1 - block * width);
            for (int i = 1; i < end; ++i)
                if (left[i] != left[i - 1] || above[i] != above[i - 1]) {
                    const Lanes rest = run(i);
                    std::copy(rest.data() + i, rest.data() + width, value.data() + i);
                }
        }
        Eigen::Map<Lanes>(sampled_.data() + block * width) = value;
    }
}

template <int Order>
typename SubsetMatcher<Order>::Sums SubsetMatcher<Order>::sample(int x, int y, const Warp& warp) {
    Lanes gray = Lanes::Zero(), squared = Lanes::Zero(), by_reference = Lanes::Zero();
    std::array<Lanes, 2 * terms> by_descent;
    clear(by_descent);
    const auto mean = static_cast<float>(mean_);
    for (int row = 0; row <= 2 * half_; ++row) {
        sample_row(x, y, warp, row);
        std::array<Lanes, Order + 1> by_x, by_y;
        clear(by_x);
        clear(by_y);
        for (int block = 0; block < blocks_; ++block) {
            const auto at = static_cast<std::size_t>(row * blocks_ + block);
            const Lanes& xi = xi_[static_cast<std::size_t>(block)];
            const Lanes g =
                (Eigen::Map<const Lanes>(sampled_.data() + block * width) - mean) * inside_[static_cast<std::size_t>(block)];
            gray += g;
            squared += g * g;
            by_reference += g * gray_[at];
            Lanes gx = g * smooth_by_x_[at], gy = g * smooth_by_y_[at];
            by_x[0] += gx;
            by_y[0] += gy;
            for (std::size_t a = 1; a <= Order; ++a) {
                gx *= xi;
                gy *= xi;
                by_x[a] += gx;
                by_y[a] += gy;
            }
        }
        const auto eta = static_cast<float>(static_cast<double>(row - half_) / half_);
        const std::array<float, 3> by_eta{1.0f, eta, eta * eta};
        for (std::size_t m = 0; m < terms; ++m) {
            const auto [a, b] = powers[m];
            by_descent[m] += by_x[a] * by_eta[b];
            by_descent[terms + m] += by_y[a] * by_eta[b];
        }
    }
    Sums sums{static_cast<double>(gray.sum()), static_cast<double>(squared.sum()), static_cast<double>(by_reference.sum()), {}};
    for (int m = 0; m < 2 * terms; ++m) sums.by_descent[m] = static_cast<double>(by_descent[static_cast<std::size_t>(m)].sum());
    return sums;
}

/// Variance of what is left of the grays, the worst few pixels left out; `mean` is of the image's gray less that of the
/// reference, and `gain` what brings it to the contrast of the reference.
template <int Order>
double SubsetMatcher<Order>::residual_of_most(int x, int y, const Warp& warp, double mean, double gain) {
    std::vector<float> squares;
    const int subset = 2 * half_ + 1;
    for (int row = 0; row < subset; ++row) {
        sample_row(x, y, warp, row);
        const float* gray = gray_[static_cast<std::size_t>(row * blocks_)].data();
        for (int i = 0; i < subset; ++i) {
            const double left = gain * (sampled_[static_cast<std::size_t>(i)] - mean_ - mean) - gray[i];
            squares.push_back(static_cast<float>(left * left));
        }
    }
    const auto most = static_cast<std::ptrdiff_t>(static_cast<double>(squares.size()) * (1 - few));
    std::ranges::nth_element(squares, squares.begin() + most);
    return std::accumulate(squares.begin(), squares.begin() + most, 0.0) / static_cast<double>(most);
}

template <int Order>
SubsetMatch SubsetMatcher<Order>::match(int x, int y, const Warp& guess) {
    SubsetMatch found;
    if (!take_subset(x, y)) {
        found.status = PointStatus::no_contrast;
        return found;
    }
    make_matrices();
    found.warp = guess;
    const double count = (2 * half_ + 1) * (2 * half_ + 1);
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
        if (!stays_inside(x, y, found.warp)) {
            found.status = PointStatus::left_picture;
            return found;
        }
        const Sums sums = sample(x, y, found.warp);
        const double mean = sums.gray / count;
        const double norm = std::sqrt(std::max(0.0, sums.squared - sums.gray * mean));
        if (norm < reference_.least_deviation * std::sqrt(count)) {
            found.status = PointStatus::no_contrast;
            return found;
        }
        found.zncc = std::min(1.0, sums.by_reference / (norm_ * norm));  // rounding may pass 1
        // Pan et al. (2013) eq. 7 with smooth descents, and the sums over the image's gray taken apart.
        const Parameters slope = descent_by_gray_ - norm_ / norm * (sums.by_descent - mean * descent_);
        const Parameters step = -tangent_.solve(slope);
        if (!step.allFinite() || step.template lpNorm<Eigen::Infinity>() > half_) return found;
        Warp update;
        std::copy_n(step.data(), terms, update.u.begin());
        std::copy_n(step.data() + terms, terms, update.v.begin());
        compose_inverse<Order>(found.warp, update, half_);
        if (step.template lpNorm<Eigen::Infinity>() < settled) {
            found.residual = 2 * norm_ * norm_ * (1 - found.zncc) / (count - 2 * terms - 2);
            found.slope = slope_;
            found.apart = found.residual > most_apart * most_apart * slope_
                              ? residual_of_most(x, y, found.warp, mean, norm_ / norm)
                              : found.residual;
            found.sigma = standard_error(found.residual);
            found.status = found.zncc < least_zncc ? PointStatus::low_correlation : PointStatus::ok;
            return found;
        }
    }
    return found;
}

template class SubsetMatcher<1>;
template class SubsetMatcher<2>;

}  // namespace crampfit

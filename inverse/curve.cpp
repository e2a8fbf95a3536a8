#include "inverse/curve.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace crampfit {
namespace {

constexpr double narrow = 1e-9;  // of the curve: there a difference of areas is all rounding, and a rise is a step

}  // namespace

Curve::Curve(std::span<const double> x, std::span<const double> y) {
    assert(x.size() == y.size());
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < x.size(); ++i) {
        if (!std::isnan(x[i]) && !std::isnan(y[i])) {
            rows.push_back(i);
        }
    }
    assert(!rows.empty());
    std::stable_sort(rows.begin(), rows.end(), [&](std::size_t a, std::size_t b) { return x[a] < x[b]; });
    for (std::size_t begin = 0, end = 0; begin < rows.size(); begin = end) {
        while (end < rows.size() && x[rows[end]] == x[rows[begin]]) {
            ++end;
        }
        const auto mean = [&](std::size_t from, std::size_t to) {
            double sum = 0;
            for (std::size_t i = from; i < to; ++i) {
                sum += y[rows[i]];
            }
            return sum / static_cast<double>(to - from);
        };
        x_.push_back(x[rows[begin]]);
        y_.push_back(mean(begin, begin + (end - begin + 1) / 2));
        if (end > begin + 1) {
            x_.push_back(std::nextafter(x_.back(), INFINITY));
            y_.push_back(mean(begin + (end - begin) / 2, end));
        }
        rows_.resize(x_.size(), static_cast<int>(end - begin));
        means_.resize(x_.size(), mean(begin, end));
    }
    level_.resize(x_.size(), false);
    integrate();
}

void Curve::integrate() {
    area_.assign(x_.size(), 0.0);
    for (std::size_t i = 1; i < x_.size(); ++i) {
        area_[i] = area_[i - 1] + 0.5 * (y_[i] + y_[i - 1]) * (x_[i] - x_[i - 1]);
    }
    after_ = y_.back();
}

double Curve::at(double x) const {
    if (x <= x_.front()) {
        return y_.front();
    }
    if (x > x_.back()) {
        return after_;
    }
    const auto above = static_cast<std::size_t>(std::lower_bound(x_.begin(), x_.end(), x) - x_.begin());
    return std::lerp(y_[above - 1], y_[above], (x - x_[above - 1]) / (x_[above] - x_[above - 1]));
}

double Curve::area(double x) const {
    if (x <= x_.front()) {
        return y_.front() * (x - x_.front());
    }
    if (x > x_.back()) {
        return area_.back() + after_ * (x - x_.back());
    }
    const auto above = static_cast<std::size_t>(std::lower_bound(x_.begin(), x_.end(), x) - x_.begin());
    return area_[above - 1] + 0.5 * (y_[above - 1] + at(x)) * (x - x_[above - 1]);
}

double Curve::mean(double from, double to) const {
    return to - from > narrow * (x_.back() - x_.front()) ? (area(to) - area(from)) / (to - from) : 0.5 * (at(from) + at(to));
}

bool Curve::is_step(std::size_t node) const { return node + 1 < x_.size() && x_[node + 1] == std::nextafter(x_[node], INFINITY); }

int Curve::usual_rows() const {
    std::vector<int> places;
    for (std::size_t i = 0; i < x_.size(); ++i) {
        if (!is_step(i)) {
            places.push_back(rows_[i]);
        }
    }
    const auto middle = places.begin() + static_cast<std::ptrdiff_t>(places.size() / 2);
    std::nth_element(places.begin(), middle, places.end());
    return *middle;
}

void Curve::level_steps(double noise) {
    for (std::size_t i = 0; i < x_.size(); ++i) {
        if (is_step(i) && std::abs(y_[i + 1] - y_[i]) <= 2 * noise * std::sqrt(2 * (variance(i) - covariance_with_next(i)))) {
            y_[i] = y_[i + 1] = means_[i];
            level_[i] = level_[i + 1] = true;
        }
    }
    integrate();
}

void Curve::count_at_most(int rows) { most_rows_ = rows; }

double Curve::rows(double from, double to) const {
    double sum = 0;
    for (std::size_t i = 0; i < x_.size(); ++i) {
        if (x_[i] >= from && x_[i] < to) {
            const double there = std::min(rows_[i], most_rows_);
            sum += rows_[i] > 1 ? 0.5 * there : 1.0;
        }
    }
    return sum;
}

double Curve::variance(std::size_t node) const {
    const int rows = rows_[node], part = level_[node] ? rows : (rows + 1) / 2;  // half of them, or the only one
    return std::max(1.0, static_cast<double>(rows) / most_rows_) / part;
}

double Curve::covariance_with_next(std::size_t node) const {
    const int rows = rows_[node];
    if (!is_step(node) || (!level_[node] && rows % 2 == 0)) {
        return 0.0;
    }
    return level_[node] ? variance(node) : variance(node) / ((rows + 1) / 2);  // an odd row in the middle is in both halves
}

double Curve::error(std::size_t node) const { return std::sqrt(variance(node)); }

double Curve::usual_error() const {
    std::vector<double> errors;
    for (std::size_t i = 0; i < x_.size(); ++i) {
        errors.push_back(error(i));
    }
    const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
    std::nth_element(errors.begin(), middle, errors.end());
    return *middle;
}

double Curve::off_line(std::size_t node) const {
    const std::size_t i = node;
    const double s = (x_[i] - x_[i - 1]) / (x_[i + 1] - x_[i - 1]);
    const double off = y_[i] - std::lerp(y_[i - 1], y_[i + 1], s);
    const double squares = variance(i) + (1 - s) * (1 - s) * variance(i - 1) + s * s * variance(i + 1) -
                           2 * (1 - s) * covariance_with_next(i - 1) - 2 * s * covariance_with_next(i);
    return off / std::sqrt(squares);
}

std::vector<double> Curve::weights_of_mean(double from, double to) const {
    std::vector<double> weights(x_.size(), 0.0);
    if (!(to - from > narrow * (x_.back() - x_.front()))) {
        for (const double end : {from, to}) {
            const double x = std::clamp(end, x_.front(), x_.back());
            const auto above = static_cast<std::size_t>(std::lower_bound(x_.begin(), x_.end(), x) - x_.begin());
            const double s = above > 0 ? (x - x_[above - 1]) / (x_[above] - x_[above - 1]) : 1.0;
            weights[above] += 0.5 * s;
            if (above > 0) {
                weights[above - 1] += 0.5 * (1 - s);
            }
        }
        return weights;
    }
    weights.front() = std::max(0.0, std::min(to, x_.front()) - from);
    weights.back() += std::max(0.0, to - std::max(from, x_.back()));
    for (std::size_t i = 0; i + 1 < x_.size(); ++i) {
        const double low = std::max(from, x_[i]), high = std::min(to, x_[i + 1]);
        if (low < high) {
            const double part = (0.5 * (low + high) - x_[i]) / (x_[i + 1] - x_[i]);  // of the next node, in the mean
            weights[i] += (1 - part) * (high - low);
            weights[i + 1] += part * (high - low);
        }
    }
    for (double& weight : weights) {
        weight /= to - from;
    }
    return weights;
}

double Curve::error_of_mean(double from, double to) const {
    const std::vector<double> weights = weights_of_mean(from, to);
    double squares = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        squares += weights[i] * weights[i] * variance(i);
        if (is_step(i)) {
            squares += 2 * weights[i] * weights[i + 1] * covariance_with_next(i);
        }
    }
    return std::sqrt(squares);
}

double Curve::widest_step(double from, double to) const {
    double widest = 0;
    for (std::size_t i = 0; i + 1 < x_.size(); ++i) {
        if (x_[i] < to && x_[i + 1] > from) {
            widest = std::max(widest, x_[i + 1] - x_[i]);
        }
    }
    return widest;
}

Curve Curve::smoothed(double window) const {
    const double least = narrow * (x_.back() - x_.front());
    Curve result = *this;
    for (std::size_t i = 0; i + 1 < x_.size(); ++i) {
        for (const double corner : {x_[i] - 0.5 * window, x_[i] + 0.5 * window}) {
            if (x_[i + 1] - x_[i] <= least && corner > x_.front() && corner < x_.back()) {
                result.x_.push_back(corner);
            }
        }
    }
    std::sort(result.x_.begin(), result.x_.end());
    result.x_.erase(std::unique(result.x_.begin(), result.x_.end()), result.x_.end());
    result.y_.clear();
    for (const double x : result.x_) {
        const double half = std::min({0.5 * window, x - x_.front(), x_.back() - x});
        result.y_.push_back(half > least ? mean(x - half, x + half) : at(x));
    }
    result.rows_.clear();
    result.integrate();
    return result;
}

std::optional<double> Curve::arrival(double level) const {
    if (*std::max_element(y_.begin(), y_.end()) < level) {
        return std::nullopt;
    }
    double below = 0;
    for (std::size_t i = 0; i + 1 < x_.size(); ++i) {
        const bool first = y_[i] < level, second = y_[i + 1] < level;
        const double share = first == second ? 1.0 : (level - std::min(y_[i], y_[i + 1])) / std::abs(y_[i + 1] - y_[i]);
        below += first || second ? share * (x_[i + 1] - x_[i]) : 0.0;
    }
    return x_.front() + below;
}

}  // namespace crampfit

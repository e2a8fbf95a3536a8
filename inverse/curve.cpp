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
    }
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

int Curve::count(double from, double to) const {
    return static_cast<int>(std::lower_bound(x_.begin(), x_.end(), to) - std::lower_bound(x_.begin(), x_.end(), from));
}

double Curve::error_of_mean(double from, double to) const {
    if (!(to - from > narrow * (x_.back() - x_.front()))) {
        const double at = std::clamp(0.5 * (from + to), x_.front(), x_.back());
        const auto above = std::max<std::ptrdiff_t>(1, std::lower_bound(x_.begin(), x_.end(), at) - x_.begin());
        if (x_.size() == 1) {
            return 1;
        }
        const auto i = static_cast<std::size_t>(above);
        const double s = (at - x_[i - 1]) / (x_[i] - x_[i - 1]);
        return std::hypot(1 - s, s);
    }
    double squares = 0, weight = std::max(0.0, std::min(to, x_.front()) - from);  // of the node at hand: what lies to its left
    for (std::size_t i = 0; i < x_.size(); ++i) {
        double next = 0;
        if (i + 1 < x_.size()) {
            const double low = std::max(from, x_[i]), high = std::min(to, x_[i + 1]);
            if (low < high) {
                const double part = (0.5 * (low + high) - x_[i]) / (x_[i + 1] - x_[i]);  // of the next node, in the mean
                weight += (1 - part) * (high - low);
                next = part * (high - low);
            }
        } else {
            weight += std::max(0.0, to - std::max(from, x_.back()));
        }
        squares += weight * weight;
        weight = next;
    }
    return std::sqrt(squares) / (to - from);
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

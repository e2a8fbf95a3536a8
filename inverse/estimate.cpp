#include "inverse/estimate.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>

namespace crampfit {
namespace {

constexpr int resamples = 1000;

// Between the two nearest of the sorted values.
double quantile(const std::vector<double>& sorted, double part) {
    const double place = part * static_cast<double>(sorted.size() - 1);
    const auto below = static_cast<std::size_t>(place);
    const std::size_t above = std::min(below + 1, sorted.size() - 1);
    return std::lerp(sorted[below], sorted[above], place - static_cast<double>(below));
}

}  // namespace

Estimate bootstrap(int rows, unsigned seed, const std::function<double(std::span<const int>)>& statistic) {
    if (rows < 2) {
        constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
        return {unknown, unknown, unknown};
    }
    std::vector<int> drawn(static_cast<std::size_t>(rows));
    std::iota(drawn.begin(), drawn.end(), 0);
    Estimate estimate{statistic(drawn), 0, 0};
    std::mt19937 generator(seed);
    std::vector<double> values;
    for (int i = 0; i < resamples; ++i) {
        for (int& row : drawn) {
            row = static_cast<int>(static_cast<std::uint64_t>(generator()) * static_cast<unsigned>(rows) >> 32);
        }
        values.push_back(statistic(drawn));
    }
    std::sort(values.begin(), values.end());
    estimate.lower_95 = quantile(values, 0.025);
    estimate.upper_95 = quantile(values, 0.975);
    return estimate;
}

}  // namespace crampfit

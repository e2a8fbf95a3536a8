#pragma once

#include <functional>
#include <span>
#include <vector>

namespace crampfit {

/// A number with its 95 % interval.
struct Estimate {
    double value = 0;
    double lower_95 = 0;
    double upper_95 = 0;
};

/// A statistic of `rows` observations with the interval of the percentile bootstrap (Efron and Tibshirani 1993, chapter
/// 13): the statistic is taken anew of rows drawn with replacement, 1000 times over. It is told which rows, by number.
/// Less than two rows: not a number.
Estimate bootstrap(int rows, unsigned seed, const std::function<double(std::span<const int>)>& statistic);

}  // namespace crampfit

#pragma once

#include <algorithm>
#include <vector>

namespace crampfit {

/// The value that this share of all lies at or below; 0 of none.
inline double quantile(std::vector<float> values, double share) {
    if (values.empty()) return 0;
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
}

}  // namespace crampfit

#include "inverse/force_path.hpp"

#include "forward/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

ForcePath::ForcePath(const std::vector<double>& lengths, const std::vector<double>& forces, double length_noise,
                     double force_noise)
    : noise_(length_noise, force_noise) {
    for (std::size_t i = 0; i < lengths.size(); ++i) {
        const Vec2 corner = Vec2(lengths[i], forces[i]).cwiseQuotient(noise_);
        if (corners_.empty() || corner != corners_.back()) {
            corners_.push_back(corner);
        }
    }
}

double ForcePath::distance(double length, double force) const {
    const Vec2 row = Vec2(length, force).cwiseQuotient(noise_);
    if (corners_.size() == 1) {
        return (row - corners_.front()).norm();
    }
    double least = std::numeric_limits<double>::infinity();
    Vec2 off = Vec2::Zero(), along = Vec2::Zero();
    for (std::size_t i = 0; i + 1 < corners_.size(); ++i) {
        const Vec2 step = corners_[i + 1] - corners_[i];
        const double part = std::clamp((row - corners_[i]).dot(step) / step.squaredNorm(), 0.0, 1.0);
        const Vec2 to_row = row - corners_[i] - part * step;
        if (to_row.squaredNorm() < least) {
            least = to_row.squaredNorm();
            off = to_row;
            along = step.normalized();
            // At a corner both of its sides say together on which side of the path a row is.
            if (part == 1.0 && i + 2 < corners_.size()) {
                along += (corners_[i + 2] - corners_[i + 1]).normalized();
            } else if (part == 0.0 && i > 0) {
                along += (corners_[i] - corners_[i - 1]).normalized();
            }
        }
    }
    return std::copysign(std::sqrt(least), cross(off, along));
}

}  // namespace crampfit

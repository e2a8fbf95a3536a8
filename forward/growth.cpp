#include "forward/growth.hpp"

#include <cmath>

namespace crampfit {

Vec2 growth_direction(GrowthDirection criterion, const CrackTip& tip, const TipLoad& load) {
    if (criterion == GrowthDirection::normal_to_opening) {
        // Normal to the opening displacement (Nairn 2007), on the side that lies ahead.
        const Vec2 normal = left_of(load.opening);
        if (std::abs(normal.dot(tip.direction)) > 0.1 * normal.norm())
            return normal.normalized() * (normal.dot(tip.direction) > 0 ? 1.0 : -1.0);
    }
    return tip.direction;
}

} // namespace crampfit

#pragma once

namespace crampfit {

/// Which way a picture's wood grew, from pith to bark. The picture's top is up: +y is up.
enum class GrowthAxis { right, left, up, down };

/// "+x", "-x", "+y" or "-y".
const char* name(GrowthAxis growth);

}  // namespace crampfit

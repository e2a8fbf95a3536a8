#pragma once

#include "datasets/fit.hpp"

#include <vector>

namespace crampfit {

/// How far each modelled curve is from the measured one, both as straight lines between the stations of `residuals`, which hold
/// the curves one after another. Frechet distance: the discrete one (Eiter and Mannila 1994) over the stations.
std::vector<CurveDistance> curve_distances(const std::vector<FitResidual>& residuals);

}  // namespace crampfit

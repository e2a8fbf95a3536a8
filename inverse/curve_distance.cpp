#include "inverse/curve_distance.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace crampfit {
namespace {

using Stations = std::span<const FitResidual>;

double range(Stations curve, double FitResidual::*member) {
    const auto [low, high] =
        std::minmax_element(curve.begin(), curve.end(), [&](const auto& a, const auto& b) { return a.*member < b.*member; });
    return (*high).*member - (*low).*member;
}

// Area between a straight line and the axis, from one end's height to the other's.
double unsigned_area(double width, double from, double to) {
    if (from * to >= 0) {
        return 0.5 * width * (std::abs(from) + std::abs(to));
    }
    return 0.5 * width * (from * from + to * to) / (std::abs(from) + std::abs(to));  // two triangles about the crossing
}

// The least, over all ways along both curves that never go back, of the longest leash (Eiter and Mannila 1994, table 1).
double frechet(Stations curve) {
    const double width = std::max(range(curve, &FitResidual::at), 1e-300),
                 height = std::max(range(curve, &FitResidual::measured), 1e-300);
    const std::size_t n = curve.size();
    std::vector<double> row(n);
    for (std::size_t i = 0; i < n; ++i) {
        double diagonal = 0;
        for (std::size_t j = 0; j < n; ++j) {
            const double leash =
                std::hypot((curve[i].at - curve[j].at) / width, (curve[i].measured - curve[j].modelled) / height);
            const double above = row[j];
            const double reached = i == 0 && j == 0 ? 0.0
                                   : i == 0         ? row[j - 1]
                                   : j == 0         ? above
                                                    : std::min({above, row[j - 1], diagonal});
            diagonal = above;
            row[j] = std::max(leash, reached);
        }
    }
    return row.back();
}

}  // namespace

std::vector<CurveDistance> curve_distances(const std::vector<FitResidual>& residuals) {
    std::vector<CurveDistance> distances;
    for (std::size_t begin = 0, end = 0; begin < residuals.size(); begin = end) {
        while (end < residuals.size() && residuals[end].experiment == residuals[begin].experiment &&
               residuals[end].kind == residuals[begin].kind) {
            ++end;
        }
        const Stations curve(residuals.data() + begin, end - begin);
        if (curve[0].kind != "force" && curve[0].kind != "arrival") {
            continue;  // no curve
        }
        CurveDistance& distance = distances.emplace_back();
        distance.experiment = curve[0].experiment;
        distance.kind = curve[0].kind;
        for (std::size_t i = 1; i < curve.size(); ++i) {
            const double width = curve[i].at - curve[i - 1].at;
            distance.area_measured += 0.5 * width * (curve[i - 1].measured + curve[i].measured);
            distance.area_modelled += 0.5 * width * (curve[i - 1].modelled + curve[i].modelled);
            distance.area_between +=
                unsigned_area(width, curve[i - 1].modelled - curve[i - 1].measured, curve[i].modelled - curve[i].measured);
        }
        distance.frechet = frechet(curve);
    }
    return distances;
}

}  // namespace crampfit

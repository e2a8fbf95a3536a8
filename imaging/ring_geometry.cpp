#include "imaging/ring_geometry.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace crampfit {
namespace {

constexpr double pi = std::numbers::pi;
constexpr std::size_t wave_count = 6;

// Waves come and go over about this many rings, so that neighbouring rings wave together.
constexpr double coherent_rings = 4;

// LW begins at about the same place in this many neighbouring files of cells.
constexpr double files_per_onset = 4;

enum Stream : std::uint64_t { wave_around, wave_inward, wave_phase, first_border, ring_width, latewood, onset };

double farthest_corner(const EndGrainOptions& options) {
    const Vec2 reach = (options.pith.cwiseAbs()).cwiseMax((options.size - options.pith).cwiseAbs());
    return reach.norm();
}

double nearest_point(const EndGrainOptions& options) {
    return (options.pith.cwiseMax(Vec2::Zero()).cwiseMin(options.size) - options.pith).norm();
}

/// Largest sum of the waves, in units of the waviness: each has amplitude sqrt(2 / n) for a joint variance of 1.
double crest() { return std::sqrt(2.0 * wave_count); }

}  // namespace

RingGeometry::RingGeometry(const EndGrainOptions& options, const RandomField& random)
    : options_(options), random_(random), near_(nearest_point(options)), far_(farthest_corner(options)) {
    const double around = 2 * pi * far_ / options.waviness_length;
    for (std::size_t i = 0; i < wave_count; ++i) {
        const double share = (static_cast<double>(i) + random.uniform(wave_around, i)) / wave_count;
        waves_[i].around = std::max(1.0, std::round(around * (0.6 + 0.8 * share)));
        waves_[i].inward = (2 * random.uniform(wave_inward, i) - 1) * 2 * pi / (coherent_rings * options.period);
        waves_[i].phase = 2 * pi * random.uniform(wave_phase, i);
    }
    lay_rings();
}

double RingGeometry::steepness(const EndGrainOptions& options) {
    // |d/dr (r / far) sum a cos(...)| <= crest (1 / far + largest phase change per length), as r <= far.
    return options.waviness * crest() * (1 / farthest_corner(options) + 2 * pi / (coherent_rings * options.period));
}

/// radius = r + waviness (r / far) sum over waves of sqrt(2 / n) cos(m angle + k r + phase). The factor r / far keeps
/// the warp smooth at the pith, where the angle is not defined.
RingGeometry::Warp RingGeometry::warp(double distance, double angle) const {
    const double amplitude = options_.waviness / far_ * std::sqrt(2.0 / wave_count);
    double sum = 0, along = 0, across = 0;
    for (const Wave& wave : waves_) {
        const double phase = wave.around * angle + wave.inward * distance + wave.phase;
        const double sine = std::sin(phase);
        sum += std::cos(phase);
        along -= wave.inward * sine;
        across -= wave.around * sine;
    }
    return {distance * (1 + amplitude * sum), 1 + amplitude * (sum + distance * along), amplitude * across};
}

RingGeometry::Place RingGeometry::at(const Vec2& position) const {
    const Vec2 arm = position - options_.pith;
    Place place;
    place.distance = arm.norm();
    place.angle = std::atan2(arm.y(), arm.x());
    const Warp warped = warp(place.distance, place.angle);
    const Vec2 outward(std::cos(place.angle), std::sin(place.angle));
    place.radius = warped.radius;
    place.gradient = warped.slope * outward + warped.turn * Vec2(-outward.y(), outward.x());
    return place;
}

/// Widths are log-normal, so that none is ever negative: ln of the width has variance ln(1 + (sd / mean)^2) and mean
/// ln(mean) less half of that. Latewood fractions are uniform over mean +- sqrt(3) sd, so that they stay within 0
/// and 1.
void RingGeometry::lay_rings() {
    const double variation = options_.period_sd / options_.period;
    const double log_variance = std::log1p(variation * variation);
    const double log_mean = std::log(options_.period) - log_variance / 2;
    const double slack = options_.waviness * crest() / far_;

    double radius = std::max(0.0, near_ * (1 - slack) - random_.uniform(first_border, 0) * options_.period);
    for (std::uint64_t i = 0; radius <= far_ * (1 + slack); ++i) {
        GrowthRing ring;
        ring.inner_radius = radius;
        radius += std::exp(log_mean + std::sqrt(log_variance) * random_.normal(ring_width, i));
        ring.outer_radius = radius;
        ring.latewood_fraction =
            options_.latewood_fraction + std::sqrt(3.0) * options_.latewood_fraction_sd * (2 * random_.uniform(latewood, i) - 1);
        const double earlywood = (1 - ring.latewood_fraction) * (ring.outer_radius - ring.inner_radius);
        ring.transition = std::min(options_.transition, earlywood);
        rings_.push_back(ring);
    }
}

/// Where LW begins at an angle, against the ring's mean [m].
double RingGeometry::onset_shift(std::size_t ring, double angle) const {
    const auto steps = std::max(1ll, std::llround(2 * pi * far_ / (files_per_onset * options_.cell_size)));
    const double along = angle / (2 * pi) * static_cast<double>(steps);
    return options_.onset_roughness * random_.smooth(onset, static_cast<double>(ring), along, steps);
}

double RingGeometry::degree(double radius, double angle) const {
    const auto ring = std::upper_bound(rings_.begin(), rings_.end(), radius,
                                       [](double r, const GrowthRing& other) { return r < other.outer_radius; });
    // Half a pixel beyond the last ring or before the first there is wood as well.
    if (ring == rings_.end()) {
        return 1;
    }
    const double mean = ring->outer_radius - ring->latewood_fraction * (ring->outer_radius - ring->inner_radius);
    const double shift = onset_shift(static_cast<std::size_t>(ring - rings_.begin()), angle);
    const double latewood = std::clamp(mean + shift, ring->inner_radius + ring->transition, ring->outer_radius);
    if (radius >= latewood) {
        return 1;
    }
    const double onset_radius = latewood - ring->transition;
    return radius <= onset_radius ? 0 : (radius - onset_radius) / ring->transition;
}

/// The distance from the pith at which the warped radius has a value, by bisection: it rises all along.
double RingGeometry::distance_of(double radius, double angle) const {
    const double slack = options_.waviness * crest() / far_;
    double low = radius / (1 + slack);
    double high = radius / (1 - slack);
    while (true) {
        const double middle = (low + high) / 2;
        if (middle <= low || middle >= high) {
            return middle;
        }
        (warp(middle, angle).radius < radius ? low : high) = middle;
    }
}

std::vector<RingBorder> RingGeometry::borders() const {
    // The block is seen from the pith within `span` to either side of its middle; from inside it, all around.
    const Vec2 middle = options_.size / 2 - options_.pith;
    const double centre = std::atan2(middle.y(), middle.x());
    double span = pi;
    if (near_ > 0) {
        span = 0;
        for (const Vec2& corner : {Vec2(0, 0), Vec2(options_.size.x(), 0), Vec2(0, options_.size.y()), options_.size}) {
            const Vec2 arm = corner - options_.pith;
            const double cross = middle.x() * arm.y() - middle.y() * arm.x();
            span = std::max(span, std::abs(std::atan2(cross, middle.dot(arm))));
        }
    }
    const auto steps = static_cast<long>(std::ceil(2 * span * far_ / options_.pixel));

    std::vector<RingBorder> borders;
    for (std::size_t i = 0; i < rings_.size(); ++i) {
        bool inside_before = false;
        for (long step = 0; step <= steps; ++step) {
            const double angle = centre + span * (2 * static_cast<double>(step) / static_cast<double>(steps) - 1);
            const Vec2 outward(std::cos(angle), std::sin(angle));
            const Vec2 point = options_.pith + distance_of(rings_[i].outer_radius, angle) * outward;
            const bool inside = (point.array() >= 0).all() && (point.array() <= options_.size.array()).all();
            if (inside && !inside_before) {
                borders.push_back({static_cast<int>(i), {}});
            }
            if (inside) {
                borders.back().points.push_back(point);
            }
            inside_before = inside;
        }
    }
    return borders;
}

}  // namespace crampfit

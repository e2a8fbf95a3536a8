#include "forward/growth.hpp"

#include "forward/near_tip_field.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <numbers>

namespace crampfit {

namespace {

Vec2 turned(const Vec2& direction, double angle) { return std::cos(angle) * direction + std::sin(angle) * left_of(direction); }

// Of the normal to an opening, on the side that lies ahead (Nairn 2007).
double normal_angle(const CrackTip& tip, const Vec2& opening) {
    const double along = opening.dot(tip.direction), across = cross(tip.direction, opening);
    return std::abs(across) > 0.1 * opening.norm() ? -std::atan(along / across) : 0.0;
}

// Mean over a straight way; a boundary across it is seen to 1/16 of it [J/m^2].
double toughness_along(const MaterialMap& materials, const Vec2& from, const Vec2& way) {
    constexpr int samples = 16;
    double sum = 0.0;
    for (int i = 0; i < samples; ++i) sum += materials.at(from + (i + 0.5) / samples * way).toughness;
    return sum / samples;
}

// Where a function of the angle is largest: of all whole degrees up to `most`, then of the parabola through its neighbours [rad].
template <class Function>
double largest_at(int most, Function function) {
    constexpr double degree = std::numbers::pi / 180.0;
    int best = 0;
    double largest = function(0.0);
    for (const int sense : {1, -1}) {
        for (int k = 1; k <= most; ++k) {
            const double here = function(sense * k * degree);
            if (here <= largest) continue;
            largest = here;
            best = sense * k;
        }
    }
    const double before = function((best - 1) * degree);
    const double after = function((best + 1) * degree);
    const double bend = before - 2.0 * largest + after;
    if (std::abs(best) == most || bend >= 0.0) return best * degree;
    const double refined = (best + 0.5 * (before - after) / bend) * degree;
    return function(refined) > largest ? refined : best * degree;
}

// The angle with the largest G / G_c, both of a short branch.
double weakest_angle(const CrackTip& tip, const TipLoad& load, const MaterialMap& materials, double increment) {
    constexpr int most = 80;                               // [degrees] as far as `branch_intensities` is good
    const double least_toughness = 1e-3 * load.toughness;  // a void has none: it draws the crack, but the ratio stays finite
    return largest_at(most, [&](double angle) {
        const Vec2 K = branch_intensities(angle, load.K_I, load.K_II);
        const double opening = std::max(0.0, K[0]);  // a branch whose faces touch has no mode I
        const Vec2 way = increment * turned(tip.direction, angle);
        const double toughness = materials.homogeneous() ? load.toughness : toughness_along(materials, tip.position, way);
        return (opening * opening + K[1] * K[1]) / std::max(least_toughness, toughness);
    });
}

// In orthotropic wood: of the near-tip field itself.
double hoop_stress_angle(const CrackTip& tip, const TipLoad& load, const MaterialMap& materials) {
    constexpr int most = 150;  // [degrees]
    const NearTipField field = near_tip_field(materials.at(tip.position).elasticity.stiffness(), tip.direction);
    return largest_at(most, [&](double angle) {
        const auto modes = field.at(1.0, angle);
        const Vec2 across(-std::sin(angle), std::cos(angle));
        return across.dot((load.K_I * modes[0].stress + load.K_II * modes[1].stress) * across);
    });
}

// How far K_I and K_II at a tip can be trusted, from 0 to 1: not within `near` of wood that is much stiffer or softer, ahead,
// behind or to a side, wholly from `far` on. Near it K is that of cells of several woods, and vanishes or grows without bound
// besides: crossing a photographed latewood band it has asked for turns of 40 degrees to either side within two cells, where
// cells half as wide ask for none; beside one it has turned cracks by 60 degrees into latewood, where they stood. Up to 2^`same`
// times the stiffness wood is the same, from 2^`other` times on another: between them trust falls, as with the way.
double trust_in_intensities(const CrackTip& tip, const MaterialMap& materials, double near, double far, double same,
                            double other) {
    constexpr int samples = 16, halvings = 10;
    if (materials.homogeneous()) return 1.0;
    const double here = materials.at(tip.position).plane_modulus();
    double doubt = 0.0;
    for (const Vec2& way : {tip.direction, Vec2(-tip.direction), left_of(tip.direction), Vec2(-left_of(tip.direction))}) {
        const auto otherness = [&](double distance) {
            const double modulus = materials.at(tip.position + distance * way).plane_modulus();
            if (modulus <= 0.0 || here <= 0.0) return 0.0;  // a void is no other wood
            return std::clamp((std::abs(std::log2(modulus / here)) - same) / std::max(other - same, 1e-9), 0.0, 1.0);
        };
        double before = 0.0;
        for (int i = 1; i <= samples && before < 1.0; ++i) {
            const double after = otherness(far * i / samples);
            double lower = far * (i - 1) / samples, upper = far * i / samples;
            for (int k = 0; k < halvings && after > before; ++k) {
                const double middle = 0.5 * (lower + upper);
                (otherness(middle) > 0.5 * (before + after) ? upper : lower) = middle;
            }
            doubt = std::max(doubt, after * std::clamp((far - upper) / (far - near), 0.0, 1.0));
            before = after;
        }
    }
    return 1.0 - doubt;
}

// Nairn's opening is that just behind the tip. What the grid shows there swings by 3 degrees with the tip's place in a cell, as
// points change sides; K_I and K_II, from a domain about the tip, tell it within 0.3. Near other wood, twice as stiff or half so,
// it is the better one, and a crack must not turn at once where the one takes over from the other.
double normal_to_opening(const CrackTip& tip, const TipLoad& load, const MaterialMap& materials, double increment,
                         bool may_turn) {
    const double by_grid = normal_angle(tip, load.opening);
    const LocalWood wood = materials.at(tip.position);
    if (!std::isfinite(load.K_I) || wood.plane_modulus() <= 0.0) return by_grid;  // a void has no K
    const double trust = trust_in_intensities(tip, materials, 0.5 * increment, increment, 1.0, 1.0);
    const NearTipField field = near_tip_field(wood.elasticity.stiffness(), tip.direction);
    const Vec2 opening = field.release() * Vec2(load.K_I, load.K_II);  // by K_I across, by K_II along
    const double by_intensities =
        may_turn ? normal_angle(tip, opening[0] * left_of(tip.direction) + opening[1] * tip.direction) : 0.0;
    return std::lerp(by_grid, by_intensities, trust);
}

}  // namespace

double hoop_stress_angle(double K_I, double K_II) {
    // Erdogan and Sih 1963: K_I sin t + K_II (3 cos t - 1) = 0, solved for tan(t / 2) without a difference of like numbers.
    const double size = K_I + std::sqrt(K_I * K_I + 8.0 * K_II * K_II);
    return size > 0.0 ? -2.0 * std::atan(2.0 * K_II / size) : 0.0;
}

Vec2 branch_intensities(double angle, double K_I, double K_II) {
    // Amestoy and Leblond 1992, the expansions of F_pq(m), for a branch much shorter than everything else, in one wood.
    constexpr double pi = std::numbers::pi;
    constexpr double p2 = pi * pi, p3 = p2 * pi, p4 = p2 * p2, p5 = p4 * pi, p6 = p3 * p3;
    const double m = angle / pi;
    const double s = m * m;
    const auto series = [s](std::initializer_list<double> factors) {
        double sum = 0.0;
        for (auto factor = std::rbegin(factors); factor != std::rend(factors); ++factor) sum = sum * s + *factor;
        return sum;
    };
    const double I_I = series({1.0, -3.0 * p2 / 8.0, p2 - 5.0 * p4 / 128.0, p2 / 9.0 - 11.0 * p4 / 72.0 + 119.0 * p6 / 15360.0,
                               5.07790, -2.88312, -0.0925, 2.996, -4.059, 1.63, 4.1});
    const double I_II = m * series({-1.5 * pi, 10.0 * pi / 3.0 + p3 / 16.0, -2.0 * pi - 133.0 * p3 / 180.0 + 59.0 * p5 / 1280.0,
                                    12.313906, -7.32433, 1.5793, 4.0216, -6.915, 4.21, 4.56});
    const double II_I =
        m * series({0.5 * pi, -4.0 * pi / 3.0 - p3 / 48.0, -2.0 * pi / 3.0 + 13.0 * p3 / 30.0 - 59.0 * p5 / 3840.0, -6.176023,
                    4.44112, -1.5340, -2.0700, 4.684, -3.95, -1.32});
    const double II_II = series({1.0, -4.0 - 3.0 * p2 / 8.0, 8.0 / 3.0 + 29.0 * p2 / 18.0 - 5.0 * p4 / 128.0,
                                 -32.0 / 15.0 - 4.0 * p2 / 9.0 - 1159.0 * p4 / 7200.0 + 119.0 * p6 / 15360.0, 10.58254, -4.78511,
                                 -1.8804, 7.280, -7.591, 0.25, 12.5});
    return {I_I * K_I + I_II * K_II, II_I * K_I + II_II * K_II};
}

bool steered_by_intensities(GrowthDirection criterion) {
    return criterion == GrowthDirection::hoop_stress || criterion == GrowthDirection::energy_release_rate;
}

double least_leg_in_cells(const CrackLine& line, bool at_end) {
    constexpr double usual = 1.0, after_sharp_turn = 1.5, sharp = 20.0 * std::numbers::pi / 180.0;
    const std::vector<Vec2>& x = line.points;
    if (x.size() < 3) return usual;
    const std::size_t corner = at_end ? x.size() - 2 : 1;
    const Vec2 before = x[corner] - x[corner - 1], after = x[corner + 1] - x[corner];
    return std::abs(std::atan2(cross(before, after), before.dot(after))) > sharp ? after_sharp_turn : usual;
}

Vec2 growth_direction(GrowthDirection criterion, const CrackTip& tip, TipLoad load, const MaterialMap& materials,
                      double increment, bool may_turn) {
    if (steered_by_intensities(criterion)) {
        if (!may_turn) return tip.direction;
        // From wood of 1.4 to wood of 2.8 times the stiffness: no small change of a modulus, by which a pixel would count or not,
        // turns a crack.
        const double trust = trust_in_intensities(tip, materials, 0.75 * increment, 1.25 * increment, 0.5, 1.5);
        load.K_I = std::lerp(std::hypot(load.K_I, load.K_II), load.K_I, trust);
        load.K_II *= trust;
    }
    constexpr double rounding = 1e-7;  // [rad]; a crack on a line of symmetry, often one of the grid, would leave it by a hair
    const auto by_criterion = [&]() -> Vec2 {
        switch (criterion) {
        case GrowthDirection::straight:
            return tip.direction;
        case GrowthDirection::normal_to_opening:
            return turned(tip.direction, normal_to_opening(tip, load, materials, increment, may_turn)).normalized();
        case GrowthDirection::hoop_stress: {
            const double angle =
                materials.orthotropic() ? hoop_stress_angle(tip, load, materials) : hoop_stress_angle(load.K_I, load.K_II);
            return turned(tip.direction, angle).normalized();
        }
        case GrowthDirection::energy_release_rate:
            return turned(tip.direction, weakest_angle(tip, load, materials, increment)).normalized();
        }
        return tip.direction;
    };
    const Vec2 direction = by_criterion();
    return (direction - tip.direction).norm() < rounding ? tip.direction : direction;
}

}  // namespace crampfit

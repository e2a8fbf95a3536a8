#pragma once

#include "datasets/experiment.hpp"
#include "datasets/record.hpp"
#include "inverse/fit.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <random>
#include <vector>

namespace crampfit::testing {

/// A cantilever-like splitting test in closed form. The crack of length a moves when G = (F a)^2 / c reaches the
/// toughness at a, which swings between earlywood's and latewood's with the rings; under rising displacement the crack
/// stands at the largest a that every displacement so far has allowed: it waits in front of latewood and jumps behind
/// it.
struct FakeWedge {
    double first_length = 2e-3;         // [m]
    double last_length = 10e-3;         // [m]
    double ring = 2e-3;                 // [m]
    double sharpness = 2.0;             // of the latewood bands; at 1 with a small contrast the crack never jumps
    double last_displacement = 0.6e-3;  // [m]

    double toughness(double a, double earlywood, double latewood) const {
        const double wave = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * a / ring);
        return earlywood + (latewood - earlywood) * std::pow(wave, sharpness);
    }
    double critical_displacement(double a, double earlywood, double latewood) const {
        return 0.6 * std::sqrt(toughness(a, earlywood, latewood)) * a * a;  // [m]
    }
    double stiffness(double a) const { return 3e-4 / (a * a * a); }  // F / u [N/m]

    /// `rows` instants evenly spread over the displacement.
    Record operator()(double earlywood, double latewood, int rows = 800) const {
        constexpr int lengths = 4000;
        const auto length = [&](int i) { return first_length + (last_length - first_length) * i / lengths; };
        Record record;
        int i = 0;
        double needed = critical_displacement(first_length, earlywood, latewood), before = needed;
        for (int row = 0; row < rows; ++row) {
            const double u = last_displacement * row / (rows - 1);
            while (i < lengths && needed <= u) {
                before = needed;
                needed = std::max(needed, critical_displacement(length(++i), earlywood, latewood));
            }
            Instant instant;
            instant.displacement = u;
            instant.time = u / 2.0;
            instant.crack_length = i == 0 ? first_length
                                   : needed > u && needed > before
                                       ? std::lerp(length(i - 1), length(i), (u - before) / (needed - before))
                                       : length(i);
            instant.force = stiffness(instant.crack_length) * u;
            record.series.push_back(instant);
        }
        return record;
    }

    Record operator()(const Scene& scene) const {
        return (*this)(scene.materials.at("EW").toughness, scene.materials.at("LW").toughness);
    }
};

/// Rows of a test: what the record has, with normal noise.
inline Curves measure(const Record& record, double force_noise, double length_noise, unsigned seed) {
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    Curves curves;
    for (const Instant& instant : record.series) {
        curves.time.push_back(instant.time);
        curves.displacement.push_back(instant.displacement);
        curves.force.push_back(instant.force + force_noise * normal(generator));
        curves.crack_length.push_back(instant.crack_length + length_noise * normal(generator));
    }
    return curves;
}

inline Parameter toughness_parameter(const char* wood, double initial) {
    Parameter parameter;
    parameter.name = std::string(wood) + " toughness";
    parameter.keys = {std::string("materials.") + wood + ".toughness"};
    parameter.initial = initial;
    parameter.lower = 20;
    parameter.upper = 400;
    parameter.unit = "J/m^2";
    parameter.scale = Scale::logarithmic;
    return parameter;
}

constexpr double true_earlywood = 110;  // [J/m^2]
constexpr double true_latewood = 180;   // [J/m^2]

/// A study of EW and LW toughness on a fake wedge test.
inline Study wedge_study(const FakeWedge& wedge, double force_noise = 0, double length_noise = 0, unsigned seed = 1) {
    Study study;
    Experiment experiment;
    experiment.name = "wedge";
    experiment.scene.materials["EW"] = {40e6, 0.33, 300, 100};
    experiment.scene.materials["LW"] = {1200e6, 0.33, 900, 100};
    experiment.scene.cracks.emplace_back().grows = Growth::end;
    experiment.data = measure(wedge(true_earlywood, true_latewood), force_noise, length_noise, seed);
    experiment.noise.force = force_noise > 0 ? force_noise : 0.1;
    experiment.noise.crack_length = length_noise > 0 ? length_noise : 1e-4;
    study.experiments.push_back(experiment);
    study.parameters = {toughness_parameter("EW", 80), toughness_parameter("LW", 250)};
    return study;
}

/// The same number in [0, 1) for the same bits of two numbers: noise that depends on the parameters as a solver's does.
inline double scramble(double a, double b) {
    std::uint64_t bits[2];
    std::memcpy(&bits[0], &a, 8);
    std::memcpy(&bits[1], &b, 8);
    std::uint64_t h = bits[0] * 0x9E3779B97F4A7C15ull + bits[1];
    h = (h ^ (h >> 30)) * 0xBF58476D1CE4E5B9ull;
    h = (h ^ (h >> 27)) * 0x94D049BB133111EBull;
    return static_cast<double>((h ^ (h >> 31)) >> 11) / 9007199254740992.0;  // 2^53
}

inline FitOptions with(const FakeWedge& wedge, int threads = 1) {
    FitOptions options;
    options.threads = threads;
    options.forward = [wedge](const Scene& scene, const std::atomic<bool>*) { return wedge(scene); };
    return options;
}

/// What an explicit run does to the curves: a vibration whose size and phase change with every parameter.
inline Forward noisy(const FakeWedge& wedge, double size) {
    return [wedge, size](const Scene& scene, const std::atomic<bool>*) {
        const double earlywood = scene.materials.at("EW").toughness;
        const double latewood = scene.materials.at("LW").toughness;
        Record record = wedge(scene);
        const double phase = 2 * std::numbers::pi * scramble(earlywood, latewood);
        const double amplitude = size * scramble(latewood, earlywood);
        for (Instant& instant : record.series) {
            instant.force *= 1 + amplitude * std::sin(2 * std::numbers::pi * instant.displacement / 0.06e-3 + phase);
            instant.displacement += 0.02e-3 * amplitude * std::sin(phase);
        }
        return record;
    };
}

}  // namespace crampfit::testing

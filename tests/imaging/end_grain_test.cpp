// Synthetic end grain against what was asked of it. Random quantities are held to 4 standard errors of their mean,
// which a right generator misses once in 16,000 seeds; the seeds are fixed.
#include "imaging/end_grain.hpp"
#include "imaging/random_field.hpp"
#include "imaging/ring_geometry.hpp"

#include "datasets/error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <tuple>

using namespace crampfit;

namespace {

using std::numbers::pi;

/// FNV-1a (Fowler, Noll and Vo), 64 bit.
std::uint64_t hash(const std::vector<std::uint8_t>& bytes) {
    std::uint64_t value = 0xcbf29ce484222325u;
    for (const std::uint8_t byte : bytes) value = (value ^ byte) * 0x100000001b3u;
    return value;
}

/// A long strip of about sixty narrow rings, drawn without what hides them.
EndGrainOptions plain_strip() {
    EndGrainOptions options;
    options.size = {60e-3, 2e-3};
    options.pixel = 50e-6;
    options.pith = {-50e-3, 1e-3};
    options.period = 1e-3;
    options.period_sd = 0.15e-3;
    options.latewood_fraction = 0.3;
    options.latewood_fraction_sd = 0.02;
    options.transition = 0;
    options.onset_roughness = 0;
    options.waviness = 0;
    options.ray_contrast = options.texture = options.mottle = options.noise = options.illumination = 0;
    return options;
}

/// The waviest block that is allowed.
EndGrainOptions wavy_block() {
    EndGrainOptions options;
    options.waviness = 0.15e-3;
    EXPECT_GT(RingGeometry::steepness(options), 0.3);
    return options;
}

template <class Values>
double mean(const Values& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double standard_deviation(const std::vector<double>& values) {
    const double centre = mean(values);
    double sum = 0;
    for (const double value : values) sum += (value - centre) * (value - centre);
    return std::sqrt(sum / static_cast<double>(values.size() - 1));
}

}  // namespace

TEST(UnitRandomField, ValuesAreThoseOfTheFormula) {
    // By an independent program in whole numbers of any length (SplitMix64's own first output for seed 0 checked
    // there).
    EXPECT_EQ(RandomField(1).uniform(2, 3), 0.4175580595044027);
    EXPECT_EQ(RandomField(0).uniform(0, 0), 0.13870941014555427);
    EXPECT_EQ(RandomField(~0ull).uniform(7, 1'000'000'000'000), 0.6742422907014549);
    EXPECT_NEAR(RandomField(1).normal(2, 3), -1.592222226864897, 1e-14);
    EXPECT_NEAR(RandomField(5).normal(105, 1000), -0.2362122573172821, 1e-14);
}

TEST(UnitRandomField, MomentsAndContinuity) {
    const RandomField random(3);
    constexpr int n = 40'000;
    std::vector<double> normal(n), line(n), plane(n);
    for (int i = 0; i < n; ++i) {
        normal[i] = random.normal(0, i);
        line[i] = random.smooth(1, i * 2.61803398875);
        plane[i] = random.smooth(2, i * 2.61803398875, i * 1.7320508, 1'000'000);
    }
    for (const auto* values : {&normal, &line, &plane}) {
        // Neighbours share lattice points at most pairwise: at most half of the values count as independent.
        EXPECT_NEAR(mean(*values), 0, 4 / std::sqrt(n / 2.0));
        EXPECT_NEAR(standard_deviation(*values), 1, 4 / std::sqrt(n));
    }
    // Continuous at the lattice and around the seam.
    EXPECT_NEAR(random.smooth(1, -3 - 1e-9), random.smooth(1, -3 + 1e-9), 1e-7);
    EXPECT_NEAR(random.smooth(2, 0.3, 5 - 1e-9, 5), random.smooth(2, 0.3, 0, 5), 1e-7);
    EXPECT_NEAR(random.smooth(2, 0.3, -1.25, 5), random.smooth(2, 0.3, 3.75, 5), 1e-12);
}

TEST(UnitEndGrain, TheSameSeedGivesTheSamePictureOnAnyMachine) {
    EndGrainOptions options;
    options.seed = 5;  // the packaged sample, whose pixels another program hashed to the same
    EXPECT_EQ(hash(grow_end_grain(options).bgr), 0xa31a6c2b85850edfu);
    options.seed = 6;
    EXPECT_EQ(hash(grow_end_grain(options).bgr), 0x7fa6dd0684b7798du);
}

TEST(UnitEndGrain, MapsHaveThePicturesShapeAndSayTheSame) {
    EndGrainOptions options;
    options.size = {4e-3, 3e-3};
    const EndGrain grown = grow_end_grain(options);
    EXPECT_EQ(grown.columns, 160);
    EXPECT_EQ(grown.rows, 120);
    const std::size_t count = 160 * 120;
    EXPECT_EQ(grown.bgr.size(), 3 * count);
    EXPECT_EQ(grown.gray.size(), count);
    const Specimen& truth = grown.truth;
    EXPECT_EQ(truth.columns, 160);
    EXPECT_EQ(truth.rows, 120);
    EXPECT_EQ(truth.pixel, options.pixel);
    EXPECT_EQ(truth.classes, (std::vector<std::string>{"EW", "LW"}));
    ASSERT_EQ(grown.degree.size(), count);
    ASSERT_EQ(truth.label.size(), count);
    ASSERT_EQ(truth.grade.size(), count);
    ASSERT_EQ(truth.orientation.size(), count);
    for (std::size_t i = 0; i < count; ++i) {
        EXPECT_EQ(truth.label[i] + truth.grade[i], grown.degree[i]);
        EXPECT_TRUE(truth.orientation[i] >= 0 && truth.orientation[i] <= static_cast<float>(pi));
    }
}

TEST(UnitEndGrain, RingWidthsHaveTheMeanAndDeviationAskedFor) {
    EndGrainOptions options = plain_strip();
    options.size = {400e-3, 50e-6};
    const EndGrain grown = grow_end_grain(options);
    std::vector<double> widths;
    for (const GrowthRing& ring : grown.rings) {
        widths.push_back(ring.outer_radius - ring.inner_radius);
        EXPECT_GT(widths.back(), 0);
        EXPECT_LE(std::abs(ring.latewood_fraction - 0.3), std::sqrt(3.0) * 0.02);
    }
    const double n = static_cast<double>(widths.size());
    EXPECT_NEAR(n, 400, 20);
    EXPECT_NEAR(mean(widths), 1e-3, 4 * 0.15e-3 / std::sqrt(n));
    EXPECT_NEAR(standard_deviation(widths), 0.15e-3, 4 * 0.15e-3 / std::sqrt(2 * n) * 1.1);  // 1.1: log-normal kurtosis
}

TEST(UnitEndGrain, LatewoodFractionIsTheOneAskedFor) {
    // Standard error from 60 rings, and the parts of rings at both ends, each at most f (1 - f) period of 60.
    const double tolerance = 4 * 0.02 / std::sqrt(60.0) + 2 * 0.3 * 0.7 / 60;
    EndGrainOptions options = plain_strip();
    EXPECT_NEAR(mean(grow_end_grain(options).degree), 0.3, tolerance);
    // A linear rise over `transition` adds half of it to each ring.
    options.transition = 0.2e-3;
    EXPECT_NEAR(mean(grow_end_grain(options).degree), 0.3 + 0.1, tolerance);
    // Where LW begins may vary along the ring, its mean does not.
    options.onset_roughness = 20e-6;
    options.waviness = 20e-6;
    EXPECT_NEAR(mean(grow_end_grain(options).degree), 0.3 + 0.1, tolerance);
}

TEST(UnitEndGrain, DegreeAlongARowFollowsTheRings) {
    EndGrainOptions options = plain_strip();
    options.size.y() = options.pixel;
    options.pith.y() = options.pixel / 2;
    options.transition = 0.2e-3;
    const EndGrain grown = grow_end_grain(options);
    for (int column = 0; column < grown.columns; ++column) {
        // Mean of the definition over the pixel by its own fine sum; 4 places a pixel leave 1/8 at a sharp border.
        double sum = 0;
        constexpr int places = 1000;
        for (int i = 0; i < places; ++i) {
            const double radius = (column + (i + 0.5) / places) * options.pixel - options.pith.x();
            const auto ring = std::find_if(grown.rings.begin(), grown.rings.end(),
                                           [&](const GrowthRing& r) { return radius < r.outer_radius; });
            ASSERT_NE(ring, grown.rings.end());
            const double width = ring->outer_radius - ring->inner_radius;
            const double before_latewood = ring->inner_radius + (1 - ring->latewood_fraction) * width - radius;
            sum += std::clamp(1 - before_latewood / options.transition, 0.0, 1.0);
        }
        EXPECT_NEAR(grown.degree[column], sum / places, 0.126) << column;
    }
}

TEST(UnitEndGrain, RingsNeverCross) {
    const EndGrainOptions options = wavy_block();
    const RingGeometry rings(options, RandomField(options.seed));
    for (int turn = -30; turn <= 30; ++turn) {
        const double angle = 0.01 * turn;
        double before = 0;
        for (int step = 1; step < 1000; ++step) {
            const Vec2 arm = 32e-6 * step * Vec2(std::cos(angle), std::sin(angle));
            const double radius = rings.at(options.pith + arm).radius;
            ASSERT_GT(radius, before) << "angle " << angle << ", step " << step;
            before = radius;
        }
    }
}

TEST(UnitEndGrain, RingNormalIsTheGradientOfTheWarpedRadius) {
    const EndGrainOptions options = wavy_block();
    const RingGeometry rings(options, RandomField(options.seed));
    for (const Vec2& at : {Vec2(1e-3, 1e-3), Vec2(9e-3, 4e-3), Vec2(5e-3, 9.9e-3)}) {
        const double h = 1e-7;  // [m]; central differences are off by (h / wavelength)^2 and rounding / h, some 1e-8
        const auto radius = [&](double x, double y) { return rings.at(at + Vec2(x, y)).radius; };
        const Vec2 expected((radius(h, 0) - radius(-h, 0)) / (2 * h), (radius(0, h) - radius(0, -h)) / (2 * h));
        EXPECT_LT((rings.at(at).gradient - expected).norm(), 1e-6);
    }
}

TEST(UnitEndGrain, BordersLieWhereLatewoodEndsSharply) {
    const EndGrainOptions options = wavy_block();
    const EndGrain grown = grow_end_grain(options);
    const RingGeometry rings(options, RandomField(options.seed));
    const auto degree_at = [&](const Vec2& point) -> std::optional<float> {
        const auto column = static_cast<int>(std::floor(point.x() / options.pixel));
        const auto row = grown.rows - 1 - static_cast<int>(std::floor(point.y() / options.pixel));
        if (column < 0 || column >= grown.columns || row < 0 || row >= grown.rows) return std::nullopt;
        return grown.degree[row * grown.columns + column];
    };
    std::size_t checked = 0;
    ASSERT_GE(grown.borders.size(), 3u);
    for (const RingBorder& border : grown.borders)
        for (const Vec2& point : border.points) {
            const RingGeometry::Place place = rings.at(point);
            EXPECT_NEAR(place.radius, grown.rings.at(border.ring).outer_radius, 1e-15);
            // Two pixels to either side lie clear of the border's own pixel.
            const Vec2 step = 2 * options.pixel * place.gradient.normalized();
            if (const auto before = degree_at(point - step), after = degree_at(point + step); before && after) {
                EXPECT_EQ(*before, 1);
                EXPECT_EQ(*after, 0);
                ++checked;
            }
        }
    EXPECT_GT(checked, 1000u);
}

TEST(UnitEndGrain, GrowthPointsAwayFromThePithWhereverItLies) {
    for (const Vec2& pith : {Vec2(-20e-3, 5e-3), Vec2(30e-3, 5e-3), Vec2(5e-3, -25e-3), Vec2(3e-3, 4e-3), Vec2(2e3, 1e3)}) {
        EndGrainOptions options;
        options.pixel = 100e-6;
        options.pith = pith;
        options.waviness = 0;
        const EndGrain grown = grow_end_grain(options);
        for (int row = 0; row < grown.rows; row += 7)
            for (int column = 0; column < grown.columns; column += 7) {
                const Vec2 arm = options.pixel * Vec2(column + 0.5, grown.rows - row - 0.5) - pith;
                const double angle = grown.truth.orientation[row * grown.columns + column];
                // Parallel to the line from the pith: a float angle is good to 2e-7.
                EXPECT_NEAR((arm.x() * std::sin(angle) - arm.y() * std::cos(angle)) / arm.norm(), 0, 1e-6);
            }
        EXPECT_GE(grown.borders.size(), 3u);
        for (std::size_t i = 1; i < grown.rings.size(); ++i)
            EXPECT_EQ(grown.rings[i].inner_radius, grown.rings[i - 1].outer_radius);
    }
}

TEST(UnitEndGrain, NoSeamWhereTheAngleJumps) {
    // With the pith to the right the angle jumps from -pi to pi along the middle of the block.
    EndGrainOptions options;
    options.pith = {30e-3, 5e-3};
    options.noise = 0;
    const EndGrain grown = grow_end_grain(options);
    const auto change = [&](int row) {
        double sum = 0;
        for (int column = 0; column < grown.columns; ++column)
            sum += std::abs(grown.gray[row * grown.columns + column] - grown.gray[(row + 1) * grown.columns + column]);
        return sum;
    };
    double largest_elsewhere = 0;
    for (int row = 100; row < 300; ++row)
        if (row != 199) largest_elsewhere = std::max(largest_elsewhere, change(row));
    EXPECT_LE(change(199), largest_elsewhere);
}

TEST(UnitEndGrain, NoiseTextureAndLightAreOfTheSizeAskedFor) {
    EndGrainOptions plain = plain_strip();
    const EndGrain without = grow_end_grain(plain);
    const auto deviation_with = [&](const std::function<void(EndGrainOptions&)>& change, int channel) {
        EndGrainOptions options = plain;
        change(options);
        const EndGrain with = grow_end_grain(options);
        std::vector<double> difference;
        for (std::size_t i = channel; i < with.bgr.size(); i += 3) difference.push_back(with.bgr[i] - without.bgr[i]);
        return standard_deviation(difference);
    };
    // Rounding to whole grays adds at most 1/6 to a variance of 16, 0.02 to the deviation; 48,000 pixels leave 0.01 of
    // it.
    for (const int channel : {0, 1, 2}) EXPECT_NEAR(deviation_with([](EndGrainOptions& o) { o.noise = 4; }, channel), 4, 0.1);
    // Green is 0.99 of gray in EW and 0.88 in LW here; cells are as large as pixels, so a tenth of them is still 5,000.
    EXPECT_NEAR(deviation_with([](EndGrainOptions& o) { o.texture = 4; }, 1), 4, 0.4);
    // Uniform light from 0.9 to 1.1 of a green of 208 or less.
    const double light = deviation_with([](EndGrainOptions& o) { o.illumination = 0.2; }, 1);
    EXPECT_GT(light, 78 * 0.2 / std::sqrt(12.0));
    EXPECT_LT(light, 208 * 0.2 / std::sqrt(12.0));
}

TEST(UnitEndGrain, RaysAreLighterLinesOfTheMeanSpacingAskedFor) {
    EndGrainOptions options = plain_strip();
    options.size = {2e-3, 60e-3};
    options.pixel = 20e-6;
    options.pith = {-400e-3, 30e-3};
    options.latewood_fraction = 0.5;
    const EndGrain without = grow_end_grain(options);
    options.ray_contrast = 0.5;
    options.ray_spacing = 0.6e-3;
    options.ray_width = 40e-6;
    const EndGrain with = grow_end_grain(options);
    double covered = 0, latewood = 0;
    for (std::size_t i = 0; i < with.gray.size(); ++i) {
        EXPECT_GE(with.gray[i] + 1, without.gray[i]);
        if (with.degree[i] == 1) {
            latewood += 1;
            covered += (with.gray[i] - without.gray[i]) / 0.5;
        }
    }
    // A ray's profile is a Gaussian of that width at half height, area width sqrt(pi / (4 ln 2)) = 1.064 width, times
    // the mean of smooth noise clamped to 0..1, which for a normal of the same variance is 0.3156. Rays stand at 0.95
    // of their number at the outermost ring. 100 rays with gaps: the standard error is some 0.1; a row of rays is
    // missed where two overlap.
    const double brighter = 0.114 * (186 - 50) + 0.587 * (220 - 78) + 0.299 * (236 - 132);
    EXPECT_NEAR(covered / latewood / brighter, 40.0 / 600 * 1.064 * 0.3156, 0.4 * 40.0 / 600 * 1.064 * 0.3156);
}

TEST(UnitEndGrain, BadOptionsAreNamed) {
    const double not_a_number = std::numeric_limits<double>::quiet_NaN();
    using Change = std::function<void(EndGrainOptions&, double)>;
    const std::vector<std::tuple<std::string, Change, std::vector<double>>> cases{
        {"pixel", [](auto& o, double v) { o.pixel = v; }, {0, -1, not_a_number, 1e-8}},
        {"size", [](auto& o, double v) { o.size.x() = v; }, {0, -1, not_a_number, 1e9, 10.01e-3}},
        {"pith", [](auto& o, double v) { o.pith.x() = v; }, {not_a_number, 1e9}},
        {"period", [](auto& o, double v) { o.period = v; }, {0, -1, not_a_number, 10e-6}},
        {"period_sd", [](auto& o, double v) { o.period_sd = v; }, {-1, not_a_number, 2e-3}},
        {"latewood_fraction", [](auto& o, double v) { o.latewood_fraction = v; }, {0, 1, not_a_number}},
        {"latewood_fraction_sd", [](auto& o, double v) { o.latewood_fraction_sd = v; }, {-0.1, not_a_number, 0.2}},
        {"transition", [](auto& o, double v) { o.transition = v; }, {-1e-3, not_a_number}},
        {"onset_roughness", [](auto& o, double v) { o.onset_roughness = v; }, {-1e-3, not_a_number}},
        {"waviness", [](auto& o, double v) { o.waviness = v; }, {-1e-6, not_a_number, 1e-3}},
        {"waviness_length", [](auto& o, double v) { o.waviness_length = v; }, {0, not_a_number}},
        {"ray_spacing", [](auto& o, double v) { o.ray_spacing = v; }, {0, not_a_number}},
        {"ray_width", [](auto& o, double v) { o.ray_width = v; }, {-1e-6, not_a_number}},
        {"ray_length", [](auto& o, double v) { o.ray_length = v; }, {0, not_a_number}},
        {"ray_contrast", [](auto& o, double v) { o.ray_contrast = v; }, {-0.1, 1.1, not_a_number}},
        {"earlywood", [](auto& o, double v) { o.earlywood[0] = v; }, {-1, 256, not_a_number}},
        {"latewood", [](auto& o, double v) { o.latewood[1] = v; }, {-1, 256, not_a_number}},
        {"ray", [](auto& o, double v) { o.ray[2] = v; }, {-1, 256, not_a_number}},
        {"cell_size", [](auto& o, double v) { o.cell_size = v; }, {0, not_a_number}},
        {"texture", [](auto& o, double v) { o.texture = v; }, {-1, not_a_number}},
        {"mottle", [](auto& o, double v) { o.mottle = v; }, {-1, not_a_number}},
        {"noise", [](auto& o, double v) { o.noise = v; }, {-1, not_a_number}},
        {"illumination", [](auto& o, double v) { o.illumination = v; }, {-1, 1, not_a_number}},
    };
    EXPECT_NO_THROW(EndGrainOptions{}.validate());
    for (const auto& [name, change, values] : cases)
        for (const double value : values) {
            EndGrainOptions options;
            change(options, value);
            try {
                grow_end_grain(options);
                ADD_FAILURE() << name << " = " << value << " was taken";
            } catch (const InputError& error) {
                EXPECT_EQ(error.key, name) << value;
                EXPECT_FALSE(error.rule.empty());
            }
        }
}

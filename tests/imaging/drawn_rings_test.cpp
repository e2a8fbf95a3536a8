// Drawn end grain whose truth is a formula, against the bars of borders, LW fraction, classes and orientation.
#include "imaging/ring_profile.hpp"
#include "imaging/segment.hpp"
#include "tests/imaging/pictures.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

using namespace crampfit;
using namespace crampfit::test;

namespace {

using std::numbers::pi;

using Field = std::function<double(double x, double y)>;

/// Means over 5 x 5 places in each pixel, blurred, under noise [grays].
cv::Mat drawn(cv::Size size, const Field& gray, double blur, double noise) {
    cv::Mat pixels(size, CV_32F), grain(size, CV_32F);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            double sum = 0;
            for (int i = 0; i < 25; ++i) sum += gray(x + (i % 5 - 2) / 5.0, y + (i / 5 - 2) / 5.0) / 25;
            pixels.at<float>(y, x) = static_cast<float>(sum);
        }
    if (blur > 0) cv::GaussianBlur(pixels, pixels, {}, blur);
    cv::RNG(7).fill(grain, cv::RNG::NORMAL, 0, noise);
    pixels += grain;
    pixels.convertTo(pixels, CV_8U);
    return pixels;
}

double mean(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value;
    return sum / static_cast<double>(values.size());
}

double at_share(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// Distances of the border's vertices from where the radius is a whole number of periods [px]. Beside the picture's edge but one
/// side of a border is seen.
std::vector<double> border_misses(const Specimen& specimen, const Field& radius, double period) {
    std::vector<double> misses;
    for (const BorderPolyline& border : specimen.borders)
        for (const Eigen::Vector2d& point : border.points)
            if (point.x() > 5 && point.x() < specimen.columns - 6)
                misses.push_back(std::abs(std::remainder(radius(point.x(), point.y()), period)));
    return misses;
}

std::vector<double> direction_errors(const Specimen& specimen, const Field& radius) {
    std::vector<double> errors;  // [deg]
    for (int y = 0; y < specimen.rows; y += 5)
        for (int x = 0; x < specimen.columns; x += 5) {
            const double dx = radius(x + 0.5, y) - radius(x - 0.5, y), dy = radius(x, y + 0.5) - radius(x, y - 0.5);
            const double found = specimen.orientation[static_cast<std::size_t>(y) * specimen.columns + x];
            errors.push_back(std::abs(std::remainder(found - std::atan2(-dy, dx), pi)) * 180 / pi);
        }
    return errors;
}

}  // namespace

// Drawn rings, whose EW is the picture's even white and whose LW its black, are wood and no ground around a specimen; the
// direction of wavy ones is known: r + a sin(k theta r0) is constant along a ring. The others run askew and wave by 6 to 21
// degrees, under noise of 5 %, one of them out of focus. Bars of the borders and of the orientation as above.
TEST(VerificationDrawnRings, Wavy) {
    const struct {
        const char* name;
        cv::Point2d pith;
        double a, wave;            // amplitude, length of the waves [px]
        double dark, noise, blur;  // of LW, standard deviation [grays], standard deviation [px]
    } cases[] = {{"drawn", {-1200, 180}, 2, 140, 0, 0, 0},
                 {"askew", {-600, 1000}, 2, 120, 70, 0.05 * 255, 0},
                 {"steep waves askew", {-600, 1000}, 6, 140, 70, 0.05 * 255, 0},
                 {"short steep waves", {-1200, 180}, 5, 80, 70, 0.05 * 255, 0.7},
                 {"out of focus", {-1200, 180}, 2, 140, 70, 0.05 * 255, 2}};
    const cv::Size size(500, 400);
    constexpr double period = 50;
    for (const auto& [name, pith, a, wave, dark, noise, blur] : cases) {
        const double r0 = std::hypot(250 - pith.x, 200 - pith.y), light = noise > 0 ? 130 : 255;
        const Field radius = [&](double x, double y) {
            const double theta = std::atan2(y - pith.y, x - pith.x);
            return std::hypot(x - pith.x, y - pith.y) + a * std::sin(2 * pi / wave * theta * r0);
        };
        const auto gray = [&](double x, double y) { return dark + (std::fmod(radius(x, y), period) < 0.7 * period ? light : 0); };
        const Specimen specimen = segment_pixels(drawn(size, gray, blur, noise), {.growth = GrowthAxis::right}).specimen;
        std::size_t crossing = 0;  // at the picture's middle row, three pixels within
        for (int x = 4; x < size.width - 3; ++x)
            crossing += std::floor(radius(x, 200) / period) > std::floor(radius(x - 1, 200) / period);
        EXPECT_GE(specimen.borders.size(), crossing) << name;  // others cut a corner
        const std::vector<double> misses = border_misses(specimen, radius, period), errors = direction_errors(specimen, radius);
        std::printf("%s: borders 99 %% within %.2f px; direction mean %.2f, 95 %% within %.2f deg\n", name,
                    at_share(misses, 0.99), mean(errors), at_share(errors, 0.95));
        EXPECT_LT(at_share(misses, 0.99), 1) << name;
        EXPECT_LT(mean(errors), 1) << name;
        EXPECT_LT(at_share(errors, 0.95), 3) << name;
    }
}

// Rings whose EW darkens from its very beginning and whose LW does to its very end, blurred, waving, under noise of 5 % and
// uneven light. LW is what lies beyond half of a ring's range (the
// half-range rule) in the wood, not in its blurred picture. Bars of the borders, of the LW fraction and of the classes.
TEST(VerificationDrawnRings, WithoutAPlateau) {
    const struct {
        const char* name;
        std::function<double(double)> degree;  // over the place in the ring, 0 to 1
        double latewood;                       // fraction
        double light;                          // from left to right, of its mean
    } cases[] = {{"saw-tooth", [](double x) { return x; }, 0.5, 0.2},
                 {"saw-tooth in light from one side", [](double x) { return x; }, 0.5, 0.8},
                 {"power", [](double x) { return std::pow(x, std::log(0.5) / std::log(0.7)); }, 0.3, 0.2},
                 {"kinked", [](double x) { return x < 0.7 ? 0.5 * x / 0.7 : 0.5 + 0.5 * (x - 0.7) / 0.3; }, 0.3, 0.2},
                 {"flat, then steep", [](double x) { return std::max(0.0, (x - 0.7) / 0.3); }, 0.15, 0.2},
                 {"half wave", [](double x) { return 0.5 - 0.5 * std::cos(pi * x); }, 0.5, 0.2}};
    const cv::Size size(500, 400);
    constexpr double period = 40;
    const Field radius = [](double x, double y) { return std::hypot(x + 700, y - 150) + 2 * std::sin(y / 20); };
    const auto place = [&](double x, double y) { return radius(x, y) / period - std::floor(radius(x, y) / period); };
    for (const auto& [name, degree, latewood, light] : cases) {
        const auto gray = [&, &of = degree, &side = light](double x, double y) {
            return (190 - 110 * of(place(x, y))) * (1 + side * (x / size.width - 0.5)) * 1.1 / (1 + side / 2);
        };
        const Specimen specimen = segment_pixels(drawn(size, gray, 0.7, 0.05 * 255), {.growth = GrowthAxis::right}).specimen;
        std::vector<double> off;  // of rings that are seen from the top to the bottom
        for (const RingFigures& ring : specimen.rings) {
            const auto whole = std::ranges::count_if(specimen.borders, [&](const BorderPolyline& border) {
                const double first = border.points.front().y(), last = border.points.back().y();
                return (border.ring == ring.ring || border.ring == ring.ring - 1) && std::min(first, last) < 3 &&
                       std::max(first, last) > size.height - 4;
            });
            if (whole == 2) off.push_back(ring.latewood_fraction - latewood);
        }
        EXPECT_GE(off.size(), 10u) << name;
        const auto [low, high] = std::ranges::minmax(off);
        double right = 0;
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x)
                right += specimen.label[static_cast<std::size_t>(y * size.width + x)] == (place(x, y) >= 1 - latewood);
        const double share = right / static_cast<double>(size.area());
        const std::vector<double> misses = border_misses(specimen, radius, period);
        std::printf("%s: borders 99 %% within %.2f px; LW fraction mean %+.2f, from %+.2f to %+.2f %%; classes %.2f %% right\n",
                    name, at_share(misses, 0.99), 100 * mean(off), 100 * low, 100 * high, 100 * share);
        EXPECT_LT(at_share(misses, 0.99), 1) << name;
        EXPECT_LT(std::max(high, -low), 0.02) << name;
        EXPECT_GT(share, 0.97) << name;
    }
}

// A few rings as broad as a third of the picture or more, whose LW would do for light from one side: it is LW for all that. Bars
// of the borders, of the LW fraction and of the classes; no border is found beyond those drawn.
TEST(VerificationDrawnRings, FewBroadRings) {
    const cv::Size size(600, 400);
    double miss = 0, late = 0, share = 1;
    for (const double period : {200.0, 260.0, 300.0, 340.0})
        for (const double start : {0.1, 0.35, 0.6, 0.85}) {
            const Field radius = [&](double x, double y) { return std::hypot(x + 1500, y - 150) - 1500 + start * period; };
            const auto place = [&](double x, double y) { return radius(x, y) / period - std::floor(radius(x, y) / period); };
            const auto gray = [&](double x, double y) { return place(x, y) < 0.7 ? 190.0 : 80.0; };
            const Specimen specimen = segment_pixels(drawn(size, gray, 0.7, 0.04 * 255), {.growth = GrowthAxis::right}).specimen;
            double right = 0;
            for (int y = 0; y < size.height; ++y)
                for (int x = 0; x < size.width; ++x)
                    right += specimen.label[static_cast<std::size_t>(y * size.width + x)] == (place(x, y) >= 0.7);
            const std::vector<double> misses = border_misses(specimen, radius, period);
            const double last = radius(size.width - 10, 200) / period, first = radius(10, 200) / period;
            EXPECT_GE(static_cast<double>(specimen.borders.size()), std::floor(last) - std::floor(first))
                << period << " " << start;
            for (const RingFigures& ring : specimen.rings) late = std::max(late, std::abs(ring.latewood_fraction - 0.3));
            miss = std::max(miss, at_share(misses, 0.99));
            if (specimen.borders.size() > 1) share = std::min(share, right / static_cast<double>(size.area()));
        }
    std::printf("borders 99 %% within %.2f px; LW fraction within %.2f %%; classes %.2f %% right\n", miss, 100 * late,
                100 * share);
    EXPECT_LT(miss, 1);
    EXPECT_LT(late, 0.02);
    EXPECT_GT(share, 0.97);
}

// Narrow windows see directions turn about a point here and there, where rings wave under noise: no pith, rings are traced.
TEST(VerificationDrawnRings, WavesAndNoiseAreNoPith) {
    constexpr double group = 3 * 60 + 3 * 16;  // three broad rings, three narrow ones
    const cv::Point2d waves[] = {{55, 0.8}, {58, 1.6}, {67, 1.6}, {55, 2.4}, {61, 0}, {64, 0.8}};  // length [px], phase
    for (const auto& [length, phase] : waves) {
        const auto gray = [length = length, phase = phase](double x, double y) {
            const double r = std::hypot(x + 3000, y - 200) - 2940 + 2 * std::sin(2 * pi * y / length + phase);
            const double place = r - group * std::floor(r / group),
                         ring = (place < 180 ? place : place - 180) / (place < 180 ? 60 : 16);
            return ring - std::floor(ring) < 0.7 ? 190.0 : 80.0;
        };
        const Segmentation result = segment_pixels(drawn({600, 400}, gray, 0.7, 0.06 * 255), {.growth = GrowthAxis::right});
        EXPECT_GE(result.specimen.borders.size(), 15u) << length << " " << phase;
        for (const std::string& note : result.notes) EXPECT_EQ(note.find("pith"), std::string::npos) << note;
    }
}

// The steps of two plain classes are alike both ways and straight rings have no pith: waves must not be taken for its arcs.
TEST(UnitDrawnRings, WavesDoNotTellTheGrowth) {
    for (const double phase : {0.0, 1.5, 3.0, 4.5}) {
        const auto gray = [phase](double x, double y) {
            const double r = x + 1000 + 3 * std::sin(2 * pi * y / 150 + phase);
            return r / 40 - std::floor(r / 40) < 0.7 ? 190.0 : 80.0;
        };
        const Segmentation result = segment_pixels(drawn({500, 400}, gray, 0.7, 10));
        EXPECT_TRUE(std::ranges::any_of(result.notes, [](const std::string& note) {
            return note.find("growth +x, by assumption") == 0;
        })) << phase;
    }
}

// A picture of one or two rings has more rises than falls, or fewer: with steps alike both ways its arcs tell the growth.
TEST(UnitDrawnRings, FewWideRingsTellTheGrowthByTheirArcs) {
    for (const double start : {430.0, 475.0, 520.0, 655.0}) {
        const auto gray = [start](double x, double y) {
            const double rings = (std::hypot(x + 600, y - 150) - start) / 265;
            return rings - std::floor(rings) < 0.7 ? 190.0 : 80.0;
        };
        const Segmentation result = segment_pixels(drawn({401, 301}, gray, 0.8, 5));
        EXPECT_TRUE(std::ranges::any_of(result.notes, [](const std::string& note) {
            return note.find("growth +x, by the rings' curvature") == 0;
        })) << start;
    }
}

// LW is not as dark in all rings: by 0.25 of its contrast (standard deviation) here. It is no void for that.
TEST(UnitDrawnRings, LatewoodDiffersFromRingToRing) {
    constexpr double darker[] = {0.1,  -0.3,  0.25, 0.0,  -0.2, 0.35,  -0.1, 0.3, -0.35,
                                 0.15, -0.05, 0.2,  -0.4, 0.05, -0.15, 0.4,  0.0};
    const auto gray = [&](double x, double) {
        const double ring = std::floor(x / 40);
        return x / 40 - ring < 0.75 ? 200.0 : 100 - 100 * darker[static_cast<int>(ring + 17) % 17];
    };
    const Specimen specimen = segment_pixels(drawn({680, 200}, gray, 0.7, 3), {.growth = GrowthAxis::right}).specimen;
    EXPECT_EQ(specimen.rings.size(), 15u);
    for (const RingFigures& ring : specimen.rings) {
        EXPECT_NEAR(ring.width, 40, 0.5) << ring.ring;
        EXPECT_NEAR(ring.latewood_fraction, 0.25, 0.02) << ring.ring;
    }
    EXPECT_EQ(std::ranges::count(specimen.label, Specimen::void_label), 0);
}

// A crack in EW that runs along its ring, as in RT tests, hides EW: its ring has no more LW for it.
TEST(UnitDrawnRings, ACrackAlongARingIsNoLatewood) {
    for (const double width : {3.0, 8.0}) {
        const auto gray = [width](double x, double) {
            if (std::abs(x - 310) < width / 2) return 10.0;
            return x / 50 - std::floor(x / 50) < 0.7 ? 190.0 : 90.0;
        };
        const Specimen specimen = segment_pixels(drawn({600, 200}, gray, 0.7, 3), {.growth = GrowthAxis::right}).specimen;
        EXPECT_EQ(specimen.rings.size(), 10u) << width;
        for (const RingFigures& ring : specimen.rings) EXPECT_NEAR(ring.latewood_fraction, 0.3, 0.02) << ring.ring;
        EXPECT_NEAR(static_cast<double>(std::ranges::count(specimen.label, Specimen::void_label)) / 200, width, 2) << width;
    }
}

// Strips much narrower than a ring, as a thin core shows them, along both axes.
TEST(UnitDrawnRings, AStripNarrowerThanARing) {
    const auto gray = [](double x, double) { return x / 200 - std::floor(x / 200) < 0.7 ? 190.0 : 80.0; };
    const cv::Mat along = drawn({900, 20}, gray, 0.7, 5);
    for (const cv::Mat& pixels : {along, cv::Mat(along.t())}) {
        const GrowthAxis growth = pixels.cols > pixels.rows ? GrowthAxis::right : GrowthAxis::down;
        const Specimen specimen = segment_pixels(pixels, {.growth = growth}).specimen;
        EXPECT_EQ(specimen.borders.size(), 4u);
        EXPECT_EQ(specimen.rings.size(), 3u);
        for (const RingFigures& ring : specimen.rings) EXPECT_NEAR(ring.latewood_fraction, 0.3, 0.02);
    }
}

// A ring's mean gray through a blur that is known: its integral is. The tolerance is half a step and what half a gray's noise
// does.
TEST(UnitRingProfile, SharpenedIsAsBeforeTheBlur) {
    constexpr double width = 30, blur = 1.2;
    const std::function<double(double)> profiles[] = {[](double x) { return x < 0.8 ? 190.0 : 80.0; },
                                                      [](double x) { return 190 - 110 * x; },
                                                      [](double x) { return 190 - 110 * std::max(0.0, (x - 0.7) / 0.3); }};
    const double latewood[] = {0.2, 0.5, 0.15};
    cv::RNG random(5);
    for (int i = 0; i < 3; ++i) {
        const auto gray = [&](double v) { return profiles[i](v / width - std::floor(v / width)); };
        RingProfile stretch(width), ring(width);
        for (double v = 0.02; v < width; v += 0.02) {
            double sum = 0, weight = 0;
            for (double d = -5 * blur; d <= 5 * blur; d += 0.02) {
                const double w = std::exp(-0.5 * d * d / (blur * blur));
                weight += w;
                sum += w * gray(v + d);
            }
            stretch.add(v / width, sum / weight + random.gaussian(0.5));
        }
        ring.add(stretch);
        const BorderGrays edge{gray(width - 1e-9), gray(0)};
        const SharpProfile sharp = ring.sharpened(blur, edge, edge);
        EXPECT_NEAR(sharp.earlywood, 190, 2) << i;
        EXPECT_NEAR(sharp.latewood, 80, 2) << i;
        EXPECT_NEAR(sharp.latewood_fraction, latewood[i], 0.5 / width) << i;
        EXPECT_LT(ring.seen().earlywood - ring.seen().latewood, 110 + 1) << i;
        RingProfile other(width);  // the same wood in other light
        for (double v = 0.02; v < width; v += 0.02) other.add(v / width, 10 + 0.9 * gray(v));
        RingProfile same(width);
        for (double v = 0.02; v < width; v += 0.02) same.add(v / width, gray(v));
        EXPECT_NEAR(same.line_to(other).first, 10, 1e-9) << i;
        EXPECT_NEAR(same.line_to(other).second, 0.9, 1e-9) << i;
    }
}

// Drawn rings in pictures that are hard to read: coloured light, grounds, cracks, hot pixels, no rings at all. Which pixel is
// what is known from the drawing.
#include "datasets/error.hpp"
#include "imaging/segment.hpp"
#include "tests/imaging/pictures.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <functional>

using namespace crampfit;
using namespace crampfit::test;

namespace {

/// Straight rings that grow to the right, askew.
struct DrawnWood {
    double period = 58, slope = 0.1;
    double early = 190, late = 90;  // [grays]
    double latewood = 0.25;         // fraction

    double turns(double x, double y) const { return (x + slope * y) / std::hypot(1, slope) / period + 0.4; }
    bool is_late(double x, double y) const { return turns(x, y) - std::floor(turns(x, y)) > 1 - latewood; }

    /// Means over 4 x 4 places in each pixel, blurred by 0.7 px.
    cv::Mat drawn(cv::Size size) const {
        cv::Mat gray(size, CV_32F);
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x) {
                int dark = 0;
                for (int i = 0; i < 16; ++i) dark += is_late(x + (i % 4 - 1.5) / 4, y + (i / 4 - 1.5) / 4);
                gray.at<float>(y, x) = static_cast<float>(early + (late - early) * dark / 16);
            }
        cv::GaussianBlur(gray, gray, {}, 0.7);
        return gray;
    }
    /// That cross the middle row, five pixels within.
    std::size_t borders(int columns, int row) const {
        return static_cast<std::size_t>(std::floor(turns(columns - 6, row)) - std::floor(turns(5, row)));
    }
};

cv::Mat with_noise(const cv::Mat& gray, double deviation, int depth = CV_8U, double scale = 1) {
    cv::Mat grain(gray.size(), CV_32F), pixels = gray.clone();
    cv::RNG(7).fill(grain, cv::RNG::NORMAL, 0, deviation);
    pixels += grain;
    pixels.convertTo(pixels, depth, scale);
    return pixels;
}

using Where = std::function<bool(double x, double y)>;

/// Share of the pixels there that are void.
double void_share(const Specimen& specimen, const Where& where) {
    double all = 0, voids = 0;
    for (int y = 0; y < specimen.rows; ++y)
        for (int x = 0; x < specimen.columns; ++x)
            if (where(x, y)) {
                ++all;
                voids += specimen.label[static_cast<std::size_t>(y) * specimen.columns + x] == Specimen::void_label;
            }
    return voids / all;
}

bool noted(const Segmentation& result, const std::string& phrase) {
    return std::ranges::any_of(result.notes, [&](const std::string& note) { return note.find(phrase) != std::string::npos; });
}

const cv::Size size(600, 500);

}  // namespace

// The light's own colour makes no wood foreign; ink of another colour on it still is.
TEST(VerificationHardPictures, ColouredLight) {
    const DrawnWood rings;
    const cv::Mat gray = with_noise(rings.drawn(size), 4, CV_32F);
    const auto written = [](int x, int y, int rim) { return std::abs(x - 300) < 15 + rim && std::abs(y - 250) < 60 + rim; };
    for (const cv::Vec3d& light : {cv::Vec3d(1.1, 1, 1), {1.25, 1.12, 1}, {1, 1.05, 1}, {1, 1.25, 1}, {0.6, 0.8, 1}}) {
        cv::Mat colour;
        cv::merge(std::vector<cv::Mat>{gray, gray, gray}, colour);
        colour(cv::Rect(286, 191, 29, 119)) = cv::Scalar(200, 110, 70);
        cv::multiply(colour, cv::Scalar(light[0], light[1], light[2]), colour);
        colour.convertTo(colour, CV_8U);
        const Specimen specimen = segment_pixels(colour, {.growth = GrowthAxis::right}).specimen;
        EXPECT_EQ(specimen.borders.size(), rings.borders(size.width, 250)) << light;
        EXPECT_LT(void_share(specimen, [](double, double) { return true; }), 0.001) << light;
        if (light[0] < 1) continue;  // as red as that, the ink is gray
        double inked = 0, marked = 0, beside = 0;
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x) {
                const bool mark =
                    specimen.feature[static_cast<std::size_t>(y * size.width + x)] == static_cast<int>(Feature::mark);
                inked += written(x, y, 0);
                marked += mark && written(x, y, 0);
                beside += mark && !written(x, y, 3);
            }
        EXPECT_GT(marked / inked, 0.99) << light;
        EXPECT_LT(beside / inked, 0.01) << light;
    }
}

// A block that lies askew on an even ground of any gray but that of its EW, under a camera's noise.
TEST(VerificationHardPictures, EvenGroundsOfAnyGray) {
    const DrawnWood rings{.slope = 0.2};
    const cv::Size whole(800, 700);
    const cv::Mat wood = with_noise(rings.drawn(whole), 4, CV_32F);
    for (const double degrees : {3.0, 17.0})
        for (const auto& [ground, noise] : {std::pair{10.0, 3.0}, {20.0, 0.0}, {40.0, 2.0}, {128.0, 2.0}, {225.0, 3.0}}) {
            const double c = std::cos(degrees * CV_PI / 180), s = std::sin(degrees * CV_PI / 180);
            const auto block = [&](double x, double y, double rim) {
                return std::abs((x - 400) * c - (y - 350) * s) < 280 + rim && std::abs((x - 400) * s + (y - 350) * c) < 200 + rim;
            };
            cv::Mat pixels = with_noise(cv::Mat(whole, CV_32F, cv::Scalar(ground)), noise, CV_32F);
            for (int y = 0; y < whole.height; ++y)
                for (int x = 0; x < whole.width; ++x)
                    if (block(x, y, 0)) pixels.at<float>(y, x) = wood.at<float>(y, x);
            pixels.convertTo(pixels, CV_8U);
            const Segmentation result = segment_pixels(pixels);
            const Specimen& specimen = result.specimen;
            std::size_t crossing = 0;  // of the block's middle row
            for (int x = 1; x < whole.width; ++x)
                crossing += block(x, 350, -5) && std::floor(rings.turns(x, 350)) > std::floor(rings.turns(x - 1, 350));
            EXPECT_GE(specimen.borders.size(), crossing) << ground << " at " << degrees;  // others cut a corner
            EXPECT_GT(void_share(specimen, [&](double x, double y) { return !block(x, y, 1); }), 0.995)
                << ground << " at " << degrees;
            EXPECT_LT(void_share(specimen, [&](double x, double y) { return block(x, y, -5); }), 0.002)
                << ground << " at " << degrees;
        }
}

// Rings in light that falls off toward the corners, as in a poor lens, lie on no ground.
TEST(VerificationHardPictures, FallingLightIsNoGround) {
    const DrawnWood rings{.slope = 0.0};
    cv::Mat gray = rings.drawn(size);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            gray.at<float>(y, x) *=
                static_cast<float>(1 - 0.3 * (std::pow((x - 300) / 390.0, 2) + std::pow((y - 250) / 390.0, 2)));
    for (const double noise : {0.5, 4.0})
        EXPECT_LT(void_share(segment_pixels(with_noise(gray, noise)).specimen, [](double, double) { return true; }), 0.001)
            << noise;
}

// Three corners in EW, little noise, and arcs of rings that reach two sides each: no ground.
TEST(VerificationHardPictures, ArcsAreNoGround) {
    for (const double noise : {0.0, 1.0, 3.0}) {
        cv::Mat gray(size, CV_32F);
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x) {
                const double turns = std::hypot(x + 60, y + 60) / 58 + 0.5;
                gray.at<float>(y, x) = turns - std::floor(turns) > 0.75 ? 90 : 190;
            }
        const Specimen specimen = segment_pixels(with_noise(gray, noise)).specimen;
        EXPECT_LT(void_share(specimen, [](double, double) { return true; }), 0.001) << noise;
        EXPECT_GE(specimen.borders.size(), 11u) << noise;
    }
}

// Cracks across the rings, right through the picture, and along them, of any width; wood beside them stays wood and every ring's
// LW fraction is within 2 % of what was drawn.
TEST(VerificationHardPictures, CracksOfAnyWidthAndWay) {
    const DrawnWood rings;
    const cv::Mat wood = with_noise(rings.drawn(size), 4, CV_32F);
    const auto across = [](double thickness) -> Where {
        return [=](double x, double y) { return std::abs(y - 250 - 8 * std::sin(x / 40)) < thickness / 2; };
    };
    const auto along = [&](double thickness) -> Where {
        return [=](double x, double y) {
            return std::abs(rings.turns(x, y) - std::floor(rings.turns(300, 250)) - 0.4) * rings.period < thickness / 2 &&
                   std::abs(y - 250) < 190;
        };
    };
    struct Crack {
        const char* name;
        double thickness;
        Where where;
    };
    std::vector<Crack> cracks;
    for (const double thickness : {4.0, 11.0, 14.0, 18.0, 24.0}) cracks.push_back({"across", thickness, across(thickness)});
    for (const double thickness : {3.0, 6.0, 10.0}) cracks.push_back({"along", thickness, along(thickness)});
    for (const auto& [name, thickness, where] : cracks) {
        cv::Mat pixels = wood.clone();
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x)
                if (where(x, y)) pixels.at<float>(y, x) = 15;
        cv::GaussianBlur(pixels, pixels, {}, 0.7);
        pixels.convertTo(pixels, CV_8U);
        const Specimen specimen = segment_pixels(pixels, {.growth = GrowthAxis::right}).specimen;
        const double found = void_share(specimen, where);
        const double beside = void_share(specimen, [&](double x, double y) {  // by more than a pixel and a half
            for (int i = -2; i <= 2; ++i)
                for (int j = -2; j <= 2; ++j)
                    if (where(x + i, y + j)) return false;
            return true;
        });
        double worst = 0;
        for (const RingFigures& ring : specimen.rings) worst = std::max(worst, std::abs(ring.latewood_fraction - rings.latewood));
        std::printf("%s %g px: %.1f %% of it void, %.2f %% of the wood; LW fraction worst %.2f %%\n", name, thickness,
                    100 * found, 100 * beside, 100 * worst);
        EXPECT_GT(found, 0.85) << name << thickness;  // its blurred rim is half a pixel to either side
        EXPECT_LT(beside, 0.002) << name << thickness;
        EXPECT_LT(worst, 0.02) << name << thickness;
        EXPECT_EQ(specimen.borders.size(), rings.borders(size.width, 250)) << name << thickness;
    }
}

// A hot pixel at the top of the range above a picture that uses a sixteenth of it.
TEST(VerificationHardPictures, AHotPixelSetsNoScale) {
    const DrawnWood rings;
    cv::Mat pixels = with_noise(rings.drawn(size), 4, CV_16U, 16);
    const Specimen expected = segment_pixels(pixels).specimen;
    ASSERT_EQ(expected.borders.size(), rings.borders(size.width, 250));
    pixels.at<std::uint16_t>(100, 100) = 65535;
    const Specimen specimen = segment_pixels(pixels).specimen;
    EXPECT_EQ(specimen.borders.size(), expected.borders.size());
    std::size_t differ = 0;
    for (std::size_t i = 0; i < specimen.label.size(); ++i) differ += specimen.label[i] != expected.label[i];
    EXPECT_LT(differ, 50u);  // about the pixel
}

// Rings about a pith at the picture's corner are cut off by its sides askew; along each radius LW is a quarter of a ring. Bar of
// the LW fraction.
TEST(VerificationHardPictures, LatewoodOfStronglyCurvedRings) {
    for (const cv::Point2d& pith : {cv::Point2d(-60, -60), {300, -80}}) {
        cv::Mat gray(size, CV_32F);
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x) {
                int dark = 0;
                for (int i = 0; i < 16; ++i) {
                    const double turns = std::hypot(x + (i % 4 - 1.5) / 4 - pith.x, y + (i / 4 - 1.5) / 4 - pith.y) / 58;
                    dark += turns - std::floor(turns) > 0.75;
                }
                gray.at<float>(y, x) = static_cast<float>(190 - 100 * dark / 16);
            }
        const Specimen specimen = segment_pixels(with_noise(gray, 3)).specimen;
        EXPECT_GE(specimen.rings.size(), 7u);
        double mean = 0;
        for (const RingFigures& ring : specimen.rings) {
            mean += ring.latewood_fraction / static_cast<double>(specimen.rings.size());
            EXPECT_NEAR(ring.latewood_fraction, 0.25, 0.02) << ring.ring;
        }
        EXPECT_NEAR(mean, 0.25, 0.003) << pith;  // a fifth of what noise leaves of one ring's
    }
}

// Nobody should take the LW fraction of rings that are but a few pixels wide without a word.
TEST(UnitHardPictures, NarrowRingsAreTold) {
    const auto told = [](double period) {
        const DrawnWood rings{.period = period};
        return noted(segment_pixels(with_noise(rings.drawn({300, 200}), 4), {.growth = GrowthAxis::right}), "LW fractions need");
    };
    EXPECT_TRUE(told(8));
    EXPECT_FALSE(told(40));
}

TEST(UnitHardPictures, CrossingBordersAreRefused) {
    const cv::Mat pixels = with_noise(DrawnWood{}.drawn(size), 4);
    SegmentOptions options{.growth = GrowthAxis::right};
    options.borders = {{1, {{100, 0}, {200, 499}}}, {2, {{200, 0}, {100, 499}}}, {3, {{300, 0}, {300, 499}}}};
    try {
        segment_pixels(pixels, options);
        ADD_FAILURE() << "borders that cross were taken";
    } catch (const InputError& error) {
        EXPECT_EQ(error.file, "--borders");
        EXPECT_EQ(error.value, "2");
        EXPECT_NE(error.rule.find("ring 1 at 150,250"), std::string::npos) << error.rule;
    }
    options.borders.erase(options.borders.begin());
    EXPECT_EQ(segment_pixels(pixels, options).specimen.rings.size(), 1u);
}

TEST(UnitHardPictures, OblongResolutionTagsAreRefused) {
    const TemporaryFolder folder;
    const auto file = folder / "a.tiff";
    ASSERT_TRUE(cv::imwrite(file.string(), with_noise(DrawnWood{}.drawn({200, 150}), 4),
                            {cv::IMWRITE_TIFF_XDPI, 1016, cv::IMWRITE_TIFF_YDPI, 508, cv::IMWRITE_TIFF_RESUNIT, 2}));
    try {
        segment(file, {});
        ADD_FAILURE() << "oblong pixels were taken";
    } catch (const InputError& error) {
        EXPECT_EQ(error.file, file.string());
        EXPECT_EQ(error.key, "resolution tag");
        EXPECT_EQ(error.value, "1016 x 508 dpi");
        EXPECT_NE(error.rule.find("--pixel"), std::string::npos);
    }
    const Segmentation told = segment(file, {.pixel = 25e-6});
    EXPECT_EQ(told.specimen.pixel, 25e-6);
    EXPECT_TRUE(noted(told, "oblong"));
}

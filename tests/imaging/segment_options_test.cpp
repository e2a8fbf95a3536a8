// What a user tells `segment` beside the picture, and specimens that do not fill theirs.
#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "imaging/end_grain.hpp"
#include "imaging/picture.hpp"
#include "imaging/segment.hpp"
#include "tests/imaging/pictures.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <cstdio>

using namespace crampfit;
using namespace crampfit::test;

namespace {

/// The picture turned about its middle, on an even ground that is larger than it.
cv::Mat turned_on(const cv::Mat& pixels, double degrees, const cv::Scalar& ground) {
    const cv::Point2d middle(0.5 * (pixels.cols - 1), 0.5 * (pixels.rows - 1));
    cv::Mat turn = cv::getRotationMatrix2D(middle, degrees, 1);
    const int side = static_cast<int>(std::ceil(std::hypot(pixels.cols, pixels.rows))) + 20;
    turn.at<double>(0, 2) += 0.5 * (side - pixels.cols);
    turn.at<double>(1, 2) += 0.5 * (side - pixels.rows);
    cv::Mat turned;
    cv::warpAffine(pixels, turned, turn, {side, side}, cv::INTER_CUBIC, cv::BORDER_CONSTANT, ground);
    return turned;
}

}  // namespace

// A block that lies askew on a black or a white ground gives the rings of the block alone, and the ground is void.
TEST(VerificationSegment, BlocksOnBlackAndOnWhite) {
    // Straight rings, so that their mean width does not hang on which stretch of them is seen.
    const cv::Mat pixels = picture_of(grow_end_grain({.size = {12e-3, 6e-3}, .pith = {-2.0, 3e-3}, .waviness = 0.0}));
    const Specimen alone = segment_pixels(pixels).specimen;
    ASSERT_GE(alone.rings.size(), 3u);
    for (const auto& [degrees, gray] : {std::pair{0.0, 0}, {15.0, 0}, {15.0, 255}, {-15.0, 250}}) {
        const cv::Mat shown = turned_on(pixels, degrees, cv::Scalar::all(gray));
        const Specimen specimen = segment_pixels(shown).specimen;
        ASSERT_EQ(specimen.rings.size(), alone.rings.size()) << degrees << " deg on " << gray;
        double worst = 0;
        for (std::size_t i = 0; i < alone.rings.size(); ++i)
            worst = std::max(worst, std::abs(specimen.rings[i].width / alone.rings[i].width - 1));
        const auto voids = std::count(specimen.label.begin(), specimen.label.end(), Specimen::void_label);
        const double ground = static_cast<double>(shown.total() - pixels.total());
        std::printf("%g degrees on gray %d: widths within %.2f %% of the block's alone, void %.2f %% of the ground\n", degrees,
                    gray, 100 * worst, 100 * static_cast<double>(voids) / ground);
        EXPECT_LT(worst, 0.01);
        EXPECT_NEAR(static_cast<double>(voids) / ground, 1, 0.05);  // its rim is taken with it
    }
}

TEST(UnitSegment, ClassesByGivenGrays) {
    cv::Mat pixels(60, 90, CV_8U, cv::Scalar(200));
    pixels.colRange(30, 60) = 90;
    pixels.colRange(60, 90) = 20;
    cv::Mat grain(pixels.size(), CV_8U);
    cv::RNG(3).fill(grain, cv::RNG::UNIFORM, 0, 9);
    pixels += grain;
    SegmentOptions options;
    options.gray = {{"dark", 80, 120}, {"bright", 150, 255}};
    const Specimen specimen = segment_pixels(pixels, options).specimen;
    EXPECT_EQ(specimen.classes, (std::vector<std::string>{"bright", "dark"}));
    const auto label = [&](int x) { return specimen.label[static_cast<std::size_t>(30 * 90 + x)]; };
    EXPECT_EQ(label(10), 0);
    EXPECT_EQ(label(45), 1);
    EXPECT_EQ(label(75), Specimen::void_label);
    options.gray = {{"dark", 80, 160}, {"bright", 150, 255}};
    EXPECT_THROW(segment_pixels(pixels, options), InputError);
    options.gray = {{"dark", 80, 120}, {"dark", 150, 255}};
    EXPECT_THROW(options.validate(), InputError);
    options.gray = {{"dark", 80, 256}};
    EXPECT_THROW(segment_pixels(pixels, options), InputError);
}

// LW is the class of that name, darker ones or not.
TEST(UnitSegment, LatewoodOfRingsIsTheClassOfThatName) {
    cv::Mat pixels = picture_of(grow_end_grain({}));
    double darkest = 0, brightest = 0;
    cv::minMaxLoc(pixels, &darkest, &brightest);
    ASSERT_GT(darkest, 10);
    const int middle = static_cast<int>(0.5 * (darkest + brightest));
    pixels(cv::Rect(20, 20, 6, 6)) = 2;
    SegmentOptions two, three;
    two.gray = {{"EW", middle, 255}, {"LW", 0, middle - 1}};
    three.gray = {{"EW", middle, 255}, {"LW", 6, middle - 1}, {"resin", 0, 5}};
    const std::vector<RingFigures> plain = segment_pixels(pixels, two).specimen.rings,
                                   resinous = segment_pixels(pixels, three).specimen.rings;
    ASSERT_EQ(plain.size(), resinous.size());
    ASSERT_GT(plain.size(), 2U);
    for (std::size_t i = 0; i < plain.size(); ++i) {
        EXPECT_GT(plain[i].latewood_fraction, 0.05);
        EXPECT_NEAR(resinous[i].latewood_fraction, plain[i].latewood_fraction, 0.02);
    }
}

TEST(UnitSegment, DirectionFromASecondPicture) {
    const cv::Mat pixels = picture_of(grow_end_grain({}));
    cv::Mat stripes(pixels.size(), CV_8U);
    for (int y = 0; y < stripes.rows; ++y)
        for (int x = 0; x < stripes.cols; ++x)
            // Brightest along 45 degrees.
            stripes.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(128 + 80 * std::sin(0.3 * (x - y)));
    const TemporaryFolder folder;
    ASSERT_TRUE(cv::imwrite((folder / "a.png").string(), pixels) && cv::imwrite((folder / "b.png").string(), stripes) &&
                cv::imwrite((folder / "c.png").string(), stripes.rowRange(0, 100)));
    const Specimen own = segment(folder / "a.png", {}).specimen;
    const Specimen other = segment(folder / "a.png", {.direction = folder / "b.png"}).specimen;
    EXPECT_EQ(other.label, own.label);
    for (const float angle : other.orientation) ASSERT_NEAR(angle, 0.25 * CV_PI, 0.02);  // x - y grows to the right and up
    EXPECT_THROW(segment(folder / "a.png", {.direction = folder / "c.png"}), InputError);
}

// Rings about a known pith outside the picture and in it, under noise of 5 %, a wide crack and a knot of noise across them; and
// straight ones. Bar of the directions: mean error 1 degree.
TEST(VerificationSegment, DirectionsFromAFittedPith) {
    for (const Vec2& pith : {Vec2(-250, 420), Vec2(200, 130), Vec2(-1e6, 150)}) {
        cv::Mat pixels(300, 400, CV_32F), grain(pixels.size(), CV_32F);
        for (int y = 0; y < pixels.rows; ++y)
            for (int x = 0; x < pixels.cols; ++x) {
                const double turns = std::hypot(x - pith.x(), y - pith.y()) / 30;
                pixels.at<float>(y, x) = turns - std::floor(turns) < 0.7 ? 200.0f : 90.0f;
            }
        cv::line(pixels, {300, 0}, {330, 299}, 20, 12);
        cv::RNG(7).fill(grain, cv::RNG::NORMAL, 0, 0.05 * 255);
        pixels += grain;
        cv::RNG(8).fill(pixels(cv::Rect(60, 60, 80, 80)), cv::RNG::UNIFORM, 60, 200);
        pixels.convertTo(pixels, CV_8U);
        const auto error_of = [&](const SegmentOptions& options) {
            const Segmentation result = segment_pixels(pixels, options);
            for (const std::string& note : result.notes)
                if (note.starts_with("pith")) std::printf("%s\n", note.c_str());
            double sum = 0;
            for (int y = 0; y < pixels.rows; ++y)
                for (int x = 0; x < pixels.cols; ++x) {
                    const double truth = std::atan2(pith.y() - y, x - pith.x());
                    const float found = result.specimen.orientation[static_cast<std::size_t>(y * pixels.cols + x)];
                    sum += std::abs(std::remainder(found - truth, CV_PI)) * 180 / CV_PI;
                }
            return sum / static_cast<double>(pixels.total());
        };
        const double own = error_of({}), fitted = error_of({.fit_pith = true});
        std::printf("pith at %g,%g px: directions off by %.2f degrees on average, of the fitted pith by %.2f\n", pith.x(),
                    pith.y(), own, fitted);
        EXPECT_LT(fitted, 1);
        EXPECT_LT(fitted, own);
        EXPECT_LT(error_of({.pith = pith}),
                  0.05);  // between nodes a direction is off by about the square of their spacing over the pith's distance
    }
}

// The wood of a specimen with a map of its density lies between EW and LW by that.
TEST(UnitSegment, DensityByATable) {
    const EndGrain grown = grow_end_grain({});
    const TemporaryFolder folder;
    ASSERT_TRUE(cv::imwrite((folder / "a.png").string(),
                            cv::Mat(grown.rows, grown.columns, CV_8U, const_cast<std::uint8_t*>(grown.gray.data()))));
    SegmentOptions options;
    options.pixel = grown.truth.pixel;
    options.density = DensityTable{{50, 210}, {1000, 200}};  // brighter is lighter, as in a print of an X-ray picture
    const Segmentation result = segment(folder / "a.png", options);
    for (std::size_t i = 0; i < grown.gray.size(); i += 97)
        ASSERT_NEAR(result.specimen.density[i], 1000 - 5.0 * std::clamp<int>(grown.gray[i] - 50, 0, 160), 1e-3);

    Scene scene;
    scene.file = "scene.toml";
    scene.specimen.file = folder / "specimen.h5";
    scene.materials["EW"] = {100e6, 0.3, 400, 100};
    scene.materials["LW"] = {900e6, 0.3, 800, 100};
    write(result.specimen, scene.specimen.file);
    load_specimen(scene);
    const Specimen& map = *scene.specimen.map;
    EXPECT_EQ(map.classes, (std::vector<std::string>{"EW", "LW"}));
    for (std::size_t i = 0; i < map.label.size(); ++i)  // what the exponents of density take: linear in density
        ASSERT_NEAR(map.label[i] + map.grade[i], std::clamp((result.specimen.density[i] - 400.0) / 400.0, 0.0, 1.0), 1e-5);
    scene.materials["LW"].density = 400;
    EXPECT_THROW(load_specimen(scene), InputError);
}

// The negative of a picture shows the same wood where a table of density, or ranges of gray, say that LW is its brighter part.
TEST(UnitSegment, BrightLatewood) {
    const EndGrain grown = grow_end_grain({});
    const cv::Mat dark(grown.rows, grown.columns, CV_8U, const_cast<std::uint8_t*>(grown.gray.data())), bright = 255 - dark;
    const SegmentOptions told{.growth = GrowthAxis::right};
    SegmentOptions by_density = told, by_gray = told;
    by_density.density = DensityTable{{0, 255}, {100, 1000}};
    by_gray.gray = {{"EW", 0, 110}, {"LW", 111, 255}};
    const Specimen expected = segment_pixels(dark, told).specimen, dense = segment_pixels(bright, by_density).specimen,
                   gray = segment_pixels(bright, by_gray).specimen;
    ASSERT_GE(expected.rings.size(), 3u);
    ASSERT_EQ(dense.rings.size(), expected.rings.size());
    ASSERT_EQ(gray.rings.size(), expected.rings.size());
    EXPECT_EQ(gray.classes, (std::vector<std::string>{"EW", "LW"}));
    for (std::size_t i = 0; i < expected.rings.size(); ++i) {
        EXPECT_NEAR(dense.rings[i].width, expected.rings[i].width, 0.1);
        EXPECT_NEAR(gray.rings[i].width, expected.rings[i].width, 0.1);
        EXPECT_NEAR(dense.rings[i].latewood_fraction, expected.rings[i].latewood_fraction, 0.01);
        EXPECT_NEAR(gray.rings[i].latewood_fraction, expected.rings[i].latewood_fraction, 0.05);  // the range is a guess
    }
}

// Bright dots in LW are canals and no rays; LW fractions do not count them.
TEST(UnitSegment, ResinCanalsAreKeptApart) {
    const EndGrain grown = grow_end_grain({.ray_contrast = 0.0});
    cv::Mat pixels = picture_of(grown);
    std::vector<cv::Point> canals;
    for (int y = 40; y < grown.rows - 40; y += 60)
        for (int x = 20; x < grown.columns - 20; ++x) {
            bool inside = true;  // of LW
            for (int d = -8; d <= 8; ++d)
                inside = inside && grown.degree[static_cast<std::size_t>(y * grown.columns + x + d)] > 0.95f;
            if (inside) {
                canals.emplace_back(x, y);
                cv::circle(pixels, canals.back(), 3, {220, 235, 240}, cv::FILLED);
                x += 30;
            }
        }
    ASSERT_GT(canals.size(), 8u);
    const Specimen specimen = segment_pixels(pixels).specimen;
    std::size_t found = 0;
    for (const cv::Point& canal : canals)
        found += specimen.feature[static_cast<std::size_t>(canal.y * grown.columns + canal.x)] ==
                 static_cast<int>(Feature::resin_canal);
    const auto marked =
        std::count(specimen.feature.begin(), specimen.feature.end(), static_cast<std::uint8_t>(Feature::resin_canal));
    std::printf("%zu of %zu canals found, %ld pixels marked\n", found, canals.size(), static_cast<long>(marked));
    EXPECT_GE(found, canals.size() - 1);
    EXPECT_LT(marked, static_cast<long>(60 * canals.size()));
}

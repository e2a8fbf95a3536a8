// The packaged ring picture, read as the packaged scenes read it, against the truth that it was drawn from.
#include "imaging/end_grain.hpp"
#include "imaging/picture.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>

using namespace crampfit;

namespace {

const std::filesystem::path sample = std::filesystem::path(SAMPLES) / "rings.png";

EndGrain drawn() {
    EndGrainOptions options;
    options.seed = 5;
    return grow_end_grain(options);
}

Specimen read_sample() {
    Picture picture;
    picture.file = sample;
    picture.pixel = 25e-6;
    picture.classes = {{"EW", 198, 255}, {"LW", 0, 102}};
    picture.graded = true;
    return read_picture(picture);
}

/// Length along a row, in all its rings, over which the degree is neither 0 nor 1 [pixels].
template <class Degree>
double transition_pixels(int columns, int row, const Degree& degree) {
    double length = 0;
    for (int column = 0; column < columns; ++column) {
        const double value = degree(row * columns + column);
        length += value > 0 && value < 1 ? 1 : 0;
    }
    return length;
}

}  // namespace

TEST(UnitSample, RingsAreWhatTheGeneratorDraws) {
    const EndGrain grown = drawn();
    const cv::Mat pixels = cv::imread(sample.string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(pixels.type(), CV_8UC3);
    ASSERT_EQ(pixels.cols, grown.columns);
    ASSERT_EQ(pixels.rows, grown.rows);
    EXPECT_TRUE(std::equal(grown.bgr.begin(), grown.bgr.end(), pixels.data));
    EXPECT_LT(std::filesystem::file_size(sample), 300'000u);
}

TEST(UnitSample, ReadBackAsTheWoodThatWasDrawn) {
    const EndGrain grown = drawn();
    const Specimen specimen = read_sample();
    ASSERT_EQ(specimen.label.size(), grown.degree.size());
    ASSERT_EQ(specimen.grade.size(), grown.degree.size());
    std::size_t wrong = 0;
    double error = 0, latewood = 0;
    for (std::size_t i = 0; i < grown.degree.size(); ++i) {
        const double degree = static_cast<double>(specimen.label[i]) + static_cast<double>(specimen.grade[i]);
        const double difference = degree - static_cast<double>(grown.degree[i]);
        wrong += std::abs(difference) > 0.25 ? 1 : 0;
        error += difference;
        latewood += degree;
    }
    const double count = static_cast<double>(grown.degree.size());
    EXPECT_LT(static_cast<double>(wrong) / count, 0.02);
    EXPECT_NEAR(error / count, 0, 0.01);                          // rays, texture and the cut ends of the gray scale, on the mean
    EXPECT_NEAR(latewood / count, 0.25 + 0.3 / (2 * 2.2), 0.04);  // five rings whose fractions vary by 0.025
}

TEST(UnitSample, TransitionIsWideOnTheEarlywoodSideAndSharpOnTheOther) {
    const EndGrain grown = drawn();
    const Specimen specimen = read_sample();
    const auto degree = [&](int i) { return static_cast<double>(specimen.label[i]) + static_cast<double>(specimen.grade[i]); };
    double length = 0, rings = 0, sharp = 0;
    for (int row = 0; row < specimen.rows; ++row) {
        length += transition_pixels(specimen.columns, row, degree);
        for (int column = 2; column + 2 < specimen.columns; ++column) {
            const int i = row * specimen.columns + column;
            // The true sharp border lies in this pixel: two pixels on, LW must have become EW. Noise leaves a grade of
            // 0.1.
            if (grown.degree[i - 1] == 1 && grown.degree[i] < 1) {
                ++rings;
                sharp += degree(i - 2) > 0.8 && degree(i + 2) < 0.1 ? 1 : 0;
            }
        }
    }
    EXPECT_GT(rings, 4 * specimen.rows);
    // Of 0.3 mm, the ranges cut a tenth at either end, and the border's own pixel and noise give some back.
    EXPECT_NEAR(length / rings * specimen.pixel, 0.3e-3, 0.05e-3);
    EXPECT_GT(sharp / rings, 0.97);
}

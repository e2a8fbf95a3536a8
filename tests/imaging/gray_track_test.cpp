// Tips of cracks that show as dark lines in plain pictures of wood, against a known truth.
#include "imaging/gray_track.hpp"
#include "imaging/opening.hpp"
#include "tests/imaging/plane_fields.hpp"
#include "tests/imaging/wood_camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

using namespace crampfit;

namespace {

constexpr int columns = 480, rows = 400;

/// Another light, and a camera that has moved and turned.
WoodShot shaken(int seed) {
    WoodShot shot;
    shot.gain = 0.9;
    shot.tilt = 0.08;
    shot.offset = 4;
    const double turn = 0.004;
    shot.camera = {std::cos(turn), -std::sin(turn), 2.3, std::sin(turn), std::cos(turn), -1.7};
    shot.seed = seed;
    return shot;
}

struct GrayCase {
    const char* what;
    double angle;        // [rad]
    double opening;      // at 100 px behind the tip; a fifth of it slides [px]
    double period;       // of the rings [px]
    Vec2 pith;           // [px]
    double worst, mean;  // bars: of the distance, and of the mean along the crack [px]
};

void expect_tips(const std::vector<GrayCase>& cases) {
    double squares = 0;
    int count = 0, seed = 2;
    for (const GrayCase& one : cases) {
        const WoodCamera camera(end_grain_picture(columns, rows, one.period, one.pith, 3), 10);
        const GrayTracker tracker(camera.take({}), {});
        const Vec2 direction(std::cos(one.angle), std::sin(one.angle));
        double sum = 0;
        for (const double way : {-100, 0, 100}) {
            const Vec2 truth = Vec2(240.3, 200.7) + way * direction;
            WoodShot shot = shaken(seed++);
            shot.displacement = crack_field(truth, one.angle, one.opening, 0.2 * one.opening, {0.4, -0.3});
            const CrackTip tip = tracker.tip(camera.take(shot));
            ASSERT_EQ(tip.status, TipStatus::ok) << one.what << " " << way;
            const Vec2 error = tip.tip - truth;
            const double along = error.dot(direction);
            std::printf("%-20s tip at %4.0f %4.0f: off by %5.2f px along, %5.2f px across, said %.2f px\n", one.what, truth.x(),
                        truth.y(), along, direction.x() * error.y() - direction.y() * error.x(), tip.sigma);
            EXPECT_LT(error.norm(), one.worst) << one.what << " " << way;
            sum += along;
            squares += std::pow(along / tip.sigma, 2);
            ++count;
        }
        EXPECT_LT(std::abs(sum / 3), one.mean) << one.what;
    }
    std::printf("root mean square of error over sigma: %.2f in %d pictures\n", std::sqrt(squares / count), count);
    EXPECT_LT(std::sqrt(squares / count), 2);
}

}  // namespace

// Bars: a few pixels, unbiased. Where the crack is 0.8 px wide at 100 px behind its tip, the last 15 px are less than 0.3 px
// wide: there the bar is that.
TEST(VerificationGrayTrack, TipsOfCracksInWood) {
    expect_tips({{"across rings", 0, 3, 60, {-2000, 200}, 5, 2}, {"across, hardly open", 0, 0.8, 60, {-2000, 200}, 15, 5}});
}

TEST(SlowGrayTrack, TipsOfMoreCracksInWood) {
    expect_tips({{"across, wide", 0.1, 12, 60, {-2000, 200}, 5, 2},
                 {"along rings", 0.05, 3, 60, {240, -3000}, 5, 2},
                 {"along, wide", 0, 10, 90, {240, -3000}, 5, 2.5},
                 {"oblique", 2.6, 3, 70, {-1500, -1500}, 5, 2},
                 {"from above", 1.57, 2, 50, {-2000, 200}, 5, 2}});
}

// Wide open right behind the tip, which has just crossed a sharp border of latewood: the wood that the opening drives ahead of
// the tip, and its motion at the border, pass for opening (2.5 and 9 px short where they do). Bar: a few pixels.
TEST(VerificationGrayTrack, TipsJustBehindABorder) {
    constexpr int border = 232;
    cv::Mat wood(rows, columns, CV_32F), picture;
    cv::RNG(9).fill(wood, cv::RNG::NORMAL, 0, 25);
    cv::GaussianBlur(wood, wood, {}, 1.0);
    for (int x = 0; x < columns; ++x) wood.col(x) += x > border - 20 && x <= border ? 90 : 205;
    wood.convertTo(picture, CV_8U);
    const WoodCamera camera(picture, 5);
    const GrayTracker tracker(camera.take({}), {});
    double sum = 0;
    int count = 0;
    for (const double beyond : {4.3, 8.3, 12.3}) {
        const Vec2 truth(border + beyond, 200.7);
        WoodShot shot{.seed = static_cast<int>(10 * beyond)};
        shot.displacement = crack_field(truth, 0, 18, 0, {0.4, -0.3});
        const CrackTip tip = tracker.tip(camera.take(shot));
        ASSERT_EQ(tip.status, TipStatus::ok) << beyond;
        const double off = tip.tip.x() - truth.x();
        std::printf("%.1f px behind a border: tip off by %.2f px, said %.2f px\n", beyond, off, tip.sigma);
        EXPECT_LT(std::abs(off), 3 * tip.sigma) << beyond;
        EXPECT_LT(std::abs(off), 3) << beyond;
        sum += off;
        ++count;
    }
    EXPECT_LT(std::abs(sum / count), 1);
}

// A specimen that has come apart: its lower part is held, the upper one has moved by 10 px. The way is where the wood parted, not
// in the middle of the gap, which lies 5 px above; nor along a ring that the motion darkens. Bar: a few pixels, as for tips; 10
// px from the picture's sides.
TEST(VerificationGrayTrack, WayOfACrackThatHasGoneThrough) {
    const WoodCamera camera(end_grain_picture(columns, rows, 90, {-600, -900}, 3), 10);
    const GrayTracker tracker(camera.take({}), {});
    const auto crack = [](double x) { return 200 + 15 * std::sin(x / 70); };
    WoodShot shot;
    shot.seed = 12;
    shot.displacement = [&](const Vec2& px) { return px.y() < crack(px.x()) ? Vec2(1.5, -10) : Vec2(0, 0); };
    const CrackTip tip = tracker.tip(camera.take(shot));
    EXPECT_EQ(tip.status, TipStatus::outside);
    ASSERT_GT(tip.way.size(), 400u);
    double worst = 0, sum = 0;
    int count = 0;
    for (const Vec2& point : tip.way) {
        if (point.x() < 10 || point.x() > columns - 10) continue;
        const double off = point.y() - crack(point.x());
        worst = std::max(worst, std::abs(off));
        sum += off;
        ++count;
    }
    std::printf("way of a crack that has gone through: off by %.2f px on average, %.2f px at most\n", sum / count, worst);
    EXPECT_LT(std::abs(sum / count), 2);
    EXPECT_LT(worst, 5);
}

// A specimen before a dark ground, black or gray, under a camera's noise, which shows through the crack: it begins at the
// specimen's edge, and ends there when both halves have parted over the ground.
TEST(VerificationGrayTrack, CrackOfASpecimenOnADarkGround) {
    constexpr int margin = 40;
    const cv::Mat wood = end_grain_picture(columns, rows, 60, {-2000, 200}, 3);
    const cv::Rect specimen(margin, margin, columns - 2 * margin, rows - 2 * margin);
    for (const auto& [gray, noise] : {std::pair{8, 0.0}, {30, 0.0}, {50, 0.0}, {10, 2.0}, {10, 4.0}, {40, 3.0}}) {
        cv::Mat picture(wood.size(), CV_8U, cv::Scalar(gray));
        wood(specimen).copyTo(picture(specimen));
        const WoodCamera camera(picture, gray);
        const GrayTracker tracker(camera.take({.noise = noise, .seed = 4}), {});
        WoodShot shot{.noise = noise, .seed = 5};
        const Vec2 truth(240.3, 200.7);
        shot.displacement = crack_field(truth, 0, 8, 0, {0.4, -0.3});
        const CrackTip tip = tracker.tip(camera.take(shot));
        ASSERT_EQ(tip.status, TipStatus::ok) << gray;
        std::printf("on a ground of gray %d, noise %.0f: tip off by %.2f px, length by %.2f px\n", gray, noise,
                    (tip.tip - truth).norm(), tip.length - (truth.x() - margin + 0.5));
        EXPECT_LT((tip.tip - truth).norm(), 5) << gray;
        EXPECT_NEAR(tip.length, truth.x() - margin + 0.5, 5) << gray;
        shot.displacement = [&](const Vec2& px) { return px.y() < truth.y() ? Vec2(0, -6) : Vec2(0, 6); };
        EXPECT_EQ(tracker.tip(camera.take(shot)).status, TipStatus::outside) << gray;
    }
}

TEST(VerificationGrayTrack, NoneWhereThereIsNoCrack) {
    const WoodCamera camera(end_grain_picture(columns, rows, 60, {-2000, 200}, 3), 10);
    const GrayTracker tracker(camera.take({}), {});
    EXPECT_EQ(tracker.tip(camera.take({.seed = 7})).status, TipStatus::no_crack);
    EXPECT_EQ(tracker.tip(camera.take(shaken(8))).status, TipStatus::no_crack);
    for (const PlaneField& field : {polynomial_field({240, 200}, {0.01, 0.005, 0, 0, 0}, {-0.01, -0.004, 0, 0, 0}, {0.3, 0.4}),
                                    polynomial_field({240, 200}, {0.01, 0, 1e-5, -2e-5, 0}, {0, -0.01, 2e-5, 0, 1e-5})}) {
        WoodShot shot = shaken(9);
        shot.displacement = field.displacement;
        EXPECT_EQ(tracker.tip(camera.take(shot)).status, TipStatus::no_crack);
    }
}

TEST(VerificationGrayTrack, AnotherPictureIsNotLinedUp) {
    const WoodCamera camera(end_grain_picture(columns, rows, 60, {-2000, 200}, 3), 10),
        other(end_grain_picture(columns, rows, 37, {100, -900}, 4), 10);
    const GrayTracker tracker(camera.take({}), {});
    EXPECT_NE(tracker.tip(other.take({})).status, TipStatus::ok);
    FinePicture black = camera.take({});  // a frame that the camera dropped
    std::ranges::fill(black.gray, 0.0f);
    EXPECT_EQ(tracker.tip(black).status, TipStatus::not_lined_up);
}

// Openings with noise, their start known.
TEST(VerificationGrayTrack, OpeningOfAnyShapeBeginsWhereItDoes) {
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 0.1);
    for (const double power : {0.0, 0.5, 1.0, 1.5})
        for (const double truth : {50.0, 80.3}) {
            OpeningProfile profile;
            for (int i = 0; i < 140; ++i) {
                const double r = truth - i;
                profile.opening.push_back((r > 0 ? 3 * std::pow(r / 80, power) : 0) + noise(random));
                profile.along.push_back(0);
                profile.across.push_back(0);
            }
            profile.opening[30] += 5;  // an outlier
            const auto start = find_opening_start(profile);
            ASSERT_TRUE(start) << power;
            std::printf("power %.1f: off by %.2f px, said %.2f px\n", power, start->place - truth, start->sigma);
            EXPECT_LT(std::abs(start->place - truth), 3 * start->sigma + 0.5) << power;
        }
    OpeningProfile flat{std::vector<double>(140), std::vector<double>(140), std::vector<double>(140)};
    for (double& value : flat.opening) value = noise(random);
    EXPECT_FALSE(find_opening_start(flat));
    EXPECT_FALSE(find_opening_start({{1, 0}, {0, 0}, {0, 0}}));
}

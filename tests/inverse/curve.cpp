#include "inverse/curve.hpp"
#include "inverse/force_path.hpp"

#include <gtest/gtest.h>

#include <cmath>

using crampfit::Curve;

namespace {

const double nan_ = std::nan("");

TEST(UnitCurve, SortsRowsSkipsGapsAndStepsAtEqualPlaces) {
    const std::vector<double> x{2, 0, 1, 1, 3, nan_, 4};
    const std::vector<double> y{20, 0, 8, 12, nan_, 7, 40};
    const Curve curve(x, y);
    EXPECT_EQ(curve.x(), (std::vector<double>{0, 1, std::nextafter(1.0, 2.0), 2, 4}));
    EXPECT_EQ(curve.y(), (std::vector<double>{0, 8, 12, 20, 40}));
    EXPECT_NEAR(curve.mean(0, 2), 0.5 * (0.5 * 8 + 0.5 * (12 + 20)), 1e-14);
    const Curve many(std::vector<double>{0, 1, 1, 1, 2}, std::vector<double>{0, 1, 2, 6, 0});
    EXPECT_EQ(many.y(), (std::vector<double>{0, 1.5, 4, 0}));
}

TEST(UnitCurve, InterpolatesAndContinuesItsEnds) {
    Curve curve(std::vector<double>{1, 2}, std::vector<double>{10, 30});
    EXPECT_DOUBLE_EQ(curve.at(1.25), 15);
    EXPECT_DOUBLE_EQ(curve.at(0), 10);
    EXPECT_DOUBLE_EQ(curve.at(5), 30);
    curve.continue_with(0);
    EXPECT_DOUBLE_EQ(curve.at(2), 30);
    EXPECT_DOUBLE_EQ(curve.at(5), 0);
    EXPECT_DOUBLE_EQ(curve.mean(1, 3), 10);  // area 20 under the line, then nothing
}

// The average is the exact integral of the polygon, so it does not depend on how the rows lie.
TEST(UnitCurve, MeanIsTheIntegralOfThePolygon) {
    const Curve coarse(std::vector<double>{0, 1, 3}, std::vector<double>{0, 4, 0});
    const Curve fine(std::vector<double>{0, 0.3, 1, 1.7, 2.2, 3}, std::vector<double>{0, 1.2, 4, 2.6, 1.6, 0});
    EXPECT_NEAR(coarse.mean(0.5, 2), (0.5 * (2 + 4) * 0.5 + 0.5 * (4 + 2)) / 1.5, 1e-14);
    EXPECT_NEAR(coarse.mean(0.1, 2.9), fine.mean(0.1, 2.9), 1e-14);
    EXPECT_DOUBLE_EQ(coarse.mean(2, 2), coarse.at(2));
    EXPECT_EQ(fine.rows(0.3, 1.7), 2);
}

TEST(UnitCurve, SmoothingKeepsAStraightLineUpToItsEnds) {
    std::vector<double> x, y;
    for (int i = 0; i <= 100; ++i) {
        x.push_back(0.01 * i);
        y.push_back(3 - 2 * x.back());
    }
    const Curve smooth = Curve(x, y).smoothed(0.2);
    for (std::size_t i = 0; i < x.size(); ++i) {
        EXPECT_NEAR(smooth.y()[i], y[i], 1e-13);
    }
}

// A test that ends with a jump has its last two rows at one displacement.
TEST(UnitCurve, SmoothingLeavesAStepAtTheEnd) {
    std::vector<double> x, y;
    for (int i = 0; i <= 1000; ++i) {
        x.push_back(0.9366060300e-6 * i);
        y.push_back(1.1e-3 + 0.6e-6 * i);
    }
    x.push_back(x.back());
    y.push_back(3.9e-3);
    const Curve smooth = Curve(x, y).smoothed(2e-5);
    for (std::size_t i = 1; i < smooth.y().size(); ++i) {
        EXPECT_GE(smooth.y()[i], smooth.y()[i - 1]);
    }
    EXPECT_DOUBLE_EQ(smooth.y().back(), 3.9e-3);
}

TEST(UnitCurve, SmoothingTakesOutAVibrationOfItsOwnPeriod) {
    std::vector<double> x, y;
    for (int i = 0; i <= 1000; ++i) {
        x.push_back(0.001 * i);
        y.push_back(std::sin(2 * M_PI * x.back() / 0.1));
    }
    const Curve smooth = Curve(x, y).smoothed(0.1);
    EXPECT_NEAR(smooth.at(0.525), 0, 1e-3);  // a whole period in the window; the polygon is that far from a sine
}

TEST(UnitCurve, ArrivalOfARisingCurveIsItsInverse) {
    const Curve curve(std::vector<double>{0, 1, 2, 3}, std::vector<double>{0, 1, 5, 6});
    EXPECT_DOUBLE_EQ(*curve.arrival(3), 1.5);
    EXPECT_DOUBLE_EQ(*curve.arrival(1), 1);
    EXPECT_DOUBLE_EQ(*curve.arrival(-1), 0);
    EXPECT_FALSE(curve.arrival(6.5));
}

TEST(UnitCurve, ArrivalOfANoisyCurveLiesMidway) {
    const Curve curve(std::vector<double>{0, 1, 2, 3, 4}, std::vector<double>{0, 2, 0, 2, 4});
    EXPECT_DOUBLE_EQ(*curve.arrival(1), 1.5);  // first reached at 0.5, last below at 2.5
}

// A crack that stands and jumps: one row far off must not move the jump half way to it.
TEST(UnitCurve, ARowFarOffHardlyMovesAnArrival) {
    std::vector<double> x, y;
    for (int i = 0; i < 200; ++i) {
        x.push_back(i);
        y.push_back(i < 100 ? 0.0 : 2.0);
    }
    const double exact = *Curve(x, y).arrival(1.0);
    EXPECT_DOUBLE_EQ(exact, 99.5);
    for (const int far_off : {0, 50}) {
        std::vector<double> noisy = y;
        noisy[far_off] = 1.5;
        EXPECT_NEAR(*Curve(x, noisy).arrival(1.0), exact, 1.0);
    }
}

// Up at 2, with a tooth: 10 N at 2, down to 4 N at 5, up to 7 N there. Noise: 1 N, and 0.5 of a length.
TEST(UnitForcePath, IsAsFarFromARowAsItsNearestPoint) {
    const crampfit::ForcePath path({2, 2, 2, 5, 5}, {0, 5, 10, 4, 7}, 0.5, 1);
    EXPECT_NEAR(path.distance(2, 3), 0, 1e-15);  // on the way up
    EXPECT_DOUBLE_EQ(path.distance(2.25, 3), 0.5);
    EXPECT_DOUBLE_EQ(path.distance(1.5, 3), -1);
    EXPECT_DOUBLE_EQ(path.distance(2, 12), -2);  // above the tooth, which is a corner of less than a right angle
    EXPECT_DOUBLE_EQ(path.distance(1.9, 12), -std::hypot(0.2, 2));
    // From (4, 10) to (10, 4), in noise: a row 3 below it at (7, 4).
    EXPECT_DOUBLE_EQ(path.distance(3.5, 4), 3 / std::sqrt(2));
    EXPECT_DOUBLE_EQ(path.distance(3.5, 10), -3 / std::sqrt(2));
    EXPECT_DOUBLE_EQ(path.distance(5.5, 4), 1);                    // beside the next tooth
    EXPECT_DOUBLE_EQ(path.distance(4.9, 9), -std::hypot(0.2, 2));  // beyond its end
    EXPECT_DOUBLE_EQ(crampfit::ForcePath({2, 2}, {3, 3}, 0.5, 1).distance(2, 5), 2);
}

}  // namespace

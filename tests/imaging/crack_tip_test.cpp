// Crack tips in pictures whose crack is known: a virtual test.
#include "imaging/correlate.hpp"
#include "imaging/crack_tip.hpp"
#include "imaging/virtual_camera.hpp"
#include "tests/imaging/plane_fields.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

using namespace crampfit;

namespace {

FinePicture fine(const GrayPicture& picture) {
    return {picture.columns, picture.rows, {picture.gray.begin(), picture.gray.end()}};
}

/// A camera, and the tips that it sees.
class VirtualTest {
  public:
    explicit VirtualTest(const VirtualCameraOptions& options)
        : options_(options), camera_(options), correlator_(fine(camera_.photograph(0)), {}, {}, "reference") {}

    CrackTip tip(const PlaneDisplacement& displacement) {
        const DisplacementField field = correlator_.field(fine(camera_.photograph(displacement, ++shot_)));
        return find_crack_tip({correlator_.lattice(), CorrelateOptions().subset, options_.columns, options_.rows}, field);
    }

  private:
    VirtualCameraOptions options_;
    VirtualCamera camera_;
    Correlator correlator_;
    std::uint64_t shot_ = 0;
};

constexpr double subset = 31;

struct Case {
    const char* what;
    double angle;    // [rad]
    double opening;  // at 100 px behind the tip [px]
    double sliding;  // [px]
};

}  // namespace

// Bars: the tip within two subsets in every frame, and unbiased within half a subset on average.
TEST(VerificationCrackTip, WithinTwoSubsetsInEveryFrame) {
    VirtualCameraOptions options;
    options.columns = 480;
    options.rows = 400;
    VirtualTest test(options);
    for (const Case& one : {Case{"opening", 0, 2, 0}, Case{"opening wide", 0.1, 8, 0}, Case{"opening little", -0.1, 0.3, 0},
                            Case{"mixed, turned", 2.6, 2, 1}, Case{"from above", 1.57, 2, 0.3}}) {
        const Vec2 direction(std::cos(one.angle), std::sin(one.angle));
        Vec2 mean = Vec2::Zero();
        int frames = 0;
        for (double way = -100; way <= 100; way += 100) {
            const Vec2 truth = Vec2(240.3, 200.7) + way * direction;
            const CrackTip tip = test.tip(crack_field(truth, one.angle, one.opening, one.sliding, {0.4, -0.3}));
            ASSERT_EQ(tip.status, TipStatus::ok) << one.what << " " << way;
            const Vec2 error = tip.tip - truth;
            std::printf("%-15s tip at %4.0f %4.0f: off by %6.2f %6.2f px, said %.2f px, angle off by %.2f deg\n", one.what,
                        truth.x(), truth.y(), error.x(), error.y(), tip.sigma, (tip.angle - one.angle) * 57.3);
            EXPECT_LT(error.norm(), 2 * subset);
            mean += error;
            ++frames;
        }
        std::printf("%-15s mean error %.2f %.2f px\n", one.what, mean.x() / frames, mean.y() / frames);
        EXPECT_LT((mean / frames).norm(), subset / 2);
    }
}

TEST(VerificationCrackTip, NoneWhereThereIsNoCrack) {
    VirtualCameraOptions options;
    options.columns = 320;
    options.rows = 320;
    VirtualTest test(options);
    const Vec2 middle(160, 160);
    for (const PlaneField& field : {polynomial_field(middle, {0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}, {0.3, 0.4}),
                                    polynomial_field(middle, {0.01, 0.005, 0, 0, 0}, {-0.01, -0.004, 0, 0, 0}),
                                    polynomial_field(middle, {0.01, 0, 1e-5, -2e-5, 0}, {0, -0.01, 2e-5, 0, 1e-5})})
        EXPECT_EQ(test.tip(field.displacement).status, TipStatus::no_crack);
}

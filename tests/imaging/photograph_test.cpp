// Photographs on the axes of a specimen; its wood before the virtual camera.
#include "datasets/error.hpp"
#include "imaging/frame_motion.hpp"
#include "imaging/photograph.hpp"
#include "imaging/record_camera.hpp"
#include "imaging/wood_surface.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <cmath>

using namespace crampfit;

namespace {

/// A light picture with one black square of 10 pixels about a place.
GrayPicture marked(int columns, int rows, int x, int y) {
    GrayPicture picture{columns, rows, std::vector<std::uint8_t>(static_cast<std::size_t>(columns * rows), 200)};
    for (int j = -5; j < 5; ++j)
        for (int i = -5; i < 5; ++i) picture.gray[static_cast<std::size_t>((y + j) * columns + x + i)] = 0;
    return picture;
}

/// The middle of what is dark, in the specimen [m].
Vec2 middle_of_mark(const PlanePicture& picture) {
    Vec2 sum = Vec2::Zero();
    double dark = 0;
    const Vec2 pixel = (picture.high - picture.low).cwiseQuotient(Vec2(picture.columns, picture.rows));
    for (int j = 0; j < picture.rows; ++j)
        for (int i = 0; i < picture.columns; ++i) {
            const double weight = std::max(0, 200 - picture.gray[static_cast<std::size_t>(j * picture.columns + i)]);
            sum += weight * Vec2(picture.low.x() + (i + 0.5) * pixel.x(), picture.high.y() - (j + 0.5) * pixel.y());
            dark += weight;
        }
    return sum / dark;
}

}  // namespace

// The mark's middle is a pixel's corner, 0.5 left of and above the pixel that `marked` names.
TEST(UnitPhotograph, LiesWhereItsPlacementSays) {
    const TemporaryFolder folder;
    write_gray(marked(400, 300, 250, 120), folder / "photograph.png");
    for (const double pixel : {20e-6, 5e-6})  // as it is; shrunk, since 1600 pixels are kept of 21 mm
        for (const double rotation : {0.0, 0.3, 1.5707963267948966}) {
            const Vec2 size(20e-3, 15e-3), offset(9e-3, 7e-3);
            Photograph photograph{
                .file = folder / "photograph.png", .placement = {pixel, offset, rotation, 0}, .path = {}, .picture = {}};
            const Vec2 mark = Placement{pixel, offset, rotation, 300}.place(249.5, 119.5);
            load_photograph(photograph, size, {"study.toml", "picture"});
            const PlanePicture& picture = photograph.picture;
            EXPECT_LE(std::max(picture.columns, picture.rows), 1601);
            EXPECT_LT((middle_of_mark(picture) - mark).norm(), 0.1 * pixel) << rotation;
            EXPECT_LT(picture.low.maxCoeff(), 0);
            EXPECT_GT((picture.high - size).minCoeff(), 0);
            EXPECT_EQ(picture.gray.back(), 255) << "the specimen's lower right corner is not on the photograph";
        }
}

TEST(UnitPhotograph, RefusesWhatDoesNotFit) {
    const TemporaryFolder folder;
    write_gray(marked(40, 30, 20, 15), folder / "photograph.png");
    folder.write("text.png", "no picture");
    const auto refused = [&](const Photograph& photograph, const std::string& phrase) {
        try {
            Photograph copy = photograph;
            load_photograph(copy, {1e-3, 1e-3}, {"study.toml", "experiments.a.photograph.picture"});
            FAIL() << phrase;
        } catch (const InputError& error) {
            EXPECT_EQ(error.file, "study.toml");
            EXPECT_EQ(error.key, "experiments.a.photograph.picture");
            EXPECT_NE(error.rule.find(phrase), std::string::npos) << error.what();
        }
    };
    const Placement placement{25e-6, Vec2::Zero(), 0, 0};
    refused({.file = folder / "text.png", .placement = placement, .path = {}, .picture = {}}, "picture");
    refused({.file = folder / "photograph.png", .placement = placement, .path = {}, .columns = 41, .rows = 30, .picture = {}},
            "must have their size");
    refused({.file = folder / "photograph.png", .placement = {25e-6, {1, 1}, 0, 0}, .path = {}, .picture = {}},
            "shows nothing of the specimen");
    Photograph none;
    load_photograph(none, {1e-3, 1e-3}, {"study.toml", "picture"});
    EXPECT_TRUE(none.picture.gray.empty());
}

// A spline through samples of a plane is that plane: gray at any place is exact, but for the rounding of float and the picture's
// ends.
TEST(UnitWoodSurface, GrayOfTheWoodAtItsPlace) {
    FinePicture picture{80, 60, {}};
    for (int y = 0; y < 60; ++y)
        for (int x = 0; x < 80; ++x) picture.gray.push_back(static_cast<float>(10 + 2 * x + y));
    const Placement placement{25e-6, {1e-3, 2e-3}, 0.4, 60};
    const auto gray = wood_surface(picture, placement, 25e-6), coarse = wood_surface(picture, placement, 50e-6);
    for (const Vec2& px : {Vec2(40, 30), Vec2(30.25, 22.75), Vec2(51.5, 40.1)}) {
        const double truth = 10 + 2 * px.x() + px.y();
        EXPECT_NEAR(gray(placement.place(px.x(), px.y())), truth, 1e-3);
        EXPECT_NEAR(coarse(placement.place(px.x(), px.y())), truth, 1e-2) << "pixels joined in fours";
    }
    EXPECT_TRUE(covers(picture, {25e-6, Vec2::Zero(), 0, 60}, {2e-3, 1.5e-3}));
    EXPECT_FALSE(covers(picture, {25e-6, Vec2::Zero(), 0, 60}, {2.1e-3, 1.5e-3}));
    EXPECT_FALSE(covers(picture, {25e-6, {1e-4, 0}, 0, 60}, {2e-3, 1.5e-3}));
}

// What opens by a tenth of a pixel darkens the pixel by a tenth, where its gray is the mean over its square: 200 wood, 10 gap.
TEST(UnitVirtualCamera, ANarrowGapDarkensAPixelByItsShare) {
    const VirtualCameraOptions options{.columns = 20, .rows = 20, .noise = 0, .gap_gray = 10, .samples = 10};
    const VirtualCamera camera(options, [](const Vec2&) { return 200.0; });
    const auto opened = [](const Vec2& px) { return Vec2(0, px.y() > 9.5 ? 0.1 : 0.0); };
    const GrayPicture picture = camera.photograph(opened, 1);
    double missing = 0;
    for (int y = 0; y < 20; ++y) missing += 200.0 - picture.gray[static_cast<std::size_t>(y * 20 + 10)];
    EXPECT_EQ(missing, 19);
}

// A crack goes through points exactly, and rounding has said for each to which side it belongs.
TEST(UnitFrameMotion, PointsOnACrackBelongToNeitherSide) {
    Record record;
    record.point_size = {0.1e-3, 0.1e-3};
    Frame& frame = record.frames.emplace_back();
    frame.crack = {{0.5e-3, 0.5e-3}, {2.5e-3, 2.5e-3}};
    record.paths = {frame.crack};
    const Eigen::Vector2f above(-1e-5F, 1e-5F), below(1e-5F, -1e-5F);
    for (int j = 0; j < 30; ++j)
        for (int i = 0; i < 30; ++i) {
            record.point_position.emplace_back((i + 0.5) * 0.1e-3, (j + 0.5) * 0.1e-3);
            frame.moved.push_back(j > i || (j == i && i % 3 == 0) ? above : below);
        }
    const FrameMotion motion(record, 0, "record.h5");
    for (double along = 0.8e-3; along < 2.2e-3; along += 0.033e-3)
        for (const double side : {1.0, -1.0}) {
            const Vec2 moved = motion({along - side * 1e-6, along + side * 1e-6});
            EXPECT_NEAR(moved.y(), side * 1e-5, 1e-9) << along;
            EXPECT_NEAR(moved.x(), -side * 1e-5, 1e-9) << along;
        }
}

#include "imaging/silhouette.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

using namespace crampfit;

namespace {

/// A picture of 400 x 300 pixels, of what `gray` gives at a place.
template <class Gray>
FinePicture picture_of(const Gray& gray) {
    FinePicture picture;
    picture.columns = 400;
    picture.rows = 300;
    for (int y = 0; y < picture.rows; ++y)
        for (int x = 0; x < picture.columns; ++x) picture.gray.push_back(static_cast<float>(gray(x, y)));
    return picture;
}

long ground_of(const Silhouette& silhouette) { return std::ranges::count(silhouette.mask(), 0); }

}  // namespace

// A notch of 100 x 80 pixels from above, with its root at 200, 80; a specimen that fills the picture and one that does not.
TEST(UnitSilhouette, ANotchIsNoWood) {
    for (const int margin : {0, 20}) {
        std::mt19937 random(1);
        std::uniform_real_distribution<double> grain(80, 220);
        std::normal_distribution<double> noise(0, 2);
        const auto notched = [&](int x, int y) {
            const bool outside = x < margin || x >= 400 - margin || y < margin || y >= 300 - margin;
            const bool notch = std::abs(x - 200) < 0.625 * (80 - y);
            return outside || notch ? 10 + noise(random) : grain(random);
        };
        const Silhouette silhouette(picture_of(notched));
        EXPECT_NEAR(silhouette.to_edge({200, 180}, {0, -1}), 100, 5) << margin;
        EXPECT_NEAR(silhouette.to_mouth({206, 180}, {0, -1}), std::hypot(100, 6), 5)
            << "the root is aside of the line; " << margin;
        EXPECT_NEAR(silhouette.to_edge({100, 150}, {-1, 0}), 100.5 - margin, margin == 0 ? 1e-9 : 5) << margin;
        EXPECT_NEAR(silhouette.to_mouth({100, 150}, {-1, 0}), 100.5 - margin, margin == 0 ? 1e-9 : 5) << margin;
        const PointLattice lattice{2, 1, 200, 100, 100};
        EXPECT_TRUE(silhouette.subsets_at_edge(lattice, 31)[0]);
        EXPECT_EQ(silhouette.subsets_at_edge({2, 1, 100, 200, 100}, 31), (std::vector<bool>{false, false}));
    }
}

TEST(UnitSilhouette, DrawnRingsAndCracksAreWood) {
    const auto rings = [](int x, int y) { return std::fmod(std::hypot(x + 300, y - 150), 80) > 50 ? 40 : 220; };
    EXPECT_EQ(ground_of(Silhouette(picture_of(rings))), 0);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> grain(80, 220);
    const auto cracked = [&](int x, int y) { return x < 200 && std::abs(y - 150) < 5 ? 10 : grain(random); };
    EXPECT_EQ(ground_of(Silhouette(picture_of(cracked))), 0);
}

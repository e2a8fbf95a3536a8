// Specimens cut from the photograph of a disk: segmented by the command, then split across and along the rings.
#include "datasets/io.hpp"
#include "forward/geometry.hpp"
#include "tests/cli/command.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

using namespace crampfit;

namespace {

struct Cut {
    const char* name;
    const char* offset;  // of the picture
    const char* pulled;  // side that moves
    const char* held;
    const char* velocity;
    const char* notch;
};

std::string scene(const Cut& cut, double cell) {
    return fmt::format(R"(
[model]
plane = "strain"
thickness = "10 mm"
cell = "{} mm"

[specimen]
size = ["12 mm", "12 mm"]
file = "disk.h5"
offset = {}

[materials]
EW = {{ kind = "isotropic", E = "40 MPa", nu = 0.33, density = "300 kg/m^3", toughness = "100 J/m^2" }}
LW = {{ kind = "isotropic", E = "1200 MPa", nu = 0.33, density = "760 kg/m^3", toughness = "100 J/m^2" }}

[[edges]]
name = "pulled"
side = "{}"
velocity = {}

[[edges]]
name = "held"
side = "{}"
velocity = ["0 mm/min", "0 mm/min"]

[[cracks]]
points = {}
grows = "end"
direction = "hoop stress"
advance = "0.4 mm"

[measure]
force = "pulled"
displacement = "pulled"

[solver]
kind = "quasistatic"

[stop]
displacement = "4 mm"
)",
                       cell, cut.offset, cut.pulled, cut.velocity, cut.held, cut.notch);
}

// Distance of x from a way.
double apart(const Vec2& x, const std::vector<Vec2>& way) {
    double nearest = INFINITY;
    for (std::size_t k = 0; k + 1 < way.size(); ++k) {
        const double share = nearest_on_segment(way[k], way[k + 1], x);
        nearest = std::min(nearest, (x - way[k] - share * (way[k + 1] - way[k])).norm());
    }
    return nearest;
}

class SlowDisk : public testing::Test {
  protected:
    void SetUp() override {
        const auto image = std::filesystem::path(SHARED_DATA) / "wood" / "urudendro_f02c_crop.png";
        if (!std::filesystem::exists(image))
            GTEST_SKIP() << "there is no " << image;  // photographs are read beside the project, not part of it
        const Outcome found = command.run({"segment", image.string(), "-o", command.path("disk.h5"), "--pixel", "50 um"});
        ASSERT_EQ(found.status, 0) << found.error;
    }

    std::vector<Vec2> way_through(const Cut& cut, double cell) {
        command.folder.write("scene.toml", scene(cut, cell));
        const Outcome run = command.run({"simulate", command.path("scene.toml"), "-o", command.path("record.h5")});
        EXPECT_EQ(run.status, 0) << cut.name << ": " << run.error;
        const Record record = read_record(command.path("record.h5"));
        EXPECT_EQ(record.status, RunStatus::split)
            << cut.name << ", offset " << cut.offset << ", cells " << cell << ": " << record.message;
        return record.paths[0];
    }

    Command command;
};

const char *right_mm_min = R"(["1 mm/min", "0 mm/min"])", *up_mm_min = R"(["0 mm/min", "1 mm/min"])";

Cut along_rings(const char* offset) {
    return {"RT", offset, "top", "bottom", up_mm_min, R"([["0 mm", "6.3 mm"], ["3 mm", "6.3 mm"]])"};
}

// Of the way on coarse cells off that on fine ones [m]: at worst, and in the root of the mean square. What lies within 0.6 mm of
// its end is left out: three coarse cells before it goes out the domain in which K steers it does not fit.
struct Apart {
    double worst = 0.0, typical = 0.0;
    Apart(const Cut& cut, const std::vector<Vec2>& coarse, const std::vector<Vec2>& fine) {
        int count = 0;
        for (const Vec2& x : coarse) {
            if ((x - coarse.back()).norm() < 0.6e-3) continue;
            const double here = apart(x, fine);
            worst = std::max(worst, here);
            typical += here * here;
            ++count;
        }
        typical = std::sqrt(typical / count);
        std::printf("%s, offset %s: from one grid to the other the ways are %.2f mm apart, at worst %.2f mm\n", cut.name,
                    cut.offset, 1e3 * typical, 1e3 * worst);
    }
};

// Each crack goes through, and cells half as wide show the same way to one and a half of the coarse cells.
TEST_F(SlowDisk, ScenesCutFromItSplit) {
    const char* offset = R"(["-12 mm", "-10 mm"])";
    for (const Cut& cut : {Cut{"TR+", offset, "right", "left", right_mm_min, R"([["6 mm", "12 mm"], ["6 mm", "9 mm"]])"},
                           Cut{"TR-", offset, "right", "left", right_mm_min, R"([["6 mm", "0 mm"], ["6 mm", "3 mm"]])"}})
        EXPECT_LT(Apart(cut, way_through(cut, 0.2), way_through(cut, 0.1)).worst, 0.3e-3) << cut.name;
}

// Along the rings a crack meets latewood at a small angle, within cells of both woods: wherever the specimen is cut, it goes on.
// It goes along a wavy border, with turns off it whose places are chance; both grids show the same way to a coarse cell but for
// these.
TEST_F(SlowDisk, AlongTheRingsNoTipIsStuck) {
    for (const char* offset :
         {R"(["-11.7 mm", "-10 mm"])", R"(["-11.9 mm", "-9.9 mm"])", R"(["-11.9 mm", "-10 mm"])", R"(["-11.9 mm", "-10.1 mm"])",
          R"(["-12 mm", "-10 mm"])", R"(["-12.1 mm", "-10 mm"])", R"(["-12.3 mm", "-9.9 mm"])"}) {
        const Cut cut = along_rings(offset);
        EXPECT_LT(Apart(cut, way_through(cut, 0.2), way_through(cut, 0.1)).typical, 0.2e-3) << offset;
    }
}

}  // namespace

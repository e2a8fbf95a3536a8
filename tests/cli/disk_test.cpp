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

// Each crack goes through, and cells half as wide show the same way to one and a half of the coarse cells, but for the last three
// of these before it goes out, where the domain in which K steers it does not fit.
TEST_F(SlowDisk, ScenesCutFromItSplit) {
    const char* offset = R"(["-12 mm", "-10 mm"])";
    const Cut cuts[] = {{"TR+", offset, "right", "left", right_mm_min, R"([["6 mm", "12 mm"], ["6 mm", "9 mm"]])"},
                        {"TR-", offset, "right", "left", right_mm_min, R"([["6 mm", "0 mm"], ["6 mm", "3 mm"]])"},
                        along_rings(offset)};
    for (const Cut& cut : cuts) {
        std::vector<Vec2> ways[2];
        for (const int fine : {0, 1}) ways[fine] = way_through(cut, fine ? 0.1 : 0.2);
        double worst = 0.0, at_end = 0.0;
        for (const Vec2& x : ways[0]) {
            const bool goes_out = (x - ways[0].back()).norm() < 0.6e-3;
            double& here = goes_out ? at_end : worst;
            here = std::max(here, apart(x, ways[1]));
        }
        std::printf("%s: from one grid to the other the ways are up to %.2f mm apart, on the last 0.6 mm %.2f mm\n", cut.name,
                    1e3 * worst, 1e3 * at_end);
        EXPECT_LT(worst, 0.3e-3) << cut.name;
    }
}

// Along the rings a crack meets latewood at a small angle, within cells of both woods: wherever the specimen is cut, it goes on.
TEST_F(SlowDisk, AlongTheRingsNoTipIsStuck) {
    for (const char* offset : {R"(["-11.7 mm", "-10 mm"])", R"(["-11.9 mm", "-9.9 mm"])", R"(["-11.9 mm", "-10 mm"])",
                               R"(["-11.9 mm", "-10.1 mm"])", R"(["-12.1 mm", "-10 mm"])", R"(["-12.3 mm", "-9.9 mm"])"})
        for (const double cell : {0.2, 0.1}) way_through(along_rings(offset), cell);
}

}  // namespace

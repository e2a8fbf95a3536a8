// The verb `segment` from picture to scene, as a user runs it.
#include "tests/cli/command.hpp"

#include "datasets/io.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

using namespace crampfit;

namespace {

const std::string picture = std::string(SAMPLES) + "/rings.png";  // 400 x 400 pixels, 25 um, growth about +x

std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
}

// The sample's scene with the specimen in place of its picture.
std::string scene_on_specimen() {
    std::ifstream sample(std::string(SAMPLES) + "/tension_tr_plus.toml");
    std::string scene;
    for (std::string line; std::getline(sample, line);) {
        if (line.rfind("pixel =", 0) == 0 || line.rfind("classes =", 0) == 0 || line.rfind("between =", 0) == 0) continue;
        scene += (line.rfind("image =", 0) == 0 ? "file = \"s.h5\"" : line) + '\n';
    }
    return scene;
}

}  // namespace

TEST(SystemSegment, PictureToTablesAndBackThroughEditedBorders) {
    Command command;
    const std::string specimen = command.path("s.h5"), preview = command.path("p.png");
    const Outcome made = command.run({"segment", picture, "-o", specimen, "--pixel", "25 um", "--preview", preview});
    ASSERT_EQ(made.status, 0) << made.error;
    EXPECT_TRUE(contains(made.error, "from --pixel"));
    EXPECT_TRUE(contains(made.error, "growth +x"));
    EXPECT_GT(std::filesystem::file_size(preview), 10'000u);

    const Outcome borders = command.run({"csv", specimen, "borders"});
    ASSERT_EQ(borders.status, 0) << borders.error;
    EXPECT_EQ(lines_of(borders.out).front(), "ring,x_px,y_px");
    const Outcome rings = command.run({"csv", specimen, "rings"});
    EXPECT_EQ(lines_of(rings.out).front(), "ring,width_mm,latewood_fraction");
    const Outcome orientation = command.run({"csv", specimen, "orientation"});
    EXPECT_EQ(lines_of(orientation.out).front(), "x_px,y_px,radial_deg,coherency");
    EXPECT_EQ(lines_of(orientation.out).size(), 1u + 100 * 100);

    // Without the first ring's border there is a ring less.
    std::string edited;
    for (const std::string& line : lines_of(borders.out))
        if (line.rfind("1,", 0) != 0) edited += line + '\n';
    command.folder.write("edited.csv", edited);
    const std::string again = command.path("again.h5");
    const Outcome redone =
        command.run({"segment", picture, "-o", again, "--pixel", "25 um", "--borders", command.path("edited.csv")});
    ASSERT_EQ(redone.status, 0) << redone.error;
    EXPECT_EQ(lines_of(command.run({"csv", again, "rings"}).out).size() + 1, lines_of(rings.out).size());
}

TEST(SystemSegment, ASceneStandsOnTheSpecimen) {
    Command command;
    ASSERT_EQ(command.run({"segment", picture, "-o", command.path("s.h5"), "--pixel", "25 um", "--quiet"}).status, 0);
    command.folder.write("scene.toml", scene_on_specimen());
    const Outcome run = command.run({"simulate", command.path("scene.toml"), "-o", command.path("r.h5"), "--set",
                                     "model.cell=0.5 mm", "--set", "edges.top.velocity=[\"0 m/s\", \"1 mm/min\"]"});
    ASSERT_EQ(run.status, 0) << run.error;
    const Record record = read_record(command.folder / "r.h5");
    const auto [low, high] = std::minmax_element(record.point_latewood.begin(), record.point_latewood.end());
    EXPECT_EQ(*low, 0);
    EXPECT_EQ(*high, 1);

    ASSERT_EQ(command.run({"segment", picture, "-o", command.path("s.h5")}).status, 0);
    const Outcome refused = command.run({"explain", command.path("scene.toml")});
    EXPECT_EQ(refused.status, 2);
    EXPECT_TRUE(contains(refused.error, "has no scale")) << refused.error;
}

TEST(SystemSegment, BadUseIsNamedAndLeavesNothing) {
    Command command;
    const std::string out = command.path("s.h5");
    const auto refused = [&](std::vector<std::string> more, const std::string& phrase) {
        std::vector<std::string> words{"segment", picture, "-o", out};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 2) << phrase;
        EXPECT_TRUE(contains(outcome.error, phrase)) << outcome.error;
        EXPECT_FALSE(std::filesystem::exists(out));
    };
    refused({"--pixel", "25"}, "unit");
    refused({"--pixel", "0 um"}, "--pixel");
    refused({"--pixel", "5 kg"}, "--pixel");
    refused({"--classes", "4"}, "--classes");
    refused({"--growth", "north"}, "--growth");
    refused({"--borders", command.path("none.csv")}, "no such file");
    refused({"--borders", command.folder.write("a.csv", "ring,x_px\n1,2\n").string()}, "ring, x_px and y_px");
    refused({"--borders", command.folder.write("b.csv", "ring,x_px,y_px\n1,2,3\n1,x,5\n").string()}, "x_px, line 3");
    refused({"--borders", command.folder.write("c.csv", "ring,x_px,y_px\n1,2,3\n").string()}, "at least 2 vertices");
    refused({"--borders", command.folder.write("d.csv", "ring,x_px,y_px\n").string()}, "no borders");
    refused({"--preview", command.path("p.nothing")}, "--preview");
    refused({"--set", "a=1"}, "--set");
    const Outcome none = command.run({"segment", command.path("none.png"), "-o", out});
    EXPECT_EQ(none.status, 2);
    EXPECT_TRUE(contains(none.error, "no such file"));
}

TEST(SystemSegment, ScaleGraysAndDensityAsTold) {
    Command command;
    const std::string specimen = command.path("s.h5");
    const Outcome made = command.run({"segment", picture, "-o", specimen, "--scale", "0,0 300,400 = 12.5 mm"});
    ASSERT_EQ(made.status, 0) << made.error;
    EXPECT_TRUE(contains(made.error, "25 um a pixel, from two points")) << made.error;
    const std::string table = command.folder.write("wedge.csv", "gray,density [kg/m^3]\n0,1200\n255,200\n").string();
    const Outcome dense = command.run({"segment", "--gray", "EW 128-255", "--gray", "LW 0-127", picture, "-o", specimen,
                                       "--pixel", "25 um", "--density", table});
    ASSERT_EQ(dense.status, 0) << dense.error;
    EXPECT_TRUE(contains(dense.error, "density of LW")) << dense.error;
    EXPECT_EQ(read_specimen(specimen).density.size(), read_specimen(specimen).label.size());
    // Its wood has 200 to 1200 kg/m^3.
    const std::string scene = command.folder.write("scene.toml", scene_on_specimen()).string();
    const auto explained = [&](int early, int late) {
        return command.run({"explain", scene, "--set", "model.cell=0.5 mm", "--set",
                            fmt::format("materials.EW.density={} kg/m^3", early), "--set",
                            fmt::format("materials.LW.density={} kg/m^3", late)});
    };
    const Outcome narrow = explained(600, 620), wide = explained(200, 1200);
    EXPECT_EQ(narrow.status, 0) << narrow.error;
    EXPECT_TRUE(contains(narrow.out + narrow.error, "wood beyond EW and LW")) << narrow.out;
    EXPECT_EQ(wide.status, 0) << wide.error;
    EXPECT_FALSE(contains(wide.out + wide.error, "wood beyond EW and LW")) << wide.out;
    const auto refused = [&](const std::vector<std::string>& more, const std::string& phrase) {
        std::vector<std::string> words{"segment", picture, "-o", specimen};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 2) << phrase;
        EXPECT_TRUE(contains(outcome.error, phrase)) << outcome.error;
    };
    for (const char* bad :
         {"0,0 300,400", "0,0 300,400 = 12.5", "0,0 0,0 = 1 mm", "0,0 3 = 1 mm", "0,0 300,400 = -1 mm", "0,0 1e999,1 = 1 mm"})
        refused({"--scale", bad}, "--scale");
    refused({"--scale", "0,0 1,1 = 1 mm", "--pixel", "1 mm"}, "--pixel");
    for (const char* bad : {"EW", "EW 1", "EW 1-", "EW 1:2", "EW 1-2 3", "EW 200-100", "EW 0-256"})
        refused({"--gray", bad}, "--gray");
    refused({"--gray", "EW 0-100", "--gray", "LW 100-200"}, "overlap");
    refused({"--density", command.path("none.csv")}, "none.csv");
    refused({"--direction", command.path("none.png")}, "none.png");
}

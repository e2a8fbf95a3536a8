// The direction criterion from pictures of bare wood: simulate, photograph, track, fit each criterion, look at the paths.
#include "datasets/io.hpp"
#include "tests/cli/command.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <sstream>

using namespace crampfit;

namespace {

constexpr int frames = 4;

/// A block cut at 45 degrees to its rings, pulled as in a laboratory.
std::string scene(const std::string& direction) {
    return fmt::format(R"(
[model]
plane = "strain"
thickness = "10 mm"
cell = "0.2 mm"

[specimen]
size = ["7 mm", "7 mm"]
image = "{}/rings.png"
pixel = "25 um"
rotation = "45 deg"
offset = ["3.5 mm", "-3.571 mm"]
classes = [ {{ material = "EW", gray = [198, 255] }}, {{ material = "LW", gray = [0, 102] }} ]
between = "graded"

[materials]
EW = {{ kind = "isotropic", E = "40 MPa", nu = 0.33, density = "300 kg/m^3", toughness = "100 J/m^2" }}
LW = {{ kind = "isotropic", E = "400 MPa", nu = 0.33, density = "750 kg/m^3", toughness = "150 J/m^2" }}

[[edges]]
name = "top"
side = "top"
velocity = ["0 m/s", "1 mm/min"]

[[edges]]
name = "bottom"
side = "bottom"
velocity = ["0 m/s", "0 m/s"]

[[cracks]]
points = [["7 mm", "3.5 mm"], ["5 mm", "3.5 mm"]]
grows = "end"
advance = "0.4 mm"
direction = "{}"

[measure]
force = "top"
displacement = "top"

[stop]
displacement = "1.2 mm"

[output]
frames = {}
)",
                       SAMPLES, direction, frames);
}

const std::string paths_study = R"(
title = "Which way does the crack turn?"

[[experiments]]
name = "block"
scene = "scene.toml"
data = "curves.csv"
noise = { force = "1 N" }
photograph = { picture = "pictures/image_0003.png", track = "track.h5" }

[[parameters]]
name = "EW toughness"
key = "materials.EW.toughness"
initial = "90 J/m^2"
lower = "50 J/m^2"
upper = "200 J/m^2"
scale = "log"

[compare]
key = "cracks.0.direction"
values = ["straight", "normal to opening"]
)";

std::map<std::string, std::vector<double>> distances_of(const std::string& csv) {
    std::map<std::string, std::vector<double>> distances;
    std::istringstream lines(csv);
    std::string line;
    for (std::getline(lines, line); std::getline(lines, line);) {
        std::vector<std::string> row;
        std::istringstream in(line);
        for (std::string field; std::getline(in, field, ',');) row.push_back(field);
        distances[row.at(1)] = {std::stod(row.at(2)), std::stod(row.at(3)), std::stod(row.at(4))};
    }
    return distances;
}

}  // namespace

TEST(SystemPaths, PhotographedPathTellsTheCriterion) {
    Command command;
    command.folder.write("truth.toml", scene("normal to opening"));
    command.folder.write("scene.toml", scene("straight"));
    const auto done = [&](const std::vector<std::string>& words) {
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 0) << outcome.error;
        return outcome;
    };
    done({"simulate", command.path("truth.toml"), "-o", command.path("truth.h5")});
    done({"camera", command.path("truth.h5"), "-o", command.path("pictures"), "--pixel", "20 um", "--wood", SAMPLES "/rings.png",
          "--noise", "2"});
    std::vector<std::string> words{"track", command.path("pictures/reference.png")};
    for (int i = 0; i < frames; ++i) words.push_back(command.path(fmt::format("pictures/image_{:04}.png", i)));
    words.insert(words.end(),
                 {"-o", command.path("track.h5"), "--pixel", "20 um", "--from", "gray", "--preview", command.path("track.png")});
    done(words);
    EXPECT_GT(done({"csv", command.path("track.h5"), "ways"}).out.size(), 1000u);
    Curves curves;
    for (const Instant& instant : read_record(command.path("truth.h5")).series) {
        curves.displacement.push_back(instant.displacement);
        curves.force.push_back(instant.force);
    }
    write_curves(curves, command.path("curves.csv"));
    command.folder.write("study.toml", paths_study);
    const Outcome fitted = done({"fit", command.path("study.toml"), "-o", command.path("fit.h5")});
    EXPECT_TRUE(contains(fitted.out, "path off by")) << fitted.out;

    auto distances = distances_of(done({"csv", command.path("fit.h5"), "path_distances"}).out);
    ASSERT_EQ(distances.size(), 2u);
    for (const auto& [model, distance] : distances)
        std::printf("%s: mean %.3f, largest %.3f mm over %.2f mm\n", model.c_str(), 1e3 * distance[0], 1e3 * distance[1],
                    1e3 * distance[2]);
    std::fflush(stdout);
    // The right model has the path but for what the pictures say of it: a few pixels of 20 um.
    EXPECT_LT(distances["normal to opening"][0], 0.06e-3);
    EXPECT_LT(distances["normal to opening"][0], 0.5 * distances["straight"][0]);
    EXPECT_NEAR(distances["normal to opening"][2], 5e-3,
                0.2e-3);  // from the notch's tip to the side, over which they have both grown

    done({"report", command.path("fit.h5"), "-o", command.path("fit.html")});
    const std::string page = command.folder.read("fit.html");
    for (const char* part : {"block: photograph", "block: straight", "block: normal to opening", "Path off by, mean [mm]"})
        EXPECT_TRUE(contains(page, part)) << part;
}

TEST(SystemPaths, WoodThatTheCameraCannotSeeIsRefused) {
    Command command;
    std::string coarse = scene("straight");
    coarse.replace(coarse.find("cell = \"0.2 mm\""), 15, "cell = \"0.5 mm\"");
    command.folder.write("scene.toml", coarse);
    ASSERT_EQ(command.run({"simulate", command.path("scene.toml"), "-o", command.path("record.h5")}).status, 0);
    const auto refused = [&](const std::vector<std::string>& more, const std::string& phrase) {
        std::vector<std::string> words{"camera", command.path("record.h5"), "-o", command.path("pictures"), "--pixel", "50 um"};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 2) << phrase;
        EXPECT_TRUE(contains(outcome.error, phrase)) << outcome.error;
    };
    const std::string rings = SAMPLES "/rings.png";
    refused({"--wood", "none.png"}, "--wood");
    refused({"--wood-pixel", "25 um"}, "--wood");
    refused({"--wood", rings, "--spot", "2"}, "--spot");
    refused({"--wood", rings, "--wood-pixel", "20 um"}, "must show the whole specimen");
    refused({"--wood", rings, "--wood-pixel", "20"}, "--wood-pixel");
    refused({"--wood", rings, "--blur", "-1"}, "blur");
    EXPECT_FALSE(std::filesystem::exists(command.path("pictures")));
}

TEST(SystemPaths, PicturesThatDoNotFitAreRefusedBeforeAnythingRuns) {
    Command command;
    command.folder.write("scene.toml", scene("straight"));
    command.folder.write("curves.csv", "displacement [mm],force [N]\n0,0\n0.1,1\n");
    command.folder.write("text.png", "no picture");
    const auto refused = [&](const std::string& photograph, const std::string& phrase) {
        std::string text = paths_study;
        const std::size_t at = text.find("photograph ="), end = text.find('\n', at);
        command.folder.write("study.toml", text.replace(at, end - at, "photograph = " + photograph));
        const Outcome outcome = command.run({"fit", command.path("study.toml"), "-o", command.path("fit.h5")});
        EXPECT_EQ(outcome.status, 2) << phrase;
        EXPECT_TRUE(contains(outcome.error, phrase)) << outcome.error;
        EXPECT_FALSE(std::filesystem::exists(command.path("fit.h5.runs")));
    };
    refused(R"({ picture = "text.png", pixel = "20 um" })", "experiments.block.photograph.picture");
    refused(fmt::format(R"({{ picture = "{}/rings.png", pixel = "20 um", offset = ["1 m", "0 m"] }})", SAMPLES),
            "shows nothing of the specimen");
    refused(R"({ picture = "text.png" })", "edge of a pixel");
}

// The whole way of a test through the command, against a known truth: simulate, photograph, correlate, track, fit.
#include "datasets/displacement_field.hpp"
#include "datasets/io.hpp"
#include "tests/cli/command.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>

using namespace crampfit;

namespace {

/// A block that is split from its left side, as a laboratory does it.
struct Block {
    bool rings = false;
    double cell = 0.25;  // of the model that is fitted; the truth's is half of it [mm]
    int frames = 5;
    double pixel = 40;  // [um]
    int subset = 21;    // [px]
    bool notched = false;
    double margin = 0;  // of the pictures about the specimen [mm]

    std::string scene(double with_cell) const {
        return fmt::format(
            R"(
[model]
plane = "strain"
thickness = "10 mm"
cell = "{} mm"

[specimen]
size = ["12 mm", "10 mm"]
{}
{}

[materials]
EW = {{ kind = "isotropic", E = "150 MPa", nu = 0.33, density = "300 kg/m^3", toughness = "60 J/m^2" }}
LW = {{ kind = "isotropic", E = "1500 MPa", nu = 0.33, density = "800 kg/m^3", toughness = "120 J/m^2" }}

[[edges]]
name = "top"
side = "top"
range = ["0 mm", "2 mm"]
velocity = ["0 m/s", "1 mm/min"]

[[edges]]
name = "bottom"
side = "bottom"
range = ["0 mm", "2 mm"]
velocity = ["0 m/s", "0 m/s"]

[[cracks]]
points = [["{} mm", "5.1 mm"], ["{} mm", "5.1 mm"]]
grows = "end"
advance = "0.5 mm"
direction = "straight"

[measure]
force = "top"
displacement = "top"

[solver]
kind = "quasistatic"

[stop]
displacement = "{}"

[output]
frames = {}
)",
            with_cell,
            rings ? R"(rings = { pith = ["-20 mm", "5 mm"], period = "3 mm", latewood_fraction = 0.3, transition = "0 mm" })"
                  : "material = \"EW\"",
            notched ? R"(cutouts = [ { polygon = [["0 mm", "3.6 mm"], ["3 mm", "5.1 mm"], ["0 mm", "6.6 mm"]] } ])" : "",
            notched ? 3 : 0, notched ? 4.5 : 3, rings ? "0.48 mm" : "0.45 mm", frames);
    }
};

struct Image {
    double tip_x, tip_y, length;  // true [px], [px], [m]
    std::string status;           // of the tracked tip
    double found_x = NAN, found_y = NAN;
};

std::vector<std::vector<std::string>> fields_of(const std::string& csv) {
    std::vector<std::vector<std::string>> rows;
    std::istringstream lines(csv);
    std::string line;
    std::getline(lines, line);
    while (std::getline(lines, line)) {
        std::istringstream in(line);
        std::vector<std::string>& row = rows.emplace_back();
        for (std::string field; std::getline(in, field, ',');) row.push_back(field);
    }
    return rows;
}

std::vector<std::string> images_of(const Command& command, int frames) {
    std::vector<std::string> names{command.path("pictures/reference.png")};
    for (int i = 0; i < frames; ++i) names.push_back(command.path(fmt::format("pictures/image_{:04}.png", i)));
    return names;
}

Outcome with_images(Command& command, const std::string& verb, const Block& block, const std::string& output) {
    std::vector<std::string> words{verb};
    for (const std::string& name : images_of(command, block.frames)) words.push_back(name);
    for (const std::string& word :
         {std::string("-o"), command.path(output), std::string("--pixel"), fmt::format("{} um", block.pixel),
          std::string("--subset"), std::to_string(block.subset), std::string("--times"), command.path("pictures/load.csv"),
          std::string("--preview"), command.path(verb + ".png")})
        words.push_back(word);
    if (verb == "track") words.insert(words.end(), {"--load", command.path("pictures/load.csv")});
    return command.run(words);
}

void simulate_and_photograph(Command& command, const Block& block) {
    command.folder.write("truth.toml", block.scene(0.5 * block.cell));
    command.folder.write("scene.toml", block.scene(block.cell));
    const Outcome run = command.run({"simulate", command.path("truth.toml"), "-o", command.path("record.h5")});
    ASSERT_EQ(run.status, 0) << run.error;
    const Outcome taken = command.run({"camera", command.path("record.h5"), "-o", command.path("pictures"), "--pixel",
                                       fmt::format("{} um", block.pixel), "--margin", fmt::format("{} mm", block.margin)});
    ASSERT_EQ(taken.status, 0) << taken.error;
}

/// Tips against the truth: within 2 subsets in every frame, unbiased within half a subset on average.
void expect_tips(Command& command, const Block& block) {
    const Outcome tracked = with_images(command, "track", block, "track.h5");
    ASSERT_EQ(tracked.status, 0) << tracked.error;
    EXPECT_TRUE(contains(tracked.error, "clocks: by the displacement that images and load share")) << tracked.error;
    const auto truth = fields_of(command.folder.read("pictures/truth.csv"));
    const auto found = fields_of(command.run({"csv", command.path("track.h5"), "series"}).out);
    ASSERT_EQ(found.size(), truth.size());
    double sum = 0, worst = 0;
    int count = 0;
    for (std::size_t i = 1; i < truth.size(); ++i) {  // the first picture is of the unloaded specimen
        const double x = std::stod(truth[i][2]), y = std::stod(truth[i][3]);
        if (x > 12e3 / block.pixel - 1.5 * block.subset) continue;  // it has left, or is about to
        ASSERT_EQ(found[i][6], "ok") << "image " << i;
        const double off = std::stod(found[i][2]) - x;
        const double distance = std::hypot(off, std::stod(found[i][3]) - y);
        std::printf("image %zu: tip at %.1f, %.1f; found off by %.1f, %.1f px, sigma %.1f px\n", i, x, y, off,
                    std::stod(found[i][3]) - y, std::stod(found[i][5]) / (1e-6 * block.pixel));
        sum += off;
        worst = std::max(worst, distance);
        ++count;
    }
    ASSERT_GE(count, 3);
    std::printf("tips in %d images: worst %.1f px of %d, mean %.1f px of %.1f\n", count, worst, 2 * block.subset, sum / count,
                0.5 * block.subset);
    std::fflush(stdout);
    EXPECT_LT(worst, 2 * block.subset);
    EXPECT_LT(std::abs(sum / count), 0.5 * block.subset);
}

std::string parameter(const std::string& key, const char* unit, double truth) {
    return fmt::format("[[parameters]]\nname = \"{}\"\nkey = \"materials.{}\"\ninitial = \"{} {}\"\nlower = \"{} {}\"\nupper = "
                       "\"{} {}\"\nscale = \"log\"\n\n",
                       key, key, 1.5 * truth, unit, 0.3 * truth, unit, 3 * truth, unit);
}

void expect_fit(Command& command, const std::vector<std::pair<std::string, double>>& truth, double tolerance) {
    command.folder.write("experiment.csv", command.run({"csv", command.path("track.h5"), "experiment"}).out);
    std::string study = R"(
[[experiments]]
name = "block"
scene = "scene.toml"
data = "experiment.csv"
fields = "field.h5"
noise = { force = "0.3 N", crack_length = "0.3 mm", displacement_field = "1 um" }  # 1 um is the grid's own error, more than the pictures'

[optimizer]
max_runs = 200

)";
    for (const auto& [key, value] : truth) study += parameter(key, contains(key, "tough") ? "J/m^2" : "MPa", value);
    command.folder.write("study.toml", study);
    const Outcome fitted = command.run({"fit", command.path("study.toml"), "-o", command.path("fit.h5")});
    ASSERT_EQ(fitted.status, 0) << fitted.error;
    const Fit fit = read_fit(command.path("fit.h5"));
    for (std::size_t j = 0; j < truth.size(); ++j) {
        const FittedParameter& p = fit.parameters[j];
        std::printf("%s: %.4g %s, true %.4g (%+.2f %%), 95 %% within %.4g .. %.4g\n", p.name.c_str(), p.value, p.unit.c_str(),
                    truth[j].second, 100 * (p.value / truth[j].second - 1), p.lower_95, p.upper_95);
        EXPECT_NEAR(p.value, truth[j].second, tolerance * truth[j].second);
    }
    std::fflush(stdout);
    std::printf("%zu runs, %.1f s, reduced chi-square %.3g\n%s\n", fit.runs.size(), fit.seconds, fit.reduced_chi_square,
                fit.message.c_str());
}

}  // namespace

TEST(SystemChain, FromASimulationThroughPicturesToItsParameters) {
    Command command;
    const Block block;
    simulate_and_photograph(command, block);
    expect_tips(command, block);
    const Outcome correlated = with_images(command, "correlate", block, "field.h5");
    ASSERT_EQ(correlated.status, 0) << correlated.error;
    expect_fit(command, {{"EW.E", 150}, {"EW.toughness", 60}}, 0.05);
}

TEST(SlowChain, RingsWithMoreFrames) {
    Command command;
    const Block block{.rings = true, .frames = 16, .pixel = 25, .subset = 31};
    simulate_and_photograph(command, block);
    expect_tips(command, block);
    const Outcome correlated = with_images(command, "correlate", block, "field.h5");
    ASSERT_EQ(correlated.status, 0) << correlated.error;
    expect_fit(command, {{"EW.E", 150}, {"LW.E", 1500}, {"EW.toughness", 60}, {"LW.toughness", 120}}, 0.05);
}

// As in a wedge test: subsets along the flanks and the edges are lost as well as those that the crack tears, and the crack begins
// at the notch's root, in the scene and in the pictures.
TEST(SystemChain, CrackOfANotchedSpecimen) {
    for (const double margin : {0.0, 0.8}) {
        Command command;
        const Block block{.pixel = 20, .subset = 31, .notched = true, .margin = margin};
        simulate_and_photograph(command, block);
        const Outcome tracked = with_images(command, "track", block, "track.h5");
        ASSERT_EQ(tracked.status, 0) << tracked.error;
        const auto truth = fields_of(command.folder.read("pictures/truth.csv"));
        const auto found = fields_of(command.run({"csv", command.path("track.h5"), "series"}).out);
        ASSERT_EQ(found.size(), truth.size());
        int told = 0;
        for (std::size_t i = 1; i < truth.size(); ++i) {
            ASSERT_EQ(found[i][6], "ok") << "image " << i;
            const double x = std::stod(found[i][2]) - std::stod(truth[i][2]), y = std::stod(found[i][3]) - std::stod(truth[i][3]);
            const double length = std::stod(found[i][4]) - std::stod(truth[i][4]), sigma = std::stod(found[i][5]);
            std::printf("margin %.1f mm, image %zu: crack %.2f mm, tip off by %.1f, %.1f px, length by %.3f mm, sigma %.3f mm\n",
                        margin, i, 1e3 * std::stod(truth[i][4]), x, y, 1e3 * length, 1e3 * sigma);
            EXPECT_LT(std::abs(length), 3 * sigma + 0.1e-3);  // the root is found to a few pixels
            told += sigma < 0.3e-3;
        }
        EXPECT_GE(told, 3);
        // Arms that turn apart darken the notch's flanks, too: no part of the crack.
        const Outcome dark =
            command.run({"track", command.path("pictures/reference.png"), command.path("pictures/image_0004.png"), "-o",
                         command.path("dark.h5"), "--pixel", "20 um", "--from", "gray"});
        ASSERT_EQ(dark.status, 0) << dark.error;
        const auto by_line = fields_of(command.run({"csv", command.path("dark.h5"), "series"}).out);
        ASSERT_EQ(by_line.at(0)[6], "ok");
        const double off = std::stod(by_line[0][4]) - std::stod(truth[4][4]), sigma = std::stod(by_line[0][5]);
        std::printf("margin %.1f mm, by the dark line alone: length by %.3f mm, sigma %.3f mm\n", margin, 1e3 * off, 1e3 * sigma);
        EXPECT_LT(std::abs(off), 3 * sigma + 0.1e-3);
        EXPECT_EQ(command.run({"report", command.path("track.h5"), "-o", command.path("track.html")}).status, 0);
    }
}

TEST(SystemChain, CameraRefusesWhatItCannotPhotograph) {
    Command command;
    Block block;
    block.frames = 0;
    command.folder.write("scene.toml", block.scene(1.0));
    ASSERT_EQ(command.run({"simulate", command.path("scene.toml"), "-o", command.path("record.h5")}).status, 0);
    const auto refused = [&](const std::vector<std::string>& more, const std::string& phrase) {
        std::vector<std::string> words{"camera", command.path("record.h5"), "-o", command.path("pictures")};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 2) << phrase;
        EXPECT_TRUE(contains(outcome.error, phrase)) << outcome.error;
    };
    refused({"--pixel", "25 um"}, "output.frames");
    refused({"--pixel", "25"}, "--pixel");
    refused({"--pixel", "25 um", "--noise", "-1"}, "noise");
    refused({"--pixel", "25 um", "--margin", "-1 mm"}, "--margin");
    EXPECT_FALSE(std::filesystem::exists(command.path("pictures")));
}

#include "datasets/io.hpp"
#include "tests/cli/command.hpp"
#include "tests/cli/scenes.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

using namespace crampfit;

namespace {

/// A study that looks for the E with which `small_scene` was run to make its data.
std::string study(int max_runs) {
    return fmt::format(R"(
title = "E of a block"

[[experiments]]
name = "pull"
scene = "scene.toml"
data = "pull.csv"
noise = {{ force = "0.5 N" }}

[[parameters]]
name = "EW stiffness"
key = "materials.EW.E"
initial = "60 MPa"
lower = "10 MPa"
upper = "100 MPa"
scale = "log"

[optimizer]
starts = 1
max_runs = {}
)",
                       max_runs);
}

/// Runs the scene and writes its force and displacement as the test's data.
void make_data(Command& command) {
    command.folder.write("scene.toml", small_scene);
    ASSERT_EQ(command.run({"simulate", command.path("scene.toml"), "-o", command.path("truth.h5")}).status, 0);
    Curves curves;
    for (const Instant& instant : read_record(command.path("truth.h5")).series) {
        curves.displacement.push_back(instant.displacement);
        curves.force.push_back(instant.force);
    }
    write_curves(curves, command.path("pull.csv"));
}

}  // namespace

TEST(SystemCommand, FitFindsWhatMadeTheData) {
    Command command;
    make_data(command);
    command.folder.write("study.toml", study(60));
    const Outcome outcome = command.run({"fit", command.path("study.toml"), "-o", command.path("fit.h5")});
    ASSERT_EQ(outcome.status, 0) << outcome.error;
    EXPECT_TRUE(contains(outcome.out, "EW stiffness")) << outcome.out;
    EXPECT_TRUE(contains(outcome.out, "95 % interval")) << outcome.out;

    const Fit fit = read_fit(command.path("fit.h5"));
    EXPECT_EQ(fit.status, FitStatus::converged);
    ASSERT_EQ(fit.parameters.size(), 1u);
    // The data come from the model itself and carry no noise: what is left is where the search ends.
    EXPECT_NEAR(fit.parameters.front().value, 40.0, 0.4);
    EXPECT_EQ(fit.parameters.front().unit, "MPa");

    const Outcome table = command.run({"csv", command.path("fit.h5"), "parameters"});
    EXPECT_EQ(table.out.rfind("name,key,value,unit,standard_error,lower_95,upper_95,initial,at_bound\n"
                              "EW stiffness,materials.EW.E,",
                              0),
              0u)
        << table.out;
}

TEST(SystemCommand, FitThatRunsOutOfRunsIsSavedWithStatusOne) {
    Command command;
    make_data(command);
    command.folder.write("study.toml", study(2));
    const Outcome outcome = command.run({"fit", command.path("study.toml"), "-o", command.path("fit.h5"), "--quiet"});
    EXPECT_EQ(outcome.status, 1) << outcome.error;
    EXPECT_EQ(outcome.error, "crampfit: All runs that optimizer.max_runs allows were used up before the end.\n");
    EXPECT_EQ(read_fit(command.path("fit.h5")).status, FitStatus::run_limit);
}

TEST(SystemCommand, InterruptedFitIsSaved) {
    Command command;
    make_data(command);
    command.folder.write("scene.toml", endless_scene);
    command.folder.write("study.toml", study(60));
    command.start({"fit", command.path("study.toml"), "-o", command.path("fit.h5"), "--log", command.path("log.txt")});
    EXPECT_TRUE(command.wait_for("log.txt", "study is read"));
    command.send(SIGINT);
    const Outcome outcome = command.finish();
    EXPECT_EQ(outcome.status, 130) << outcome.error;
    EXPECT_EQ(read_fit(command.path("fit.h5")).status, FitStatus::interrupted);
}

TEST(SystemCommand, BadStudyIsStatusTwoAndNamesFileAndKey) {
    Command command;
    make_data(command);
    command.folder.write("study.toml", study(60) + "\nbest = true\n");
    const Outcome outcome = command.run({"fit", command.path("study.toml"), "-o", command.path("fit.h5")});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_EQ(outcome.error.rfind("crampfit: error: ", 0), 0u) << outcome.error;
    EXPECT_TRUE(contains(outcome.error, "study.toml: optimizer.best")) << outcome.error;

    command.folder.write("study.toml", study(60));
    command.folder.write("pull.csv", "displacement [mm],force [N]\n0.1,1\n0.05,2\n0.02,3\n");
    const Outcome falls = command.run({"fit", command.path("study.toml"), "-o", command.path("fit.h5")});
    EXPECT_EQ(falls.status, 2);
    EXPECT_TRUE(contains(falls.error, "pull.csv: displacement")) << falls.error;
    for (const char* file : {"fit.h5", "fit.h5.runs"}) EXPECT_FALSE(std::filesystem::exists(command.path(file))) << file;
}

// A fixture that gives way and begins loose: what it does to the curve takes no further run, and with its compliance given the
// modulus and the slack are found as exactly as the data say them.
TEST(SystemCommand, FitSeesThroughTheMachine) {
    Command command;
    command.folder.write("scene.toml", slow_scene());
    ASSERT_EQ(command.run({"simulate", command.path("scene.toml"), "-o", command.path("truth.h5"), "--quiet"}).status, 0);
    Curves curves;
    for (const Instant& instant : read_record(command.path("truth.h5")).series) {
        if (instant.force > 60) break;  // before the crack moves
        curves.displacement.push_back(instant.displacement + 0.3e-6 * instant.force + 5e-6);
        curves.force.push_back(instant.force - 0.25);
    }
    write_curves(curves, command.path("pull.csv"));
    command.folder.write("study.toml", study(60) + R"(
[[parameters]]
name = "slack"
key = "experiments.pull.displacement_offset"
initial = "0 um"
lower = "-20 um"
upper = "20 um"
)");
    const Outcome outcome =
        command.run({"fit", command.path("study.toml"), "-o", command.path("fit.h5"), "--quiet", "--set",
                     "experiments.pull.compliance=0.3 um/N", "--set", "experiments.pull.force_offset=-0.25 N"});
    ASSERT_EQ(outcome.status, 0) << outcome.error;
    const Fit fit = read_fit(command.path("fit.h5"));
    EXPECT_NEAR(fit.parameters[0].value, 40.0, 40e-6);
    EXPECT_NEAR(fit.parameters[1].value, 5.0, 5e-6);
}

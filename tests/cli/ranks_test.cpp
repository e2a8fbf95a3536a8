// A study on several ranks, against one process.
#include "datasets/io.hpp"
#include "tests/cli/command.hpp"
#include "tests/cli/scenes.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>

using namespace crampfit;

namespace {

const std::string small_study = R"(
scene = "scene.toml"
outputs = ["peak force", "work of fracture"]

[[parameters]]
name = "toughness"
key = "materials.EW.toughness"
lower = "50 J/m^2"
upper = "110 J/m^2"

[[parameters]]
name = "modulus"
key = "materials.EW.E"
initial = "50 MPa"
lower = "40 MPa"
upper = "80 MPa"

[sensitivity]
method = "sobol"
samples = 8
)";

const std::string fit_study = R"(
[[experiments]]
name = "pull"
scene = "scene.toml"
data = "pull.csv"
noise = { force = "0.5 N" }

[[parameters]]
name = "EW stiffness"
key = "materials.EW.E"
initial = "60 MPa"
lower = "10 MPa"
upper = "100 MPa"
scale = "log"

[optimizer]
method = "sbplx"
starts = 3
max_runs = 24
)";

Outcome on_ranks(Command& command, int ranks, int threads, const std::string& verb, const std::string& output) {
    const std::string words =
        fmt::format("cd {} && mpirun --allow-run-as-root --oversubscribe --bind-to none -n {} {} {} study.toml -o {} "
                    "--threads {} > out.txt 2> error.txt",
                    command.path("."), ranks, COMMAND, verb, output, threads);
    const int status = std::system(words.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 255, command.folder.read("out.txt"), command.folder.read("error.txt")};
}

}  // namespace

TEST(SystemRanks, SensitivityHasTheSameBits) {
    Command command;
    command.folder.write("scene.toml", slow_scene());
    command.folder.write("study.toml", small_study);
    ASSERT_EQ(command.run({"sensitivity", command.path("study.toml"), "-o", command.path("alone.h5"), "--threads", "1"}).status,
              0);
    const std::string indices = command.run({"csv", command.path("alone.h5"), "indices"}).out;
    const std::string runs = command.run({"csv", command.path("alone.h5"), "runs"}).out;
    for (const auto& [ranks, threads] : {std::pair{1, 2}, {2, 1}, {2, 2}, {4, 1}, {4, 2}}) {
        const Outcome outcome = on_ranks(command, ranks, threads, "sensitivity", "ranks.h5");
        ASSERT_EQ(outcome.status, 0) << outcome.error;
        EXPECT_EQ(command.run({"csv", command.path("ranks.h5"), "indices"}).out, indices) << ranks << " ranks";
        EXPECT_EQ(without_seconds(command.run({"csv", command.path("ranks.h5"), "runs"}).out), without_seconds(runs))
            << ranks << " ranks";
    }
}

TEST(SystemRanks, FitHasTheSameBits) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    command.folder.write("study.toml", fit_study);
    command.folder.write("pull.csv", "displacement [mm],force [N]\n0,0\n0.05,20\n0.1,41\n");
    const int alone = command.run({"fit", command.path("study.toml"), "-o", command.path("alone.h5"), "--threads", "1"}).status;
    const std::string runs = without_seconds(command.run({"csv", command.path("alone.h5"), "runs"}).out);
    const std::string parameters = command.run({"csv", command.path("alone.h5"), "parameters"}).out;
    EXPECT_TRUE(contains(parameters, "EW stiffness"));
    for (const int ranks : {2, 4}) {
        const Outcome outcome = on_ranks(command, ranks, 1, "fit", "ranks.h5");
        EXPECT_EQ(outcome.status, alone) << outcome.error;
        EXPECT_EQ(command.run({"csv", command.path("ranks.h5"), "parameters"}).out, parameters);
        EXPECT_EQ(without_seconds(command.run({"csv", command.path("ranks.h5"), "runs"}).out), runs);
    }
}

// Runs that fail on other ranks are recorded with their reason, as they are at home.
TEST(SystemRanks, FailedRunsAreRecorded) {
    Command command;
    command.folder.write("scene.toml", endless_scene);
    command.folder.write("study.toml", small_study + "[runs]\ntime_limit = \"50 ms\"\n");
    const Outcome outcome = on_ranks(command, 3, 1, "sensitivity", "ranks.h5");
    EXPECT_EQ(outcome.status, 1) << outcome.error;
    const std::string runs = command.run({"csv", command.path("ranks.h5"), "runs"}).out;
    int failed = 0;
    for (std::size_t at = 0; (at = runs.find("longer than runs.time_limit", at)) != std::string::npos; ++at) ++failed;
    EXPECT_EQ(failed, 32) << runs;
    EXPECT_TRUE(contains(outcome.error, "to run it again")) << outcome.error;
}

// A rank that dies takes the others with it; what has ended is kept, and one process goes on from there to the same bits.
TEST(SystemRanks, ALostRankCostsNoRunThatHasEnded) {
    Command command;
    std::string scene = small_scene;
    scene.replace(scene.find("\"0.5 mm\""), 8, "\"0.2 mm\"");
    command.folder.write("scene.toml", scene);
    command.folder.write("study.toml", small_study);
    const std::string script = fmt::format(
        "mpirun --allow-run-as-root --oversubscribe --bind-to none -n 3 {} sensitivity {} -o {} --threads 1 > {} 2>&1 & job=$!\n"
        "for i in $(seq 6000); do [ \"$(stat -c %s {}.runs 2> /dev/null || echo 0)\" -gt 500 ] && break; sleep 0.01; done\n"
        "for p in $(pgrep -f '{}'); do grep -qz OMPI_COMM_WORLD_RANK=2 /proc/$p/environ && kill -9 $p; done\nwait $job\n",
        COMMAND, command.path("study.toml"), command.path("lost.h5"), command.path("out.txt"), command.path("lost.h5"),
        "sensitivity " + command.path("study.toml"));
    EXPECT_NE(std::system(script.c_str()), 0);
    EXPECT_FALSE(std::filesystem::exists(command.path("lost.h5")));
    const auto kept = command.folder.read("lost.h5.runs").size();
    EXPECT_GT(kept, 500u);
    ASSERT_EQ(
        command.run({"sensitivity", command.path("study.toml"), "-o", command.path("lost.h5"), "--resume", "--quiet"}).status, 0);
    ASSERT_EQ(command.run({"sensitivity", command.path("study.toml"), "-o", command.path("alone.h5"), "--quiet"}).status, 0);
    EXPECT_EQ(command.run({"csv", command.path("lost.h5"), "indices"}).out,
              command.run({"csv", command.path("alone.h5"), "indices"}).out);
    EXPECT_EQ(command.folder.read("lost.h5.runs").size(), command.folder.read("alone.h5.runs").size());  // none was run twice
}

TEST(SystemRanks, BadInputIsSaidOnce) {
    Command command;
    command.folder.write("scene.toml", slow_scene());
    command.folder.write("study.toml", small_study + "best = 1\n");
    const Outcome outcome = on_ranks(command, 3, 1, "sensitivity", "ranks.h5");
    EXPECT_EQ(outcome.status, 2) << outcome.error;
    const std::size_t first = outcome.error.find("sensitivity.best");
    EXPECT_NE(first, std::string::npos) << outcome.error;
    EXPECT_EQ(outcome.error.find("sensitivity.best", first + 1), std::string::npos) << outcome.error;
}

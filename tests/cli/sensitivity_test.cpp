#include "datasets/io.hpp"
#include "tests/cli/command.hpp"
#include "tests/cli/scenes.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>

using namespace crampfit;

namespace {

const std::string sensitivity_study = R"(
scene = "scene.toml"
outputs = ["peak force", "initial stiffness", "work of fracture"]

[[parameters]]
name = "toughness"
key = "materials.EW.toughness"
lower = "50 J/m^2"
upper = "110 J/m^2"
scale = "log"

[[parameters]]
name = "modulus"
key = "materials.EW.E"
initial = "50 MPa"
lower = "40 MPa"
upper = "80 MPa"

[sensitivity]
method = "local"
samples = 8
)";

}  // namespace

// Peak force goes with sqrt(E Gc), stiffness with E, the work to split the specimen with Gc (Griffith 1921).
TEST(SystemCommand, LocalSensitivityKnowsLinearFractureMechanics) {
    Command command;
    command.folder.write("scene.toml", slow_scene());
    command.folder.write("study.toml", sensitivity_study);
    const Outcome outcome = command.run({"sensitivity", command.path("study.toml"), "-o", command.path("out.h5")});
    ASSERT_EQ(outcome.status, 0) << outcome.error;
    EXPECT_TRUE(contains(outcome.out, "elasticity")) << outcome.out;
    std::map<std::pair<std::string, std::string>, double> elasticity, derivative;
    for (const SensitivityIndex& index : read_sensitivity(command.path("out.h5")).indices) {
        (index.kind == "elasticity" ? elasticity : derivative)[{index.output, index.parameter}] = index.value;
        EXPECT_LE(index.lower_95, index.value);
        EXPECT_GE(index.upper_95, index.value);
    }
    // Exact derivatives; the peak is a row of the series, and the slope of a line through rows is good to a part in 10^7.
    const double near = 1e-6;
    EXPECT_NEAR((elasticity[{"peak force", "toughness"}]), 0.5, near);
    EXPECT_NEAR((elasticity[{"peak force", "modulus"}]), 0.5, near);
    EXPECT_NEAR((elasticity[{"initial stiffness", "toughness"}]), 0, near);
    EXPECT_NEAR((elasticity[{"initial stiffness", "modulus"}]), 1, near);
    EXPECT_NEAR((elasticity[{"work of fracture", "toughness"}]), 1, near);
    EXPECT_NEAR((elasticity[{"work of fracture", "modulus"}]), 0, near);
    const Outcome simulated = command.run(
        {"simulate", command.path("scene.toml"), "-o", command.path("r.h5"), "--quiet", "--set", "materials.EW.E=50 MPa"});
    ASSERT_EQ(simulated.status, 0);
    double peak = 0;
    for (const Instant& instant : read_record(command.path("r.h5")).series) peak = std::max(peak, instant.force);
    EXPECT_NEAR((derivative[{"peak force", "modulus"}]), 0.5 * peak / 50, 1e-6 * peak / 50);  // N for each MPa
    EXPECT_EQ(read_sensitivity(command.path("out.h5")).runs.size(), 1u);
}

TEST(SystemCommand, MorrisAndSobolSensitivityPrintTheirTable) {
    Command command;
    command.folder.write("scene.toml", slow_scene());
    command.folder.write("study.toml", sensitivity_study);
    for (const std::string method : {"morris", "sobol"}) {
        const Outcome outcome = command.run({"sensitivity", command.path("study.toml"), "-o", command.path("out.h5"), "--quiet",
                                             "--set", "sensitivity.method=" + method});
        ASSERT_EQ(outcome.status, 0) << outcome.error;
        const Outcome table = command.run({"csv", command.path("out.h5"), "indices"});
        EXPECT_EQ(table.out.rfind("output,parameter,method,value,lower_95,upper_95,kind\npeak force,toughness," + method, 0), 0u)
            << table.out;
    }
}

// Killed three times on its way, then left to finish: as if it had never been killed.
TEST(SystemCommand, KilledSensitivityGoesOnToTheSameBits) {
    Command command;
    command.folder.write("scene.toml", slow_scene());
    command.folder.write("study.toml", sensitivity_study);
    const auto words = [&](const std::string& output) {
        return std::vector<std::string>{
            "sensitivity", command.path("study.toml"), "-o",    command.path(output),      "--quiet", "--resume",
            "--set",       "sensitivity.method=sobol", "--set", "sensitivity.samples=1024"};
    };
    std::size_t kept = 0;
    for (int i = 0; i < 3; ++i) {
        command.start(words("killed.h5"));
        const auto grown = [&] { return command.folder.read("killed.h5.runs").size() > kept + 300; };  // bytes: some runs
        for (int wait = 0; wait < 6000 && !grown(); ++wait) std::this_thread::sleep_for(std::chrono::milliseconds(5));
        command.send(SIGKILL);
        EXPECT_EQ(command.finish().status, 128 + SIGKILL);
        EXPECT_FALSE(std::filesystem::exists(command.path("killed.h5")));
        kept = command.folder.read("killed.h5.runs").size();
        EXPECT_GT(kept, 300u);
    }
    ASSERT_EQ(command.run(words("killed.h5")).status, 0);
    ASSERT_EQ(command.run(words("whole.h5")).status, 0);
    const std::string killed = command.run({"csv", command.path("killed.h5"), "indices"}).out;
    EXPECT_EQ(killed, command.run({"csv", command.path("whole.h5"), "indices"}).out);
    EXPECT_TRUE(contains(killed, "total"));
    EXPECT_EQ(command.folder.read("killed.h5.runs").size(), command.folder.read("whole.h5.runs").size());  // none was run twice
}

TEST(SystemCommand, SensitivityRefusesAFitWithoutDataAndUnknownOutputs) {
    Command command;
    command.folder.write("scene.toml", slow_scene());
    command.folder.write("study.toml", sensitivity_study);
    const Outcome fit = command.run({"fit", command.path("study.toml"), "-o", command.path("fit.h5")});
    EXPECT_EQ(fit.status, 2);
    EXPECT_TRUE(contains(fit.error, "experiments")) << fit.error;
    const Outcome outcome = command.run(
        {"sensitivity", command.path("study.toml"), "-o", command.path("out.h5"), "--set", "outputs=[\"peak farce\"]"});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(contains(outcome.error, "did you mean \"peak force\"?")) << outcome.error;
}

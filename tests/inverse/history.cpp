// Numbers of wood that remembers, found again from curves made with them.
#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "forward/simulate.hpp"
#include "inverse/fit.hpp"
#include "inverse/kept_walks.hpp"
#include "inverse/run_end.hpp"
#include "tests/temporary_folder.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdio>

namespace crampfit::testing {
namespace {

std::string bar(const std::string& wood, const std::string& until) {
    return fmt::format(R"(
[model]
plane = "stress"
thickness = "10 mm"
cell = "1 mm"
[specimen]
size = ["4 mm", "2 mm"]
material = "EW"
[materials.EW]
{}
E = "40 MPa"
nu = 0.33
density = "300 kg/m^3"
toughness = "100 J/m^2"
[[edges]]
name = "left"
side = "left"
velocity = ["0 m/s", "free"]
[[edges]]
name = "bottom"
side = "bottom"
velocity = ["free", "0 m/s"]
[[edges]]
name = "right"
side = "right"
velocity = ["0.1 mm/s", "free"]
until = "{}"
[measure]
force = "right"
displacement = "right"
[solver]
kind = "quasistatic"
[stop]
time = "10 s"
)",
                       wood, until);
}

std::string parameter(const std::string& key, const std::string& initial, const std::string& lower, const std::string& upper) {
    return fmt::format(
        "[[parameters]]\nname = \"{}\"\nkey = \"materials.EW.{}\"\ninitial = {}\nlower = {}\nupper = {}\nscale = \"log\"\n", key,
        key, initial, lower, upper);
}

/// Fits from other values to curves of force over time, or over displacement where it rises to the end.
Fit fit_again(const std::string& scene_text, const std::string& parameters, bool over_time) {
    const TemporaryFolder folder;
    const Scene scene = read_scene(folder.write("scene.toml", scene_text));
    Curves curves;
    for (const Instant& row : simulate(scene).series) {
        (over_time ? curves.time : curves.displacement).push_back(over_time ? row.time : row.displacement);
        curves.force.push_back(row.force);
    }
    write_curves(curves, folder / "data.csv");
    const Study study =
        read_study(folder.write("study.toml", "[[experiments]]\nname = \"bar\"\nscene = \"scene.toml\"\ndata = \"data.csv\"\n"
                                              "noise = { force = \"0.01 N\" }\n" +
                                                  parameters + "[optimizer]\nstarts = 1\nmax_runs = 200\n"));
    const KeptWalks walks(study, 1);
    EXPECT_FALSE(walks.has_slopes());
    FitOptions options;
    options.threads = 1;
    options.forward = walks.exact();
    return fit_study(study, options);
}

TEST(SystemHistory, APronySeriesIsFoundAgain) {
    const Fit fit = fit_again(
        bar("kind = \"viscoelastic\"\nprony = [ { g = 0.3, k = 0.3, tau = \"2 s\" } ]", "0.5 s"),
        parameter("prony.0.g", "0.5", "0.05", "0.9") + parameter("prony.0.tau", "\"1 s\"", "\"0.1 s\"", "\"20 s\""), true);
    ASSERT_EQ(fit.parameters.size(), 2U);
    std::printf("g %.4f, tau %.4f s\n", fit.parameters[0].value, fit.parameters[1].value);
    EXPECT_NEAR(fit.parameters[0].value, 0.3, 0.003);
    EXPECT_NEAR(fit.parameters[1].value, 2.0, 0.02);
}

// The same curve a hundred times as fast is another test; where the wood does not remember, it is the same.
TEST(SystemHistory, WoodThatRemembersIsLoadedAsInTheTest) {
    const TemporaryFolder folder;
    const std::string relaxes = "kind = \"viscoelastic\"\nprony = [ { g = 0.3, k = 0.3, tau = \"2 s\" } ]";
    const auto told = [&](const std::string& wood, double faster, const std::string& of_experiment) -> std::string {
        folder.write("scene.toml", bar(wood, "0.5 s"));
        std::string data = "time [s],displacement [mm],force [N]\n";
        for (int i = 1; i <= 5; ++i) {
            data += fmt::format("{},{},{}\n", 0.1 * i / faster, 0.01 * i, i);
        }
        folder.write("data.csv", data);
        const Study study =
            read_study(folder.write("study.toml", "[[experiments]]\nscene = \"scene.toml\"\ndata = \"data.csv\"\n" +
                                                      of_experiment + parameter("E", "\"40 MPa\"", "\"10 MPa\"", "\"90 MPa\"")));
        try {
            covered_data(study, 0);
            return "";
        } catch (const InputError& error) {
            return error.what();
        }
    };
    EXPECT_EQ(told(relaxes, 1, ""), "");
    EXPECT_NE(told(relaxes, 100, "").find("time = 0.04 mm in 0.004 s: "), std::string::npos) << told(relaxes, 100, "");
    EXPECT_NE(told(relaxes, 0.5, ""), "");
    EXPECT_EQ(told(relaxes, 100, "compliance = \"1 um/N\"\n"), "");
    EXPECT_EQ(told("kind = \"isotropic\"", 100, ""), "");
}

TEST(SystemHistory, YieldStressAndHardeningAreFoundAgain) {
    const Fit fit = fit_again(bar("kind = \"plastic\"\nyield_stress = \"0.6 MPa\"\nhardening = \"4 MPa\"", "10 s"),
                              parameter("yield_stress", "\"0.9 MPa\"", "\"0.2 MPa\"", "\"3 MPa\"") +
                                  parameter("hardening", "\"2 MPa\"", "\"0.5 MPa\"", "\"20 MPa\""),
                              false);
    ASSERT_EQ(fit.parameters.size(), 2U);
    std::printf("yield stress %.4f, hardening %.4f\n", fit.parameters[0].value, fit.parameters[1].value);
    EXPECT_NEAR(fit.parameters[0].value, 0.6, 0.006);
    EXPECT_NEAR(fit.parameters[1].value, 4.0, 0.04);
}

}  // namespace
}  // namespace crampfit::testing

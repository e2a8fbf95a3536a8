// A picture of angles, from file to curve.
#include "tests/cli/command.hpp"
#include "tests/cli/scenes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

namespace {

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
}

/// The small scene in orthotropic wood, slow enough for equilibrium.
std::string orthotropic(const std::string& specimen) {
    std::string scene = replaced(small_scene, "kind = \"isotropic\"\nE = \"40 MPa\"\nnu = 0.33",
                                 "kind = \"orthotropic\"\nE_R = \"80 MPa\"\nE_T = \"40 MPa\"\nG_RT = \"8 MPa\"\nnu_RT = 0.4\n"
                                 "E_L = \"1 GPa\"\nnu_LR = 0.4\nnu_LT = 0.45");
    scene = replaced(scene, "material = \"EW\"", specimen);
    scene = replaced(scene, "grows = \"end\"", "grows = \"end\"\ndirection = \"straight\"");
    return replaced(scene, "kind = \"explicit\"", "kind = \"quasistatic\"");
}

std::vector<double> force_curve(Command& command, const std::string& scene) {
    command.folder.write("scene.toml", scene);
    const Outcome run = command.run({"simulate", command.folder / "scene.toml", "-o", command.folder / "record.h5", "--quiet"});
    EXPECT_EQ(run.status, 0) << run.error;
    std::istringstream series(command.run({"csv", command.folder / "record.h5", "series"}).out);
    std::vector<double> force;
    std::string line;
    std::getline(series, line);
    while (std::getline(series, line)) force.push_back(std::stod(line.substr(line.find(',', line.find(',') + 1) + 1)));
    return force;
}

}  // namespace

TEST(SystemGrain, APictureOfAnglesIsTheDirectionThatItShows) {
    // Gray 85 is 60 degrees: 85 / 255 of 180.
    Command command;
    const std::string head = "P5\n20 20\n255\n";
    command.folder.write("wood.pgm", head + std::string(400, '\xc8'));
    command.folder.write("angles.pgm", head + std::string(400, '\x55'));
    const std::vector<double> number = force_curve(command, orthotropic("material = \"EW\"\nradial = \"60 deg\""));
    const std::vector<double> picture =
        force_curve(command, orthotropic("image = \"wood.pgm\"\npixel = \"0.5 mm\"\norientation = \"angles.pgm\"\n"
                                         "classes = [ { material = \"EW\", gray = [0, 255] } ]"));
    const std::vector<double> turned = force_curve(command, orthotropic("material = \"EW\"\nradial = \"0 deg\""));
    ASSERT_GT(number.size(), 10u);
    ASSERT_EQ(picture.size(), number.size());
    for (std::size_t k = 0; k < number.size(); ++k) EXPECT_NEAR(picture[k], number[k], 1e-5 * std::abs(number.back()));
    EXPECT_GT(std::abs(turned[3] / number[3] - 1), 0.01);  // the direction counts
}

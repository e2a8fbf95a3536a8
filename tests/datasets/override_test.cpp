// Overrides of the command line, and numbers that a fit sets.
#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "tests/datasets/good_scenes.hpp"

#include <gtest/gtest.h>

using namespace crampfit;

namespace {

Scene parse(const Overrides& overrides, const std::string& text = ring_scene) {
    return parse_scene(text, "scene.toml", overrides);
}

/// `blamed_key` and `blamed_value` where they are not those of the override itself.
void expect_error(const std::string& key, const std::string& value, const std::string& phrase, const std::string& blamed_key = "",
                  const std::string& blamed_value = "") {
    try {
        parse({{key, value}});
        FAIL() << key << " = " << value;
    } catch (const InputError& error) {
        EXPECT_EQ(error.file, "command line (--set)") << error.what();
        EXPECT_EQ(error.key, blamed_key.empty() ? key : blamed_key) << error.what();
        EXPECT_EQ(error.value, blamed_value.empty() ? value : blamed_value) << error.what();
        EXPECT_NE(error.rule.find(phrase), std::string::npos) << error.what();
    }
}

}  // namespace

TEST(UnitOverride, KeysOfEveryKind) {
    EXPECT_DOUBLE_EQ(parse({{"materials.EW.toughness", "120 J/m^2"}}).materials.at("EW").toughness, 120);
    EXPECT_DOUBLE_EQ(parse({{"materials.EW.toughness", "\"120 J/m^2\""}}).materials.at("EW").toughness, 120);
    EXPECT_DOUBLE_EQ(parse({{"materials.EW.nu", "0.2"}}).materials.at("EW").poisson_ratio, 0.2);
    EXPECT_EQ(parse({{"model.plane", "stress"}}).model.plane, PlaneCondition::stress);
    EXPECT_DOUBLE_EQ(parse({{"cracks.0.advance", "0 mm"}}).cracks[0].advance, 0);
    EXPECT_DOUBLE_EQ(*parse({{"edges.grip.velocity", "[\"0 m/s\", \"1 m/s\"]"}}).edges[0].velocity[1], 1);
    EXPECT_DOUBLE_EQ(*parse({{"edges.grip.velocity.1", "2 m/s"}}).edges[0].velocity[1], 2);
    EXPECT_DOUBLE_EQ(*parse({{"edges.0.velocity.1", "3 m/s"}}).edges[0].velocity[1], 3);
    EXPECT_DOUBLE_EQ(parse({{"edges.left.traction.0", "3 Pa"}}).edges[1].traction->x(), 3) << "an edge named by its side";
    EXPECT_DOUBLE_EQ(parse({{"bodies.left wheel.velocity.1", "4 m/s"}}).bodies[0].velocity.y(), 4);
    EXPECT_DOUBLE_EQ(parse({{"bodies.\"left wheel\".velocity.1", "5 m/s"}}).bodies[0].velocity.y(), 5);
    EXPECT_DOUBLE_EQ(parse({{"bodies.body 1.velocity.1", "6 m/s"}}).bodies[1].velocity.y(), 6);
    EXPECT_DOUBLE_EQ(parse({{"specimen.rings.period", "3 mm"}}).specimen.rings->period, 3e-3);
    EXPECT_DOUBLE_EQ(std::get<Circle>(parse({{"specimen.cutouts.1.circle.radius", "2 mm"}}).specimen.cutouts[1]).radius, 2e-3);
    EXPECT_EQ(parse({{"output.frames", "1"}, {"output.frames", "2"}}).output.frames, 2) << "the last one counts";
    const std::string dotted = "[materials.\"EW 2.1\"]\nE = \"1 MPa\"\nnu = 0\ndensity = \"1 kg/m^3\"\ntoughness = \"1 J/m^2\"\n";
    EXPECT_DOUBLE_EQ(parse({{"materials.'EW 2.1'.E", "2 MPa"}}, ring_scene + dotted).materials.at("EW 2.1").youngs_modulus, 2e6);
}

TEST(UnitOverride, KeysThatTheFileDoesNotHave) {
    EXPECT_DOUBLE_EQ(parse({{"solver.damping", "5 1/s"}}, plain_scene).solver.damping, 5);
    EXPECT_EQ(parse({{"output.frames", "7"}}, plain_scene).output.frames, 7);
    EXPECT_EQ(parse({{"title", "another"}}, plain_scene).title, "another");
    EXPECT_DOUBLE_EQ(*parse({{"edges.0.until", "2 s"}}, plain_scene).edges[0].until, 2);
}

TEST(UnitOverride, TextIsTheSceneAsUsed) {
    const Scene scene = parse({{"materials.EW.toughness", "120 J/m^2"}, {"bodies.left wheel.velocity.1", "5 m/s"}});
    const Scene again = parse({}, scene.text);
    EXPECT_DOUBLE_EQ(again.materials.at("EW").toughness, 120);
    EXPECT_DOUBLE_EQ(again.bodies[0].velocity.y(), 5);
    EXPECT_DOUBLE_EQ(again.materials.at("EW").poisson_ratio, 0.33);
    EXPECT_EQ(again.cracks.size(), 2U);
}

TEST(UnitOverride, ErrorsNameTheCommandLine) {
    expect_error("materials.EW.toughness", "120", "missing unit");
    expect_error("materials.EW.toughness", "-1 J/m^2", "greater than 0");
    expect_error("materials.EW.tougness", "1 J/m^2", "unknown key; did you mean \"toughness\"?");
    expect_error("materials", "{ EW = { E = \"1 MPa\" } }", "missing key", "materials.EW.nu", "(missing)");
    expect_error("materials.XX.E", "1 MPa", "there is no materials.XX in scene.toml");
    expect_error("modell.cell", "1 mm", "unknown key; did you mean \"model\"?");
    expect_error("model", "3", "must be a table");
    expect_error("model.plane", "plain", "must be one of");
    expect_error("edges.0.velocity.1", "4 MPa", "wrong dimension");
    expect_error("edges.roof.velocity", "4 m/s", "has no member \"roof\"");
    expect_error("cracks.2.advance", "1 mm", "has no member \"2\"");
    expect_error("cracks.advance", "1 mm", "has no member \"advance\"");
    expect_error("model.cell.size", "1 mm", "neither a table nor a list");
    expect_error("model..cell", "1 mm", "a part of the key is empty");
    std::string deep = "model";
    for (int i = 0; i < 100; ++i) {
        deep += ".x";
    }
    expect_error(deep, "1 mm", "too many parts");
    expect_error("", "1 mm", "a part of the key is empty");
    expect_error("bodies.\"left wheel.velocity", "1 mm", "quote");
}

TEST(UnitOverride, NumbersOfAScene) {
    Scene scene = parse({});
    for (const auto& [key, value] : {std::pair{"materials.EW.E", 1e6},
                                     {"materials.EW.nu", 0.1},
                                     {"materials.LW.density", 700.0},
                                     {"materials.LW.toughness", 33.0},
                                     {"model.thickness", 0.02},
                                     {"specimen.rings.period", 4e-3},
                                     {"specimen.rings.latewood_fraction", 0.5},
                                     {"specimen.rings.transition", 1e-3},
                                     {"specimen.rings.pith.1", -4e-3},
                                     {"cracks.1.advance", 1e-3},
                                     {"solver.damping", 3.0},
                                     {"edges.grip.velocity.1", 9.0},
                                     {"bodies.left wheel.velocity.0", 8.0},
                                     {"bodies.1.velocity.1", -7.0}}) {
        set_number(scene, key, value);
        EXPECT_EQ(get_number(scene, key), value) << key;
    }
    EXPECT_EQ(scene.materials.at("EW").youngs_modulus, 1e6);
    EXPECT_EQ(scene.materials.at("EW").poisson_ratio, 0.1);
    EXPECT_EQ(scene.materials.at("LW").density, 700);
    EXPECT_EQ(scene.materials.at("LW").toughness, 33);
    EXPECT_EQ(scene.model.thickness, 0.02);
    EXPECT_EQ(scene.specimen.rings->period, 4e-3);
    EXPECT_EQ(scene.specimen.rings->latewood_fraction, 0.5);
    EXPECT_EQ(scene.specimen.rings->transition, 1e-3);
    EXPECT_EQ(scene.specimen.rings->pith.y(), -4e-3);
    EXPECT_EQ(scene.cracks[1].advance, 1e-3);
    EXPECT_EQ(scene.solver.damping, 3);
    EXPECT_EQ(*scene.edges[0].velocity[1], 9);
    EXPECT_EQ(scene.bodies[0].velocity.x(), 8);
    EXPECT_EQ(scene.bodies[1].velocity.y(), -7);
}

TEST(UnitOverride, NumbersThatCannotBe) {
    Scene scene = parse({});
    const std::vector<std::tuple<std::string, double, std::string>> table{
        {"materials.EW.toughness", 0, "greater than 0"},
        {"materials.EW.nu", 0.5, "between -1 and 0.5"},
        {"materials.EW.E", std::nan(""), "greater than 0"},
        {"materials.EW.E", INFINITY, "greater than 0"},
        {"specimen.rings.period", 0.3e-3, "longer than the ring's period"},
        {"materials.EW.tougness", 1, "did you mean \"toughness\"?"},
        {"materials.EX.toughness", 1, "there is no material EX; did you mean \"EW\"?"},
        {"materials.EW", 1, "ends too early"},
        {"materials.EW.E.0", 1, "goes too far"},
        {"material.EW.E", 1, "did you mean \"materials\"?"},
        {"edges.grip.velocity.0", 1, "this component is free"},
        {"edges.left.velocity.0", 1, "this component is free"},
        {"edges.roof.velocity.0", 1, "there is no \"roof\" in edges"},
        {"edges.grip.velocity.2", 1, "no number"},
        {"edges.grip.until", 1, "no number"},
        {"edges.grip.traction.1", 1, "no number"},
        {"specimen.rings.pith.2", 1, "no number"},
        {"specimen.pith.0", 1, "no pith of its own"},
        {"specimen.offset.0", 1, "neither image nor file"},
        {"cracks.2.advance", 1, "there is no crack 2"},
        {"specimen.rotation", 1, "neither image nor file"},
        {"title", 1, "no number"},
    };
    for (const auto& [key, value, phrase] : table) {
        try {
            set_number(scene, key, value);
            FAIL() << key;
        } catch (const InputError& error) {
            EXPECT_EQ(error.file, "scene.toml");
            EXPECT_EQ(error.key, key);
            EXPECT_NE(error.rule.find(phrase), std::string::npos) << error.what();
        }
    }
    EXPECT_DOUBLE_EQ(scene.specimen.rings->period, 2.2e-3) << "what was refused is not kept";
    EXPECT_DOUBLE_EQ(scene.materials.at("EW").toughness, 100);
}

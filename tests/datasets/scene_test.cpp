#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "tests/datasets/good_scenes.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <numbers>

using namespace crampfit;

namespace {

struct SceneFolder : TemporaryFolder {
    SceneFolder() {
        write("block.png", "");
        write("angles.png", "");
        write("specimen.h5", "");
    }
    Scene parse(const std::string& text, const Overrides& overrides = {}) const {
        return parse_scene(text, *this / "scene.toml", overrides);
    }
};

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

template <class Call>
void expect_error(const std::string& file, const std::string& key, const std::string& phrase, const Call& call) {
    try {
        call();
        FAIL() << "no error; expected one at " << key << " with: " << phrase;
    } catch (const InputError& error) {
        EXPECT_EQ(error.file, file) << error.what();
        EXPECT_EQ(error.key, key) << error.what();
        EXPECT_NE(error.rule.find(phrase), std::string::npos) << error.what();
    }
}

/// A good scene with one piece of it replaced, and the error that this must give.
struct BadScene {
    const std::string& scene;
    std::string from;
    std::string to;
    std::string key;
    std::string phrase;
};

void expect_errors(const std::vector<BadScene>& table) {
    const SceneFolder folder;
    for (const BadScene& bad : table) {
        SCOPED_TRACE("'" + bad.from + "' -> '" + bad.to + "'");
        expect_error((folder / "scene.toml").string(), bad.key, bad.phrase,
                     [&] { folder.parse(replaced(bad.scene, bad.from, bad.to)); });
    }
}

}  // namespace

TEST(UnitScene, RingsBodiesAndCracks) {
    const Scene scene = SceneFolder().parse(ring_scene);
    EXPECT_EQ(scene.title, "TR+ crack under tension");
    EXPECT_EQ(scene.model.plane, PlaneCondition::strain);
    EXPECT_DOUBLE_EQ(scene.model.thickness, 0.01);
    EXPECT_DOUBLE_EQ(scene.model.cell, 1e-4);
    EXPECT_EQ(scene.model.points_per_cell, 9);
    EXPECT_TRUE(scene.specimen.size.isApprox(Vec2(0.01, 0.02)));
    ASSERT_EQ(scene.specimen.cutouts.size(), 2U);
    EXPECT_EQ(std::get<Polygon>(scene.specimen.cutouts[0]).points.size(), 3U);
    EXPECT_DOUBLE_EQ(std::get<Circle>(scene.specimen.cutouts[1]).radius, 1e-3);
    ASSERT_TRUE(scene.specimen.rings);
    EXPECT_DOUBLE_EQ(scene.specimen.rings->pith.x(), -0.02);
    EXPECT_DOUBLE_EQ(scene.specimen.rings->period, 2.2e-3);
    EXPECT_DOUBLE_EQ(scene.specimen.rings->latewood_fraction, 0.25);
    EXPECT_DOUBLE_EQ(scene.specimen.rings->transition, 0.3e-3);
    EXPECT_DOUBLE_EQ(scene.materials.at("EW").youngs_modulus, 40e6);
    EXPECT_DOUBLE_EQ(scene.materials.at("EW").poisson_ratio, 0.33);
    EXPECT_DOUBLE_EQ(scene.materials.at("LW").density, 900);
    EXPECT_DOUBLE_EQ(scene.materials.at("LW").toughness, 300);
    ASSERT_EQ(scene.edges.size(), 2U);
    EXPECT_EQ(scene.edges[0].name, "grip");
    EXPECT_DOUBLE_EQ(scene.edges[0].range->second, 6e-3);
    EXPECT_FALSE(scene.edges[0].velocity[0]);
    EXPECT_DOUBLE_EQ(*scene.edges[0].velocity[1], 5);
    EXPECT_DOUBLE_EQ(*scene.edges[0].until, 1e-3);
    EXPECT_EQ(scene.edges[1].name, "left");
    EXPECT_EQ(scene.edges[1].side, Side::left);
    EXPECT_DOUBLE_EQ(scene.edges[1].traction->y(), 1e6);
    EXPECT_DOUBLE_EQ(get_number(scene, "edges.left.traction.1"), 1e6);
    ASSERT_EQ(scene.bodies.size(), 2U);
    EXPECT_EQ(scene.bodies[0].contact.kind, Contact::Kind::friction);
    EXPECT_DOUBLE_EQ(scene.bodies[0].contact.coefficient, 0.3);
    EXPECT_DOUBLE_EQ(scene.bodies[0].velocity.y(), -1e-3 / 60);
    EXPECT_DOUBLE_EQ(*scene.bodies[0].until, 2e-3);
    EXPECT_EQ(scene.bodies[1].name, "body 1");
    EXPECT_EQ(scene.bodies[1].contact.kind, Contact::Kind::bonded);
    ASSERT_EQ(scene.cracks.size(), 2U);
    EXPECT_EQ(scene.cracks[0].grows, Growth::end);
    EXPECT_DOUBLE_EQ(scene.cracks[0].advance, 1e-4);
    EXPECT_EQ(scene.cracks[0].direction, GrowthDirection::hoop_stress);
    EXPECT_EQ(scene.cracks[0].faces.kind, CrackFaces::Kind::friction);
    EXPECT_DOUBLE_EQ(scene.cracks[0].faces.coefficient, 0.2);
    EXPECT_EQ(scene.cracks[1].faces.kind, CrackFaces::Kind::stick);
    EXPECT_EQ(scene.cracks[1].points.size(), 3U);
    EXPECT_EQ(scene.measure.force, "left wheel");
    EXPECT_EQ(scene.measure.displacement, "grip");
    EXPECT_EQ(scene.solver.kind, SolverKind::explicit_dynamics);
    EXPECT_EQ(scene.solver.shape_function, ShapeFunction::gimp);
    EXPECT_DOUBLE_EQ(scene.solver.damping, 2e4);
    EXPECT_DOUBLE_EQ(*scene.stop.displacement, 0.5e-3);
    EXPECT_DOUBLE_EQ(*scene.stop.crack_length, 8e-3);
    EXPECT_DOUBLE_EQ(*scene.stop.time, 1e-3);
    EXPECT_EQ(scene.output.frames, 50);
    EXPECT_EQ(scene.output.samples, 400);
    EXPECT_EQ(scene.text, ring_scene);
}

TEST(UnitScene, Picture) {
    const SceneFolder folder;
    const Scene scene = folder.parse(picture_scene);
    ASSERT_TRUE(scene.specimen.picture);
    const Picture& picture = *scene.specimen.picture;
    EXPECT_EQ(picture.file, folder / "block.png");
    EXPECT_EQ(picture.orientation, folder / "angles.png");
    EXPECT_DOUBLE_EQ(picture.pixel, 25e-6);
    EXPECT_DOUBLE_EQ(picture.offset.x(), -1e-3);
    EXPECT_DOUBLE_EQ(get_number(scene, "specimen.offset.0"), -1e-3);
    EXPECT_DOUBLE_EQ(picture.rotation, std::numbers::pi / 6);
    EXPECT_TRUE(picture.graded);
    ASSERT_EQ(picture.classes.size(), 2U);
    EXPECT_EQ(picture.classes[1].material, "LW");
    EXPECT_EQ(picture.classes[1].high, 100);
}

TEST(UnitScene, SpecimenFile) {
    const SceneFolder folder;
    const std::string text =
        replaced(plain_scene, "material = \"EW\"", "file = \"specimen.h5\"\noffset = [\"1 mm\", \"0 mm\"]\nrotation = \"1 rad\"");
    const Scene scene = folder.parse(text);
    EXPECT_EQ(scene.specimen.file, folder / "specimen.h5");
    EXPECT_DOUBLE_EQ(scene.specimen.file_offset.x(), 1e-3);
    EXPECT_DOUBLE_EQ(get_number(scene, "specimen.offset.0"), 1e-3);
    EXPECT_DOUBLE_EQ(scene.specimen.file_rotation, 1);
    EXPECT_DOUBLE_EQ(get_number(scene, "specimen.rotation"), 1);
}

TEST(UnitScene, Defaults) {
    const SceneFolder folder;
    const Scene scene = folder.parse(plain_scene);
    EXPECT_EQ(scene.model.points_per_cell, 4);
    EXPECT_EQ(scene.edges[0].name, "bottom");
    EXPECT_EQ(scene.measure.force, "top") << "the edge under traction, since none moves";
    EXPECT_EQ(folder.parse(picture_scene).measure.displacement, "top") << "the edge that moves, not the one that is held";
    const std::string crack = "\n[[cracks]]\npoints = [[\"0 mm\", \"5 mm\"], [\"2 mm\", \"5 mm\"]]\n";
    const Scene cracked = folder.parse(plain_scene + crack);
    EXPECT_EQ(cracked.cracks[0].grows, Growth::none);
    EXPECT_EQ(cracked.cracks[0].advance, 0);
    EXPECT_EQ(cracked.cracks[0].direction, GrowthDirection::normal_to_opening);
    EXPECT_EQ(cracked.cracks[0].faces.kind, CrackFaces::Kind::frictionless);
}

// Two grids unless one is asked for.
TEST(UnitScene, Extrapolate) {
    const SceneFolder folder;
    const auto with = [](const std::string& value) { return plain_scene + "\n[solver]\nextrapolate = " + value + "\n"; };
    EXPECT_TRUE(folder.parse(plain_scene).solver.extrapolate);
    EXPECT_TRUE(folder.parse(with("true")).solver.extrapolate);
    EXPECT_FALSE(folder.parse(with("false")).solver.extrapolate);
    EXPECT_FALSE(folder.parse(plain_scene, {{"solver.extrapolate", "false"}}).solver.extrapolate);
    const std::string file = (folder / "scene.toml").string();
    expect_error(file, "solver.extrapolate", "", [&] { folder.parse(with("1")); });
    expect_error(file, "solver.extrapolate", "", [&] { folder.parse(with("\"yes\"")); });
    expect_error(file, "solver.extrapolat", "did you mean \"extrapolate\"?",
                 [&] { folder.parse(plain_scene + "\n[solver]\nextrapolat = true\n"); });
}

// How an explicit step updates velocities and stresses.
TEST(UnitScene, Updates) {
    const SceneFolder folder;
    const auto with = [](const std::string& keys) { return plain_scene + "\n[solver]\n" + keys + "\n"; };
    EXPECT_EQ(folder.parse(plain_scene).solver.velocity_update, VelocityUpdate::automatic);
    EXPECT_EQ(folder.parse(plain_scene).solver.stress_update, StressUpdate::last);
    const SolverChoice flip =
        folder.parse(with("velocity_update = \"flip\"\npic_share = \"5 %\"\nstress_update = \"first\"")).solver;
    EXPECT_EQ(flip.velocity_update, VelocityUpdate::flip);
    EXPECT_DOUBLE_EQ(flip.pic_share, 0.05);
    EXPECT_EQ(flip.stress_update, StressUpdate::first);
    const SolverChoice fmpm = folder.parse(with("velocity_update = \"fmpm\"\norder = 4\nstress_update = \"average\"")).solver;
    EXPECT_EQ(fmpm.velocity_update, VelocityUpdate::fmpm);
    EXPECT_EQ(fmpm.order, 4);
    EXPECT_EQ(fmpm.stress_update, StressUpdate::average);
    EXPECT_EQ(folder.parse(with("velocity_update = \"xpic\"")).solver.order, 2);
    EXPECT_EQ(folder.parse(with("strain = \"finite rotation\"")).solver.strain, StrainMeasure::finite_rotation);
    const std::string file = (folder / "scene.toml").string();
    const auto refused = [&](const std::string& keys, const std::string& key, const std::string& rule) {
        expect_error(file, key, rule, [&] { folder.parse(with(keys)); });
    };
    refused("velocity_update = \"flipp\"", "solver.velocity_update", "did you mean \"flip\"?");
    refused("stress_update = \"middle\"", "solver.stress_update", "must be one of");
    refused("strain = \"large\"", "solver.strain", "must be one of");
    refused("velocity_update = \"flip\"\norder = 2", "solver.order", "belongs to");
    refused("velocity_update = \"fmpm\"\norder = 0", "solver.order", "");
    refused("pic_share = 0.1", "solver.pic_share", "belongs to");
    refused("velocity_update = \"flip\"\npic_share = 1.5", "solver.pic_share", "between 0 and 1");
}

// Pieces that start with a velocity need no edge, but then a time to stop at.
TEST(UnitScene, Parts) {
    const SceneFolder folder;
    const std::string parts =
        "parts = [ { circle = { centre = [\"3 mm\", \"3 mm\"], radius = \"2 mm\" }, velocity = [\"5 m/s\", \"0 m/s\"] },\n"
        "          { polygon = [[\"6 mm\", \"1 mm\"], [\"9 mm\", \"1 mm\"], [\"9 mm\", \"5 mm\"]] } ]\n";
    const auto scene = [&](const std::string& more, const std::string& stop) {
        return "[model]\nplane = \"strain\"\nthickness = \"1 mm\"\ncell = \"0.5 mm\"\n[specimen]\nsize = [\"10 mm\", \"6 mm\"]\n"
               "material = \"EW\"\n" +
               more +
               "[materials.EW]\nE = \"40 MPa\"\nnu = 0.3\ndensity = \"300 kg/m^3\"\n"
               "toughness = \"100 J/m^2\"\n[stop]\n" +
               stop + "\n";
    };
    const Scene two = folder.parse(scene(parts, "time = \"1 ms\""));
    ASSERT_EQ(two.specimen.parts.size(), 2u);
    EXPECT_EQ(two.specimen.parts[0].velocity, Vec2(5, 0));
    EXPECT_EQ(two.specimen.parts[1].velocity, Vec2(0, 0));
    EXPECT_EQ(std::get<Polygon>(two.specimen.parts[1].shape).points.size(), 3u);
    const std::string file = (folder / "scene.toml").string();
    expect_error(file, "stop", "by time alone", [&] { folder.parse(scene(parts, "displacement = \"1 mm\"")); });
    expect_error(file, "specimen.parts.0.speed", "unknown key", [&] {
        folder.parse(scene("parts = [ { circle = { centre = [\"3 mm\", \"3 mm\"], radius = \"2 mm\" }, speed = 1 } ]\n",
                           "time = \"1 ms\""));
    });
    expect_error(file, "measure.force", "nothing loads the specimen", [&] {
        folder.parse(scene("parts = [ { circle = { centre = [\"3 mm\", \"3 mm\"], radius = \"2 mm\" } } ]\n", "time = \"1 ms\""));
    });
}

TEST(UnitScene, FileOnDisk) {
    const SceneFolder folder;
    EXPECT_EQ(read_scene(folder.write("windows.toml", "\xEF\xBB\xBF" + plain_scene)).edges.size(), 2U);
    expect_error((folder / "none.toml").string(), "", "no such file", [&] { read_scene(folder / "none.toml"); });
}

TEST(UnitScene, CracksMayCrossOrTouchButNotLieOnEachOther) {
    const SceneFolder folder;
    const std::string first = "\n[[cracks]]\npoints = [[\"0 mm\", \"5 mm\"], [\"4 mm\", \"5 mm\"]]\n";
    const auto with = [&](const std::string& points) { return plain_scene + first + "[[cracks]]\npoints = " + points + "\n"; };
    for (const char* points : {"[[\"0 mm\", \"5 mm\"], [\"4 mm\", \"5 mm\"]]", "[[\"5 mm\", \"5 mm\"], [\"3 mm\", \"5 mm\"]]",
                               "[[\"2 mm\", \"2 mm\"], [\"2 mm\", \"5 mm\"], [\"3 mm\", \"5 mm\"]]"})
        expect_error((folder / "scene.toml").string(), "cracks.1.points", "lies on cracks.0",
                     [&] { folder.parse(with(points)); });
    for (const char* points : {"[[\"4 mm\", \"5 mm\"], [\"6 mm\", \"5 mm\"]]", "[[\"2 mm\", \"2 mm\"], [\"2 mm\", \"8 mm\"]]",
                               "[[\"0 mm\", \"5.1 mm\"], [\"4 mm\", \"5.1 mm\"]]"})
        EXPECT_EQ(folder.parse(with(points)).cracks.size(), 2u);
}

TEST(UnitScene, SyntaxErrorHasLineAndColumn) {
    const SceneFolder folder;
    expect_error((folder / "scene.toml").string(), "", "line 2, column ", [&] { folder.parse("a = 1\nb = = 2\n"); });
    expect_error((folder / "scene.toml").string(), "", "line 3", [&] { folder.parse("[a]\nb = 1\nb = 2\n"); });
}

TEST(UnitScene, UnknownKeys) {
    expect_errors({
        {ring_scene, "title", "titel", "titel", "unknown key; did you mean \"title\"?"},
        {ring_scene, "[model]", "[modell]", "modell", "did you mean \"model\"?"},
        {ring_scene, "thickness", "thicknes", "model.thicknes", "did you mean \"thickness\"?"},
        {ring_scene, "cutouts", "cut_outs", "specimen.cut_outs", "did you mean \"cutouts\"?"},
        {ring_scene, "{ circle =", "{ square = 1, circle =", "specimen.cutouts.1.square", "unknown key"},
        {ring_scene, "radius =", "r = 1, radius =", "specimen.cutouts.1.circle.r", "unknown key"},
        {ring_scene, "pith", "pit", "specimen.rings.pit", "did you mean \"pith\"?"},
        {ring_scene, "toughness", "tougness", "materials.EW.tougness", "did you mean \"toughness\"?"},
        {ring_scene, "range", "rang", "edges.grip.rang", "did you mean \"range\"?"},
        {ring_scene, "contact", "contakt", "bodies.left wheel.contakt", "did you mean \"contact\"?"},
        {ring_scene, "friction =", "frictoin =", "bodies.left wheel.contact.frictoin", "unknown key"},
        {ring_scene, "grows", "grow", "cracks.0.grow", "did you mean \"grows\"?"},
        {ring_scene, "{ friction = 0.2 }", "{ mu = 0.2 }", "cracks.0.faces.mu", "unknown key"},
        {ring_scene, "[measure]", "[measure]\nforces = 1", "measure.forces", "did you mean \"force\"?"},
        {ring_scene, "shape_function", "shape_funktion", "solver.shape_funktion", "unknown key"},
        {ring_scene, "crack_length", "crack", "stop.crack", "unknown key"},
        {ring_scene, "frames", "frame", "output.frame", "did you mean \"frames\"?"},
        {picture_scene, "gray", "grey", "specimen.classes.0.grey", "did you mean \"gray\"?"},
    });
}

TEST(UnitScene, MissingKeys) {
    expect_errors({
        {plain_scene, "plane = \"stress\"", "", "model.plane", "missing"},
        {plain_scene, "thickness = \"10 mm\"", "", "model.thickness", "missing"},
        {plain_scene, "cell = \"0.1 mm\"", "", "model.cell", "missing"},
        {plain_scene, "size = [\"10 mm\", \"10 mm\"]", "", "specimen.size", "missing"},
        {plain_scene, "material = \"EW\"", "", "specimen", "give one of material, rings, image, file"},
        {plain_scene, "E = \"40 MPa\"", "", "materials.EW.E", "missing"},
        {plain_scene, "nu = 0.33", "", "materials.EW.nu", "missing"},
        {plain_scene, "density = \"300 kg/m^3\"", "", "materials.EW.density", "missing"},
        {plain_scene, "toughness = \"100 J/m^2\"", "", "materials.EW.toughness", "missing"},
        {plain_scene, "side = \"bottom\"", "", "edges.0.side", "missing"},
        {plain_scene, "velocity = [\"0 m/s\", \"0 m/s\"]", "", "edges.bottom", "give one of velocity and traction"},
        {plain_scene, "[stop]\ntime = \"1 ms\"", "", "stop", "missing"},
        {plain_scene, "time = \"1 ms\"", "", "stop", "never end"},
        {ring_scene, "pith = [\"-20 mm\", \"5 mm\"], ", "", "specimen.rings.pith", "missing"},
        {ring_scene, "period = \"2.2 mm\", ", "", "specimen.rings.period", "missing"},
        {ring_scene, "latewood_fraction = 0.25, ", "", "specimen.rings.latewood_fraction", "missing"},
        {ring_scene, "centre = [\"5 mm\", \"2 mm\"], ", "", "specimen.cutouts.1.circle.centre", "missing"},
        {ring_scene, ", radius = \"1 mm\"", "", "specimen.cutouts.1.circle.radius", "missing"},
        {ring_scene, "velocity = [\"0 m/s\", \"-1 mm/min\"]", "", "bodies.left wheel.velocity", "missing"},
        {ring_scene, "circle = { centre = [\"4 mm\"", "#", "bodies.left wheel", "give one of circle and polygon"},
        {ring_scene, "points = [[\"10 mm\", \"5 mm\"], [\"7.5 mm\", \"5 mm\"]]", "", "cracks.0.points", "missing"},
        {picture_scene, "pixel = \"25 um\"", "", "specimen.pixel", "missing"},
        {picture_scene, "classes =", "#", "specimen.classes", "missing"},
        {picture_scene, "material = \"EW\", ", "", "specimen.classes.0.material", "missing"},
        {picture_scene, ", gray = [128, 255]", "", "specimen.classes.0.gray", "missing"},
    });
}

TEST(UnitScene, UnitsAndTypes) {
    expect_errors({
        {ring_scene, "\"10 mm\"", "10", "model.thickness", "missing unit: expected a length"},
        {ring_scene, "\"10 mm\"", "\"10\"", "model.thickness", "missing unit: expected a length"},
        {ring_scene, "\"10 mm\"", "\"10 MPa\"", "model.thickness", "wrong dimension: got a pressure"},
        {ring_scene, "\"10 mm\"", "\"10 milli\"", "model.thickness", "unknown unit 'milli'"},
        {ring_scene, "\"10 mm\"", "\"ten mm\"", "model.thickness", "not a number"},
        {ring_scene, "\"10 mm\"", "\"inf mm\"", "model.thickness", "infinite"},
        {ring_scene, "\"10 mm\"", "true", "model.thickness", "must be a length"},
        {ring_scene, "\"10 mm\"", "[\"10 mm\"]", "model.thickness", "must be a length"},
        {ring_scene, "\"40 MPa\"", "\"40 mm\"", "materials.EW.E", "expected a pressure"},
        {ring_scene, "\"100 J/m^2\"", "\"100 J\"", "materials.EW.toughness", "expected an energy per area"},
        {ring_scene, "nu = 0.33", "nu = \"0.33 mm\"", "materials.EW.nu", "expected a pure number"},
        {ring_scene, "nu = 0.33", "nu = nan", "materials.EW.nu", "not NaN"},
        {ring_scene, "nu = 0.33", "nu = inf", "materials.EW.nu", "not infinite"},
        {ring_scene, "\"5 m/s\"", "\"5 m\"", "edges.grip.velocity.1", "expected a velocity"},
        {ring_scene, "\"5 m/s\"", "5", "edges.grip.velocity.1", "missing unit"},
        {ring_scene, "[\"free\", \"5 m/s\"]", "\"5 m/s\"", "edges.grip.velocity", "list of two velocities"},
        {ring_scene, "[\"free\", \"5 m/s\"]", "[\"5 m/s\"]", "edges.grip.velocity", "list of two velocities"},
        {ring_scene, "\"1 MPa\"", "\"1 N\"", "edges.left.traction.1", "wrong dimension"},
        {ring_scene, "\"2e4 1/s\"", "\"2e4 s\"", "solver.damping", "expected a rate"},
        {ring_scene, "[\"10 mm\", \"20 mm\"]", "[\"10 mm\"]", "specimen.size", "list of two lengths"},
        {ring_scene, "[\"7.5 mm\", \"5 mm\"]", "[\"7.5 mm\", 5]", "cracks.0.points.1.1", "missing unit"},
        {ring_scene, "[\"7.5 mm\", \"5 mm\"]", "\"7.5 mm\"", "cracks.0.points.1", "list of two lengths"},
        {ring_scene, "plane = \"strain\"", "plane = 3", "model.plane", "must be a text"},
        {ring_scene, "plane = \"strain\"", "plane = \"\"", "model.plane", "not empty"},
        {ring_scene, "points_per_cell = 9", "points_per_cell = 9.0", "model.points_per_cell", "whole number"},
        {ring_scene, "frames = 50", "frames = \"50\"", "output.frames", "whole number"},
        {ring_scene, "frames = 50", "frames = 9999999999", "output.frames", "whole number"},
        {ring_scene, "rings = {", "rings = 1 #", "specimen.rings", "must be a table"},
        {ring_scene, "[measure]", "[[measure]]", "measure", "must be a table"},
        {ring_scene, "[[edges]]\nname = \"grip\"", "[edges]\nname = \"grip\"", "", "cannot redefine"},
        {ring_scene, "[[cracks]]\npoints = [[\"10", "[cracks]\n[cracks.x]\n#", "", "cannot redefine"},
        {plain_scene, "material = \"EW\"", "material = \"EW\"\ncutouts = { a = 1 }", "specimen.cutouts", "must be a list"},
        {plain_scene, "[[edges]]\nside = \"top\"", "[bodies]\nside = \"top\"", "bodies", "must be a list"},
        {picture_scene, "\"30 deg\"", "30", "specimen.rotation", "missing unit: expected an angle"},
        {picture_scene, "\"30 deg\"", "\"30 %\"", "specimen.rotation", "expected an angle"},
        {picture_scene, "[128, 255]", "[128.5, 255]", "specimen.classes.0.gray.0", "whole number from 0 to 255"},
        {picture_scene, "\"block.png\"", "7", "specimen.image", "must be a text"},
    });
}

TEST(UnitScene, ImpossibleValues) {
    expect_errors({
        {ring_scene, "thickness = \"10 mm\"", "thickness = \"0 mm\"", "model.thickness", "greater than 0"},
        {ring_scene, "\"0.1 mm\"", "\"-0.1 mm\"", "model.cell", "greater than 0"},
        {ring_scene, "\"0.1 mm\"", "\"11 mm\"", "model.cell", "larger than the specimen"},
        {ring_scene, "points_per_cell = 9", "points_per_cell = 5", "model.points_per_cell", "square number"},
        {ring_scene, "points_per_cell = 9", "points_per_cell = 36", "model.points_per_cell", "from 1 to 25"},
        {ring_scene, "points_per_cell = 9", "points_per_cell = 0", "model.points_per_cell", "from 1 to 25"},
        {ring_scene, "[\"10 mm\", \"20 mm\"]", "[\"10 mm\", \"0 mm\"]", "specimen.size.1", "greater than 0"},
        {ring_scene, "radius = \"1 mm\"", "radius = \"0 mm\"", "specimen.cutouts.1.circle.radius", "greater than 0"},
        {ring_scene, "radius = \"1 mm\" }\ncontact", "radius = \"-1 mm\" }\ncontact", "bodies.left wheel.circle.radius",
         "greater than 0"},
        {ring_scene, "[\"6 mm\", \"20 mm\"], ", "", "specimen.cutouts.0.polygon", "at least 3 points"},
        {ring_scene, "[\"5 mm\", \"17 mm\"]", "[\"5 mm\", \"20 mm\"]", "specimen.cutouts.0.polygon", "must have an area"},
        {ring_scene, "[\"5 mm\", \"17 mm\"]", "[\"4 mm\", \"20 mm\"]", "specimen.cutouts.0.polygon", "repeats its neighbour"},
        {ring_scene, "[\"5 mm\", \"17 mm\"]", "[\"4 mm\", \"17 mm\"], [\"7 mm\", \"18 mm\"]", "specimen.cutouts.0.polygon",
         "must not cross"},
        {ring_scene, "centre = [\"5 mm\", \"2 mm\"]", "centre = [\"5 mm\", \"-2 mm\"]", "specimen.cutouts.1",
         "beside the specimen"},
        {plain_scene, "[stop]", "[stop]\ncrack_length = \"1 mm\"", "stop.crack_length", "there is no crack"},
        {ring_scene, "E = \"40 MPa\"", "E = \"0 MPa\"", "materials.EW.E", "greater than 0"},
        {ring_scene, "nu = 0.33", "nu = 0.5", "materials.EW.nu", "between -1 and 0.5"},
        {ring_scene, "nu = 0.33", "nu = -1", "materials.EW.nu", "between -1 and 0.5"},
        {ring_scene, "\"300 kg/m^3\"", "\"0 kg/m^3\"", "materials.EW.density", "greater than 0"},
        {ring_scene, "\"100 J/m^2\"", "\"-100 J/m^2\"", "materials.EW.toughness", "greater than 0"},
        {ring_scene, "\"2.2 mm\"", "\"0 mm\"", "specimen.rings.period", "greater than 0"},
        {ring_scene, "latewood_fraction = 0.25", "latewood_fraction = 1.25", "specimen.rings.latewood_fraction",
         "between 0 and 1"},
        {ring_scene, "latewood_fraction = 0.25", "latewood_fraction = -0.1", "specimen.rings.latewood_fraction",
         "between 0 and 1"},
        {ring_scene, "\"0.3 mm\"", "\"-0.3 mm\"", "specimen.rings.transition", "must not be negative"},
        {ring_scene, "\"0.3 mm\"", "\"1.7 mm\"", "specimen.rings.transition", "longer than the ring's period"},
        {ring_scene, "[\"4 mm\", \"6 mm\"]", "[\"6 mm\", \"4 mm\"]", "edges.grip.range", "reversed"},
        {ring_scene, "[\"4 mm\", \"6 mm\"]", "[\"4 mm\", \"11 mm\"]", "edges.grip.range", "from 0 to 10 mm"},
        {ring_scene, "[\"4 mm\", \"6 mm\"]", "[\"-1 mm\", \"6 mm\"]", "edges.grip.range", "from 0 to 10 mm"},
        {ring_scene, "[\"4 mm\", \"16 mm\"]", "[\"4 mm\", \"21 mm\"]", "edges.left.range", "from 0 to 20 mm"},
        {ring_scene, "until = \"1 ms\"", "until = \"0 ms\"", "edges.grip.until", "greater than 0"},
        {ring_scene, "until = \"2 ms\"", "until = \"-2 ms\"", "bodies.left wheel.until", "greater than 0"},
        {ring_scene, "friction = 0.3", "friction = -0.3", "bodies.left wheel.contact.friction", "must not be negative"},
        {ring_scene, "friction = 0.2", "friction = -0.2", "cracks.0.faces.friction", "must not be negative"},
        {ring_scene, ", [\"7.5 mm\", \"5 mm\"]", "", "cracks.0.points", "at least 2 points"},
        {ring_scene, "[\"7.5 mm\", \"5 mm\"]", "[\"10 mm\", \"5 mm\"]", "cracks.0.points", "point 1 repeats"},
        {ring_scene, "[\"7.5 mm\", \"5 mm\"]", "[\"7.5 mm\", \"5 mm\"], [\"9 mm\", \"7 mm\"], [\"9 mm\", \"3 mm\"]",
         "cracks.0.points", "must not cross"},
        {ring_scene, "[\"7.5 mm\", \"5 mm\"]", "[\"7.5 mm\", \"5 mm\"], [\"8 mm\", \"5 mm\"]", "cracks.0.points",
         "must not cross"},
        {ring_scene, "[[\"10 mm\", \"5 mm\"], [\"7.5 mm\", \"5 mm\"]]", "[[\"12 mm\", \"5 mm\"], [\"11 mm\", \"5 mm\"]]",
         "cracks.0.points", "outside the specimen"},
        {ring_scene, "advance = \"0.1 mm\"", "advance = \"-0.1 mm\"", "cracks.0.advance", "must not be negative"},
        {ring_scene, "\"2e4 1/s\"", "\"-2e4 1/s\"", "solver.damping", "must not be negative"},
        {ring_scene, "displacement = \"0.5 mm\"", "displacement = \"0 mm\"", "stop.displacement", "greater than 0"},
        {ring_scene, "crack_length = \"8 mm\"", "crack_length = \"-8 mm\"", "stop.crack_length", "greater than 0"},
        {ring_scene, "time = \"1 ms\"", "time = \"0 ms\"", "stop.time", "greater than 0"},
        {ring_scene, "frames = 50", "frames = -1", "output.frames", "whole number from 0"},
        {ring_scene, "samples = 400", "samples = 0", "output.samples", "whole number from 1"},
        {picture_scene, "\"25 um\"", "\"0 um\"", "specimen.pixel", "greater than 0"},
        {picture_scene, "[128, 255]", "[128, 256]", "specimen.classes.0.gray.1", "from 0 to 255"},
        {picture_scene, "[128, 255]", "[-1, 255]", "specimen.classes.0.gray.0", "from 0 to 255"},
        {picture_scene, "[128, 255]", "[255, 128]", "specimen.classes.0.gray", "reversed"},
        {picture_scene, "[0, 100]", "[0, 128]", "specimen.classes.1.gray", "overlaps the range 128..255 of material EW"},
        {picture_scene, "{ material = \"EW\", gray = [128, 255] }, { material = \"LW\", gray = [0, 100] }", "",
         "specimen.classes", "at least one class"},
    });
}

TEST(UnitScene, UnknownWordsAndReferences) {
    expect_errors({
        {ring_scene, "\"strain\"", "\"strian\"", "model.plane", "did you mean \"strain\"?"},
        {ring_scene, "\"isotropic\"", "\"isotrop\"", "materials.EW.kind", "did you mean \"isotropic\"?"},
        {ring_scene, "side = \"top\"", "side = \"up\"", "edges.grip.side", "must be one of \"top\", \"bottom\""},
        {ring_scene, "\"bonded\"", "\"glued\"", "bodies.body 1.contact", "must be one of"},
        {ring_scene, "grows = \"end\"", "grows = \"yes\"", "cracks.0.grows", "must be one of"},
        {ring_scene, "\"energy release rate\"", "\"stress\"", "cracks.0.criterion", "must be one of \"energy release rate\""},
        {ring_scene, "\"hoop stress\"", "\"hoop\"", "cracks.0.direction", "must be one of"},
        {ring_scene, "\"stick\"", "\"sticky\"", "cracks.1.faces", "did you mean \"stick\"?"},
        {ring_scene, "\"explicit\"", "\"implicit\"", "solver.kind", "did you mean \"explicit\"?"},
        {ring_scene, "\"gimp\"", "\"gmp\"", "solver.shape_function", "did you mean \"gimp\"?"},
        {ring_scene, "force = \"left wheel\"", "force = \"left weel\"", "measure.force", "did you mean \"left wheel\"?"},
        {ring_scene, "displacement = \"grip\"", "displacement = \"roof\"", "measure.displacement", "no edge or body"},
        {ring_scene, "[materials.LW]", "[materials.Latewood]", "specimen.rings", "there is no [materials.LW]"},
        {plain_scene, "material = \"EW\"", "material = \"Ew\"", "specimen.material", "did you mean \"EW\"?"},
        {picture_scene, "material = \"LW\"", "material = \"XX\"", "specimen.classes.1.material", "no [materials.XX]"},
        {picture_scene, "\"graded\"", "\"sharp\"", "specimen.between", "must be one of \"graded\""},
        {picture_scene, "\"block.png\"", "\"none.png\"", "specimen.image", "no such file"},
        {picture_scene, "\"block.png\"", "\".\"", "specimen.image", "is a folder"},
        {picture_scene, "\"angles.png\"", "\"none.png\"", "specimen.orientation", "no such file"},
        {plain_scene, "material = \"EW\"", "file = \"none.h5\"", "specimen.file", "no such file"},
    });
}

TEST(UnitScene, KeysThatDoNotGoTogether) {
    expect_errors({
        {plain_scene, "material = \"EW\"", "material = \"EW\"\nimage = \"block.png\"", "specimen.image", "\"material\" already"},
        {plain_scene, "material = \"EW\"", "material = \"EW\"\npixel = \"1 um\"", "specimen.pixel", "needs an image"},
        {plain_scene, "material = \"EW\"", "material = \"EW\"\noffset = [\"0 mm\", \"0 mm\"]", "specimen.offset",
         "needs an image or a file"},
        {plain_scene, "material = \"EW\"", "material = \"EW\"\nrotation = \"1 deg\"", "specimen.rotation",
         "needs an image or a file"},
        {plain_scene, "material = \"EW\"", "material = \"EW\"\nclasses = []", "specimen.classes", "needs an image"},
        {plain_scene, "material = \"EW\"", "material = \"EW\"\norientation = \"angles.png\"", "specimen.orientation",
         "needs an image"},
        {plain_scene, "material = \"EW\"", "file = \"specimen.h5\"\nbetween = \"graded\"", "specimen.between", "needs an image"},
        {ring_scene, "{ circle =", "{ polygon = [], circle =", "specimen.cutouts.1", "give one of circle and polygon"},
        {ring_scene, "until = \"1 ms\"", "traction = [\"0 MPa\", \"0 MPa\"]", "edges.grip", "give one of velocity and traction"},
        {ring_scene, "\"1 MPa\"]", "\"1 MPa\"]\nuntil = \"1 ms\"", "edges.left.until", "belongs to a velocity"},
        {ring_scene, "side = \"left\"", "name = \"grip\"\nside = \"left\"", "edges.grip.name", "is taken"},
        {ring_scene, "name = \"left wheel\"", "name = \"grip\"", "bodies.grip.name", "is taken"},
        {plain_scene, "side = \"top\"", "side = \"bottom\"", "edges.bottom", "is taken"},
        {picture_scene, "side = \"top\"", "name = \"half\"\nside = \"bottom\"\nrange = [\"0 mm\", \"1 mm\"]", "edges.half",
         "moves its y otherwise than edge \"bottom\""},
    });
    const SceneFolder folder;
    expect_error((folder / "scene.toml").string(), "measure.force", "nothing loads the specimen", [&] {
        const std::size_t edges = plain_scene.find("[[edges]]");
        folder.parse(plain_scene.substr(0, edges) + plain_scene.substr(plain_scene.find("[stop]")));
    });
}

TEST(UnitScene, OrthotropicWood) {
    const SceneFolder folder;
    const Scene scene = folder.parse(orthotropic_scene);
    const OrthotropicElasticity& wood = *scene.materials.at("EW").orthotropic;
    EXPECT_DOUBLE_EQ(wood.E_R, 800e6);
    EXPECT_DOUBLE_EQ(wood.E_T, 400e6);
    EXPECT_DOUBLE_EQ(wood.G_RT, 40e6);
    EXPECT_DOUBLE_EQ(wood.nu_RT, 0.45);
    EXPECT_DOUBLE_EQ(wood.E_L, 11e9);
    EXPECT_DOUBLE_EQ(wood.nu_LR, 0.4);
    EXPECT_DOUBLE_EQ(wood.nu_LT, 0.45);
    EXPECT_FALSE(scene.materials.at("LW").orthotropic);
    const DensityExponents& exponents = scene.specimen.density_exponents;
    EXPECT_DOUBLE_EQ(exponents.E_T, 2.5);
    EXPECT_DOUBLE_EQ(exponents.E_R, 1.0);
    EXPECT_DOUBLE_EQ(*exponents.toughness, 1.5);
    EXPECT_FALSE(exponents.E);
    // In plane stress the constants along L may be left out.
    const std::string stress = replaced(orthotropic_scene, "\"strain\"", "\"stress\"");
    EXPECT_EQ(
        folder.parse(replaced(stress, "E_L = \"11 GPa\"\nnu_LR = 0.4\nnu_LT = 0.45\n", "")).materials.at("EW").orthotropic->E_L,
        0);
    // A direction for wood without rings.
    const std::string rings = orthotropic_scene.substr(orthotropic_scene.find("rings"),
                                                       orthotropic_scene.find("density_exp") - orthotropic_scene.find("rings"));
    EXPECT_DOUBLE_EQ(
        *folder.parse(replaced(orthotropic_scene, rings, "material = \"EW\"\nradial = \"90 deg\"\n")).specimen.radial, M_PI / 2);
    EXPECT_DOUBLE_EQ(
        folder.parse(replaced(orthotropic_scene, rings, "material = \"EW\"\npith = [\"1 m\", \"2 m\"]\n")).specimen.pith->y(), 2);
    expect_errors({
        {orthotropic_scene, "E_R = \"800 MPa\"", "E_R = \"0 MPa\"", "materials.EW.E_R", "greater than 0"},
        {orthotropic_scene, "G_RT = \"40 MPa\"\n", "", "materials.EW.G_RT", "missing key"},
        {orthotropic_scene, "E_L = \"11 GPa\"\n", "", "materials.EW.E_L", "missing key"},
        {orthotropic_scene, "nu_RT", "nu_TR", "materials.EW.nu_TR", "give nu_RT = nu_TR E_R / E_T instead"},
        {orthotropic_scene, "G_RT", "E", "materials.EW.E", "unknown key"},
        {orthotropic_scene, "nu_RT = 0.45", "nu_RT = 1.4143", "materials.EW.nu_RT",
         "between -1.414 and 1.414, the root of E_R / E_T"},
        {orthotropic_scene, "nu_LR = 0.4", "nu_LR = -3.8", "materials.EW.nu_LR", "the root of E_L / E_R"},
        {orthotropic_scene, "nu_LT = 0.45", "nu_LT = 5.3", "materials.EW.nu_LT", "the root of E_L / E_T"},
        {orthotropic_scene, "nu_RT = 0.45", "nu_RT = 1.413", "materials.EW.nu_RT", "too large together"},
        {orthotropic_scene, "E_T = 2.5", "E_T = 0", "specimen.density_exponents.E_T", "greater than 0"},
        {orthotropic_scene, "E_T = 2.5", "rho = 2", "specimen.density_exponents.rho", "unknown key"},
        {orthotropic_scene, "density_exponents", "radial = \"0 deg\"\ndensity_exponents", "specimen.radial", "pith of their own"},
        {orthotropic_scene, rings, "material = \"EW\"\n", "specimen.material", "give its radial direction"},
        {orthotropic_scene, rings, "material = \"EW\"\npith = [\"1 m\", \"2 m\"]\nradial = \"1 deg\"\n", "specimen.pith",
         "one of radial and pith"},
    });
}

TEST(UnitScene, OrthotropicConstantsAreNumbersThatAFitMayAdjust) {
    Scene scene = SceneFolder().parse(orthotropic_scene);
    for (const char* key : {"E_R", "E_T", "G_RT", "nu_RT", "E_L", "nu_LR", "nu_LT"}) {
        const std::string full = std::string("materials.EW.") + key;
        const double value = 1.01 * get_number(scene, full);
        set_number(scene, full, value);
        EXPECT_DOUBLE_EQ(get_number(scene, full), value);
    }
    set_number(scene, "specimen.density_exponents.E_T", 3);
    EXPECT_DOUBLE_EQ(scene.specimen.density_exponents.E_T, 3);
    EXPECT_THROW(set_number(scene, "materials.EW.E", 1e6), InputError);
    EXPECT_THROW(set_number(scene, "specimen.density_exponents.E", 1), InputError);  // not given: no number there
    EXPECT_THROW(set_number(scene, "materials.EW.E_T", 1e10), InputError);           // breaks the limit of nu_RT
    EXPECT_DOUBLE_EQ(scene.materials.at("EW").orthotropic->E_T, 404e6);              // and left as it was
}

TEST(UnitScene, NotSupportedYet) {
    expect_errors({
        {ring_scene, "cell = \"0.1 mm\"", "cell = \"0.1 mm\"\nerror = \"2 %\"", "model.error", "either"},
        {ring_scene, "cell = \"0.1 mm\"", "error = \"0 %\"", "model.error", "between"},
        {ring_scene, "cell = \"0.1 mm\"", "error = \"2 mm\"", "model.error", ""},
    });
}

TEST(UnitScene, WoodThatRemembers) {
    const SceneFolder folder;
    Scene scene = folder.parse(remembering_scene);
    EXPECT_DOUBLE_EQ(*scene.solver.time_step, 2.0);
    const Material& viscoelastic = scene.materials.at("EW");
    ASSERT_TRUE(viscoelastic.viscoelastic && !viscoelastic.plastic && scene.materials.at("LW").remembers());
    ASSERT_EQ(viscoelastic.viscoelastic->prony.size(), 2U);
    EXPECT_EQ(viscoelastic.viscoelastic->prony[0].k, 0.0);
    EXPECT_EQ(viscoelastic.viscoelastic->prony[1].k, 0.1);
    EXPECT_DOUBLE_EQ(viscoelastic.viscoelastic->prony[1].tau, 120.0);
    // A fit may adjust them, within the rules for all together.
    set_number(scene, "materials.EW.prony.1.tau", 60.0);
    set_number(scene, "materials.EW.prony.0.g", 0.25);
    EXPECT_DOUBLE_EQ(get_number(scene, "materials.EW.prony.1.tau"), 60.0);
    EXPECT_THROW(set_number(scene, "materials.EW.prony.0.g", 0.75), InputError);
    EXPECT_DOUBLE_EQ(scene.materials.at("EW").viscoelastic->prony[0].g, 0.25);
    for (const char* key : {"prony", "prony.2.g", "prony.0", "prony.0.h", "prony.0.g.x", "yield_stress"})
        EXPECT_THROW(set_number(scene, std::string("materials.EW.") + key, 0.1), InputError) << key;

    const Plasticity& plastic = *scene.materials.at("LW").plastic;
    EXPECT_EQ(plastic.yield_stress, 2e6);
    EXPECT_EQ(plastic.hardening, 5e6);
    EXPECT_EQ(plastic.saturation->stress, 3e6);
    EXPECT_EQ(plastic.saturation->strain, 0.02);
    set_number(scene, "materials.LW.yield_stress", 2.5e6);
    EXPECT_THROW(set_number(scene, "materials.LW.yield_stress", 3.5e6), InputError);  // above the saturation stress
    EXPECT_EQ(scene.materials.at("LW").plastic->yield_stress, 2.5e6);
    EXPECT_EQ(folder.parse(replaced(remembering_scene, "hardening = \"5 MPa\"\n", "")).materials.at("LW").plastic->hardening,
              0.0);

    const std::string& all = remembering_scene;
    expect_errors({
        {all, "g = 0.2", "g = 0.8", "materials.EW.prony", "below 1"},
        {all, "g = 0.2", "g = 1.2", "materials.EW.prony.0.g", "between 0 and 1"},
        {all, "g = 0.2", "g = \"0.2 MPa\"", "materials.EW.prony.0.g", ""},
        {all, "g = 0.2, tau", "tau", "materials.EW.prony.0.g", "missing"},
        {all, "\"1 s\"", "\"0 s\"", "materials.EW.prony.0.tau", "greater than 0"},
        {all, "\"1 s\"", "1", "materials.EW.prony.0.tau", ""},
        {all, ", tau = \"1 s\"", "", "materials.EW.prony.0.tau", "missing"},
        {all, "g = 0.2,", "g = 0.2, G = 0.1,", "materials.EW.prony.0.G", ""},
        {all, "prony = [ { g = 0.2, tau = \"1 s\" }, { g = 0.3, k = 0.1, tau = \"2 min\" } ]", "", "materials.EW.prony",
         "missing"},
        {all, "[ { g = 0.2, tau = \"1 s\" }, { g = 0.3, k = 0.1, tau = \"2 min\" } ]", "[]", "materials.EW.prony",
         "at least one"},
        {all, "prony =", "yield_stress = \"1 MPa\"\nprony =", "materials.EW.yield_stress", ""},
        {all, "\"2 MPa\"", "\"-2 MPa\"", "materials.LW.yield_stress", "greater than 0"},
        {all, "yield_stress = \"2 MPa\"\n", "", "materials.LW.yield_stress", "missing"},
        {all, "\"5 MPa\"", "\"-5 MPa\"", "materials.LW.hardening", "negative"},
        {all, "\"3 MPa\"", "\"1 MPa\"", "materials.LW.saturation_stress", "yield_stress"},
        {all, "\nsaturation_strain = 0.02", "", "materials.LW.saturation_strain", "missing"},
        {all, "strain = 0.02", "strain = 0", "materials.LW.saturation_strain", "greater than 0"},
        {all, "saturation_strain", "saturation_strian", "materials.LW.saturation_strian", "did you mean"},
    });
}

TEST(UnitScene, ABodyMayFollowAForce) {
    const std::string free = "velocity = [\"0 m/s\", \"-1 mm/min\"]";
    std::string text = ring_scene;
    text.replace(text.find(free), free.size(), "velocity = [\"2 mm/s\", \"free\"]\nforce = [\"0 N\", \"-3 N\"]");
    Scene scene = SceneFolder().parse(text);
    const Body& wheel = scene.bodies[0];
    EXPECT_EQ(wheel.velocity, Vec2(2e-3, 0.0));
    EXPECT_EQ(wheel.force, Vec2(0.0, -3.0));
    EXPECT_FALSE(wheel.free[0]);
    EXPECT_TRUE(wheel.free[1]);
    // Its force and the friction are numbers that a fit may adjust, the free component is none.
    set_number(scene, "bodies.left wheel.force.1", -4.0);
    EXPECT_EQ(scene.bodies[0].force.y(), -4.0);
    set_number(scene, "bodies.left wheel.contact.friction", 0.5);
    EXPECT_EQ(scene.bodies[0].contact.coefficient, 0.5);
    set_number(scene, "cracks.0.faces.friction", 0.6);
    EXPECT_EQ(scene.cracks[0].faces.coefficient, 0.6);
    EXPECT_THROW(set_number(scene, "bodies.left wheel.velocity.1", 1.0), InputError);
    EXPECT_THROW(set_number(scene, "bodies.left wheel.force.0", 1.0), InputError);
    EXPECT_THROW(set_number(scene, "bodies.body 1.contact.friction", 0.1), InputError);
    EXPECT_THROW(set_number(scene, "cracks.1.faces.friction", 0.1), InputError);
    expect_errors({
        {ring_scene, "\"-1 mm/min\"", "\"free\"", "bodies.left wheel.velocity", "give force"},
        {ring_scene, "contact = \"bonded\"", "force = [\"0 N\", \"1 N\"]", "bodies.body 1.force.1", "make it \"free\""},
        {ring_scene, free, "velocity = [\"0 m/s\", \"free\"]\nforce = [\"0 N\"]", "bodies.left wheel.force", "two forces"},
        {ring_scene, free, "velocity = [\"0 m/s\", \"free\"]\nforce = [\"0 N\", \"3\"]", "bodies.left wheel.force.1", ""},
    });
}

TEST(UnitScene, FacesThatATractionPullsTogether) {
    const std::string rub = "faces = { friction = 0.2 }";
    const std::string good = "faces = { traction = { stress = \"2 MPa\", opening = \"0.1 mm\" } }";
    const std::string text = replaced(ring_scene, rub, good);
    Scene scene = SceneFolder().parse(text);
    ASSERT_TRUE(scene.cracks[0].faces.bridging);
    EXPECT_EQ(scene.cracks[0].faces.kind, CrackFaces::Kind::frictionless);
    EXPECT_DOUBLE_EQ(scene.cracks[0].faces.bridging->stress, 2e6);
    EXPECT_DOUBLE_EQ(scene.cracks[0].faces.bridging->opening, 1e-4);
    EXPECT_FALSE(scene.cracks[0].faces.bridging->on_all_faces);
    EXPECT_FALSE(scene.cracks[1].faces.bridging);
    EXPECT_TRUE(SceneFolder()
                    .parse(replaced(text, "\"0.1 mm\" } }", "\"0.1 mm\", on = \"all faces\" } }"))
                    .cracks[0]
                    .faces.bridging->on_all_faces);
    set_number(scene, "cracks.0.faces.traction.stress", 3e6);
    EXPECT_EQ(scene.cracks[0].faces.bridging->stress, 3e6);
    EXPECT_THROW(set_number(scene, "cracks.0.faces.traction.opening", 0.0), InputError);
    EXPECT_THROW(set_number(scene, "cracks.0.faces.friction", 0.1), InputError);
    EXPECT_THROW(set_number(scene, "cracks.1.faces.traction.stress", 1e6), InputError);
    const std::string key = "cracks.0.faces.traction";
    expect_errors({
        {text, "\"2 MPa\"", "\"-2 MPa\"", key + ".stress", "greater than 0"},
        {text, "\"2 MPa\"", "\"0 MPa\"", key + ".stress", "greater than 0"},
        {text, "\"2 MPa\"", "2", key + ".stress", "unit"},
        {text, "\"2 MPa\"", "\"2 mm\"", key + ".stress", "pressure"},
        {text, "stress = \"2 MPa\", ", "", key + ".stress", "missing"},
        {text, "\"0.1 mm\" } }", "\"0 mm\" } }", key + ".opening", "greater than 0"},
        {text, ", opening = \"0.1 mm\"", "", key + ".opening", "missing"},
        {text, "opening =", "openning =", key + ".openning", "did you mean \"opening\"?"},
        {text, "\"0.1 mm\" } }", "\"0.1 mm\", on = \"old faces\" } }", key + ".on", "new faces"},
        {text, "traction = { stress", "tration = { stress", "cracks.0.faces.tration", "did you mean \"traction\"?"},
        {text, "{ traction =", "{ friction = 0.2, traction =", "cracks.0.faces", "one of friction and traction"},
        {text, "grows = \"end\"", "grows = \"none\"", key, "all faces"},
    });
}

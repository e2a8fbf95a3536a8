#include "datasets/displacement_field.hpp"
#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "tests/datasets/full_results.hpp"
#include "tests/datasets/good_scenes.hpp"
#include "tests/temporary_folder.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

using namespace crampfit;

namespace {

const std::string good_study = R"(title = "EW and LW toughness from two tests"

[[experiments]]
name = "wedge 1"
scene = "wedge.toml"
data = "wedge_1.csv"
noise = { force = "200 mN", crack_length = "0.1 mm" }
weight = 2.0

[[experiments]]
scene = "plain.toml"
data = "plain.csv"

[[parameters]]
name = "EW toughness"
key = "materials.EW.toughness"
initial = "80 J/m^2"
lower = "0.02 kJ/m^2"
upper = "400 N/m"
scale = "log"
prior = { mean = "100 J/m^2", sd = "30 J/m^2" }

[[parameters]]
name = "stiffness"
keys = ["materials.EW.E", "materials.LW.E"]
initial = "50 MPa"
lower = "1 MPa"
upper = "2 GPa"

[[parameters]]
key = "materials.EW.nu"
initial = 0.3
lower = 0
upper = 0.4

[optimizer]
method = "bobyqa"
starts = 4
max_runs = 200

[uncertainty]
profile = true
posterior = 2000
)";

struct StudyFolder : TemporaryFolder {
    StudyFolder() {
        write("wedge.toml", ring_scene);
        write("plain.toml", plain_scene);
        write("wedge_1.csv", "displacement [mm],force [N],crack_length [mm]\n0,0,1\n0.1,5,1\n");
        write("plain.csv", "time [s],force [N]\n0,0\n1,5\n");
    }
    Study read(const std::string& text, const Overrides& overrides = {}) const {
        return read_study(write("study.toml", text), overrides);
    }
};

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

}  // namespace

TEST(UnitStudy, Read) {
    const StudyFolder folder;
    const Study study = folder.read(good_study);
    EXPECT_EQ(study.title, "EW and LW toughness from two tests");
    EXPECT_EQ(study.text, good_study);
    ASSERT_EQ(study.experiments.size(), 2U);
    const Experiment& wedge = study.experiments[0];
    EXPECT_EQ(wedge.name, "wedge 1");
    EXPECT_EQ(wedge.scene.title, "TR+ crack under tension");
    EXPECT_EQ(wedge.data_file, folder / "wedge_1.csv");
    EXPECT_DOUBLE_EQ(wedge.data.displacement[1], 1e-4);
    EXPECT_DOUBLE_EQ(*wedge.noise.force, 0.2);
    EXPECT_DOUBLE_EQ(*wedge.noise.crack_length, 1e-4);
    EXPECT_FALSE(wedge.noise.time);
    EXPECT_EQ(wedge.weight, 2);
    EXPECT_EQ(study.experiments[1].name, "experiment 1");
    EXPECT_EQ(study.experiments[1].weight, 1);
    ASSERT_EQ(study.parameters.size(), 3U);
    const Parameter& toughness = study.parameters[0];
    EXPECT_EQ(toughness.keys, std::vector<std::string>{"materials.EW.toughness"});
    EXPECT_DOUBLE_EQ(toughness.initial, 80);
    EXPECT_DOUBLE_EQ(toughness.lower, 20);
    EXPECT_DOUBLE_EQ(toughness.upper, 400);
    EXPECT_EQ(toughness.unit, "J/m^2");
    EXPECT_EQ(toughness.scale, Scale::logarithmic);
    EXPECT_DOUBLE_EQ(toughness.prior->sd, 30);
    EXPECT_EQ(study.parameters[1].keys.size(), 2U);
    EXPECT_EQ(study.parameters[1].unit, "MPa");
    EXPECT_DOUBLE_EQ(study.parameters[1].unit_factor, 1e6);
    EXPECT_DOUBLE_EQ(study.parameters[1].upper, 2e9);
    EXPECT_EQ(study.parameters[1].scale, Scale::linear);
    EXPECT_EQ(study.parameters[2].name, "materials.EW.nu");
    EXPECT_EQ(study.parameters[2].unit, "");
    EXPECT_EQ(study.parameters[2].unit_factor, 1);
    EXPECT_EQ(study.optimizer.method, "bobyqa");
    EXPECT_EQ(study.optimizer.starts, 4);
    EXPECT_EQ(study.optimizer.max_runs, 200);
    EXPECT_TRUE(study.uncertainty.profile);
    EXPECT_EQ(study.uncertainty.posterior, 2000);
}

// A camera's rows know the time alone; those before and after the other instrument's get no place.
TEST(UnitStudy, RowsWithoutADisplacementArePlacedByTime) {
    const StudyFolder folder;
    folder.write("wedge_1.csv", "time [s],displacement [mm],force [N],crack_length [mm]\n"
                                "1,,,1\n2,0.1,5,\n2.5,,,1\n4,0.2,6,\n4,,,2\n5,0.4,6,\n4.25,,,2\n6,,,3\n,,4,\n");
    const std::vector<double> placed = folder.read(good_study).experiments[0].data.displacement;
    const std::vector<double> expected{NAN, 0.1e-3, 0.125e-3, 0.2e-3, 0.2e-3, 0.4e-3, 0.25e-3, NAN, NAN};
    ASSERT_EQ(placed.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_EQ(std::isnan(placed[i]), std::isnan(expected[i])) << i;
        EXPECT_TRUE(std::isnan(expected[i]) || std::abs(placed[i] - expected[i]) < 1e-12) << i << " " << placed[i];
    }
}

TEST(UnitStudy, OverridesOfTheStudyAndOfItsScenes) {
    const StudyFolder folder;
    const Study study = folder.read(good_study, {{"optimizer.starts", "7"},
                                                 {"parameters.EW toughness.initial", "90 J/m^2"},
                                                 {"experiments.experiment 1.weight", "3"},
                                                 {"materials.EW.density", "333 kg/m^3"}});
    EXPECT_EQ(study.optimizer.starts, 7);
    EXPECT_DOUBLE_EQ(study.parameters[0].initial, 90);
    EXPECT_EQ(study.experiments[1].weight, 3);
    for (const Experiment& experiment : study.experiments) {
        EXPECT_DOUBLE_EQ(experiment.scene.materials.at("EW").density, 333);
    }
    expect_error("command line (--set)", "optimizer.starts", "whole number", [&] {
        folder.read(good_study, {{"optimizer.starts", "0"}});
    });
    expect_error("command line (--set)", "materials.EW.E", "missing unit", [&] {
        folder.read(good_study, {{"materials.EW.E", "1"}});
    });
    expect_error("command line (--set)", "optimiser.starts", "unknown key", [&] {
        folder.read(good_study, {{"optimiser.starts", "1"}});
    });
}

TEST(UnitStudy, MachinesAndFixedRatios) {
    const StudyFolder folder;
    const std::string offset = "\n[[parameters]]\nname = \"offset\"\nkey = \"experiments.wedge 1.displacement_offset\"\n"
                               "initial = \"0 um\"\nlower = \"-20 um\"\nupper = \"0.02 mm\"\n";
    std::string text = good_study + offset;
    text.replace(text.find("weight = 2.0"), 12, "compliance = \"0.5 um/N\"\nforce_offset = \"-20 mN\"");
    text.replace(text.find("initial = \"50 MPa\""), 0, "factors = [1, 12.5]\n");
    text.replace(text.find("compliance = "), 0, "displacement_offset = \"3 um\"\n");
    const Study study = folder.read(text, {{"experiments.wedge 1.compliance", "0.6 um/N"}});
    const Machine& machine = study.experiments[0].machine;
    EXPECT_DOUBLE_EQ(machine.compliance, 0.6e-6);
    EXPECT_DOUBLE_EQ(machine.force_offset, -0.02);
    EXPECT_DOUBLE_EQ(machine.displacement_offset, 3e-6);
    EXPECT_EQ(study.experiments[1].machine.compliance, 0);
    EXPECT_EQ(study.parameters[1].factor(0), 1);
    EXPECT_EQ(study.parameters[1].factor(1), 12.5);
    EXPECT_EQ(study.parameters[0].factor(0), 1);
    EXPECT_EQ(study.parameters[3].unit, "um");
    EXPECT_DOUBLE_EQ(study.parameters[3].lower, -20e-6);
}

TEST(UnitStudy, ModelsToCompare) {
    const StudyFolder folder;
    const Study study = folder.read(good_study + "[compare]\nkey = \"model.thickness\"\nvalues = [\"30 mm\", \"60 mm\"]\n",
                                    {{"materials.EW.density", "333 kg/m^3"}, {"optimizer.loss", "cauchy"}});
    EXPECT_EQ(study.optimizer.loss, Loss::cauchy);
    EXPECT_EQ(study.compared_key, "model.thickness");
    ASSERT_EQ(study.models.size(), 2u);
    EXPECT_EQ(study.models[1].name, "60 mm");
    ASSERT_EQ(study.models[1].scenes.size(), 2u);
    EXPECT_DOUBLE_EQ(study.models[1].scenes[1].model.thickness, 60e-3);
    EXPECT_DOUBLE_EQ(study.models[1].scenes[1].materials.at("EW").density, 333);
}

// A picture of 400 x 200 pixels of 50 um, turned by a quarter about its lower left corner at 12, 1 mm: up the picture is to the
// left.
TEST(UnitStudy, PhotographOfACrack) {
    const StudyFolder folder;
    const auto with = [](const std::string& photograph) {
        std::string text = good_study;
        return text.insert(text.find("weight = 2.0"), "photograph = " + photograph + "\n");
    };
    CrackTrack track = full_track();
    track.pixel = 50e-6;
    track.columns = 400;
    track.rows = 200;
    track.images = {"last.png"};
    track.tips = {{.status = TipStatus::ok, .tip = {149.5, 99.5}, .way = {{-0.5, 99.5}, {149.5, 99.5}}}};
    write(track, folder / "track.h5");
    folder.write("last.png", "");  // read later
    const Study study =
        folder.read(with(R"({ picture = "last.png", track = "track.h5", offset = ["12 mm", "1 mm"], rotation = "90 deg" })"));
    ASSERT_TRUE(study.experiments[0].photograph);
    EXPECT_FALSE(study.experiments[1].photograph);
    const Photograph& photograph = *study.experiments[0].photograph;
    EXPECT_EQ(photograph.file, folder / "last.png");
    ASSERT_EQ(photograph.path.size(), 2u);
    EXPECT_NEAR((photograph.path[0] - Vec2(7e-3, 1e-3)).norm(), 0, 1e-12);
    EXPECT_NEAR((photograph.path[1] - Vec2(7e-3, 8.5e-3)).norm(), 0, 1e-12);

    const auto refused = [&](const std::string& photograph_of, const std::string& key, const std::string& phrase) {
        expect_error((folder / "study.toml").string(), "experiments.wedge 1.photograph" + key, phrase,
                     [&] { folder.read(with(photograph_of)); });
    };
    refused("{ }", ".picture", "missing");
    refused(R"({ picture = "last.png" })", "", "edge of a pixel");
    refused(R"({ picture = "none.png", pixel = "50 um" })", ".picture", "no such file");
    refused(R"({ track = "none.h5" })", ".track", "no such file");
    refused(R"({ tracks = "track.h5" })", ".tracks", "did you mean \"track\"?");
    refused(R"({ track = "track.h5", pixel = "0 um" })", ".pixel", "greater than 0");
    refused(R"({ track = "track.h5", pixel = "40 um" })", ".pixel", "contradicts the file, whose pixel is 50 um");
    refused(R"({ track = "track.h5", offset = ["1 m", "0 m"] })", "", "does not lie on the specimen");
    track.tips[0] = {.status = TipStatus::no_crack};
    write(track, folder / "track.h5");
    refused(R"({ track = "track.h5" })", ".track", "no crack in any image");
    track.rows = 0;
    write(track, folder / "track.h5");
    refused(R"({ track = "track.h5" })", ".track", "size of the pictures");
}

TEST(UnitStudy, FieldsHaveOnePixel) {
    const StudyFolder folder;
    FieldSeries series;
    series.images = {"image.png"};
    series.lattice = {2, 2, 20, 20, 20};
    series.subset = 21;
    series.pixel = 50e-6;
    series.columns = series.rows = 60;
    series.time = {1.0};
    const std::vector<double> zero(4, 0.0), small(4, 0.01);
    const DisplacementField field{zero, zero, zero, zero, zero, zero, small, std::vector(4, PointStatus::ok)};
    write_fields(
        series, [&](int) { return field; }, folder / "field.h5");
    const auto read = [&](const std::string& pixel) {
        std::string text = good_study;
        text.insert(text.find("weight = 2.0"), "fields = { file = \"field.h5\"" + pixel + " }\n");
        return *folder.read(text).experiments[0].fields;
    };
    EXPECT_DOUBLE_EQ(read("").subset, 21 * 50e-6);
    EXPECT_DOUBLE_EQ(read(", pixel = \"0.05 mm\"").subset, 21 * 50e-6);
    expect_error((folder / "study.toml").string(), "experiments.wedge 1.fields.pixel",
                 "contradicts the file, whose pixel is 50 um", [&] { read(", pixel = \"40 um\""); });
}

TEST(UnitStudy, ACrackFitsIntoItsSpecimen) {
    const StudyFolder folder;
    for (const char* length : {"-0.4", "1000"}) {
        const auto data = folder.write("wedge_1.csv", fmt::format("displacement [mm],force [N],crack_length [mm]\n0,0,1\n"
                                                                  "0.1,5,{}\n",
                                                                  length));
        expect_error(data.string(), "crack_length, reading 2", "must lie between 0 and", [&] { folder.read(good_study); });
    }
    folder.write("wedge_1.csv", "displacement [mm],force [N],crack_length [mm]\n0,0,-0.2\n0.1,5,1\n");  // noise, 2 sigma
    EXPECT_NO_THROW(folder.read(good_study));
}

TEST(UnitStudy, WhatIsWrongIsSaid) {
    const StudyFolder folder;
    struct Bad {
        std::string from, to, key, phrase;
    };
    const std::vector<Bad> table{
        {"[optimizer]", "[optimiser]", "optimiser", "did you mean \"optimizer\"?"},
        {"weight", "wieght", "experiments.wedge 1.wieght", "did you mean \"weight\"?"},
        {"scale", "scales", "parameters.EW toughness.scales", "did you mean \"scale\"?"},
        {"starts", "start", "optimizer.start", "did you mean \"starts\"?"},
        {"profile", "profiles", "uncertainty.profiles", "did you mean \"profile\"?"},
        {"sd =", "sigma =", "parameters.EW toughness.prior.sigma", "unknown key"},
        {"noise = { force", "noise = { forces", "experiments.wedge 1.noise.forces", "did you mean \"force\"?"},
        {"scene = \"wedge.toml\"", "", "experiments.wedge 1.scene", "missing"},
        {"\"wedge.toml\"", "\"none.toml\"", "experiments.wedge 1.scene", "no such file"},
        {"data = \"plain.csv\"", "", "experiments.experiment 1.data", "missing"},
        {"\"plain.csv\"", "\"none.csv\"", "experiments.experiment 1.data", "no such file"},
        {"\"200 mN\"", "\"200 mm\"", "experiments.wedge 1.noise.force", "wrong dimension"},
        {"\"200 mN\"", "0.2", "experiments.wedge 1.noise.force", "missing unit"},
        {"\"200 mN\"", "\"0 N\"", "experiments.wedge 1.noise.force", "greater than 0"},
        {"noise = { force = \"200 mN\"", "noise = { time = \"1 s\"", "experiments.wedge 1.noise.time", "no such column"},
        {"\"200 mN\"", "\"1e300 N\"", "experiments.wedge 1.noise.force", "largest reading"},
        {"\"200 mN\"", "\"1e-300 N\"", "experiments.wedge 1.noise.force", "last digit"},
        {"weight = 2.0", "weight = 0", "experiments.wedge 1.weight", "greater than 0"},
        {"weight = 2.0", "weight = 1e300", "experiments.wedge 1.weight", "from 1e-9 to 1e9"},
        {"scene = \"plain.toml\"", "name = \"wedge 1\"\nscene = \"plain.toml\"", "experiments.wedge 1", "is taken"},
        {"key = \"materials.EW.toughness\"", "", "parameters.EW toughness", "give one of key and keys"},
        {"key = \"materials.EW.toughness\"", "key = \"materials.EW.tougness\"", "parameters.EW toughness.key",
         "did you mean \"toughness\"?"},
        {"key = \"materials.EW.toughness\"", "key = \"materials.XX.toughness\"", "parameters.EW toughness.key",
         "there is no material XX"},
        {"[\"materials.EW.E\", \"materials.LW.E\"]", "[\"materials.EW.E\", \"materials.LW.nu\"]", "parameters.stiffness.keys.1",
         "one dimension"},
        {"[\"materials.EW.E\", \"materials.LW.E\"]", "[]", "parameters.stiffness.keys", "at least one key"},
        {"initial = \"80 J/m^2\"", "initial = 80", "parameters.EW toughness.initial", "missing unit"},
        {"initial = \"80 J/m^2\"", "initial = \"80 MPa\"", "parameters.EW toughness.initial", "wrong dimension"},
        {"initial = \"80 J/m^2\"", "", "parameters.EW toughness.initial", "missing key"},
        {"initial = \"80 J/m^2\"", "initial = \"10 J/m^2\"", "parameters.EW toughness.initial", "between lower and upper"},
        {"initial = \"80 J/m^2\"", "initial = \"500 J/m^2\"", "parameters.EW toughness.initial", "between lower and upper"},
        {"upper = \"400 N/m\"", "upper = \"20 J/m^2\"", "parameters.EW toughness.lower", "less than upper"},
        {"lower = \"0.02 kJ/m^2\"", "lower = \"0 J/m^2\"", "parameters.EW toughness.lower", "greater than 0"},
        {"upper = 0.4", "upper = 0.5\nscale = \"linear\"", "parameters.2.upper", "between -1 and 0.5"},
        {"upper = 0.4", "upper = 0.4\nscale = \"log\"", "parameters.2.lower", "log scale"},
        {"scale = \"log\"", "scale = \"ln\"", "parameters.EW toughness.scale", "must be one of"},
        {"sd = \"30 J/m^2\"", "sd = \"0 J/m^2\"", "parameters.EW toughness.prior.sd", "greater than 0"},
        {"mean = \"100 J/m^2\", ", "", "parameters.EW toughness.prior.mean", "missing"},
        {"mean = \"100 J/m^2\", ", "mean = \"-100 J/m^2\", ", "parameters.EW toughness.prior.mean", "greater than 0"},
        {"\"materials.LW.E\"]", "\"materials.LW.E\", \"materials.EW.E\"]", "parameters.stiffness.keys.2", "given twice"},
        {"name = \"stiffness\"", "name = \"EW toughness\"", "parameters.EW toughness", "is taken"},
        {"key = \"materials.EW.nu\"", "key = \"materials.EW.E\"", "parameters.2.initial", "missing unit"},
        {"keys = [\"materials.EW.E\"", "keys = [\"materials.EW.toughness\"", "parameters.stiffness.keys.1", "one dimension"},
        {"\"bobyqa\"", "\"bobyka\"", "optimizer.method", "did you mean \"bobyqa\"?"},
        {"starts = 4", "starts = 0", "optimizer.starts", "whole number from 1"},
        {"max_runs = 200", "max_runs = 0", "optimizer.max_runs", "whole number from 1"},
        {"profile = true", "profile = 1", "uncertainty.profile", "true or false"},
        {"posterior = 2000", "posterior = -1", "uncertainty.posterior", "whole number from 0"},
        {"[optimizer]", "[sensitivity]\nmethod = \"sobel\"\n[optimizer]", "sensitivity.method", "did you mean \"sobol\"?"},
        {"[optimizer]", "[runs]\ntime_limit = \"0 s\"\n[optimizer]", "runs.time_limit", "greater than 0"},
        {"[optimizer]", "[runs]\n[optimizer]", "runs.time_limit", "missing"},
        {"[optimizer]", "[sensitivity]\nsamples = 1\n[optimizer]", "sensitivity.samples", "whole number from 2"},
        {"title =", "outputs = [\"peek force\"]\ntitle =", "outputs.0", "did you mean \"peak force\"?"},
        {"title =", "outputs = []\ntitle =", "outputs", "at least one"},
        {"title =", "outputs = [\"force at 3 N\"]\ntitle =", "outputs.0", "wrong dimension"},
        {"title =", "outputs = [\"force at -1 mm\"]\ntitle =", "outputs.0", "greater than 0"},
        {"title =", "outputs = [\"arrest length 0\"]\ntitle =", "outputs.0", "whole number from 1"},
        {"title =", "outputs = [\"peak force\", \"peak force\"]\ntitle =", "outputs.1", "asked for twice"},
        {"title =", "scene = \"wedge.toml\"\ntitle =", "scene", "either a scene or experiments"},
        {"[optimizer]", "[optimizer]\nloss = \"huper\"", "optimizer.loss", "did you mean \"huber\"?"},
        {"[optimizer]", "[compare]\nkey = \"model.thickness\"\nvalues = [\"1 mm\"]\n[optimizer]", "compare.values",
         "at least two"},
        {"[optimizer]", "[compare]\nkey = \"model.thickness\"\nvalues = [\"1 mm\", \"1 MPa\"]\n[optimizer]", "compare.values.1",
         "wrong dimension"},
        {"[optimizer]", "[compare]\nkey = \"model.thickness\"\nvalues = [\"1 mm\", \"1 mm\"]\n[optimizer]", "compare.values.1",
         "given twice"},
        {"[optimizer]", "[compare]\nkey = \"materials.EW.E\"\nvalues = [\"1 MPa\", \"2 MPa\"]\n[optimizer]", "compare.key",
         "belongs to the parameter \"stiffness\" already"},
        {"[optimizer]", "[compare]\nvalues = [\"1 MPa\", \"2 MPa\"]\n[optimizer]", "compare.key", "missing"},
        {"weight = 2.0", "compliance = \"0.1 mm\"", "experiments.wedge 1.compliance", "wrong dimension"},
        {"weight = 2.0", "compliance = \"-1 um/N\"", "experiments.wedge 1.compliance", "not be negative"},
        {"weight = 2.0", "force_offset = 0.1", "experiments.wedge 1.force_offset", "missing unit"},
        {"data = \"plain.csv\"", "data = \"plain.csv\"\ncompliance = \"1 um/N\"", "experiments.experiment 1.compliance",
         "no such column"},
        {"key = \"materials.EW.nu\"", "key = \"experiments.wedge 2.compliance\"", "parameters.2.key", "did you mean \"wedge 1\""},
        {"key = \"materials.EW.nu\"", "key = \"experiments.wedge 1.complianze\"", "parameters.2.key",
         "did you mean \"compliance\""},
        {"key = \"materials.EW.nu\"", "key = \"experiments.1.displacement_offset\"", "parameters.2.key",
         "no displacement column"},
        {"key = \"materials.EW.nu\"", "key = \"experiments.0\"", "parameters.2.key", "must be experiments.NAME"},
        {"initial = \"50 MPa\"", "factors = [1]\ninitial = \"50 MPa\"", "parameters.stiffness.factors",
         "as many as the keys: 2, not 1"},
        {"initial = \"50 MPa\"", "factors = [1, 0]\ninitial = \"50 MPa\"", "parameters.stiffness.factors.1", "must not be 0"},
        {"initial = \"50 MPa\"", "factors = [1, -2]\ninitial = \"50 MPa\"", "parameters.stiffness.initial",
         "times its factor, materials.LW.E must be greater than 0"},
        {"title =", "title = = ", "", "line 1"},
    };
    for (const Bad& bad : table) {
        SCOPED_TRACE("'" + bad.from + "' -> '" + bad.to + "'");
        std::string text = good_study;
        ASSERT_NE(text.find(bad.from), std::string::npos);
        text.replace(text.find(bad.from), bad.from.size(), bad.to);
        expect_error((folder / "study.toml").string(), bad.key, bad.phrase, [&] { folder.read(text); });
    }
    const std::size_t experiments = good_study.find("[[experiments]]");
    const std::size_t parameters = good_study.find("[[parameters]]");
    const std::size_t optimizer = good_study.find("[optimizer]");
    expect_error((folder / "study.toml").string(), "experiments", "missing", [&] { folder.read(good_study.substr(parameters)); });
    expect_error((folder / "study.toml").string(), "parameters", "missing",
                 [&] { folder.read(good_study.substr(experiments, parameters - experiments) + good_study.substr(optimizer)); });
    expect_error((folder / "study.toml").string(), "parameters", "at least one",
                 [&] { folder.read("parameters = []\n" + good_study.substr(experiments, parameters - experiments)); });
}

TEST(UnitStudy, OneKeyInTwoParameters) {
    const StudyFolder folder;
    const std::string twice = "\n[[parameters]]\nname = \"again\"\nkey = \"materials.LW.E\"\ninitial = \"2 MPa\"\n"
                              "lower = \"1 MPa\"\nupper = \"3 MPa\"\n";
    expect_error((folder / "study.toml").string(), "parameters.again", "belongs to the parameter \"stiffness\" already",
                 [&] { folder.read(good_study + twice); });
}

TEST(UnitStudy, OneNumberByTwoKeys) {
    const StudyFolder folder;
    const auto parameter = [](const std::string& name, const std::string& keys, const std::string& unit) {
        return fmt::format("\n[[parameters]]\nname = \"{0}\"\n{1}\ninitial = \"0 {2}\"\nlower = \"-1 {2}\"\nupper = \"1 {2}\"\n",
                           name, keys, unit);
    };
    const std::string file = (folder / "study.toml").string();
    const std::string by_name = parameter("zero", "key = \"experiments.wedge 1.force_offset\"", "N");
    const std::string by_number = parameter("again", "key = \"experiments.0.force_offset\"", "N");
    const std::string grip = parameter("grip", "key = \"edges.grip.velocity.1\"", "m/s");
    const std::string belongs = "belongs to the parameter \"";
    expect_error(file, "parameters.again", belongs + "zero\"", [&] { folder.read(good_study + by_name + by_number); });
    expect_error(file, "parameters.again", belongs + "grip\"",
                 [&] { folder.read(good_study + grip + parameter("again", "key = \"edges.0.velocity.1\"", "m/s")); });
    expect_error(file, "parameters.both.keys.1", "is the same number as edges.grip.velocity.1", [&] {
        folder.read(good_study + parameter("both", "keys = [\"edges.grip.velocity.1\", \"edges.0.velocity.1\"]", "m/s"));
    });
    expect_error(file, "compare.key", belongs + "grip\"", [&] {
        folder.read(good_study + grip + "[compare]\nkey = \"edges.0.velocity.1\"\nvalues = [\"1 m/s\", \"2 m/s\"]\n");
    });
    expect_error("command line (--set)", "materials.EW.E", belongs + "stiffness\": give parameters.stiffness.initial", [&] {
        folder.read(good_study, {{"materials.EW.E", "3 MPa"}});
    });
    expect_error("command line (--set)", "experiments.0.force_offset", belongs + "zero\"", [&] {
        folder.read(good_study + by_name, {{"experiments.0.force_offset", "1 N"}});
    });
}

TEST(UnitStudy, ErrorsOfItsFilesNameThoseFiles) {
    const StudyFolder folder;
    folder.write("plain.csv", "force [N]\nx\n");
    expect_error((folder / "plain.csv").string(), "force, line 2", "finite number", [&] { folder.read(good_study); });
    folder.write("wedge.toml", "title = 3");
    expect_error((folder / "wedge.toml").string(), "title", "must be a text", [&] { folder.read(good_study); });
}

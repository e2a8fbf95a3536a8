#include "datasets/io.hpp"
#include "tests/cli/command.hpp"
#include "tests/cli/scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

using namespace crampfit;

// Statuses and messages as INTERFACE.md, "Command", gives them.

TEST(SystemCommand, HelpAndVersionSucceed) {
    Command command;
    EXPECT_EQ(command.run({"--version"}).out, "crampfit " CRAMPFIT_VERSION "\n");
    EXPECT_EQ(command.run({"--version"}).status, 0);
    EXPECT_EQ(command.run({"simulate", "--version"}).status, 0);
    for (const char* verb : {"simulate", "explain", "fit", "csv"}) {
        const Outcome outcome = command.run({verb, "--help"});
        EXPECT_EQ(outcome.status, 0);
        EXPECT_TRUE(contains(outcome.out, verb)) << outcome.out;
        EXPECT_EQ(outcome.error, "");
    }
    const Outcome outcome = command.run({"--help"});
    for (const char* word : {"simulate", "explain", "fit", "csv", "--set", "--threads", "--quiet", "--log"})
        EXPECT_TRUE(contains(outcome.out, word)) << word;
}

TEST(SystemCommand, BadUsageIsStatusTwo) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    const std::string scene = command.path("scene.toml");
    const std::string record = command.path("record.h5");
    const std::vector<std::vector<std::string>> usages{
        {},
        {"paint"},
        {"simulate"},
        {"simulate", scene},
        {"simulate", scene, "-o"},
        {"simulate", scene, "-o", record, "--colour"},
        {"simulate", scene, "more", "-o", record},
        {"simulate", scene, "-o", record, "--threads", "0"},
        {"simulate", scene, "-o", record, "--threads", "two"},
        {"simulate", scene, "-o", record, "--set", "title"},
        {"simulate", scene, "-o", record, "--set", "=1"},
        {"explain"},
        {"fit"},
        {"csv", record},
    };
    for (const auto& usage : usages) {
        const Outcome outcome = command.run(usage);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(usage);
        EXPECT_EQ(outcome.error.rfind("crampfit: error: ", 0), 0u) << outcome.error;
        EXPECT_EQ(outcome.out, "");
    }
    EXPECT_FALSE(std::filesystem::exists(record));
    EXPECT_NE(command.run({"--threads", "2", "paint"}).error.find("there is no verb \"paint\""), std::string::npos);
}

TEST(SystemCommand, SimulateSavesARecord) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    const Outcome outcome = command.run({"simulate", command.path("scene.toml"), "-o", command.path("record.h5")});
    ASSERT_EQ(outcome.status, 0) << outcome.error;
    EXPECT_EQ(outcome.out, "");
    EXPECT_TRUE(contains(outcome.error, "record.h5")) << outcome.error;

    const Record record = read_record(command.path("record.h5"));
    EXPECT_EQ(record.status, RunStatus::finished);
    ASSERT_FALSE(record.series.empty());
    // The last instant meets the stop condition, to the motion of one step: 5 m/s times less than 0.8 us.
    EXPECT_NEAR(record.series.back().displacement, 1e-4, 4e-6);
    EXPECT_TRUE(contains(record.scene_text, "block under tension"));

    const Outcome table = command.run({"csv", command.path("record.h5"), "series"});
    EXPECT_EQ(table.status, 0);
    EXPECT_EQ(table.out.substr(0, table.out.find('\n')),
              "time_s,displacement_m,force_N,crack_length_m,tip_x_m,tip_y_m,G_J_m2,K_I_Pa_sqrt_m,K_II_Pa_sqrt_m,"
              "strain_energy_J,kinetic_energy_J,fracture_energy_J,external_work_J");
    EXPECT_EQ(static_cast<std::size_t>(std::count(table.out.begin(), table.out.end(), '\n')), record.series.size() + 1);
}

TEST(SystemCommand, QuietSaysNothing) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    const Outcome outcome = command.run({"simulate", "--quiet", command.path("scene.toml"), "-o", command.path("record.h5")});
    EXPECT_EQ(outcome.status, 0);
    EXPECT_EQ(outcome.out + outcome.error, "");
}

TEST(SystemCommand, PlainProgressIsALineATenth) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    const Outcome outcome = command.run({"simulate", command.path("scene.toml"), "-o", command.path("record.h5"), "--set",
                                         "edges.top.velocity=[\"0 m/s\", \"0.2 m/s\"]"});
    EXPECT_TRUE(contains(outcome.error, " steps/s")) << outcome.error;
    EXPECT_FALSE(contains(outcome.error, "\r")) << outcome.error;
    const auto lines = std::count(outcome.error.begin(), outcome.error.end(), '\n');
    EXPECT_LE(lines, 12);  // ten tenths, the result, and room for a machine that takes ten seconds over this
}

TEST(SystemCommand, SetOverridesKeysOfTheFile) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    const Outcome outcome =
        command.run({"simulate", "--set", "stop.displacement=0.05 mm", "--set", "edges.top.velocity=[\"0 m/s\", \"2 m/s\"]",
                     command.path("scene.toml"), "-o", command.path("record.h5"), "--threads", "1"});
    ASSERT_EQ(outcome.status, 0) << outcome.error;
    const Instant last = read_record(command.path("record.h5")).series.back();
    // To one step of less than 0.8 us.
    EXPECT_NEAR(last.displacement, 5e-5, 1.6e-6);
    EXPECT_NEAR(last.time, 5e-5 / 2, 0.8e-6);

    const Outcome refused = command.run(
        {"simulate", "--set", "stop.displacment=0.05 mm", command.path("scene.toml"), "-o", command.path("record.h5")});
    EXPECT_EQ(refused.status, 2);
    EXPECT_TRUE(contains(refused.error, "displacment")) << refused.error;
}

TEST(SystemCommand, BadSceneIsStatusTwoAndNamesFileAndKey) {
    Command command;
    command.folder.write("scene.toml", small_scene + "\n[modell]\ncell = 1\n");
    for (const std::vector<std::string>& usage :
         {std::vector<std::string>{"simulate", command.path("scene.toml"), "-o", command.path("record.h5")},
          std::vector<std::string>{"explain", command.path("scene.toml")}}) {
        const Outcome outcome = command.run(usage);
        EXPECT_EQ(outcome.status, 2);
        EXPECT_EQ(outcome.error.rfind("crampfit: error: ", 0), 0u) << outcome.error;
        EXPECT_TRUE(contains(outcome.error, "scene.toml") && contains(outcome.error, "modell")) << outcome.error;
    }
    EXPECT_EQ(command.run({"simulate", command.path("none.toml"), "-o", command.path("record.h5")}).status, 2);
    EXPECT_FALSE(std::filesystem::exists(command.path("record.h5")));
}

TEST(SystemCommand, OutputIsCheckedBeforeTheRun) {
    Command command;
    command.folder.write("scene.toml", endless_scene);
    const Outcome outcome = command.run({"simulate", command.path("scene.toml"), "-o", command.path("none/record.h5")});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(contains(outcome.error, "does not exist")) << outcome.error;

    EXPECT_EQ(command.run({"simulate", command.path("scene.toml"), "-o", command.path("scene.toml")}).status, 2);
    EXPECT_EQ(command.folder.read("scene.toml"), endless_scene);
}

TEST(SystemCommand, ExplainPrints) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    const Outcome outcome = command.run({"explain", command.path("scene.toml")});
    EXPECT_EQ(outcome.status, 0) << outcome.error;
    EXPECT_EQ(outcome.error, "");
    EXPECT_TRUE(contains(outcome.out, "explicit")) << outcome.out;
}

TEST(SystemCommand, InterruptedRunIsSaved) {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        Command command;
        command.folder.write("scene.toml", endless_scene);
        command.start(
            {"simulate", command.path("scene.toml"), "-o", command.path("record.h5"), "--log", command.path("log.txt")});
        EXPECT_TRUE(command.wait_for("log.txt", "scene is read"));
        command.send(signal);
        const Outcome outcome = command.finish();
        EXPECT_EQ(outcome.status, 130) << outcome.error;
        const Record record = read_record(command.path("record.h5"));
        EXPECT_EQ(record.status, RunStatus::interrupted);
        EXPECT_FALSE(record.series.empty());
    }
}

// Between two rows there are many equilibria, each by itself a matter of a second.
TEST(SystemCommand, InterruptedBetweenTwoRowsOfAWheel) {
    Command command;
    command.folder.write("scene.toml", R"(
[model]
plane = "stress"
thickness = "10 mm"
cell = "0.05 mm"
[specimen]
size = ["12 mm", "14 mm"]
material = "EW"
[materials]
EW = { kind = "isotropic", E = "40 MPa", nu = 0.33, density = "300 kg/m^3", toughness = "100 J/m^2" }
[[edges]]
side = "bottom"
velocity = ["0 m/s", "0 m/s"]
[[bodies]]
name = "wheel"
circle = { centre = ["6 mm", "16 mm"], radius = "2 mm" }
velocity = ["0 m/s", "-1 mm/min"]
[stop]
displacement = "0.4 mm"
[output]
samples = 1
)");
    command.start({"simulate", command.path("scene.toml"), "-o", command.path("record.h5"), "--log", command.path("log.txt")});
    EXPECT_TRUE(command.wait_for("log.txt", "scene is read"));
    std::this_thread::sleep_for(std::chrono::seconds(2));
    command.send(SIGINT);
    const Outcome outcome = command.finish();
    EXPECT_EQ(outcome.status, 130) << outcome.error;
    const Record record = read_record(command.path("record.h5"));
    EXPECT_EQ(record.status, RunStatus::interrupted);
    EXPECT_EQ(record.message.rfind("stopped by the user", 0), 0U) << record.message;
    EXPECT_FALSE(record.series.empty());
}

TEST(SystemCommand, LogIsAppendedWithTimes) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    for (int i = 0; i < 2; ++i) command.run({"explain", command.path("scene.toml"), "--log", command.path("log.txt")});
    command.run({"explain", command.path("none.toml"), "--log", command.path("log.txt")});
    const std::string log = command.folder.read("log.txt");
    EXPECT_EQ(std::count(log.begin(), log.end(), '\n'), 4) << log;
    EXPECT_EQ(log.rfind("20", 0), 0u) << log;
    EXPECT_TRUE(contains(log, "error: ") && contains(log, "none.toml")) << log;

    const Outcome outcome = command.run({"explain", command.path("scene.toml"), "--log", "/proc/log.txt"});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(contains(outcome.error, "--log")) << outcome.error;
}

TEST(SystemCommand, NeitherLogNorOutputTakesThePlaceOfOtherThings) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    const std::string scene = command.path("scene.toml"), made = command.path("made.h5");
    command.folder.write("times.csv", "time [s]\n1\n");
    const std::string times = command.path("times.csv"), picture = command.path("a.png");
    for (const auto& words : {std::vector<std::string>{"explain", scene, "--log", scene},
                              {"explain", scene, "--log", times},
                              {"simulate", scene, "-o", made, "--log", made},
                              {"track", picture, picture, "-o", times, "--times", times},
                              {"correlate", picture, picture, "-o", times, "--times", times},
                              {"track", picture, picture, "-o", command.path("new.png"), "--preview", command.path("new.png")}}) {
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 2) << outcome.error;
        EXPECT_TRUE(contains(outcome.error, "must ")) << outcome.error;
    }
    EXPECT_EQ(command.folder.read("scene.toml"), small_scene);
    EXPECT_EQ(command.folder.read("times.csv"), "time [s]\n1\n");
}

TEST(SystemCommand, AnEmptyOptionIsNotOneLeftOut) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    for (const auto& words : {std::vector<std::string>{"explain", command.path("scene.toml"), "--log", ""},
                              {"segment", command.path("a.png"), "-o", command.path("a.h5"), "--borders", ""}}) {
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 2);
        EXPECT_TRUE(contains(outcome.error, "must not be empty")) << outcome.error;
    }
}

TEST(SystemCommand, ASceneMayComeThroughAPipe) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    const std::string line =
        "cat " + command.path("scene.toml") + " | " + COMMAND + " explain /dev/stdin >" + command.path("out.txt");
    ASSERT_EQ(std::system(line.c_str()), 0);
    EXPECT_TRUE(contains(command.folder.read("out.txt"), "explicit"));
}

TEST(SystemCommand, CsvRefusesUnknownTablesAndSettings) {
    Command command;
    write(Record{}, command.path("record.h5"));
    const Outcome outcome = command.run({"csv", command.path("record.h5"), "serie"});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_EQ(outcome.out, "");
    EXPECT_TRUE(contains(outcome.error, "series, driving, reactions")) << outcome.error;
    EXPECT_EQ(command.run({"csv", command.path("record.h5"), "series", "--set", "a=1"}).status, 2);
    EXPECT_EQ(command.run({"csv", command.path("none.h5"), "series"}).status, 2);
}

TEST(SystemCommand, CsvBearsAReaderThatLeaves) {
    Command command;
    Record record;
    record.series.resize(100000);  // more text than a pipe holds
    write(record, command.path("record.h5"));
    const std::string csv = std::string(COMMAND) + " csv " + command.path("record.h5") + " series 2>" + command.path("error.txt");
    // The shell's status is that of `head`; the command's own is put into a file.
    const std::string line =
        "{ " + csv + "; echo $? >" + command.path("status.txt") + "; } | head -1 >" + command.path("out.txt");
    ASSERT_EQ(std::system(line.c_str()), 0);
    EXPECT_EQ(command.folder.read("status.txt"), "0\n");
    EXPECT_EQ(command.folder.read("error.txt"), "");
    EXPECT_EQ(command.folder.read("out.txt").rfind("time_s,", 0), 0u);
}

TEST(SystemCommand, FullStandardOutputIsAnError) {
    Command command;
    write(Record{}, command.path("record.h5"));
    const std::string line =
        std::string(COMMAND) + " csv " + command.path("record.h5") + " series >/dev/full 2>" + command.path("error.txt");
    EXPECT_EQ(WEXITSTATUS(std::system(line.c_str())), 2);
    EXPECT_TRUE(contains(command.folder.read("error.txt"), "standard output")) << command.folder.read("error.txt");
}

// With standard error closed, a file that the run opens could get its number, and messages would go into that file.
TEST(SystemCommand, RunNeedsNobodyToListen) {
    Command command;
    command.folder.write("scene.toml", small_scene);
    const std::string line =
        std::string(COMMAND) + " simulate " + command.path("scene.toml") + " -o " + command.path("record.h5") + " 2>&-";
    ASSERT_EQ(std::system(line.c_str()), 0);
    EXPECT_EQ(read_record(command.path("record.h5")).status, RunStatus::finished);
}

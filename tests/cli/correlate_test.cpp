// `crampfit correlate` and `crampfit track`, as a user runs them.
#include "tests/cli/pictures.hpp"
#include "tests/imaging/plane_fields.hpp"

#include "datasets/io.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <sstream>

using namespace crampfit;

namespace {

const VirtualCamera& camera() {
    static const VirtualCamera one({.columns = 240, .rows = 200});
    return one;
}

std::string big_endian(std::uint32_t value) {
    std::string bytes;
    for (const int shift : {24, 16, 8, 0}) bytes += static_cast<char>(value >> shift & 0xff);
    return bytes;
}

}  // namespace

TEST(SystemCorrelate, PointsOfASeries) {
    Command command;
    const std::string reference = write_pgm(command, "0.pgm", camera().photograph(0));
    std::vector<std::string> words{"correlate", reference};
    for (const double shift : {0.5, 3.25})
        words.push_back(write_pgm(command, std::to_string(shift) + ".pgm",
                                  camera().photograph([=](const Vec2&) { return Vec2(shift, -2 * shift); }, 1)));
    for (const char* word : {"-o", "field.h5", "--pixel", "10 um", "--threads", "1"})
        words.push_back(word == std::string("field.h5") ? command.path(word) : word);
    words.insert(words.end(), {"--preview", command.path("preview.png"), "--step", "20"});
    const Outcome outcome = command.run(words);
    ASSERT_EQ(outcome.status, 0) << outcome.error;
    EXPECT_GT(command.folder.read("preview.png").size(), 1000u);
    const std::string csv = command.run({"csv", command.path("field.h5"), "points"}).out;
    EXPECT_EQ(csv.substr(0, csv.find('\n')), "image,x_px,y_px,u_px,v_px,exx,eyy,exy,zncc,sigma_px,status");
    int followed = 0;
    for (auto& row : rows_of(csv)) {
        const double shift = row["image"] == "0" ? 0.5 : 3.25;
        if (row["status"] != "ok") {
            EXPECT_EQ(row["u_px"], "nan");
            continue;
        }
        ++followed;
        EXPECT_NEAR(std::stod(row["u_px"]), shift, 0.03);
        EXPECT_NEAR(std::stod(row["v_px"]), -2 * shift, 0.03);
        EXPECT_NEAR(std::stod(row["exx"]), 0, 1e-3);
    }
    EXPECT_GT(followed, 2 * 50);
    EXPECT_TRUE(contains(command.run({"csv", command.path("field.h5"), "images"}).out, "1,"));
}

TEST(SystemCorrelate, BadPicturesAreNamed) {
    Command command;
    const std::string good = write_pgm(command, "good.pgm", camera().photograph(0));
    const std::string whole = command.folder.read("good.pgm");
    const auto file = [&](const char* name, const std::string& bytes) { return command.folder.write(name, bytes).string(); };
    const std::string black(240 * 200, '\0');
    const std::string huge = "P5\n30000 30000\n255\n";
    const std::map<std::string, std::string> bad{
        {file("empty.pgm", ""), "empty"},
        {file("one.pgm", "P5\n1 1\n255\nx"), ""},
        {file("short.pgm", whole.substr(0, whole.size() / 2)), "cut short"},
        {file("huge.pgm", huge), "2^28 pixels"},
        {file("huge.png", "\x89PNG\r\n\x1a\n" + std::string("\0\0\0\rIHDR", 8) + big_endian(30000) + big_endian(30000)),
         "cut short"},
        {file("text.png", "no picture"), "no picture"},
        {write_pgm(command, "small.pgm", VirtualCamera({.columns = 239, .rows = 200}).photograph(0)), "one size"},
        {command.path("missing.png"), "no such file"},
    };
    for (const auto& [name, rule] : bad) {
        for (const char* verb : {"correlate", "track"}) {
            const Outcome outcome = command.run({verb, good, good, name, "-o", command.path("out.h5")});
            EXPECT_EQ(outcome.status, 2) << name;
            EXPECT_TRUE(contains(outcome.error, name)) << outcome.error;
            EXPECT_TRUE(contains(outcome.error, rule)) << outcome.error;
        }
        EXPECT_EQ(command.run({"correlate", name, good, "-o", command.path("out.h5")}).status, 2) << name;
    }
    const std::string dropped = file("black.pgm", "P5\n240 200\n255\n" + black);
    EXPECT_TRUE(contains(command.run({"correlate", dropped, good, "-o", command.path("out.h5")}).error, "gray 0 only"));
    EXPECT_EQ(command.run({"correlate", good, good, "-o", good}).status, 2);
    EXPECT_EQ(command.run({"correlate", good, good, "-o", command.path("out.h5"), "--pixel", "10"}).status, 2);
    EXPECT_EQ(command.run({"correlate", good, good, "-o", command.path("out.h5"), "--set", "a=1"}).status, 2);
    EXPECT_FALSE(std::filesystem::exists(command.path("out.h5")));
    for (const char* verb : {"correlate", "track"}) {  // a frame that the camera dropped is lost, and the others are not
        const Outcome outcome = command.run({verb, good, dropped, good, "-o", command.path("out.h5")});
        EXPECT_EQ(outcome.status, 0) << verb;
        EXPECT_TRUE(contains(outcome.error, "black.pgm: has gray 0 only and counts as lost")) << outcome.error;
    }
}

TEST(SystemTrack, SeriesAndExperiment) {
    Command command;
    std::vector<std::string> words{"track", write_pgm(command, "0.pgm", camera().photograph(0))};
    const std::vector<double> tips{90, 110, 130};
    for (std::size_t i = 0; i < tips.size(); ++i)
        words.push_back(write_pgm(command, std::to_string(i + 1) + ".pgm",
                                  camera().photograph(crack_field({tips[i], 100.2}, 0, 3, 0), i + 1)));
    words.push_back(write_pgm(command, "4.pgm", camera().photograph(4)));  // nothing has moved
    const std::string times = command.folder.write("times.csv", "time [s]\n1\n2\n3\n4\n").string();
    const std::string load =
        command.folder.write("load.csv", "time [s],force [N],displacement [mm]\n0,0,0\n2,10,0.2\n3.5,40,0.35\n").string();
    words.insert(words.end(), {"-o", command.path("track.h5"), "--pixel", "20 um", "--times", times, "--load", load, "--preview",
                               command.path("p.png")});
    const Outcome outcome = command.run(words);
    ASSERT_EQ(outcome.status, 0) << outcome.error;
    EXPECT_TRUE(contains(outcome.error, "does not reach 1 of 4 images")) << outcome.error;
    EXPECT_GT(command.folder.read("p.png").size(), 1000u);
    const std::string csv = command.run({"csv", command.path("track.h5"), "series"}).out;
    EXPECT_EQ(csv.substr(0, csv.find('\n')), "image,time_s,tip_x_px,tip_y_px,crack_length_m,sigma_m,status");
    auto rows = rows_of(csv);
    ASSERT_EQ(rows.size(), 4u);
    for (std::size_t i = 0; i < tips.size(); ++i) {
        EXPECT_EQ(rows[i]["status"], "ok");
        EXPECT_EQ(std::stod(rows[i]["time_s"]), static_cast<double>(i + 1));
        EXPECT_NEAR(std::stod(rows[i]["tip_x_px"]), tips[i], 5);
        EXPECT_NEAR(std::stod(rows[i]["tip_y_px"]), 100.2, 5);
        EXPECT_NEAR(std::stod(rows[i]["crack_length_m"]), (tips[i] + 0.5) * 20e-6, 5 * 20e-6);
    }
    EXPECT_EQ(rows[3]["status"], "no crack");
    EXPECT_EQ(rows[3]["tip_x_px"], "nan");

    const auto data = command.folder.write("experiment.csv", command.run({"csv", command.path("track.h5"), "experiment"}).out);
    const Curves curves = read_curves(data);
    ASSERT_EQ(curves.time.size(), 4u);
    EXPECT_NEAR(curves.force[0], 5, 1e-9);
    EXPECT_NEAR(curves.force[2], 30, 1e-9);
    EXPECT_NEAR(curves.displacement[2], 0.3e-3, 1e-12);
    EXPECT_TRUE(std::isnan(curves.force[3]));  // after the load's end
    EXPECT_NEAR(curves.crack_length[1], 110.5 * 20e-6, 5 * 20e-6);
    EXPECT_TRUE(std::isnan(curves.crack_length[3]));

    // A load that was read as each image was taken.
    words.resize(words.size() - 6);
    words.insert(words.end(),
                 {"--load", command.folder.write("at.csv", "force [N],time [s]\n1,10\n2,20\n3,30\n4,40\n").string()});
    ASSERT_EQ(command.run(words).status, 0);
    const Curves read =
        read_curves(command.folder.write("again.csv", command.run({"csv", command.path("track.h5"), "experiment"}).out));
    EXPECT_EQ(read.time, (std::vector<double>{10, 20, 30, 40}));
    EXPECT_EQ(read.force, (std::vector<double>{1, 2, 3, 4}));
}

// A specimen without a pattern: displacements cannot be followed, and the crack is a dark line. This camera sees through where
// the gap covers a pixel's centre, and so nothing of the last 5 px, which are open by less than 0.7 px.
TEST(SystemTrack, PlainGrayIsTrackedByTheLineThatOpens) {
    Command command;
    const VirtualCamera plain({.columns = 240, .rows = 200, .contrast = 0.5});
    std::vector<std::string> pictures{write_pgm(command, "0.pgm", plain.photograph(0))};
    const std::vector<double> tips{90, 130};
    for (std::size_t i = 0; i < tips.size(); ++i)
        pictures.push_back(
            write_pgm(command, std::to_string(i + 1) + ".pgm", plain.photograph(crack_field({tips[i], 100.2}, 0, 3, 0), i + 1)));
    pictures.push_back(write_pgm(command, "3.pgm", plain.photograph(3)));  // nothing has opened
    const auto track = [&](const std::string& from) {
        std::vector<std::string> words{"track"};
        words.insert(words.end(), pictures.begin(), pictures.end());
        words.insert(words.end(), {"-o", command.path("track.h5"), "--pixel", "20 um", "--from", from});
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 0) << outcome.error;
        return rows_of(command.run({"csv", command.path("track.h5"), "series"}).out);
    };
    for (const char* from : {"auto", "gray"}) {
        auto rows = track(from);
        ASSERT_EQ(rows.size(), 3u);
        for (std::size_t i = 0; i < tips.size(); ++i) {
            ASSERT_EQ(rows[i]["status"], "ok") << from;
            std::printf("%s: tip at %.1f px, true %.1f px\n", from, std::stod(rows[i]["tip_x_px"]), tips[i]);
            std::fflush(stdout);
            EXPECT_NEAR(std::stod(rows[i]["tip_x_px"]), tips[i], 6) << from;
            EXPECT_NEAR(std::stod(rows[i]["tip_y_px"]), 100.2, 3) << from;
            EXPECT_NEAR(std::stod(rows[i]["crack_length_m"]), (tips[i] + 0.5) * 20e-6, 6 * 20e-6) << from;
        }
        EXPECT_EQ(rows[2]["status"], "no crack") << from;
    }
    for (auto& row : track("fields")) EXPECT_EQ(row["status"], "too few points");
    EXPECT_EQ(command.run({"track", pictures[0], pictures[1], "-o", command.path("other.h5"), "--from", "dots"}).status, 2);
}

TEST(SystemTrack, BadTimesAndLoad) {
    Command command;
    const std::string good = write_pgm(command, "0.pgm", camera().photograph(0));
    const auto refused = [&](const std::vector<std::string>& more, const std::string& phrase) {
        std::vector<std::string> words{"track", good, good, "-o", command.path("track.h5")};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 2) << phrase;
        EXPECT_TRUE(contains(outcome.error, phrase)) << outcome.error;
    };
    const auto file = [&](const char* name, const char* text) { return command.folder.write(name, text).string(); };
    refused({"--times", file("two.csv", "time [s]\n1\n2\n")}, "2 rows");
    refused({"--times", file("force.csv", "force [N]\n1\n")}, "0 rows");
    const std::string times = file("times.csv", "time [s]\n1\n");
    const std::string rising = file("load.csv", "time [s],force [N]\n0,1\n2,1\n");
    refused({"--load", rising}, "without --times it needs a row for each of the 1 images");
    refused({"--load", file("gap.csv", "time [s],force [N]\n,1\n")}, "times of the images must not fall, and have no gaps");
    refused({"--load", rising, "--offset", "1 s"}, "--times");
    refused({"--times", times, "--offset", "1 s"}, "--load");
    refused({"--times", times, "--load", rising, "--offset", "1"}, "--offset");
    refused({"--times", times, "--load", rising, "--offset", "1 s", "--trigger", "1 s"}, "--offset");
    refused({"--times", file("both.csv", "time [s],force [N]\n1,0.5\n"), "--load", rising}, "must change");
    refused({"--times", times, "--load", file("fall.csv", "time [s],force [N]\n2,1\n0,1\n")}, "must rise");
    refused({"--times", times, "--load", file("bare.csv", "time [s]\n0\n2\n")}, "displacement or force");
    refused({"--times", times, "--load", file("late.csv", "force [N]\n0\n2\n")}, "needs its time");
    refused({"--times", times, "--load", rising, "--offset", "5 s"}, "no image lies on the load's record, 0 to 2 s");
}

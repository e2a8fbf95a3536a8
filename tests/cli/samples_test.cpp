// The packaged samples, through the command.
#include "datasets/io.hpp"
#include "tests/cli/command.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <sstream>
#include <vector>

namespace {

using Rows = std::vector<std::map<std::string, std::string>>;

Rows rows_of(const std::string& csv) {
    std::istringstream lines(csv);
    std::string line, field;
    std::getline(lines, line);
    std::vector<std::string> names;
    for (std::istringstream head(line); std::getline(head, field, ',');) names.push_back(field);
    Rows rows;
    while (std::getline(lines, line)) {
        std::istringstream fields(line);
        std::map<std::string, std::string> row;
        for (const std::string& name : names) {
            std::getline(fields, field, ',');
            row[name] = field;
        }
        rows.push_back(row);
    }
    return rows;
}

TEST(SystemSamples, TensionCrackCrossesTheRingsFasterInLatewood) {
    Command command;
    const std::string record = (command.folder / "record.h5").string();
    const Outcome run = command.run({"simulate", SAMPLES "/tension_tr_plus.toml", "--quiet", "--set",
                                     "edges.top.velocity=[\"0 m/s\", \"10 m/s\"]", "-o", record});
    ASSERT_EQ(run.status, 0) << run.error;
    // Latewood along the middle row lies within half a millimetre inside each ring's end (datasets/samples/README.md); rings end
    // at 1.25, 3.7, 5.7 and 7.9 mm. The crack comes from the right.
    double time_in[2] = {0, 0}, length_in[2] = {0, 0};
    Rows rows = rows_of(command.run({"csv", record, "series"}).out);
    ASSERT_GT(rows.size(), 100u);
    EXPECT_LT(std::stod(rows.back()["tip_x_m"]), 0.05e-3) << "the crack must reach the far side";
    for (std::size_t i = 1; i < rows.size(); ++i) {
        const double x = 1e3 * std::stod(rows[i]["tip_x_m"]);
        if (x > 7.49) continue;  // still at the notch
        bool latewood = false;
        for (const double end : {1.25, 3.7, 5.7}) latewood |= x < end && x > end - 0.5;
        time_in[latewood] += std::stod(rows[i]["time_s"]) - std::stod(rows[i - 1]["time_s"]);
        length_in[latewood] += std::stod(rows[i]["crack_length_m"]) - std::stod(rows[i - 1]["crack_length_m"]);
    }
    const double early = length_in[0] / time_in[0];
    const double late = length_in[1] / time_in[1];
    std::printf("TR+ at 10 m/s: crack at %.0f m/s in earlywood, %.0f m/s in latewood\n", early, late);
    EXPECT_GT(late, 1.2 * early);
}

// 0.3 mm of transition wood is less than a cell wide, and less than two.
TEST(SystemSamples, WedgePeakHardlyDependsOnCellsThatTransitionWoodFitsInto) {
    Command command;
    double peak[2] = {0.0, 0.0};
    for (const int fine : {0, 1}) {
        const Outcome outcome = command.run({"simulate", SAMPLES "/wedge.toml", "-o", command.path("wedge.h5"), "--quiet",
                                             "--set", fine ? "model.cell=0.17857 mm" : "model.cell=0.35714 mm", "--set",
                                             "solver.extrapolate=false", "--set", "output.frames=0"});
        ASSERT_EQ(outcome.status, 0) << outcome.error;
        for (const crampfit::Instant& row : crampfit::read_record(command.path("wedge.h5")).series)
            peak[fine] = std::max(peak[fine], row.force);
    }
    std::printf("wedge sample, peak on cells of 0.357 mm: %.2f N, of 0.179 mm: %.2f N\n", peak[0], peak[1]);
    EXPECT_NEAR(peak[0], peak[1], 0.05 * peak[1]);
}

TEST(SystemSamples, AllScenesExplainThemselves) {
    Command command;
    for (const char* scene : {"tension_tr_plus", "tension_tr_minus", "tension_rt", "tension_tr135", "wedge"}) {
        const Outcome outcome = command.run({"explain", std::string(SAMPLES "/") + scene + ".toml"});
        EXPECT_EQ(outcome.status, 0) << outcome.error;
        const bool slow = std::string(scene) == "wedge";  // at 1 mm/min, the others at 2 m/s
        EXPECT_NE(outcome.out.find(slow ? "equilibrium, Newton's method" : "explicit dynamics"), std::string::npos)
            << outcome.out;
    }
}

TEST(SlowSamples, WedgeFitFindsBothToughnesses) {
    // The truth stands in wedge_truth.toml; the data were made on a grid twice as fine, with noise.
    const std::map<std::string, double> truth{{"materials.EW.toughness", 110.0}, {"materials.LW.toughness", 250.0}};
    Command command;
    const std::string fit = (command.folder / "fit.h5").string();
    const Outcome run = command.run({"fit", SAMPLES "/wedge_study.toml", "--quiet", "-o", fit});
    ASSERT_EQ(run.status, 0) << run.error;
    for (auto& row : rows_of(command.run({"csv", fit, "parameters"}).out)) {
        const double value = std::stod(row["value"]);
        const double expected = truth.at(row["key"]);
        std::printf("%s: %.1f, truth %.0f, off by %+.1f %%, interval %s .. %s\n", row["name"].c_str(), value, expected,
                    100 * (value / expected - 1), row["lower_95"].c_str(), row["upper_95"].c_str());
        EXPECT_NEAR(value, expected, 0.1 * expected);
        EXPECT_LE(std::stod(row["lower_95"]), expected);
        EXPECT_GE(std::stod(row["upper_95"]), expected);
    }
}

}  // namespace

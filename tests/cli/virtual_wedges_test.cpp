// Virtual wedge tests, whose truth is known: how far off fits are, how often their intervals hold it, and whether it matters
// where they start or that they are killed on the way. `scripts/virtual_wedges` runs more of them.
#include "tests/cli/command.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace {

const std::string script = SAMPLES "/../../scripts/virtual_wedges";

/// What the script says of the tests; files stay in the command's folder.
std::string virtual_wedges(Command& command, const std::string& options) {
    const std::string words = script + " --crampfit " COMMAND " --keep " + command.path(".") + " " + options + " > " +
                              command.path("told.txt") + " 2>&1";
    EXPECT_EQ(std::system(words.c_str()), 0);
    const std::string told = command.folder.read("told.txt");
    std::printf("%s", told.c_str());
    std::fflush(stdout);  // before the next fork
    return told;
}

/// The number after some words.
double after(const std::string& text, const std::string& words) {
    const std::size_t at = text.find(words);
    EXPECT_NE(at, std::string::npos) << words;
    return at == std::string::npos ? std::nan("") : std::stod(text.substr(at + words.size()));
}

}  // namespace

// The truth lies on cells half as wide. Of intervals that hold it 95 times in a hundred, 5 or fewer of eight do six times in a
// thousand (binomial: 0.0058).
TEST(SlowVirtualWedges, EightLinearTestsOnFinerCells) {
    Command command;
    const std::string told = virtual_wedges(command, "--scene opened --finer --count 8");
    for (const char* key : {"EW.toughness", "LW.toughness"}) {
        EXPECT_LT(after(told, std::string(key) + ": median error "), 2);
        EXPECT_GE(after(told.substr(told.rfind(std::string(key) + ": median")), "covered "), 6);
    }
}

TEST(SlowVirtualWedges, TwentyStartsEndAtTheSamePlaceOrAHigherOne) {
    Command command;
    const std::string told = virtual_wedges(command, "--count 1 --starts 20 --scene opened");
    const double same = after(told, "of 20 random starts ");
    EXPECT_GE(same, 1);
    EXPECT_EQ(same + after(told, "ended at the same place, "), 20);
}

// Two-valued wood does not explain wood that is graded from early to late. Of the fits of wood like the truth one in a hundred is
// said to lack something.
TEST(SlowVirtualWedges, WhatTheModelLacksIsSaid) {
    Command command;
    EXPECT_EQ(after(virtual_wedges(command, "--scene graded --count 4"), "lack of fit said: "), 4);
    EXPECT_LE(after(virtual_wedges(command, "--scene opened --count 4"), "lack of fit said: "), 1);
}

// Wheels: each equilibrium is found from those before it.
TEST(SlowVirtualWedges, KilledFitsEndAtTheSameBits) {
    Command command;
    virtual_wedges(command, "--scene wedge --count 1");
    const auto fit = [&](const std::string& output) {
        return std::vector<std::string>{"fit",     command.path("1/study.toml"), "-o", command.path(output), "--threads", "1",
                                        "--resume"};
    };
    ASSERT_EQ(command.run(fit("whole.h5")).status, 0);
    std::mt19937 generator(5);
    int killed = 0;
    for (int i = 0; i < 20; ++i) {
        command.start(fit("killed.h5"));
        std::this_thread::sleep_for(std::chrono::milliseconds(50 + generator() % 2000));
        command.send(SIGKILL);
        killed += command.finish().status != 0 ? 1 : 0;
    }
    ASSERT_EQ(command.run(fit("killed.h5")).status, 0);
    std::printf("%d of 20 were killed before their end\n", killed);
    EXPECT_GT(killed, 5);
    for (const char* table : {"parameters", "residuals", "correlation"})
        EXPECT_EQ(command.run({"csv", command.path("killed.h5"), table}).out,
                  command.run({"csv", command.path("whole.h5"), table}).out);
    EXPECT_EQ(without_seconds(command.run({"csv", command.path("killed.h5"), "runs"}).out),
              without_seconds(command.run({"csv", command.path("whole.h5"), "runs"}).out));
    EXPECT_EQ(command.folder.read("killed.h5.runs").size(), command.folder.read("whole.h5.runs").size());
}

#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

namespace crampfit::test {

/// One line of the table of hard cases (`ctest -L hard -V`): what must hold by an exact solution, an energy identity or an
/// invariance, how far off it is, and how far it may be. What misses its bar says so; `reached` is where the gate stands then.
inline void hard_case(const std::string& what, const std::string& criterion, double off, double bar, double reached = 0.0) {
    const bool good = std::abs(off) <= bar;  // not for NaN
    std::printf("%-52s | %-62s | off by %+9.2e, bar %.0e | %s\n", what.c_str(), criterion.c_str(), off, bar,
                good ? "good" : "MISSED");
    std::fflush(stdout);  // a table is of use up to where a crash cuts it off
    EXPECT_TRUE(good || std::abs(off) <= reached) << what << ": " << criterion << ", off by " << off << ", bar " << bar;
}

}  // namespace crampfit::test

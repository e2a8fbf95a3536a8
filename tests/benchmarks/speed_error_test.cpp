// What `crampfit bench` runs, on its coarsest grids; each problem's exact value is tested on finer ones in tests/forward.
#include "benchmarks/speed_error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace crampfit::reference {
namespace {

TEST(SystemBench, CoarsestGridsAreWithinFivePercentByBothSolvers) {
    int explicit_runs = 0;
    for (const BenchRun& run : bench_runs()) {
        if (run.cells != run.problem.cells.front()) continue;
        const SpeedError row = measure(run);
        std::printf("%s, %s, %s, %s: %g cells per %s, %ld points, %.3f s, off by %+.2f %%\n", row.problem.c_str(),
                    row.quantity.c_str(), row.solver.c_str(), row.options.c_str(), row.cells, row.counted.c_str(), row.points,
                    row.seconds, 100 * row.error);
        EXPECT_LT(std::abs(row.error), 0.05) << row.problem << " " << row.solver;
        EXPECT_GT(row.seconds, 0.0);
        explicit_runs += row.solver == "explicit";
    }
    EXPECT_GE(explicit_runs, 4);
}

TEST(UnitBench, TableHasAsManyFieldsAsItsHeader) {
    SpeedError row;
    row.problem = "strip";
    const std::string text = csv({row, row});
    const auto columns = std::count(text.begin(), text.begin() + text.find('\n'), ',');
    EXPECT_EQ(columns, 10);
    std::size_t start = 0;
    for (int line = 0; line < 3; ++line) {
        const std::size_t end = text.find('\n', start);
        ASSERT_NE(end, std::string::npos);
        EXPECT_EQ(std::count(text.begin() + start, text.begin() + end, ','), columns) << line;
        start = end + 1;
    }
    EXPECT_EQ(start, text.size());
    for (const BenchRun& run : bench_runs())
        for (const std::string& field : {run.problem.name, run.problem.quantity, run.options, run.problem.counted})
            EXPECT_EQ(field.find(','), std::string::npos) << field;
}

}  // namespace
}  // namespace crampfit::reference

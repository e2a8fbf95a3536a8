#pragma once

#include "benchmarks/reference_problems.hpp"

#include <functional>
#include <string>
#include <vector>

namespace crampfit::reference {

/// One run of one problem.
struct SpeedError {
    std::string problem, quantity, solver, options;
    std::string counted;  // cells per ...
    double cells = 0;     // per that
    double cell = 0;      // [m]
    long points = 0;
    double seconds = 0;   // on one core
    double error = 0;     // relative, signed
    double known_to = 0;  // what the exact value is good to, relative
};

/// Which runs: of every problem by every solver and option, grid by grid.
struct BenchRun {
    Problem problem;
    std::string solver, options;
    double cells;
    Scene scene;
};
std::vector<BenchRun> bench_runs();

SpeedError measure(const BenchRun& run);

/// With a header that names the units.
std::string csv(const std::vector<SpeedError>& rows);

}  // namespace crampfit::reference

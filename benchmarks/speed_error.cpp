#include "benchmarks/speed_error.hpp"

#include "forward/simulate.hpp"

#include <fmt/format.h>

namespace crampfit::reference {

namespace {

// Explicit runs get long: the number of points times that of the steps goes with the cube of this.
constexpr double most_explicit_cells = 20.0;
constexpr double most_spline_cells = 10.0;

// The same with B-splines. Their nodes lie in the middle of cells: what holds a corner of a cell holds the one beside it instead.
Scene with_splines(Scene scene) {
    scene.solver.shape_function = ShapeFunction::bspline2;
    for (Edge& edge : scene.edges)
        if (!edge.traction && edge.range)
            edge.range = {{edge.range->first - 0.3 * scene.model.cell, edge.range->second + 0.2 * scene.model.cell}};
    return scene;
}

}  // namespace

std::vector<BenchRun> bench_runs() {
    std::vector<BenchRun> runs;
    for (const Problem& problem : problems()) {
        for (const double cells : problem.cells) {
            for (const int points : {4, 9, 16}) {
                Scene scene = problem.scene(cells, points);
                scene.output.samples = 2;
                const std::string options = fmt::format("{} points a cell", points);
                // A second grid betters energies and so when a crack grows, not G and K at a tip that stands.
                if (scene.cracks[0].grows != Growth::none)
                    runs.push_back({problem, "equilibrium", options + " and two grids", cells, scene});
                scene.solver.extrapolate = false;
                runs.push_back({problem, "equilibrium", options, cells, scene});
                if (problem.slowest == 0.0 || points != 4 || cells > most_explicit_cells) continue;
                const Scene moving = in_damped_motion(scene, problem.slowest);
                runs.push_back({problem, "explicit", options, cells, moving});
                if (cells <= most_spline_cells)
                    runs.push_back({problem, "explicit", options + " and B-splines", cells, with_splines(moving)});
            }
        }
    }
    return runs;
}

SpeedError measure(const BenchRun& run) {
    const Record record = simulate(run.scene);
    return {run.problem.name,    run.problem.quantity, run.solver,    run.options,    run.problem.counted,
            run.cells,           run.scene.model.cell, record.points, record.seconds, run.problem.ratio(record) - 1.0,
            run.problem.known_to};
}

std::string csv(const std::vector<SpeedError>& rows) {
    std::string text =
        "problem,quantity,solver,options,cells_per,cells,cell_m,points,seconds_s,error_relative,known_to_relative\n";
    for (const SpeedError& row : rows)
        text += fmt::format("{},{},{},{},{},{:g},{:.6g},{},{:.4g},{:.6g},{:g}\n", row.problem, row.quantity, row.solver,
                            row.options, row.counted, row.cells, row.cell, row.points, row.seconds, row.error, row.known_to);
    return text;
}

}  // namespace crampfit::reference

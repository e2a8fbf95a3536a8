// Speed of the forward solver. Of explicit dynamics `items_per_second` is material-point steps a second on one core; at
// equilibrium the time is that of a whole run.
#include "forward/explicit.hpp"
#include "forward/kept_walk.hpp"

#include <benchmark/benchmark.h>

#include <malloc.h>

#include <fstream>
#include <string>

namespace {

using namespace crampfit;

// 10 x 10 mm of growth rings with an edge crack that may grow, pulled at 2 m/s.
Scene wood(int cells, bool crack) {
    Scene scene;
    scene.model = {PlaneCondition::strain, 10e-3, 10e-3 / cells, 4};
    scene.specimen.size = {10e-3, 10e-3};
    scene.specimen.rings = Rings{Vec2(-20e-3, 5e-3), 2.2e-3, 0.25, 0.3e-3};
    scene.materials["EW"] = {40e6, 0.33, 300.0, 100.0};
    scene.materials["LW"] = {1200e6, 0.33, 750.0, 100.0};
    Edge top;
    top.name = "top";
    top.velocity = {0.0, 2.0};
    Edge bottom;
    bottom.name = "bottom";
    bottom.side = Side::bottom;
    bottom.velocity = {0.0, 0.0};
    scene.edges = {top, bottom};
    if (crack) {
        Crack line;
        line.points = {Vec2(10e-3, 5e-3), Vec2(7.5e-3, 5e-3)};
        line.grows = Growth::end;
        scene.cracks = {line};
    }
    scene.measure = {"top", "top"};
    scene.stop.displacement = 1e-3;
    return scene;
}

void step_wood(benchmark::State& state, bool crack) {
    const Scene scene = wood(static_cast<int>(state.range(0)), crack);
    const MaterialMap materials(scene);
    Discretisation body(scene, materials);
    const Plan plan = make_plan(scene, materials, body);
    ExplicitSolver solver(scene, plan, materials, body);
    for (long step = 0; auto _ : state) {
        if (plan.grows && step++ % 2 == 0) solver.grow_cracks();
        solver.step();
    }
    state.SetItemsProcessed(state.iterations() * body.points.count());
    state.counters["points"] = body.points.count();
}

void wood_without_crack(benchmark::State& state) { step_wood(state, false); }
void wood_with_crack_and_J(benchmark::State& state) { step_wood(state, true); }

// What Linux says of this process's memory: VmRSS, or VmHWM, its largest since the mark was wiped [bytes]; 0 elsewhere.
double memory(const std::string& what) {
    std::ifstream status("/proc/self/status");
    std::string key;
    for (double kilobytes; status >> key; status.ignore(1000, '\n'))
        if (key == what + ":" && status >> kilobytes) return 1024.0 * kilobytes;
    return 0.0;
}

void wipe_mark() { std::ofstream("/proc/self/clear_refs") << 5; }

// A block of earlywood that one side pulls, in finite rotation: cells a side, threads.
void elastic_block(benchmark::State& state, ShapeFunction shape, VelocityUpdate update) {
    Scene scene = wood(static_cast<int>(state.range(0)), false);
    scene.specimen.rings.reset();
    scene.specimen.material = "EW";
    scene.solver.shape_function = shape;
    scene.solver.velocity_update = update;
    malloc_trim(0);  // of benchmarks before
    wipe_mark();
    const double before = memory("VmRSS");
    const MaterialMap materials(scene);
    Discretisation body(scene, materials);
    const Plan plan = make_plan(scene, materials, body);
    ExplicitSolver solver(scene, plan, materials, body, static_cast<int>(state.range(1)));
    for (auto _ : state) solver.step();
    state.counters["bytes_a_point"] = (memory("VmRSS") - before) / body.points.count();
    state.counters["most_bytes_a_point"] = (memory("VmHWM") - before) / body.points.count();  // while it was built
    state.SetItemsProcessed(state.iterations() * body.points.count());
    state.counters["points"] = body.points.count();
}

// At equilibrium a crack runs across the whole specimen: cells a side, threads, and by how many numbers of the woods derivatives
// are asked for (those by toughness come from the same walk).
void crack_across_wood(benchmark::State& state) {
    Scene scene = wood(static_cast<int>(state.range(0)), true);
    scene.edges[0].velocity = {0.0, 1e-3 / 60.0};
    scene.cracks[0].advance = 0.2e-3;
    scene.stop.displacement.reset();
    scene.stop.crack_length = 10e-3;
    const std::vector<std::string> moduli{"materials.EW.E", "materials.LW.E", "materials.EW.nu", "materials.LW.nu"};
    const std::vector<std::string> numbers(moduli.begin(), moduli.begin() + state.range(2));
    for (auto _ : state) {
        const Record record = KeptWalk(scene, numbers, static_cast<int>(state.range(1))).run(scene, {});
        state.counters["points"] = static_cast<double>(record.points);
        state.counters["equilibria"] = static_cast<double>(record.steps);
        const bool ended = record.status == RunStatus::split || record.status == RunStatus::finished;
        if (!ended) state.SkipWithError(record.message.c_str());
    }
}

BENCHMARK(crack_across_wood)
    ->Args({92, 1, 0})
    ->Args({92, 1, 4})
    ->Args({368, 2, 0})
    ->Iterations(1)
    ->Unit(benchmark::kSecond)
    ->MeasureProcessCPUTime();
BENCHMARK_CAPTURE(elastic_block, gimp, ShapeFunction::gimp, VelocityUpdate::automatic)
    ->Args({500, 1})
    ->Args({500, 2})
    ->UseRealTime();
BENCHMARK_CAPTURE(elastic_block, splines, ShapeFunction::bspline2, VelocityUpdate::automatic)
    ->Args({500, 1})
    ->Args({500, 2})
    ->UseRealTime();
BENCHMARK_CAPTURE(elastic_block, flip, ShapeFunction::gimp, VelocityUpdate::flip)->Args({500, 1})->UseRealTime();
BENCHMARK_CAPTURE(elastic_block, xpic2, ShapeFunction::gimp, VelocityUpdate::xpic)->Args({500, 1})->UseRealTime();
BENCHMARK(wood_without_crack)->Arg(46)->Arg(92)->Arg(184);
BENCHMARK(wood_with_crack_and_J)->Arg(46)->Arg(92)->Arg(184);

}  // namespace

BENCHMARK_MAIN();

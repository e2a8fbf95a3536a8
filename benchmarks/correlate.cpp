// Speed of image correlation on one core: `items_per_second` is points a second, strain included, subset 31, points 5
// px apart.
#include "imaging/correlate.hpp"
#include "imaging/virtual_camera.hpp"

#include <benchmark/benchmark.h>

namespace {

using namespace crampfit;

FinePicture fine(const GrayPicture& picture) {
    return {picture.columns, picture.rows, {picture.gray.begin(), picture.gray.end()}};
}

/// Speckle that is stretched by a hundredth.
void correlate(benchmark::State& state, int order) {
    const VirtualCamera camera({});
    CorrelateOptions options;
    options.step = 5;
    options.order = order;
    const Correlator correlator(fine(camera.photograph(0)), {}, options, "reference");
    const auto stretch = [](const Vec2& place) { return Vec2(0.01 * (place.x() - 256), 0.3 - 0.004 * (place.y() - 256)); };
    const FinePicture image = fine(camera.photograph(stretch, 1));
    for (auto _ : state) benchmark::DoNotOptimize(correlator.field(image));
    state.SetItemsProcessed(state.iterations() * correlator.lattice().count());
}

void first_order(benchmark::State& state) { correlate(state, 1); }
void second_order(benchmark::State& state) { correlate(state, 2); }

BENCHMARK(first_order)->Unit(benchmark::kMillisecond);
BENCHMARK(second_order)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();

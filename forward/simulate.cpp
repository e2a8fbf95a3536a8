#include "forward/simulate.hpp"

#include "forward/explicit.hpp"
#include "forward/recorder.hpp"

#include <chrono>
#include <cmath>

namespace crampfit {

namespace {

// How often cracks are looked at: the tip then moves by a quarter of a cell at most this often.
constexpr int steps_between_looks = 2;
constexpr int steps_between_reports = 64;

bool reached(const Stop& stop, const Instant& now) {
    return (stop.displacement && now.displacement >= *stop.displacement * (1.0 - 1e-9)) ||
           (stop.crack_length && now.crack_length >= *stop.crack_length * (1.0 - 1e-9)) ||
           (stop.time && now.time >= *stop.time * (1.0 - 1e-9));
}

bool all_growing_tips_left(const Scene& scene, const ExplicitSolver& solver) {
    bool any = false;
    for (int k = 0; k < static_cast<int>(scene.cracks.size()); ++k)
        for (const bool at_end : {false, true})
            if (solver.cracks().lines[k].tip(at_end).grows) {
                any = true;
                if (!solver.has_left(k, at_end)) return false;
            }
    return any;
}

} // namespace

Record simulate(const Scene& scene, const SimulateOptions& options) {
    const auto start = std::chrono::steady_clock::now();
    const MaterialMap materials(scene);
    Discretisation body(scene, materials);
    const Plan plan = make_plan(scene, materials, body);
    ExplicitSolver solver(scene, plan, materials, body);
    Recorder recorder(scene, plan, body, solver);

    for (long step = 0;; ++step) {
        if (plan.grows && step % steps_between_looks == 0) solver.grow_cracks();
        recorder.look();
        if (!recorder.is_finite()) {
            recorder.finish(RunStatus::unstable, "a displacement became infinite");
            break;
        }
        if (reached(scene.stop, recorder.now())) {
            recorder.finish(RunStatus::finished, "a stop condition was met");
            break;
        }
        if (plan.grows && all_growing_tips_left(scene, solver)) {
            recorder.finish(RunStatus::split, "every growing crack tip has reached a free surface");
            break;
        }
        if (options.stop_requested && options.stop_requested->load(std::memory_order_relaxed)) {
            recorder.finish(RunStatus::interrupted, "stopped by the user");
            break;
        }
        if (options.progress && step % steps_between_reports == 0)
            options.progress({recorder.fraction(), solver.time(), recorder.now().crack_length, step});
        solver.step();
        recorder.add_step();
    }
    Record record = recorder.take();
    record.scene_text = scene.text;
    record.explanation = describe(scene, plan, body);
    record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return record;
}

std::string explain(const Scene& scene) {
    const MaterialMap materials(scene);
    const Discretisation body(scene, materials);
    return describe(scene, make_plan(scene, materials, body), body);
}

} // namespace crampfit

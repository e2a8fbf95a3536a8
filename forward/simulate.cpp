#include "forward/simulate.hpp"

#include "forward/explicit.hpp"
#include "forward/quasistatic.hpp"
#include "forward/recorder.hpp"
#include "forward/trace.hpp"

#include <algorithm>
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

// The instant of the series that a frame of so many is due at.
const Instant& instant_of_frame(const Record& record, int frame, int frames) {
    const double first = record.series.front().time;
    const double last = record.series.back().time;
    const double due = frames == 1 ? last : std::lerp(first, last, frame / (frames - 1.0));
    const auto found = std::find_if(record.series.begin(), record.series.end(),
                                    [&](const Instant& row) { return row.time >= due * (1.0 - 1e-12); });
    return found == record.series.end() ? record.series.back() : *found;
}

// Frames at even times. A sweep keeps no displacements: each frame is solved for anew with the crack as it was then.
void draw_frames(const Scene& scene, const Plan& plan, const MaterialMap& materials, const CrackDriving& driving, Record& record) {
    Discretisation body(scene, materials);
    Equilibrium equilibrium(scene, plan, materials, body);
    record.point_position = body.points.position;
    record.point_latewood = body.points.latewood;
    const TrackedTip tracked = tracked_tip(scene);
    std::size_t station = 0;
    for (int k = 0; k < scene.output.frames; ++k) {
        const Instant& instant = instant_of_frame(record, k, scene.output.frames);
        const auto grow = [&](const Vec2& to, int crack, bool at_end) {
            const CrackTip& tip = equilibrium.cracks().lines[crack].tip(at_end);
            if (tip.inside && (to - tip.position).norm() > 1e-6 * body.layout.cell.minCoeff()) equilibrium.grow(crack, at_end, to);
        };
        const double length = instant.crack_length * (1.0 + 1e-9);
        while (station + 1 < driving.stations.size() && driving.stations[station].crack >= 0 &&
               driving.stations[station + 1].lengths[tracked.crack] <= length) {
            const Station& from = driving.stations[station++];
            grow(driving.stations[station].tips[from.crack][from.at_end], from.crack, from.at_end);
        }
        if (tracked.crack >= 0) grow(instant.tip, tracked.crack, tracked.at_end);
        if (equilibrium.solve(instant.time) != Equilibrium::Outcome::solved) return;
        record.frames.push_back(make_frame(scene, plan, body, equilibrium.displacements()));
        Frame& frame = record.frames.back();
        frame.time = instant.time;
        frame.displacement = instant.displacement;
        if (tracked.crack >= 0) frame.crack = equilibrium.cracks().lines[tracked.crack].points;
    }
}

// The same walk on a grid with cells twice as wide, and what both tell of one with cells of no width.
CrackDriving improved(const Scene& scene, const Plan& plan, CrackDriving driving) {
    Scene coarse = scene;
    coarse.model.cell *= 2.0;
    const MaterialMap materials(coarse);
    Discretisation body(coarse, materials);
    Quasistatic walk(coarse, plan, materials, body, &driving);
    while (walk.step()) {}
    if (walk.driving().stations.size() < driving.stations.size()) return driving;
    return extrapolated(driving, walk.driving());
}

Record run_quasistatic(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body,
                       const SimulateOptions& options) {
    Quasistatic walk(scene, plan, materials, body);
    const auto far_enough = [&] {
        return walk.time() > plan.end_time || (scene.stop.crack_length && walk.crack_length() >= *scene.stop.crack_length);
    };
    bool interrupted = false;
    while (walk.step() && !far_enough()) {
        interrupted = options.stop_requested && options.stop_requested->load(std::memory_order_relaxed);
        if (interrupted) break;
        if (options.progress) {
            const double by_time = walk.time() / plan.end_time;
            const double by_length = scene.stop.crack_length ? walk.crack_length() / *scene.stop.crack_length : 0.0;
            options.progress({std::clamp(std::max(by_time, by_length), 0.0, 1.0), walk.time(), walk.crack_length(), walk.equilibria()});
        }
    }
    CrackDriving driving = walk.take_driving();
    if (plan.extrapolates && !interrupted) driving = improved(scene, plan, std::move(driving));
    Record record = trace(scene, plan, driving, materials);
    record.steps = walk.equilibria();
    record.points = body.points.count();
    if (scene.output.frames > 0) draw_frames(scene, plan, materials, driving, record);
    if (interrupted) {
        record.status = RunStatus::interrupted;
        record.message = "stopped by the user";
    } else if (!walk.failure().empty()) {
        record.status = RunStatus::unstable;
        record.message = walk.failure();
    }
    return record;
}

Record run_explicit(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body,
                    const SimulateOptions& options) {
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
    return recorder.take();
}

} // namespace

Record simulate(const Scene& scene, const SimulateOptions& options) {
    const auto start = std::chrono::steady_clock::now();
    const MaterialMap materials(scene);
    Discretisation body(scene, materials);
    const Plan plan = make_plan(scene, materials, body);
    Record record = plan.quasistatic ? run_quasistatic(scene, plan, materials, body, options)
                                     : run_explicit(scene, plan, materials, body, options);
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

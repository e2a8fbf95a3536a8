#include "forward/kept_walk.hpp"

#include "forward/trace.hpp"

#include <chrono>

namespace crampfit {

KeptWalk::KeptWalk(const Scene& scene)
    : scene_(scene), materials_(scene_), plan_(make_plan(scene_, materials_, Discretisation(scene_, materials_))) {
    int tips = 0;
    for (const Crack& crack : scene_.cracks) tips += crack.grows == Growth::both ? 2 : crack.grows != Growth::none;
    reusable_ = plan_.quasistatic && tips <= 1;
}

Record KeptWalk::run(const Scene& scene, const SimulateOptions& options) {
    const auto start = std::chrono::steady_clock::now();
    const std::lock_guard lock(mutex_);
    if (!walk_ || !walk_->failure().empty()) walk_ = std::make_unique<Quasistatic>(scene_, plan_, materials_);
    const int known = walk_->equilibria();
    Record record = trace(scene, plan_, MaterialMap(scene), *walk_, [&](double, double) {
        return !(options.stop_requested && options.stop_requested->load(std::memory_order_relaxed));
    });
    record.steps = walk_->equilibria() - known;
    record.points = walk_->points();
    record.scene_text = scene.text;
    record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return record;
}

} // namespace crampfit

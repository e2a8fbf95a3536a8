#include "forward/kept_walk.hpp"

#include "datasets/io.hpp"
#include "forward/probes.hpp"
#include "forward/trace.hpp"

#include <chrono>
#include <cmath>

namespace crampfit {

KeptWalk::KeptWalk(const Scene& scene, const std::vector<std::string>& numbers, int threads)
    : scene_(scene), materials_(scene_), body_(std::in_place, scene_, materials_), plan_(make_plan(scene_, materials_, *body_)),
      numbers_(numbers), threads_(threads) {
    reusable_ = plan_.quasistatic && growing_tips(scene_) <= 1 && !plan_.friction && !plan_.remembers;
    if (!has_slopes()) numbers_.clear();
}

Record KeptWalk::run(const Scene& scene, const SimulateOptions& options, bool rough) {
    const auto start = std::chrono::steady_clock::now();
    const std::lock_guard lock(mutex_);
    if (!walk_ || !walk_->failure().empty()) {
        if (!body_) body_.emplace(scene_, materials_);
        walk_ = std::make_unique<Quasistatic>(scene_, plan_, materials_, *body_, numbers_, threads_);
        body_.reset();
    }
    const auto is_stopped = [&] { return options.stop_requested && options.stop_requested->load(std::memory_order_relaxed); };
    walk_->end_where(is_stopped);
    const int known = walk_->equilibria();
    std::vector<double> by;
    for (const std::string& key : numbers_) {
        const double from = get_number(scene_, key);
        const double to = get_number(scene, key);
        by.push_back(from > 0.0 && to > 0.0 ? from * std::log(to / from) : to - from);
    }
    walk_->set_rough(rough);
    walk_->shift(by);
    Record record = trace(scene, plan_, MaterialMap(scene), *walk_, [&](double, double) { return !is_stopped(); });
    read_probes(scene, *walk_, record);
    if (rough && !is_stopped()) walk_->rest();  // what other toughnesses and moduli need is known for the most part
    walk_->end_where({});
    record.steps = walk_->equilibria() - known;
    record.points = walk_->points();
    record.scene_text = scene.text;
    record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return record;
}

}  // namespace crampfit

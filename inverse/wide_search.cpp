#include "inverse/wide_search.hpp"

#include "datasets/error.hpp"
#include "forward/simulate.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace crampfit {
namespace {

// Cells of a scene from which on its equilibria, and not what is made of them, take a fit's time.
constexpr double least_cells = 5000;

double cells_of(const Scene& scene) {
    return scene.model.cell > 0 ? scene.specimen.size.prod() / (scene.model.cell * scene.model.cell) : 0.0;
}

}  // namespace

WideSearch::WideSearch(const Study& study, const FitOptions& options, RunStore& store, std::function<void()> look)
    : study_(on_wide_cells(study)), options_(options), store_(store), look_(std::move(look)) {}

// Whether there is a search along walks on those cells.
bool WideSearch::make_runs() {
    try {
        runs_ = std::make_unique<StudyRuns>(study_, options_, store_, 2.0, [this](const Run&) { look_(); });
    } catch (const InputError&) {  // too wide for something in the scene
        return false;
    }
    if (!runs_->by_walks()) {
        runs_.reset();
    }
    return runs_ != nullptr;
}

bool WideSearch::find_start(const std::function<void(const std::string&)>& stage) {
    const auto is_small = [](const Experiment& experiment) { return 4 * cells_of(experiment.scene) < least_cells; };
    if (std::all_of(study_.experiments.begin(), study_.experiments.end(), is_small) || !make_runs()) {
        return false;
    }
    runs_->find_start([&](const std::string& name) { stage(name + " on cells twice as wide"); });
    return runs_->objective().best() != nullptr;
}

bool WideSearch::descend(const std::function<void(const std::string&)>& stage) {
    if (!runs_ && !make_runs()) {
        return false;
    }
    runs_->descend([&](const std::string& name) { stage(name + " on cells twice as wide"); });
    return runs_->objective().best() != nullptr;
}

double WideSearch::deviance() const {
    const Run* const best = runs_ ? runs_->objective().best() : nullptr;
    return best ? runs_->model().likely_knowledge(*best->evaluation, solver_resolution).deviance
                : std::numeric_limits<double>::quiet_NaN();
}

std::string WideSearch::method() const {
    if (!runs_) {
        return "";
    }
    return fmt::format(" Before that, {} runs on cells twice as wide found {}.", runs_->objective().runs().size(),
                       runs_->objective().best() ? "where to begin" : "no point to begin from");
}

Evaluation WideSearch::at(const Eigen::VectorXd& x) {
    if (runs_) {
        runs_->objective().set_budget_left(std::max(1, runs_->objective().budget_left()));
        const auto run = runs_->objective().at(x);
        return run ? *run : Evaluation{"interrupted", {}, {}};
    }
    const Eigen::VectorXd values = UnitBox(study_.parameters).values(x);
    Eigen::VectorXd key(values.size() + 1);
    key << values, 2.0;
    return store_.at(key, [&] {
        const Forward simulation = [](const Scene& scene, const std::atomic<bool>* end) {
            SimulateOptions options;
            options.stop_requested = end;
            return simulate(scene, options);
        };
        return StudyModel(study_, simulation, solver_resolution, options_.stop_requested).at(values, 1);
    });
}

}  // namespace crampfit

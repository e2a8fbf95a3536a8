#include "inverse/study_runs.hpp"

#include "datasets/run_journal.hpp"
#include "inverse/lack_of_fit.hpp"
#include "inverse/pool.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

namespace crampfit {
namespace {

constexpr double all_ways = 1.0;       // of the box, to either side
constexpr double ways_about = 0.1;     // between both: a way that is the true one may promise little from a twentieth away
constexpr double ways_beside = 0.01;   // farther than from one jump of the misfit, as the grid sees ways, to the next
constexpr double nothing_left = 1e-6;  // of what noise leaves

constexpr int most_weighings = 6;     // by another resolution of the model
constexpr double least_change = 0.1;  // of a sigma, that they are made for

constexpr std::array<double, 2> better_known{0.0, 0.25};  // of a resolution: may the model know that well what it says?
constexpr double more_likely = 0.1;                       // in -2 ln of a likelihood
constexpr int most_steps_beside = 3;
constexpr double least_step = 1e-3;  // of the misfit: a thirtieth of a standard error

// All that the lowest point of a cheap model hangs on beyond what the runs do.
std::uint64_t what_is_asked(const Study& study, const std::vector<double>& point, const Window& window, bool rough,
                            const StudyModel& model, double widening, unsigned seed) {
    Fingerprint print;
    print.add(point)
        .add(model.resolution())
        .add(model.counts_priors())
        .add(rough)
        .add(seed)
        .add(static_cast<double>(study.optimizer.loss))
        .add(widening);
    print.add(std::vector<double>(window.origin.begin(), window.origin.end()));
    print.add(std::vector<double>(window.axes.reshaped().begin(), window.axes.reshaped().end()));
    for (const Parameter& parameter : study.parameters) {
        print.add(parameter.lower).add(parameter.upper).add(static_cast<double>(parameter.scale));
    }
    return print.value();
}

}  // namespace

Study on_wide_cells(const Study& study) {
    Study wide = study;
    for (Experiment& experiment : wide.experiments) {
        experiment.scene.model.cell *= 2.0;
        experiment.scene.solver.extrapolate = false;
        experiment.scene.output.frames = 0;
    }
    return wide;
}

StudyRuns::StudyRuns(const Study& study, const FitOptions& options, RunStore& store, double widening, Objective::OnRun on_run,
                     Objective::OnRun on_weighing)
    : study_(study), options_(options), store_(store), widening_(widening), threads_(thread_count(options.threads)),
      walks_(study, std::max(1, threads_ / std::max(1, static_cast<int>(study.experiments.size())))),
      only_toughness_(!options.forward && walks_.only_toughness()),
      has_walks_(!options.forward && (only_toughness_ || walks_.has_slopes())),
      by_walks_(has_walks_ && study.optimizer.method == "auto"),
      in_order_((by_walks_ || only_toughness_) && walks_.depend_on_order()),
      model_(study, forward(), options.forward ? 0.0 : solver_resolution, options.stop_requested),
      nearby_{by_walk_of(&KeptWalks::near),
              by_walk_of(&KeptWalks::rough),
              walks_.exact_near(),
              walks_.turn_with_toughness(),
              in_order_ ? std::vector<Eigen::Index>{} : walks_.turning(),
              [this](const auto&... asked) { return recall(asked...); }},
      // Steps on walks go on from the one before, where the walks are.
      shared_([this](const Eigen::VectorXd& values, int share) { return model_.at(values, in_order_ ? threads_ : share); },
              threads_, by_walks_ || in_order_ ? nullptr : options.farm),
      objective_(
          model_.box().size(), [this](const Eigen::VectorXd& x, int share) { return run(x, share); }, study.optimizer.max_runs,
          in_order_ ? 1 : shared_.places(), options.stop_requested, std::move(on_run)),
      on_weighing_(std::move(on_weighing)) {}

Forward StudyRuns::forward() const {
    return options_.forward ? options_.forward : by_walks_ || only_toughness_ ? walks_.exact() : walks_.in_any_order();
}

Near StudyRuns::by_walk_of(Forward (KeptWalks::*runs)(const std::vector<double>&) const) {
    return [this, runs](const Eigen::VectorXd& point) -> Objective::Evaluate {
        auto close =
            std::make_shared<StudyModel>(study_, (walks_.*runs)(values_at(point)), model_.resolution(), options_.stop_requested);
        close->count_priors(model_.counts_priors());
        return [close, in_order = in_order_, threads = threads_](const Eigen::VectorXd& x, int share) {
            return close->evaluate(x, in_order ? threads : share);
        };
    };
}

std::vector<double> StudyRuns::values_at(const Eigen::VectorXd& x) const {
    const Eigen::VectorXd values = model_.box().values(x);
    return {values.begin(), values.end()};
}

// What the store knows a run by.
Eigen::VectorXd StudyRuns::key_of(const Eigen::VectorXd& values) const {
    if (widening_ == 1.0) {
        return values;
    }
    Eigen::VectorXd key(values.size() + 1);
    key << values, widening_;
    return key;
}

// What an earlier process has done on walks that hang on one another is done again only where something goes on from them.
Lowest StudyRuns::recall(const Eigen::VectorXd& point, const Window& window, bool rough, const std::function<Lowest()>& search) {
    const std::size_t n = store_.begin_search();
    const std::uint64_t asked = what_is_asked(study_, values_at(point), window, rough, model_, widening_, options_.seed);
    if (const auto before = store_.found_by_search(n, asked)) {
        if (in_order_) {
            walks_.put_off(values_at(point), search);
        }
        return Lowest{Eigen::Map<const Eigen::VectorXd>(before->data(), model_.box().size()), before->back()};
    }
    walks_.catch_up(values_at(point));
    const Lowest found = search();
    std::vector<double> kept(found.x.begin(), found.x.end());
    kept.push_back(found.misfit);
    store_.keep_search(n, asked, kept);
    return found;
}

Evaluation StudyRuns::run(const Eigen::VectorXd& x, int share) {
    const Eigen::VectorXd values = model_.box().values(x), key = key_of(values);
    const auto run = [this, values, share] { return shared_(values, share); };
    if (in_order_ && store_.known(key)) {
        walks_.put_off(values_at(x), run);
    } else if (in_order_) {
        walks_.catch_up(values_at(x));
    }
    Evaluation evaluation = store_.at(key, run);
    model_.weigh(evaluation, values);  // stored ones may have been weighed by another resolution
    return evaluation;
}

// The misfit that noise leaves; 0 where ways differ.
double StudyRuns::left_by_noise() const {
    const MeasuredCurves curves = model_.curves();
    double left = 0;
    for (std::size_t i = 0; i < curves.lengths.size() && !nearby_.ways_differ; ++i) {
        left += std::pow(curves.root(i), 2) * curves.lengths[i];
    }
    return left;
}

// Weighed by what the model knows at worst: where that explains the misfit it is for others to go on.
SearchResult StudyRuns::descend_at_worst(int starts, const Eigen::VectorXd& initial,
                                         const std::function<void(const std::string&)>& stage) {
    const auto is_enough = [enough = left_by_noise()](const Evaluation& best) { return best.misfit < enough; };
    return descend_by_walks(objective_, nearby_, starts, is_enough, initial, options_.seed, stage);
}

SearchResult StudyRuns::descend(int starts, const Eigen::VectorXd& initial,
                                const std::function<void(const std::string&)>& stage) {
    SearchResult found = descend_at_worst(starts, initial, stage);
    found.converged = heed_data(weigh_and_descend(found.converged, left_by_noise() > 0), [this] { return descend_again(); });
    const bool is_fine = widening_ == 1.0;
    // Where a search on wide cells has gone before, each such look takes as long as all steps together.
    const bool is_cheap = is_fine && (only_toughness_ || starts > 1);
    if (is_cheap) {
        const auto look = [this] {
            for (int step = 0; step < most_steps_beside && step_beside(objective_, nearby_, more_likely, options_.seed); ++step) {
            }
        };
        found.converged = know_better(found.converged, look, [this] { return weigh_and_descend(true, true); });
    }
    if (!nearby_.turning.empty() && objective_.best()) {
        const bool goes_on = starts == 1;  // from a search on wide cells
        for (const double reach : {all_ways, ways_about, ways_beside}) {
            if ((reach == all_ways ? !goes_on : is_fine) && is_left_over()) {
                stage("other ways");
                if (look_for_ways(objective_, nearby_, reach, options_.seed)) {
                    found.converged = descend_again();
                    found.method += fmt::format(" Of other ways, up to {:g} of the bounds away, one was better.", reach);
                }
            }
        }
        if (is_fine) {
            stage("closing in");
            found.converged = found.converged && close_in(objective_, nearby_, options_.seed) && weigh_and_descend(true, false);
            found.method += " The last steps took in how the parameters turn the crack, told by runs a little aside.";
        }
    } else if (is_cheap && found.converged) {
        settle();
    }
    return found;
}

SearchResult StudyRuns::descend(const std::function<void(const std::string&)>& stage) {
    return descend(all_starts(), model_.box().initial(), stage);
}

SearchResult StudyRuns::find_start(const std::function<void(const std::string&)>& stage) {
    return nearby_.turning.empty() ? descend_at_worst(all_starts(), model_.box().initial(), stage) : descend(stage);
}

int StudyRuns::all_starts() const { return std::max(study_.optimizer.starts, least_starts_where_unexplained); }

bool StudyRuns::descend_again() { return weigh_and_descend(descend_as_weighed(false), false); }

// From the best run on to the lowest point, or, but for the last time, to where a step says that runs weigh otherwise.
bool StudyRuns::descend_as_weighed(bool last) {
    const auto weighs_otherwise = [this, last](const Evaluation& best) {
        return !last && model_.change_of_sigma(model_.likely_resolution(best, most_resolution_)) > least_change;
    };
    return crampfit::descend_again(objective_, nearby_, weighs_otherwise, options_.seed);
}

SearchResult StudyRuns::search(const Eigen::VectorXd& initial, const std::function<void(const std::string&)>& stage) {
    const auto is_explained = [this](const Evaluation& best) {
        return lack_of_fit(check_fit(model_.residuals(best), static_cast<int>(model_.box().size()))).empty();
    };
    SearchResult found = crampfit::search(objective_, study_.optimizer, initial, options_.seed, is_explained, stage);
    if (options_.forward) {
        return found;
    }
    const auto go_on = [&] {
        OptimizerChoice again = study_.optimizer;
        again.starts = 1;
        const auto enough = [](const Evaluation&) { return true; };
        const SearchResult next = crampfit::search(objective_, again, objective_.best()->x, options_.seed, enough, stage);
        found.method += " Weighed anew by what the model knows, from the best run on: " + next.method;
        return next.converged;
    };
    const auto weigh = [&](bool converged) {
        for (int round = 0; objective_.best() && round < most_weighings && weigh_anew(least_change); ++round) {
            converged = go_on();
        }
        return converged;
    };
    found.converged = heed_data(weigh(found.converged), [&] { return weigh(go_on()); });
    if (walks_.at_equilibrium()) {  // else each look costs as much as the search
        found.converged = know_better(found.converged, go_on, [&] { return weigh(go_on()); });
    }
    return found;
}

// Weighs all runs by what the best one says of the model's resolution, where that changes a sigma by more than so much.
bool StudyRuns::weigh_anew(double least) {
    const double likely = model_.likely_resolution(*objective_.best()->evaluation, most_resolution_);
    if (model_.change_of_sigma(likely) <= least) {
        return false;
    }
    model_.set_resolution(likely);
    judge_runs();
    return true;
}

void StudyRuns::judge_runs() {
    objective_.judge_anew([&](const Run& run) {
        Evaluation evaluation = *run.evaluation;
        model_.weigh(evaluation, model_.box().values(run.x));
        return evaluation;
    });
    if (on_weighing_) {
        on_weighing_(*objective_.best());
    }
}

// What the model knows is told by the data alone: where priors pull the best run off them, what is left would pass for an error
// of the model's, by which the data weigh less, so that the priors pull the more.
bool StudyRuns::heed_data(bool converged, const std::function<bool()>& descend) {
    if (!converged || !model_.has_priors() || model_.change_of_sigma(0.0) <= least_change) {
        return converged;
    }
    model_.count_priors(false);
    judge_runs();
    descend();
    most_resolution_ = model_.resolution();
    model_.count_priors(true);
    judge_runs();
    return descend();
}

// Where a run leaves much the model seems to know little, by which that run fits: a search that believes it ends there, though
// next to it the model may know more. `look` looks for a lower point as a model weighs it that does, and `descend` goes on from
// there, where the residuals, by what they say of the model themselves, are likelier.
bool StudyRuns::know_better(bool converged, const std::function<void()>& look, const std::function<bool()>& descend) {
    if (!converged || model_.change_of_sigma(0.0) <= least_change) {
        return converged;
    }
    const double resolution = model_.resolution();
    const auto deviance = [this] { return model_.likely_knowledge(*objective_.best()->evaluation, most_resolution_).deviance; };
    const double before = deviance();
    const auto weigh = [this](double by) {
        model_.set_resolution(by);
        judge_runs();
    };
    for (const double share : better_known) {
        weigh(share * resolution);
        look();
        if (objective_.stopped()) {
            break;
        }
        if (deviance() < before - more_likely) {
            weigh(model_.likely_resolution(*objective_.best()->evaluation, most_resolution_));
            const bool ended = descend();
            if (deviance() < before - more_likely) {
                return ended;
            }
        }
    }
    weigh(resolution);
    return converged;
}

// The last step: by what the model knows there, to the lowest point, however little it gains.
void StudyRuns::settle() {
    weigh_anew(0.0);
    const Evaluation& best = *objective_.best()->evaluation;
    const double least = least_step * std::max(1.0, best.misfit / static_cast<double>(best.residuals.size()));
    step_beside(objective_, nearby_, least, options_.seed);
}

// Whether more than noise is left, or hardly any: then the data may hold what another way would explain.
bool StudyRuns::is_left_over() const {
    constexpr double hardly_any = 0.25;  // of what noise leaves
    const Evaluation& best = *objective_.best()->evaluation;
    const auto checks = check_fit(model_.residuals(best), static_cast<int>(model_.box().size()));
    double left = 0, points = 0;
    for (const FitCheck& check : checks) {
        left += check.chi_square;
        points += check.points;
    }
    return left < hardly_any * points ? left > nothing_left * points : !lack_of_fit(checks).empty();
}

// How well the model knows what it says shows where it fits: on to the lowest point as that weighs it.
bool StudyRuns::weigh_and_descend(bool converged, bool ended_early) {
    for (int round = 0; converged && round < most_weighings; ++round) {
        const bool goes_on = weigh_anew(round == 0 && ended_early ? 0.0 : least_change);
        if (!goes_on && !(round == 0 && ended_early)) {
            break;
        }
        converged = descend_as_weighed(round + 1 == most_weighings);
    }
    return converged;
}

}  // namespace crampfit

#include "inverse/search.hpp"

#include "inverse/minimize.hpp"
#include "inverse/pool.hpp"
#include "inverse/sobol_points.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

namespace crampfit {
namespace {

constexpr int most_failed_starts = 20;
constexpr double least_gain = 1e-3;  // of the misfit, for which a simplex sets out once more

using Stage = std::function<void(const std::string&)>;

std::vector<Eigen::VectorXd> start_points(int count, const Eigen::VectorXd& initial, unsigned seed) {
    std::vector<Eigen::VectorXd> points = sobol_points(count, initial.size(), seed);
    points.front() = initial;
    return points;
}

// Goes on through the sequence of starts, a few at a time, as long as all runs fail.
void find_usable_start(Objective& objective, const Eigen::VectorXd& initial, unsigned seed, int from) {
    constexpr int together = 4;
    for (int i = from; i < from + most_failed_starts && !objective.best() && !objective.exhausted(); i += together) {
        std::vector<Eigen::VectorXd> points;
        for (int k = 0; k < together; ++k) {
            points.push_back(sobol_point(i + k, initial.size(), seed));
        }
        objective.at(points);
    }
}

// Local methods of NLopt take what stands for a failed run for the misfit there: a polynomial through it leads astray, and a
// simplex may shrink before its time.
bool is_misled(const Objective& objective, const Method& method) {
    return method.name != "auto" && method.name != "ceres" &&
           std::any_of(objective.runs().begin(), objective.runs().end(),
                       [](const Run& run) { return !run.evaluation->usable(); });
}

// Where failed runs end a method before its time or mislead it, a simplex method that only compares misfits goes on from the best
// point, as long as it finds lower ones.
Solution descend(Objective& objective, const Eigen::VectorXd& start, const Method& method) {
    Solution solution = minimize(objective, start, method);
    bool goes_on = !solution.converged || is_misled(objective, method);
    const std::string why = solution.converged ? "runs failed" : solution.message;
    while (goes_on && !objective.exhausted() && objective.best()) {
        const Run best = *objective.best();
        solution = minimize(objective, best.x, {"sbplx", method.seed});
        solution.message = fmt::format("{} may have ended too soon ({}); sbplx went on", method.name, why);
        goes_on =
            is_misled(objective, {"sbplx"}) && objective.best()->evaluation->misfit < (1 - least_gain) * best.evaluation->misfit;
    }
    return solution;
}

// Residuals beyond the parameters that fit them, at least one.
double freedom(const Evaluation& evaluation, Eigen::Index parameters) {
    return static_cast<double>(std::max<Eigen::Index>(1, evaluation.residuals.size() - parameters));
}

// The lowest of the runs that no descent has started from or ended at yet, where its misfit is no more than `most`; absent if
// there is none.
std::optional<Eigen::VectorXd> next_start(const std::vector<Run>& starts, const std::vector<Eigen::VectorXd>& seen, double most) {
    constexpr double far = 0.1;  // of the box
    const Run* next = nullptr;
    for (const Run& run : starts) {
        const bool is_new = std::none_of(seen.begin(), seen.end(),
                                         [&](const Eigen::VectorXd& x) { return (x - run.x).cwiseAbs().maxCoeff() < far; });
        if (is_new && run.evaluation->usable() && run.evaluation->misfit <= most &&
            (!next || run.evaluation->misfit < next->evaluation->misfit)) {
            next = &run;
        }
    }
    return next ? std::optional(next->x) : std::nullopt;
}

SearchResult search_automatically(Objective& objective, int starts, const Eigen::VectorXd& initial, unsigned seed,
                                  const std::function<bool(const Evaluation&)>& is_explained, const Stage& stage) {
    constexpr double explained = 1.3;  // reduced chi-square: as far above 1 as noise goes
    constexpr double unexplained = 4;  // residuals of two sigma
    const int p = static_cast<int>(initial.size());
    const int count = std::max(starts, 2 * p + 2);
    stage("starts");
    objective.at(start_points(count, initial, seed));
    find_usable_start(objective, initial, seed, count);
    const std::vector<Run> tried = objective.runs();
    SearchResult result;
    std::string ends;
    std::vector<Eigen::VectorXd> seen;
    stage("descent");
    int descents = starts;
    double most = std::numeric_limits<double>::infinity();
    for (int i = 0; i < descents && !objective.exhausted(); ++i) {
        const auto start = next_start(tried, seen, most);
        if (!start) {
            break;
        }
        const double least = objective.best()->evaluation->misfit;
        Objective branch = objective.branch(objective.budget_left(), objective.threads());
        const Solution solution = descend(branch, *start, {"auto", seed});
        objective.join(branch);
        if (!branch.best()) {
            break;  // stopped before its first run
        }
        seen.push_back(*start);
        seen.push_back(branch.best()->x);
        if (i == 0 || objective.best()->evaluation->misfit < least) {
            result.converged = solution.converged;
        }
        ends += fmt::format(" Descent {}: {}.", i + 1, solution.message);
        const Evaluation& best = *objective.best()->evaluation;
        const double left = best.misfit / freedom(best, p);
        const bool looks_like_noise = is_explained(best);
        // Only a start that the noise explains as it stands may lead to another explanation then.
        const bool is_one = solution.converged && left < explained && looks_like_noise;
        most = is_one ? explained * freedom(best, p) : most;
        // Others have not come to their ends: one of them may go lower.
        if (!solution.converged && left > unexplained) {
            result.converged = false;
        }
        descents = left > unexplained || !looks_like_noise ? std::max(starts, least_starts_where_unexplained) : starts;
    }
    result.method = fmt::format("auto: {} starting points side by side, then steps from the best of them to the least "
                                "misfit (Ceres) of polynomials "
                                "fitted to the residuals of all runs nearby; from others too, up to {}, while the "
                                "noise does not explain the misfit. "
                                "Chosen because the misfit is a sum of squares, a run is costly, and a fit over many "
                                "runs sees past the noise of each.{}",
                                count, descents, ends);
    return result;
}

// A global method ends only with its runs: the last third of them is for the descent from the best that it has found.
SearchResult search_the_box(Objective& objective, const Method& method, const Eigen::VectorXd& initial, const Stage& stage) {
    std::string text;
    if (!objective.best()) {  // or it has been searched
        stage("search of the box");
        Objective branch = objective.branch(objective.budget_left() - objective.budget_left() / 3, objective.threads());
        minimize(branch, initial, method);
        objective.join(branch);
        text = fmt::format("{}, as asked, with {} runs, then ", method.name, branch.runs().size());
    }
    if (!objective.best()) {
        return {false, text + "nothing: no run was usable."};
    }
    stage("descent");
    const Solution solution = descend(objective, objective.best()->x, {"auto", method.seed});
    text += "steps from the best run to the least misfit of polynomials fitted to the residuals of all runs nearby: ";
    return {solution.converged, text + solution.message + "."};
}

SearchResult search_from_starts(Objective& objective, const Method& method, int starts, const Eigen::VectorXd& initial,
                                const Stage& stage) {
    stage("descent");
    const std::vector<Eigen::VectorXd> points = start_points(starts, initial, method.seed);
    const int count = static_cast<int>(points.size());
    // Shares of the budget, so that what one start does never depends on how far another has come.
    std::vector<Objective> branches;
    for (int i = 0; i < count; ++i) {
        const int share = (objective.budget_left() + i) / count;
        branches.push_back(objective.branch(share, std::max(1, objective.threads() / count)));
    }
    std::vector<Solution> solutions(points.size());
    parallel_for(count, objective.threads(), [&](int i) {
        const auto k = static_cast<std::size_t>(i);
        Objective& branch = branches[k];
        Eigen::VectorXd start = points[k];
        branch.at(start);
        find_usable_start(branch, initial, method.seed, count + i * most_failed_starts);
        start = branch.best() ? branch.best()->x : start;
        solutions[k] = descend(branch, start, method);
    });
    SearchResult result;
    double least = INFINITY;
    std::string message;
    for (std::size_t k = 0; k < branches.size(); ++k) {
        objective.join(branches[k]);
        const Run* best = branches[k].best();
        if (best && best->evaluation->misfit < least) {
            least = best->evaluation->misfit;
            result.converged = solutions[k].converged;
            message = solutions[k].message;
        }
    }
    result.method = fmt::format("{}, as asked, from {} start{}: {}.", method.name, count, count == 1 ? "" : "s",
                                message.empty() ? "no run was usable" : message);
    return result;
}

}  // namespace

SearchResult search(Objective& objective, const OptimizerChoice& choice, const Eigen::VectorXd& initial, unsigned seed,
                    const std::function<bool(const Evaluation&)>& is_explained, const Stage& stage) {
    if (choice.method == "auto") {
        return search_automatically(objective, choice.starts, initial, seed, is_explained, stage);
    }
    const Method method{choice.method, seed};
    return is_global(method) ? search_the_box(objective, method, initial, stage)
                             : search_from_starts(objective, method, choice.starts, initial, stage);
}

}  // namespace crampfit

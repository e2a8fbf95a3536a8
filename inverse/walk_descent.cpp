#include "inverse/walk_descent.hpp"

#include "inverse/minimize.hpp"
#include "inverse/sobol_points.hpp"

#include <Eigen/Cholesky>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace crampfit {
namespace {

// Parts of the box. The radius is that of the parameters in which the model of the runs nearby is of first order; in the others
// it goes farther.
constexpr double first_radius = 0.2;
constexpr double reach_where_exact = 5.0;  // radii
constexpr double last_radius = 0.03;
constexpr double least_radius = 1e-4;
constexpr double least_gain = 3e-3;     // of the misfit, where no noise is in it
constexpr double least_rise = 0.05;     // in what noise leaves of a residual, squared: a fifth of a standard error
constexpr double last_rise = 1;         // the same: of a last step, of one standard error, which leaves far less than that
constexpr double all_noise = 0.25;      // of the misfit for each residual: with less there may be no noise to hide that step in
constexpr double free_of_noise = 0.01;  // of the misfit for each residual: below that it is rounding of data or model
constexpr int most_unconfirmed = 2;  // steps within the last radius whose gain no run confirms: what is left is the model's noise

constexpr int model_starts = 16;        // for each parameter: of the cheap model, in its window
constexpr int model_descents = 4;       // from the lowest of them
constexpr int runs_across_jumps = 200;  // for each parameter
constexpr int most_polishing_steps = 15;
constexpr double polishing_difference = 1e-5;
constexpr int most_cheap_runs = 100000;
constexpr int places_along = 128;  // of the whole box, in each parameter that is exact

// Where parameters turn the crack, what lies nearby tells of one way only:
constexpr int starts_a_parameter = 6;
constexpr int descents_of_starts = 3;

constexpr int most_failed_starts = 20;

// Looking for other ways.
constexpr int ways_a_parameter = 16;
constexpr std::size_t most_ways_tried = 3;

// Closing in on the lowest point where ways turn, in parts of the box: far less than a way goes on without a jump; far more than
// a run's rounding.
constexpr double aside = 0.1;  // of the window
constexpr double most_aside = 3e-4, least_aside = 1e-6;
constexpr double rounding = 1e-12;  // of the misfit for each residual

// Levenberg's and Marquardt's steps (Marquardt 1963) with slopes by small differences, within the unit cube.
void polish(Objective& cheap, Eigen::VectorXd y) {
    const auto size = y.size();
    auto here = cheap.at(y);
    double damping = 1e-4;
    for (int step = 0; step < most_polishing_steps && here && here->usable(); ++step) {
        Eigen::MatrixXd slopes(here->residuals.size(), size);
        for (Eigen::Index j = 0; j < size; ++j) {
            Eigen::VectorXd beside = y;
            beside[j] += y[j] < 0.5 ? polishing_difference : -polishing_difference;
            const auto there = cheap.at(beside);
            if (!there || !there->usable()) {
                return;
            }
            slopes.col(j) = (there->residuals - here->residuals) / (beside[j] - y[j]);
        }
        const Eigen::MatrixXd normal = slopes.transpose() * slopes;
        const Eigen::VectorXd gradient = slopes.transpose() * here->residuals;
        bool lower = false;
        for (int trial = 0; trial < 6 && !lower; ++trial) {
            Eigen::MatrixXd damped = normal;
            damped.diagonal() += damping * normal.diagonal().cwiseMax(1e-12 * normal.diagonal().maxCoeff());
            const Eigen::VectorXd next = (y - damped.ldlt().solve(gradient)).cwiseMax(0.0).cwiseMin(1.0);
            const auto there = cheap.at(next);
            lower = there && there->usable() && there->misfit < here->misfit;
            damping *= lower ? 0.1 : 10.0;
            if (lower) {
                const double gain = 1.0 - there->misfit / here->misfit;
                y = next;
                here = there;
                if (gain < 0.1 * least_gain) {
                    return;
                }
            }
        }
        if (!lower) {
            return;
        }
    }
}

// The lowest point of the model in the window.
Lowest lowest(const Objective::Evaluate& model, const Window& window, const Eigen::VectorXd& centre, bool across_jumps,
              int threads, const std::atomic<bool>* stop, unsigned seed) {
    const auto in_window = [&](const Eigen::VectorXd& y, int share) { return model(window.inside(y), share); };
    Objective cheap(centre.size(), in_window, most_cheap_runs, threads, stop);
    std::vector<Eigen::VectorXd> starts = sobol_points(model_starts * static_cast<int>(centre.size()), centre.size(), seed);
    starts.front() = window.share(centre).cwiseMax(0.0).cwiseMin(1.0);
    cheap.at(starts);
    std::vector<Run> order = cheap.runs();
    std::stable_sort(order.begin(), order.end(),
                     [](const Run& a, const Run& b) { return a.evaluation->misfit < b.evaluation->misfit; });
    for (int i = 0; i < std::min<int>(model_descents, static_cast<int>(order.size())) && !cheap.stopped(); ++i) {
        polish(cheap, order[static_cast<std::size_t>(i)].x);
    }
    // Along a valley with jumps across it slopes mislead, and so do steps along the axes: a population takes its shape.
    if (cheap.best() && across_jumps) {
        Objective branch = cheap.branch(runs_across_jumps * static_cast<int>(centre.size()), threads);
        minimize(branch, cheap.best()->x, {"crs2", seed});
        cheap.join(branch);
        const Eigen::VectorXd best = cheap.best()->x;
        polish(cheap, best);
    }
    const Run* best = cheap.best();
    return best ? Lowest{window.inside(best->x), best->evaluation->misfit} : Lowest{centre, INFINITY};
}

// The lowest point of the model on the lines through a point along which it is exact. A jump of the crack between two rows of a
// table lets a toughness lie within some parts in a hundred and no more, and the misfit is flat on both sides of that.
Lowest lowest_along(const Objective::Evaluate& model, const Eigen::VectorXd& centre, const std::vector<bool>& exact, int threads,
                    const std::atomic<bool>* stop) {
    Objective cheap(centre.size(), model, most_cheap_runs, threads, stop);
    std::vector<Eigen::VectorXd> places;
    for (Eigen::Index j = 0; j < centre.size(); ++j) {
        for (int i = 0; i < places_along && exact[static_cast<std::size_t>(j)]; ++i) {
            places.push_back(centre);
            places.back()[j] = (i + 0.5) / places_along;
        }
    }
    cheap.at(places);
    const Run* best = cheap.best();
    return best ? Lowest{best->x, best->evaluation->misfit} : Lowest{centre, INFINITY};
}

// That of the model of the runs near a point.
Lowest lowest_near(const Eigen::VectorXd& point, const Nearby& nearby, bool rough, const Window& window,
                   const Objective& objective, unsigned seed) {
    const auto search = [model = (rough ? nearby.rough : nearby.near)(point), window, point, rough, threads = objective.threads(),
                         stop = objective.stop(), seed] { return lowest(model, window, point, !rough, threads, stop, seed); };
    return nearby.recall ? nearby.recall(point, window, rough, search) : search();
}

bool is_worth_a_run(const Evaluation& here, double gain, double rise = least_rise) {
    const double left = (here.misfit - gain) / static_cast<double>(here.residuals.size());
    return gain > (left > free_of_noise ? rise * std::max(1.0, left) : least_gain * here.misfit);
}

Lowest lowest_along(const Eigen::VectorXd& point, const Nearby& nearby, const Objective& objective) {
    const auto search = [model = nearby.rough(point), point, exact = nearby.exact, threads = objective.threads(),
                         stop = objective.stop()] { return lowest_along(model, point, exact, threads, stop); };
    return nearby.recall ? nearby.recall(point, Window(point.size()), true, search) : search();
}

struct Descent {
    bool converged;           // it ended by its own criterion, or early
    double unconfirmed = 0;   // gain of the misfit that its last steps promised and no run confirmed
    bool was_enough = false;  // it ended early
};

Descent descend_from(Objective& objective, const Nearby& nearby, const Eigen::VectorXd& start, const Enough& enough,
                     unsigned seed) {
    objective.at(start);
    Eigen::VectorXd reach(start.size());  // in radii
    for (Eigen::Index j = 0; j < reach.size(); ++j) {
        reach[j] = nearby.exact[static_cast<std::size_t>(j)] ? reach_where_exact : 1.0;
    }
    double radius = first_radius, unconfirmed = 0;
    int in_vain = 0;
    while (objective.best() && !objective.exhausted() && radius >= least_radius && in_vain < most_unconfirmed) {
        const Run here = *objective.best();
        if (enough(*here.evaluation)) {
            return {true, 0, true};
        }
        const double misfit = here.evaluation->misfit;
        Lowest trial = lowest_near(here.x, nearby, true, Window::around(here.x, radius * reach), objective, seed);
        if (!is_worth_a_run(*here.evaluation, misfit - trial.misfit)) {
            trial = lowest_along(here.x, nearby, objective);
        }
        if (!is_worth_a_run(*here.evaluation, misfit - trial.misfit)) {
            trial = lowest_near(here.x, nearby, false,
                                Window::around(here.x, Eigen::VectorXd::Constant(here.x.size(), std::min(radius, last_radius))),
                                objective, seed);
        }
        const double expected = misfit - trial.misfit;
        if (!is_worth_a_run(*here.evaluation, expected)) {
            return {!objective.stopped(), unconfirmed};
        }
        const auto there = objective.at(trial.x);
        const double gain = misfit - objective.best()->evaluation->misfit;
        // In a window that failed steps have made small little is promised wherever it lies.
        const bool is_last = radius >= last_radius && !is_worth_a_run(*here.evaluation, expected, last_rise) &&
                             misfit - expected > all_noise * static_cast<double>(here.evaluation->residuals.size());
        if (is_last) {
            return {!objective.stopped(), is_worth_a_run(*here.evaluation, gain) ? 0.0 : expected - gain};
        }
        const Eigen::VectorXd away = (trial.x - here.x).cwiseAbs();
        const double step = away.cwiseQuotient(reach).maxCoeff();
        if (is_worth_a_run(*here.evaluation, gain)) {
            in_vain = 0;
        } else if (away.maxCoeff() <= last_radius && there && there->usable()) {
            ++in_vain;
            unconfirmed = expected - gain;
        }
        radius = gain < 0.25 * expected ? 0.25 * std::min(radius, step) : std::clamp(2.0 * step, last_radius, first_radius);
    }
    return {objective.best() != nullptr && (radius < least_radius || in_vain == most_unconfirmed), unconfirmed};
}

// What is known beside a point of how parameters turn the crack.
struct Aside {
    Eigen::Index parameter;
    double by;
    Objective::Evaluate near;
};

// Runs a little aside in each parameter that turns the crack. To one side the crack may jump to another way: where the turn does
// more than all else that the parameter does, the other side is tried too, and the one taken where it does less.
std::vector<Aside> look_aside(Objective& objective, const Nearby& nearby, const Run& here, double distance) {
    const Objective::Evaluate near = nearby.near(here.x);
    std::vector<Aside> found;
    for (Eigen::Index j = 0; j < here.x.size(); ++j) {
        double least = INFINITY;
        const double inwards = here.x[j] < 0.5 ? distance : -distance;
        for (const double by : {inwards, -inwards}) {
            Eigen::VectorXd point = here.x;
            point[j] += by;
            if (nearby.exact[static_cast<std::size_t>(j)] || least <= 1.0 || point[j] < 0.0 || point[j] > 1.0) {
                continue;
            }
            const auto run = objective.at(point);
            const Evaluation straight = near(point, 1);
            if (!run || !run->usable() || !straight.usable()) {
                continue;
            }
            const double turn = (run->residuals - straight.residuals).norm();
            const double rest = (straight.residuals - here.evaluation->residuals).norm();
            if (std::isinf(least) || turn < least * rest) {
                if (!std::isinf(least)) {
                    found.pop_back();
                }
                found.push_back({j, by, nearby.near(point)});
                least = rest > 0 ? turn / rest : 0.0;
            }
        }
    }
    return found;
}

// The runs nearby with what the turn of the crack does, to first order.
Objective::Evaluate mended(const Objective::Evaluate& near, const Eigen::VectorXd& point, const std::vector<Aside>& asides) {
    return [near, point, asides](const Eigen::VectorXd& x, int threads) {
        Evaluation result = near(x, threads);
        if (!result.usable()) {
            return result;
        }
        Eigen::VectorXd turn = Eigen::VectorXd::Zero(result.residuals.size());
        for (const Aside& known : asides) {
            const double steps = (x[known.parameter] - point[known.parameter]) / known.by;
            const Evaluation other = steps != 0.0 ? known.near(x, threads) : Evaluation{};
            if (other.usable()) {
                turn += steps * (other.residuals - result.residuals);
            }
        }
        result.residuals += turn;
        result.misfit = result.residuals.squaredNorm();
        return result;
    };
}

// Whether the noise explains the misfit: residuals of two sigma at most.
bool is_explained(const Evaluation& best, Eigen::Index parameters) {
    constexpr double explained = 4.0;
    return best.misfit < explained * static_cast<double>(std::max<Eigen::Index>(1, best.residuals.size() - parameters));
}

// From the initial values and Sobol points of the box one step each, along the way that the crack goes there; the lowest first.
std::vector<Eigen::VectorXd> lowest_of_starts(Objective& objective, const Nearby& nearby, const Eigen::VectorXd& initial,
                                              unsigned seed) {
    std::vector<Eigen::VectorXd> starts =
        sobol_points(starts_a_parameter * static_cast<int>(initial.size()), initial.size(), seed);
    starts.front() = initial;
    objective.at(starts);
    std::vector<Eigen::VectorXd> steps;
    for (const Run& run : objective.runs()) {
        if (run.evaluation->usable()) {
            steps.push_back(lowest_near(run.x, nearby, true, Window(run.x.size()), objective, seed).x);
        }
    }
    objective.at(steps);
    std::vector<Run> order = objective.runs();
    std::stable_sort(order.begin(), order.end(),
                     [](const Run& a, const Run& b) { return a.evaluation->misfit < b.evaluation->misfit; });
    starts.clear();
    for (const Run& run : order) {
        if (run.evaluation->usable() && static_cast<int>(starts.size()) < descents_of_starts) {
            starts.push_back(run.x);
        }
    }
    return starts;
}

}  // namespace

bool close_in(Objective& objective, const Nearby& nearby, unsigned seed) {
    double radius = last_radius;
    int in_vain = 0;
    while (in_vain < most_unconfirmed) {
        if (objective.exhausted()) {
            return false;
        }
        const Run here = *objective.best();
        const double misfit = here.evaluation->misfit;
        if (misfit < rounding * static_cast<double>(here.evaluation->residuals.size())) {
            return !objective.stopped();
        }
        const Objective::Evaluate model =
            mended(nearby.near(here.x), here.x,
                   look_aside(objective, nearby, here, std::clamp(aside * radius, least_aside, most_aside)));
        const Window window = Window::around(here.x, Eigen::VectorXd::Constant(here.x.size(), radius));
        const Lowest trial = lowest(model, window, here.x, true, objective.threads(), objective.stop(), seed);
        if (!is_worth_a_run(*here.evaluation, misfit - trial.misfit)) {
            return !objective.stopped();
        }
        objective.at(trial.x);
        const double step = (trial.x - here.x).cwiseAbs().maxCoeff();
        const bool is_lower = is_worth_a_run(*here.evaluation, misfit - objective.best()->evaluation->misfit);
        radius = is_lower ? std::min(4.0 * step, last_radius) : 0.25 * step;
        in_vain = is_lower ? 0 : in_vain + 1;
    }
    return !objective.stopped();
}

std::optional<Run> descend_held(Objective& objective, const Nearby& nearby, const Eigen::VectorXd& start, Eigen::Index held,
                                unsigned seed) {
    constexpr int most_steps = 3;
    constexpr double hair = 1e-9;
    const auto first = objective.at(start);
    if (!first || !first->usable()) {
        return std::nullopt;
    }
    Run here{start, first};
    Eigen::VectorXd half = Eigen::VectorXd::Constant(start.size(), first_radius);
    half[held] = hair;
    for (int step = 0; step < most_steps && !objective.exhausted(); ++step) {
        const Lowest trial = lowest_near(here.x, nearby, true, Window::around(here.x, half), objective, seed);
        if (!is_worth_a_run(*here.evaluation, here.evaluation->misfit - trial.misfit)) {
            break;
        }
        const auto there = objective.at(trial.x);
        if (!there || !there->usable() || there->misfit >= here.evaluation->misfit) {
            break;
        }
        here = {trial.x, there};
    }
    return here;
}

bool look_for_ways(Objective& objective, const Nearby& nearby, double reach, unsigned seed) {
    const Run here = *objective.best();
    const auto dimensions = static_cast<Eigen::Index>(nearby.turning.size());
    const int ways = ways_a_parameter * static_cast<int>(dimensions);
    if (objective.budget_left() < 2 * ways) {
        return false;
    }
    Eigen::VectorXd half = Eigen::VectorXd::Constant(here.x.size(), first_radius);
    std::vector<Eigen::VectorXd> places(static_cast<std::size_t>(ways), here.x);
    const std::vector<Eigen::VectorXd> even = sobol_points(ways, dimensions, seed);
    for (Eigen::Index d = 0; d < dimensions; ++d) {
        const Eigen::Index j = nearby.turning[static_cast<std::size_t>(d)];
        const double low = std::max(0.0, here.x[j] - reach), width = std::min(1.0, here.x[j] + reach) - low;
        for (int i = 0; i < ways; ++i) {
            const auto k = static_cast<std::size_t>(i);
            places[k][j] = low + width * (dimensions > 1 ? even[k][d] : (i + 0.5) / ways);
        }
        half[j] = 2.0 * width / std::pow(ways, 1.0 / static_cast<double>(dimensions));
    }
    std::vector<Lowest> found;
    constexpr std::size_t together = 4;  // whose walks are kept
    for (std::size_t k = 0; k < places.size() && !objective.exhausted(); k += together) {
        const std::span<const Eigen::VectorXd> some(&places[k], std::min(together, places.size() - k));
        const auto runs = objective.at(some);
        for (std::size_t i = 0; i < some.size(); ++i) {
            if (runs[i] && runs[i]->usable()) {
                found.push_back(lowest_near(some[i], nearby, true, Window::around(some[i], half), objective, seed));
            }
        }
    }
    std::stable_sort(found.begin(), found.end(), [](const Lowest& a, const Lowest& b) { return a.misfit < b.misfit; });
    found.resize(std::min<std::size_t>(found.size(), most_ways_tried));
    std::vector<Eigen::VectorXd> trials;
    for (const Lowest& trial : found) {
        trials.push_back(trial.x);
    }
    objective.at(trials);
    return objective.best()->evaluation->misfit < here.evaluation->misfit;
}

bool step_beside(Objective& objective, const Nearby& nearby, double least, unsigned seed) {
    if (objective.exhausted()) {
        return false;
    }
    const Run here = *objective.best();
    const Window window = Window::around(here.x, Eigen::VectorXd::Constant(here.x.size(), last_radius));
    const Lowest trial = lowest_near(here.x, nearby, false, window, objective, seed);
    if (here.evaluation->misfit - trial.misfit <= least) {
        return false;
    }
    objective.at(trial.x);
    return objective.best()->evaluation->misfit < here.evaluation->misfit;
}

bool descend_again(Objective& objective, const Nearby& nearby, const Enough& enough, unsigned seed) {
    const Eigen::VectorXd start = objective.best()->x;
    const Descent descent = descend_from(objective, nearby, start, enough, seed);
    if (!nearby.ways_differ || descent.was_enough) {
        return descent.converged;
    }
    // From way to way the misfit is rough. Polynomials of the runs themselves see past that.
    return nearby.turning.empty() ? minimize(objective, Eigen::VectorXd(objective.best()->x), {"auto", seed}).converged
                                  : close_in(objective, nearby, seed);
}

SearchResult descend_by_walks(Objective& objective, const Nearby& nearby, int starts, const Enough& enough,
                              const Eigen::VectorXd& initial, unsigned seed,
                              const std::function<void(const std::string&)>& stage) {
    const int p = static_cast<int>(initial.size());
    std::vector<Eigen::VectorXd> from{initial};
    if (nearby.ways_differ) {
        stage("starts");
        from = lowest_of_starts(objective, nearby, initial, seed);
    }
    for (int i = static_cast<int>(from.size()); i < starts; ++i) {
        from.push_back(sobol_point(i, p, seed));
    }
    const int least_descents = nearby.ways_differ ? descents_of_starts : 0;
    stage("descent");
    SearchResult result;
    double least = INFINITY, unconfirmed = 0;  // of the descents
    int descents = 0;
    const auto start_is_left = [&] {
        if (!objective.best() && descents == static_cast<int>(from.size()) && descents < starts + most_failed_starts) {
            from.push_back(sobol_point(descents, p, seed));  // as long as all runs fail
        }
        return descents < static_cast<int>(from.size());
    };
    while (start_is_left() && !objective.exhausted() &&
           !(descents >= least_descents && objective.best() && is_explained(*objective.best()->evaluation, p))) {
        Objective branch = objective.branch(objective.budget_left(), objective.threads());
        const Descent descent = descend_from(branch, nearby, from[static_cast<std::size_t>(descents)], enough, seed);
        objective.join(branch);
        ++descents;
        if (branch.best() && branch.best()->evaluation->misfit < least) {
            least = branch.best()->evaluation->misfit;
            result.converged = descent.converged;
            unconfirmed = descent.unconfirmed;
        }
    }
    result.method = fmt::format(
        "auto: steps to the lowest point nearby, each confirmed by a run; nearby, equilibria that are known serve other "
        "toughnesses as "
        "they are, and other moduli moved by their exact derivatives. From {}, and from others, up to {}, while the "
        "noise does not explain the misfit. Chosen because all parameters are such. Descents: {}; runs on the way: {}.",
        nearby.ways_differ ? "the lowest of some starting points, as the parameters turn the crack" : "the initial values",
        from.size(), descents, objective.runs().size());
    if (unconfirmed > 0) {
        result.method += fmt::format(" It ended where runs did not confirm what those nearby promised, {:.2g} of the misfit: so "
                                     "well is it known.",
                                     unconfirmed);
    }
    return result;
}

}  // namespace crampfit

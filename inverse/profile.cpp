#include "inverse/profile.hpp"

#include "inverse/minimize.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

namespace crampfit {
namespace {

constexpr int most_steps = 24;         // on a side
constexpr double least_step = 0.002;   // of the box: below it, a run's own noise is all there is
constexpr double largest_step = 0.1;   // of the box
constexpr int runs_of_a_descent = 60;  // for each of the others
constexpr int runs_across_kinks = 30;  // the same
constexpr double cliff = 4.0;          // times the rise that is looked for: it comes at once, as where a crack begins to run
constexpr int halvings = 7;            // of the way across that

// x with its coordinate j left out, or put in.
Eigen::VectorXd without(const Eigen::VectorXd& x, Eigen::Index j) {
    Eigen::VectorXd others(x.size() - 1);
    others << x.head(j), x.tail(x.size() - 1 - j);
    return others;
}

Eigen::VectorXd with(const Eigen::VectorXd& others, Eigen::Index j, double held) {
    Eigen::VectorXd x(others.size() + 1);
    x << others.head(j), held, others.tail(others.size() - j);
    return x;
}

// The point with coordinate j held elsewhere, where the parameters behind the others stay.
Eigen::VectorXd moved(const Eigen::VectorXd& x, Eigen::Index j, double to, const Eigen::VectorXd& alone) {
    Eigen::VectorXd there = alone.size() > 0 ? Eigen::VectorXd(x + (to - x[j]) * alone) : x;
    there[j] = to;
    return there;
}

// The lowest point with coordinate j held, from the lowest of some starts, which have it: where misfits have cliffs, a descent
// from one of them may end far above what another has as it stands. Absent when no run was usable.
std::optional<Run> lowest_with(Objective& objective, const std::vector<Eigen::VectorXd>& starts, Eigen::Index j) {
    std::optional<Run> lowest;
    const auto take = [&](const Eigen::VectorXd& x, const std::shared_ptr<const Evaluation>& there) {
        if (there && there->usable() && (!lowest || there->misfit < lowest->evaluation->misfit)) {
            lowest = Run{x, there};
        }
    };
    for (const Eigen::VectorXd& start : starts) {
        take(start, objective.at(start));
    }
    if (starts.front().size() == 1) {
        return lowest;
    }
    const Eigen::VectorXd start = (lowest ? lowest->x : starts.front()).cwiseMax(0.0).cwiseMin(1.0);
    Objective others(
        start.size() - 1,
        [&](const Eigen::VectorXd& y, int) {
            const auto there = objective.at(with(y, j, start[j]));
            return there ? *there : Evaluation{"not run", {}, {}};
        },
        runs_of_a_descent * static_cast<int>(start.size() - 1), 1);
    minimize_with_ceres(others, without(start, j));
    if (others.best()) {  // across kinks, where slopes mislead
        others.set_budget_left(runs_across_kinks * static_cast<int>(start.size() - 1));
        const Eigen::VectorXd best = others.best()->x;
        minimize(others, best, {"sbplx"});
    }
    if (others.best()) {
        take(with(others.best()->x, j, start[j]), others.best()->evaluation);
    }
    return lowest;
}

// Points between one that is not as high as `least` + `rise` and one beyond, halving the way for as long as a cliff lies in it.
std::vector<Run> close_in(Objective& objective, Run inside, Run outside, Eigen::Index j, double least, double rise,
                          const Eigen::VectorXd& alone) {
    std::vector<Run> between;
    for (int i = 0; i < halvings && outside.evaluation->misfit > least + cliff * rise && !objective.exhausted(); ++i) {
        const Eigen::VectorXd middle = 0.5 * (inside.x + outside.x);
        const auto lowest = lowest_with(objective, {middle, moved(inside.x, j, middle[j], alone)}, j);
        if (!lowest) {
            break;
        }
        between.push_back(*lowest);
        (lowest->evaluation->misfit < least + rise ? inside : outside) = *lowest;
    }
    return between;
}

}  // namespace

Profile profile_likelihood(Objective& objective, const Run& best, Eigen::Index j, double half_width, double rise,
                           const Eigen::VectorXd& alone) {
    const double step = std::clamp(0.25 * half_width, least_step, largest_step);
    Profile below, above;
    for (auto* side : {&below, &above}) {
        Eigen::VectorXd from = best.x, before = best.x;
        Run last = best;
        for (int i = 0; i < most_steps && !objective.exhausted(); ++i) {
            // On in the direction in which the last step went, which in a linear problem leads along the valley.
            const double held = std::clamp(from[j] + (side == &below ? -step : step), 0.0, 1.0);
            if (held == from[j]) {
                break;
            }
            Eigen::VectorXd start = i == 0 ? from : Eigen::VectorXd(2 * from - before).cwiseMax(0.0).cwiseMin(1.0);
            start[j] = held;
            const auto lowest = lowest_with(objective, {start, moved(from, j, held, alone), moved(best.x, j, held, alone)}, j);
            if (!lowest) {
                break;
            }
            const auto take_in = [&](const Run& run) {
                side->x.push_back(run.x[j]);
                side->misfit.push_back(run.evaluation->misfit);
                side->lowest.push_back(run.x);
            };
            if (lowest->evaluation->misfit > best.evaluation->misfit + 1.5 * rise) {
                auto between = close_in(objective, last, *lowest, j, best.evaluation->misfit, rise, alone);
                std::ranges::sort(between, {}, [&](const Run& run) { return std::abs(run.x[j] - best.x[j]); });
                std::ranges::for_each(between, take_in);
                take_in(*lowest);
                break;
            }
            take_in(*lowest);
            before = from;
            from = lowest->x;
            last = *lowest;
        }
    }
    Profile profile;
    profile.x.assign(below.x.rbegin(), below.x.rend());
    profile.misfit.assign(below.misfit.rbegin(), below.misfit.rend());
    profile.lowest.assign(below.lowest.rbegin(), below.lowest.rend());
    profile.x.push_back(best.x[j]);
    profile.misfit.push_back(best.evaluation->misfit);
    profile.lowest.push_back(best.x);
    profile.x.insert(profile.x.end(), above.x.begin(), above.x.end());
    profile.misfit.insert(profile.misfit.end(), above.misfit.begin(), above.misfit.end());
    profile.lowest.insert(profile.lowest.end(), above.lowest.begin(), above.lowest.end());
    return profile;
}

std::pair<double, double> interval(const Profile& profile, double least, double rise) {
    const double level = std::sqrt(rise);
    const auto height = [&](std::size_t i) { return std::sqrt(std::max(0.0, profile.misfit[i] - least)); };
    const auto lowest =
        static_cast<std::size_t>(std::min_element(profile.misfit.begin(), profile.misfit.end()) - profile.misfit.begin());
    const auto crossing = [&](std::size_t in, std::size_t out) {
        return std::lerp(profile.x[in], profile.x[out], (level - height(in)) / (height(out) - height(in)));
    };
    std::pair<double, double> ends{0.0, 1.0};
    for (std::size_t i = lowest; i > 0; --i) {
        if (height(i - 1) >= level) {
            ends.first = crossing(i, i - 1);
            break;
        }
    }
    for (std::size_t i = lowest; i + 1 < profile.x.size(); ++i) {
        if (height(i + 1) >= level) {
            ends.second = crossing(i, i + 1);
            break;
        }
    }
    return ends;
}

std::optional<double> profile_end(Objective& objective, const Run& best, Eigen::Index j, int side, double distance,
                                  const Eigen::VectorXd& valley, double least, double rise, const Eigen::VectorXd& alone) {
    constexpr int most_trials = 16;
    constexpr double farthest = 2.0;  // of the distance before
    const double level = std::sqrt(rise);
    double inside = 0, height_inside = 0;
    Run last = best;
    Eigen::VectorXd away = valley;
    for (int i = 0; i < most_trials && !objective.exhausted(); ++i) {
        Eigen::VectorXd start = (best.x + side * distance * away).cwiseMax(0.0).cwiseMin(1.0);
        start[j] = best.x[j] + side * distance;
        if (start[j] < 0 || start[j] > 1) {
            return std::nullopt;
        }
        const auto lowest =
            lowest_with(objective, {start, moved(last.x, j, start[j], alone), moved(best.x, j, start[j], alone)}, j);
        if (!lowest) {
            return std::nullopt;
        }
        const double height = std::sqrt(std::max(0.0, lowest->evaluation->misfit - least));
        if (height >= level) {
            if (i == 0) {
                return distance;
            }
            double outside = distance, height_outside = height;
            for (const Run& run : close_in(objective, last, *lowest, j, least, rise, alone)) {
                const double there = std::sqrt(std::max(0.0, run.evaluation->misfit - least));
                (there < level ? inside : outside) = std::abs(run.x[j] - best.x[j]);
                (there < level ? height_inside : height_outside) = there;
            }
            return std::lerp(inside, outside, (level - height_inside) / (height_outside - height_inside));
        }
        last = *lowest;
        inside = distance;
        height_inside = height;
        away = side * (lowest->x - best.x) / distance;
        // A little beyond where the straight line comes up.
        distance *= height > 0 ? std::min(farthest, 1.02 * level / height) : farthest;
    }
    return std::nullopt;
}

}  // namespace crampfit

#include "inverse/close_look.hpp"

#include "inverse/differences.hpp"
#include "inverse/profile.hpp"
#include "inverse/sobol_points.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace crampfit {
namespace {

constexpr double first_distance = 1e-5;  // of the box
constexpr double rise = 9;               // of the misfit, in what the noise explains: three standard errors, the others held
constexpr double room = 3;               // for correlation, and from one window to a wider one
constexpr double errors_wide = 12;       // half width in standard errors: a difference is three quarters of one
constexpr double agreement = 1.4;        // of a window with the errors that it finds
constexpr int most_rounds = 10;
constexpr int points_a_parameter = 12;  // of a spread
constexpr int most_profiles = 8;        // in windows of rising width
constexpr double rounding = 1e-9;       // of the box
constexpr double as_good = 0.02;        // of the misfit, in what the noise explains: a seventh of a standard error
constexpr double as_seen = 1;           // the same, a standard error: so far away what a look tells still holds
constexpr double as_promised = 0.5;     // of a rise of the misfit: as far as a run may be off it
constexpr int most_descents = 4;        // from lower points that looks come upon

bool all_told(const Uncertainty& u) { return u.untold.empty() && u.model_variance.size() > 0; }

// As far along each axis, either way, as the misfit needs to rise.
Window as_wide_as_the_misfit_says(const Objective::Evaluate& near, const Eigen::VectorXd& x) {
    const Evaluation here = near(x, 1);
    const double noise =
        std::max(1.0, here.misfit / static_cast<double>(std::max<Eigen::Index>(1, here.residuals.size() - x.size())));
    const auto distance = [&](Eigen::Index j, double side) {
        double d = first_distance;
        for (; d < 1.0; d *= 2) {
            Eigen::VectorXd at = x;
            at[j] = std::clamp(x[j] + side * d, 0.0, 1.0);
            const Evaluation there = near(at, 1);
            if (!there.usable() || there.misfit - here.misfit > rise * noise) {
                break;
            }
        }
        return d;
    };
    Eigen::VectorXd below(x.size()), above(x.size());
    for (Eigen::Index j = 0; j < x.size(); ++j) {
        below[j] = room * distance(j, -1);
        above[j] = room * distance(j, 1);
    }
    return Window::around(x, below, above);
}

Eigen::VectorXd in_box(const Eigen::VectorXd& x) { return x.cwiseMax(0.0).cwiseMin(1.0); }

// Runs at points spread evenly about one, within the reach of the window's differences; what would lie outside the box at its
// bound.
void spread_about(const Eigen::VectorXd& x, CloseLook& look, unsigned seed) {
    const Eigen::VectorXd y = look.window.share(x);
    std::vector<Eigen::VectorXd> points{y};
    for (const Eigen::VectorXd& even : sobol_points(points_a_parameter * static_cast<int>(x.size()), x.size(), seed)) {
        const Eigen::VectorXd away = difference_reach * (2.0 * even.array() - 1.0);
        points.push_back(look.window.share(in_box(look.window.inside(y + away))));
    }
    look.objective.at(points);
}

// Alike to either side: the edge of a jump nearby says nothing of the valley along it.
Window wider(const Window& window, const Eigen::VectorXd& x) {
    const Eigen::VectorXd y = window.share(x);
    const Eigen::VectorXd half = y.cwiseMax(Eigen::VectorXd(1.0 - y.array()));
    return {x, Eigen::MatrixXd(window.axes * (2 * room * half).asDiagonal())};
}

// Along the principal axes of what the look says of the covariance, as they are in its window, so many standard errors wide; no
// wider than by what one step allows, nor than the box. Absent where that is what the look has.
std::optional<Window> along_valley(const CloseLook& look, const Eigen::VectorXd& x) {
    if (look.uncertainty.model_variance.size() == 0) {
        return wider(look.window, x);
    }
    const Eigen::MatrixXd inverse = look.window.axes.inverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> principal(inverse * look.uncertainty.covariance * inverse.transpose());
    Eigen::MatrixXd axes = look.window.axes * principal.eigenvectors();
    bool agrees = true;
    for (Eigen::Index k = 0; k < x.size(); ++k) {
        const double wanted = std::min(2 * errors_wide * std::sqrt(std::max(0.0, principal.eigenvalues()[k])), room);
        const double factor = std::min(wanted, 2.0 / axes.col(k).cwiseAbs().maxCoeff());
        agrees = agrees && factor < agreement && factor > 1 / agreement;
        axes.col(k) *= factor;
    }
    return agrees ? std::nullopt : std::optional<Window>(std::in_place, x, axes);
}

// Whether the others would go on beyond the window where a profile is below a height: at an edge that is not the box's.
bool is_confined(const Profile& profile, const Window& window, double height) {
    constexpr double at_edge = 1e-3, beyond = 0.05;  // of the window
    const auto confines = [&](const Eigen::VectorXd& y) {
        const Eigen::VectorXd here = in_box(window.inside(y));
        for (Eigen::Index k = 1; k < y.size(); ++k) {
            Eigen::VectorXd out = y;
            out[k] += y[k] < at_edge ? -beyond : y[k] > 1 - at_edge ? beyond : 0.0;
            if ((in_box(window.inside(out)) - here).cwiseAbs().maxCoeff() > rounding) {
                return true;
            }
        }
        return false;
    };
    for (std::size_t i = 0; i < profile.x.size(); ++i) {
        if (profile.misfit[i] < height && confines(profile.lowest[i])) {
            return true;
        }
    }
    return false;
}

// Whether a direction goes from bound to bound of the box: no profile that ends within it tells it.
bool goes_through_box(const Untold& direction, const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
    int bounds = 0;
    for (const Eigen::Index j : direction.parameters) {
        bounds += (lower[j] < rounding) + (upper[j] > 1.0 - rounding);
    }
    return bounds >= 2;
}

// The first points of a profile, to either side of its lowest one, that come up to a height.
std::vector<std::size_t> ends_of(const Profile& profile, double height) {
    const auto lowest =
        static_cast<std::size_t>(std::min_element(profile.misfit.begin(), profile.misfit.end()) - profile.misfit.begin());
    std::vector<std::size_t> ends;
    for (std::size_t i = lowest; i-- > 0;) {
        if (profile.misfit[i] >= height) {
            ends.push_back(i);
            break;
        }
    }
    for (std::size_t i = lowest + 1; i < profile.misfit.size(); ++i) {
        if (profile.misfit[i] >= height) {
            ends.push_back(i);
            break;
        }
    }
    return ends;
}

enum class Profiled { taken, goes_on, unconfirmed };

// Takes intervals in the place of those that there are, where some parameters cannot be told: with standard errors as wide and
// correlated as before, as what stands in for one another does so all the way. What ends within the box is told.
void take_intervals(Uncertainty& u, const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
    u.lower_95 = lower;
    u.upper_95 = upper;
    const Eigen::VectorXd factor = ((upper - lower) / (2 * u.quantile)).cwiseQuotient(u.covariance.diagonal().cwiseSqrt());
    u.covariance = factor.asDiagonal() * u.covariance * factor.asDiagonal();
    std::erase_if(u.untold, [&](const Untold& direction) {
        if (goes_through_box(direction, lower, upper)) {
            return false;
        }
        u.message.erase(u.message.find(direction.sentence), direction.sentence.size());
        return true;
    });
}

// Goes along with each parameter that cannot be told, from the best run to its bounds or to where the misfit has risen too far,
// the others where they lower it most. Their intervals go on from there, by what they have where nothing else moves.
void follow_untold(CloseLook& look, const std::vector<std::string>& names, const NearRuns& near) {
    constexpr int halvings = 4;
    Uncertainty& u = look.uncertainty;
    const Eigen::VectorXd x = u.best.x;
    std::vector<bool> is_untold(names.size(), false);
    for (const Untold& direction : u.untold) {
        u.covariance += direction.direction * direction.direction.transpose() / 12.0;
        for (const Eigen::Index j : direction.parameters) {
            is_untold[static_cast<std::size_t>(j)] = true;
        }
    }
    Eigen::VectorXd least = x, most = x, ends_below = x, ends_above = x;
    // What no run says may be as good.
    const auto is_as_good = [&](Eigen::Index j, double at) {
        Eigen::VectorXd start = x;
        start[j] = at;
        const auto there = near.lowest_held(start, j);
        const bool is = !there || there->evaluation->misfit - u.best.evaluation->misfit <= u.rise[j];
        if (there && is) {
            least = least.cwiseMin(there->x);
            most = most.cwiseMax(there->x);
        }
        return is;
    };
    struct Side {
        Eigen::Index j;
        double good;
        double& end;
    };
    std::vector<Side> within;  // that end before the bound
    for (Eigen::Index j = 0; j < x.size(); ++j) {
        for (const double bound : {0.0, 1.0}) {
            double& end = bound < x[j] ? ends_below[j] : ends_above[j];
            if (is_untold[static_cast<std::size_t>(j)] && x[j] != bound) {
                end = bound;
                if (!is_as_good(j, bound)) {
                    within.push_back({j, x[j], end});
                }
            }
        }
    }
    for (int i = 0; i < halvings; ++i) {
        for (Side& side : within) {
            const double middle = 0.5 * (side.good + side.end);
            (is_as_good(side.j, middle) ? side.good : side.end) = middle;
        }
    }
    std::vector<std::string> followers;
    Eigen::VectorXd lower(x.size()), upper(x.size());
    for (Eigen::Index k = 0; k < x.size(); ++k) {
        const bool is_one = is_untold[static_cast<std::size_t>(k)];
        lower[k] = is_one ? ends_below[k] : std::max(0.0, u.lower_95[k] - (x[k] - least[k]));
        upper[k] = is_one ? ends_above[k] : std::min(1.0, u.upper_95[k] + (most[k] - x[k]));
        if (!is_one && upper[k] - lower[k] > room * (u.upper_95[k] - u.lower_95[k])) {
            followers.push_back("'" + names[k] + "'");
        }
    }
    take_intervals(u, lower, upper);
    if (!followers.empty() && !u.untold.empty()) {
        u.message += fmt::format("As that goes to its bounds, {} must follow: runs tell how far, and intervals count it. ",
                                 fmt::join(followers, " and "));
    }
}

// Puts the profile's intervals in the place of those of a parabola, unless one of them goes on beyond its window; what a closer
// look has told of the best point itself stays. Where the parameters cannot be told, `confirm` says whether a misfit at a point
// of the box is what a run finds there.
Profiled take_profile(CloseLook& look, const Uncertainty& closer,
                      const std::function<bool(const Eigen::VectorXd&, double misfit, double rise)>& confirm) {
    Uncertainty& u = look.uncertainty;
    if (u.model_variance.size() == 0) {
        return Profiled::goes_on;
    }
    const bool told = all_told(u);
    double least = look.objective.best()->evaluation->misfit;
    Eigen::VectorXd lower(u.lower_95.size()), upper(u.lower_95.size());
    std::vector<Run> seen;  // on all ways, in the box
    for (Eigen::Index j = 0; j < lower.size(); ++j) {
        const double level = u.rise[j];
        CloseLook::Along way = look.along(j);
        const double scale = way.window.axes(j, 0);
        double below = 0, above = 0;  // distances
        const double own = told ? u.quantile * std::sqrt((all_told(closer) ? closer : u).model_variance[j]) : 0.0;
        if (told) {
            const double variance = u.covariance(j, j) - u.model_variance[j];
            const Eigen::VectorXd valley = way.covariance.col(0) / way.covariance(0, 0);
            const auto end = [&](int side) -> std::optional<double> {
                if (way.objective.best()) {
                    least = std::min(least, way.objective.best()->evaluation->misfit);
                }
                const double half = u.quantile * std::sqrt(variance) / scale;
                const auto found = profile_end(way.objective, way.best, 0, side, half, valley, least, level, way.alone);
                const double edge = way.window.origin[j] + (side < 0 ? 0.0 : scale);
                const bool is_bound = edge < rounding || edge > 1.0 - rounding;
                return found || !is_bound ? found : std::optional(std::abs(edge - u.best.x[j]) / scale);
            };
            const auto low = end(-1), high = low ? end(1) : std::nullopt;
            if (!high) {
                return Profiled::goes_on;
            }
            below = *low * scale;
            above = *high * scale;
        } else {
            constexpr double coarse = 0.2;  // of the window: four of the profile's steps
            const Profile profile = profile_likelihood(way.objective, way.best, 0, coarse, level, way.alone);
            const double lowest = *std::min_element(profile.misfit.begin(), profile.misfit.end());
            if (is_confined(profile, way.window, lowest + level)) {
                return Profiled::goes_on;
            }
            const auto ends = interval(profile, lowest, level);
            const bool from_bound = way.window.origin[j]<rounding, to_bound = way.window.origin[j] + scale> 1.0 - rounding;
            if ((ends.first <= 0.0 && !from_bound) || (ends.second >= 1.0 && !to_bound)) {
                return Profiled::goes_on;
            }
            for (const std::size_t end : ends_of(profile, lowest + level)) {
                const Eigen::VectorXd there = in_box(way.window.inside(profile.lowest[end]));
                if (!confirm(there, profile.misfit[end], profile.misfit[end] - lowest)) {
                    return Profiled::unconfirmed;
                }
            }
            below = (way.best.x[0] - ends.first) * scale;
            above = (ends.second - way.best.x[0]) * scale;
        }
        // The model's own scatter, which no profile of it shows, comes on top.
        lower[j] = std::max(0.0, u.best.x[j] - std::hypot(below, own));
        upper[j] = std::min(1.0, u.best.x[j] + std::hypot(above, own));
        const std::vector<Run> on_way = way.seen();
        seen.insert(seen.end(), on_way.begin(), on_way.end());
    }
    for (Eigen::Index j = 0; j < lower.size(); ++j) {
        std::tie(lower[j], upper[j]) = holding(seen, least, u.rise[j], j, lower[j], upper[j]);
    }
    if (told) {
        // A descent that stays above its lowest point makes a profile narrow, never wide: a parabola that is there has its say.
        if (all_told(closer)) {
            u.covariance = closer.covariance;
            u.model_variance = closer.model_variance;
            u.slope = closer.slope;
            u.lower_95 = closer.lower_95;
            u.upper_95 = closer.upper_95;
        }
        u.lower_95 = u.lower_95.cwiseMin(lower);
        u.upper_95 = u.upper_95.cwiseMax(upper);
        const Eigen::VectorXd sd = u.covariance.diagonal().cwiseSqrt();
        const Eigen::VectorXd wider = ((upper - lower) / (2 * u.quantile)).cwiseQuotient(sd).cwiseMax(1.0);
        u.covariance = wider.asDiagonal() * u.covariance * wider.asDiagonal();
    } else {
        take_intervals(u, lower, upper);
    }
    u.message += told ? "The intervals are the wider of those of the covariance and of the profile likelihood. "
                      : "The intervals are those of the profile likelihood. ";
    return Profiled::taken;
}

bool is_lower(const Run& one, const Run& other, const Uncertainty& about, double by) {
    return one.evaluation->misfit < other.evaluation->misfit - by * about.temperature;
}

}  // namespace

// The window's edges, as a covariance, in the triangular form that begins with the parameter (Cholesky).
CloseLook::Along CloseLook::along(Eigen::Index parameter) const {
    Eigen::PermutationMatrix<Eigen::Dynamic> first(window.axes.rows());
    first.setIdentity();
    first.applyTranspositionOnTheRight(0, parameter);
    const Eigen::MatrixXd shape = first.transpose() * (window.axes * window.axes.transpose()) * first;
    Window along(window.centre(), Eigen::MatrixXd(first * Eigen::MatrixXd(shape.llt().matrixL())));
    const double from = along.origin[parameter], width = along.axes(parameter, 0);
    const double low = std::max(0.0, -from / width), high = std::min(1.0, (1.0 - from) / width);
    along.origin += low * along.axes.col(0);
    along.axes.col(0) *= high - low;
    const auto evaluate = [near = near, along](const Eigen::VectorXd& y, int threads) {
        return near(in_box(along.inside(y)), threads);
    };
    const Eigen::MatrixXd inverse = along.axes.inverse();
    return {along,
            Objective(objective.parameters(), evaluate, std::numeric_limits<int>::max(), objective.threads(), objective.stop()),
            {along.share(uncertainty.best.x), uncertainty.best.evaluation},
            inverse * uncertainty.covariance * inverse.transpose(),
            inverse.col(parameter) / inverse(0, parameter),
            is_exact};
}

std::vector<Run> CloseLook::Along::seen() const {
    std::vector<Run> runs;
    for (const Run& run : objective.runs()) {
        if (is_exact && run.evaluation->usable()) {
            runs.push_back({in_box(window.inside(run.x)), run.evaluation});
        }
    }
    return runs;
}

std::pair<double, double> holding(const std::vector<Run>& runs, double least, double rise, Eigen::Index j, double lower,
                                  double upper) {
    for (const Run& run : runs) {
        if (run.evaluation->misfit <= least + rise) {
            lower = std::min(lower, run.x[j]);
            upper = std::max(upper, run.x[j]);
        }
    }
    return {lower, upper};
}

std::optional<CloseLook> look_close(Objective& objective, const NearRuns& near, const Eigen::VectorXd& x,
                                    const MeasuredCurves& curves, const std::vector<std::string>& names, unsigned seed) {
    // Nothing where the user's stop comes before the first run.
    const auto look = [&](const Window& window) -> std::optional<CloseLook> {
        const auto evaluate = [near = near.run, window](const Eigen::VectorXd& y, int threads) {
            const Eigen::VectorXd wanted = window.inside(y), at = in_box(wanted);
            return (wanted - at).cwiseAbs().maxCoeff() < rounding ? near(at, threads) : Evaluation{"outside the bounds", {}, {}};
        };
        CloseLook here{window,
                       Objective(x.size(), evaluate, std::numeric_limits<int>::max(), near.threads, objective.stop()),
                       {},
                       near.run,
                       near.exact};
        spread_about(x, here, seed);
        if (!here.objective.best()) {
            return std::nullopt;
        }
        here.uncertainty = estimate_uncertainty(here.objective, curves, names, difference_step, window);
        return here;
    };
    const auto first = look(as_wide_as_the_misfit_says(near.run, x));
    if (!first) {
        return std::nullopt;
    }
    CloseLook found = *first;
    const auto goes_beyond_box = [](const CloseLook& l) {
        return !all_told(l.uncertainty) && l.window.axes.cwiseAbs().maxCoeff() > 1.0 + rounding;
    };
    for (int round = 0; round < most_rounds && !goes_beyond_box(found) && !objective.stopped(); ++round) {
        const auto wanted = along_valley(found, x);
        auto here = wanted ? look(*wanted) : std::nullopt;
        if (!here || (all_told(found.uncertainty) && !all_told(here->uncertainty))) {
            break;
        }
        found = std::move(*here);
    }
    const auto confirm = [&](const Eigen::VectorXd& there, double misfit, double rise_there) {
        if (near.exact) {
            return true;
        }
        const auto run = objective.at(there);
        return run && run->usable() && std::abs(run->misfit - misfit) < as_promised * rise_there;
    };
    auto profiled = std::optional(all_told(found.uncertainty) ? found : *first);
    const Uncertainty closest = profiled->uncertainty;
    for (int i = 0; i < most_profiles && profiled && !objective.stopped(); ++i) {
        const Profiled how = take_profile(*profiled, closest, confirm);
        if (how == Profiled::taken) {
            return profiled;
        }
        if (how == Profiled::unconfirmed) {
            found = *first;
            break;
        }
        profiled = look(wider(profiled->window, x));
    }
    if (!near.exact && !found.uncertainty.untold.empty()) {
        follow_untold(found, names, near);
    }
    return found;
}

bool is_lower(const Run& one, const Run& other, const Uncertainty& about) { return is_lower(one, other, about, as_good); }

std::optional<CloseLook> look_and_descend(Objective& objective, const std::function<std::optional<CloseLook>()>& look,
                                          const std::function<void()>& descend) {
    std::optional<CloseLook> close = look();
    const auto is_lower_elsewhere = [&] {  // not at the best run itself, which equilibria known since let seem lower
        const Run &there = close->uncertainty.best, &best = *objective.best();
        return is_lower(there, best, close->uncertainty) && (there.x - best.x).cwiseAbs().maxCoeff() > rounding;
    };
    for (int i = 0; i < most_descents && close && is_lower_elsewhere(); ++i) {
        const Run before = *objective.best();
        objective.at(close->uncertainty.best.x);
        if (!is_lower(*objective.best(), before, close->uncertainty) ||
            !is_lower(close->uncertainty.best, before, close->uncertainty, as_seen)) {
            break;
        }
        descend();
        close = look();
    }
    if (close) {
        Uncertainty& u = close->uncertainty;
        const Eigen::VectorXd way = objective.best()->x - u.best.x;
        u.covariance += way * way.transpose();
        if (u.model_variance.size() > 0) {
            u.model_variance += way.cwiseAbs2();
        }
        u.lower_95 = u.lower_95.cwiseMin((u.lower_95 + way).cwiseMax(0.0));
        u.upper_95 = u.upper_95.cwiseMax((u.upper_95 + way).cwiseMin(1.0));
    }
    return close;
}

}  // namespace crampfit

#include "inverse/residuals.hpp"

#include "datasets/error.hpp"
#include "inverse/curve.hpp"
#include "inverse/force_path.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <numeric>
#include <utility>

namespace crampfit {
namespace {

constexpr double noise_floor = 0.002;      // of a curve's range: a good load cell or ruler, when nothing was said about noise
constexpr double near_stations = 0.25e-3;  // least and largest growth between arrival stations [m]
constexpr double far_stations = 0.5e-3;
constexpr double rows_in_a_window = 2;  // of crack length, at least, where it is averaged
// Rows, in the mean over its places, a line between two: the mean of s^2 + (1 - s)^2 is 1 / 1.5.
constexpr double line_averages = 1.5;
// In standard deviations of what a curve goes from row to row by noise: a step beyond is a jump, hardly ever noise.
constexpr double clear = 5.0;
constexpr double one_place = 1e-3;  // of a window: rows nearer to each other
constexpr double broken = 0.5;      // of the highest force: what breaks stays below from then on

bool measured(const std::vector<double>& column) {
    return std::any_of(column.begin(), column.end(), [](double value) { return !std::isnan(value); });
}

InputError bad_data(const Experiment& experiment, const std::string& key, const std::string& value, const std::string& rule) {
    const std::string file = experiment.data_file.empty() ? "experiment " + experiment.name : experiment.data_file.string();
    return InputError(file, key, value, rule);
}

// A displacement that turns back leaves more than one force at it. Noise may turn it back a little.
void check_rises(const Experiment& experiment, const std::vector<double>& abscissa, double noise, const char* column) {
    const bool is_time = std::string_view(column) == "time";
    const auto text = [&](double value) { return fmt::format("{:g} {}", (is_time ? 1 : 1e3) * value, is_time ? "s" : "mm"); };
    double low = INFINITY, high = -INFINITY, fall = 0;
    std::string fallen;
    for (std::size_t i = 0; i < abscissa.size(); ++i) {
        if (std::isnan(abscissa[i])) {
            continue;
        }
        low = std::min(low, abscissa[i]);
        high = std::max(high, abscissa[i]);
        if (high - abscissa[i] > fall) {
            fall = high - abscissa[i];
            fallen = fmt::format("{} in reading {}, after {}", text(abscissa[i]), i + 1, text(high));
        }
    }
    if (high - low <= 0) {
        throw bad_data(experiment, column, text(low), "all rows that can be compared stand there: two or more must differ");
    }
    constexpr double clearly = 6.0;  // sigmas between the highest and the lowest of many rows at one place
    if (fall > std::max(0.05 * (high - low), clearly * std::numbers::sqrt2 * noise)) {
        throw bad_data(experiment, column, fallen,
                       "must rise through the test, and falls by more than a twentieth of its range; fit a part that rises");
    }
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

// Standard deviation of the rows about the line between their neighbours, robust against jumps: for white noise the median of
// what a node lies off it, in standard deviations of that, is sigma / 1.4826.
double scatter(const Curve& rows) {
    std::vector<double> deviations;
    for (std::size_t i = 1; i + 1 < rows.x().size(); ++i) {
        deviations.push_back(std::abs(rows.off_line(i)));
    }
    return deviations.empty() ? 0.0 : 1.4826 * median(std::move(deviations));
}

// Median of what a curve goes from row to row.
double usual_step(const Curve& rows) {
    std::vector<double> steps{0.0};
    for (std::size_t i = 0; i + 1 < rows.y().size(); ++i) {
        steps.push_back(std::abs(rows.y()[i + 1] - rows.y()[i]));
    }
    return median(std::move(steps));
}

// Of the curve from a twentieth of its range to the next, the median, whatever the noise of single rows.
double usual_slope(const Curve& rows) {
    constexpr int parts = 20;
    const double from = rows.x().front(), width = (rows.x().back() - from) / parts;
    std::vector<double> slopes;
    for (int i = 0; i + 1 < parts && width > 0; ++i) {
        const double middle = from + (i + 1) * width;
        slopes.push_back(std::abs(rows.mean(middle, middle + width) - rows.mean(middle - width, middle)) / width);
    }
    return slopes.empty() ? 0.0 : median(std::move(slopes));
}

// How the crack grew from row to row: steadily, so that the line between two rows says when it came up to a length, or by a
// jump, which was anywhere between them. Where both stand at one place, few rows time it no better than an average over `window`
// would: by the part of it in which that goes through the noise.
class GrowthByRows {
  public:
    GrowthByRows(const Curve& rows, double noise, double window) : rows_(rows) {
        std::vector<double> grown{0.0};  // from row to row, none beyond the ends
        for (std::size_t i = 0; i + 1 < rows.y().size(); ++i) {
            grown.push_back(rows.y()[i + 1] - rows.y()[i]);
        }
        grown.push_back(0.0);
        std::vector<double> steady{0.0};
        for (std::size_t i = 1; i + 1 < grown.size(); ++i) {
            // What is beyond twice the growth of the rows before and after; growth begins and ends between rows as jumps do.
            // Rows at one place are no rows before or after, where the crack has not jumped there.
            const double of_noise = noise * std::max(rows.error(i - 1), rows.error(i));
            const auto is_noise = [&](std::size_t k) {
                return k > 0 && rows.is_step(k - 1) && std::abs(grown[k]) <= clear * of_noise;
            };
            const std::size_t before = is_noise(i - 1) ? i - 2 : i - 1, after = is_noise(i + 1) ? i + 2 : i + 1;
            const double common = std::max(0.0, std::min(grown[before], grown[after]));
            const double jumped = grown[i] > clear * of_noise ? std::max(0.0, 1 - 2 * common / grown[i]) : 0.0;
            const double apart = rows.x()[i] - rows.x()[i - 1];
            // With less growth the line to the rows beside it tells.
            const bool at_one_place = apart <= one_place * window && grown[i] > 2 * of_noise;
            jump_error_.push_back(at_one_place ? window * of_noise / grown[i] : jumped * apart);
            if (jumped < 0.5 && grown[i] > 0 && !is_noise(i)) {
                steady.push_back(grown[i]);
            }
            ends_with_jump_ = jumped >= 0.5;
        }
        steady_step_ = median(std::move(steady));
    }

    // Median growth between two rows of a crack that grows steadily [m].
    double steady_step() const { return steady_step_; }

    // Whether the last row was reached by a jump.
    bool ends_with_jump() const { return ends_with_jump_; }

    // What jumps between two places leave open there [m] or [s].
    double error_between(double from, double to) const {
        const double rounding = 1e-9 * (rows_.x().back() - rows_.x().front());
        double error = 0;
        for (std::size_t i = 0; i < jump_error_.size(); ++i) {
            if (rows_.x()[i] <= to + rounding && rows_.x()[i + 1] >= from - rounding) {
                error = std::max(error, jump_error_[i]);
            }
        }
        return error;
    }

  private:
    const Curve& rows_;
    std::vector<double> jump_error_;  // of an arrival between two rows [m] or [s]
    double steady_step_ = 0;
    bool ends_with_jump_ = false;
};

// What a force must stay below to have broken.
double level_of_break(std::span<const double> force) {
    const auto [least, most] = std::ranges::minmax(force);
    return broken * std::max(std::abs(least), std::abs(most));
}

// The last node at which a force is no lower.
std::size_t last_before_break(std::span<const double> force) {
    const double level = level_of_break(force);
    const auto holds = [&](double f) { return std::abs(f) >= level; };
    return static_cast<std::size_t>(force.rend() - std::find_if(force.rbegin(), force.rend(), holds)) - 1;
}

// Where a force comes down to that for good; its end where it does not.
double break_of(std::span<const double> x, std::span<const double> force) {
    const std::size_t last = last_before_break(force);
    if (last + 1 == force.size()) {
        return x[last];
    }
    const double before = std::abs(force[last]), after = std::abs(force[last + 1]);
    return std::lerp(x[last], x[last + 1], (before - level_of_break(force)) / (before - after));
}

// Of how many rows the nodes on both sides of a place are the mean, at the least.
double rows_beside(const Curve& rows, double place) {
    const std::vector<double>& x = rows.x();
    const auto above = std::clamp<std::ptrdiff_t>(std::lower_bound(x.begin(), x.end(), place) - x.begin(), 1, std::ssize(x) - 1);
    const auto node = static_cast<std::size_t>(above);
    return 1 / std::pow(std::max(rows.error(node - 1), rows.error(node)), 2);
}

// The curve that keeps its last value up to a place beyond it.
Curve continued(std::vector<double> x, std::vector<double> y, double to) {
    if (x.back() < to) {
        x.push_back(to);
        y.push_back(y.back());
    }
    return Curve(x, y);
}

// What an error of the abscissa, one sigma, does to a mean of the curve at a place: its range within two sigmas over their width,
// times sigma: for a straight line slope times sigma, and near a jump it knows of the jump.
double shift_error(const std::function<double(double)>& mean_at, double at, double sigma, double first, double last) {
    double low = INFINITY, high = -INFINITY;
    for (const double shift : {-2.0, -1.0, 0.0, 1.0, 2.0}) {
        const double value = mean_at(std::clamp(at + shift * sigma, first, last));
        low = std::min(low, value);
        high = std::max(high, value);
    }
    const double span = std::min(at + 2 * sigma, last) - std::max(at - 2 * sigma, first);
    return span > 0 ? (high - low) / span * sigma : 0.0;
}

// The same of the rows' average over half a width to either side of a place that is `sigma` off.
double place_error(const Curve& rows, double at, double half, double sigma) {
    const auto mean_at = [&](double x) { return rows.mean(x - half, x + half); };
    return shift_error(mean_at, at, sigma, rows.x().front() + half, rows.x().back() - half);
}

// Of the middle one of three rows each: one row alone does not make it.
double largest(const Curve& rows) {
    const std::vector<double>& y = rows.y();
    double most = 0;
    for (std::size_t i = 0; i < y.size(); ++i) {
        const double before = y[i > 0 ? i - 1 : i], after = y[i + 1 < y.size() ? i + 1 : i];
        most = std::max(most, std::abs(std::max(std::min(before, after), std::min(std::max(before, after), y[i]))));
    }
    return most;
}

// A jump between two rows, `jump` of what the curve goes from one to the next, was anywhere between them. What that does to the
// mean: the jump times the standard deviation of its place, uniform between the rows, over the window.
double sampling_error(const Curve& rows, double from, double to, const std::function<double(double, double)>& jump) {
    double variance = 0;
    for (std::size_t i = 0; i + 1 < rows.x().size(); ++i) {
        if (rows.x()[i] < to && rows.x()[i + 1] > from) {
            variance += std::pow(jump(rows.y()[i], rows.y()[i + 1]) * (rows.x()[i + 1] - rows.x()[i]) / (to - from), 2) / 12;
        }
    }
    return std::sqrt(variance);
}

using Intervals = std::vector<std::pair<double, double>>;  // from, to

// From the first to the last node of each place.
Intervals places_of(const Curve& rows) {
    Intervals places;
    for (std::size_t i = 0; i < rows.x().size(); ++i) {
        if (i > 0 && rows.is_step(i - 1)) {
            places.back().second = rows.x()[i];
        } else {
            places.emplace_back(rows.x()[i], rows.x()[i]);
        }
    }
    return places;
}

// Over which intervals the rows of a tile are averaged: over all of it where rows are close, next to a window; else from first to
// last row of those that lie no farther apart than half of one, at the least a single row. A line across a gap is nobody's
// measurement, and a row's share in the tiles on both sides of it would let their errors go together.
Intervals averaged_in(const Curve& rows, double from, double to, double window) {
    constexpr double close = 0.25, together = 0.5;
    if (rows.widest_step(from, to) <= close * window) {
        return {{from, to}};
    }
    // Beside a jump that rows at one place have seen, they are averaged up to it and from it on, over as long at the least as a
    // row speaks for: a model whose jump is there but for rounding has it so.
    const double least = 0.5 * together * window;
    const Intervals places = places_of(rows);
    Intervals groups;
    for (std::size_t i = 0; i < places.size(); ++i) {
        const auto& [first, last] = places[i];
        if (first < from || first > to || (first == to && to < rows.x().back())) {
            continue;  // it belongs to the next tile
        }
        const bool jumps = i > 0 && rows.at(first) != rows.at(last);
        if (!groups.empty() && first - groups.back().second <= together * window) {
            groups.back().second = jumps ? first : last;
        } else {
            groups.emplace_back(jumps ? std::max(first - least, std::midpoint(places[i - 1].second, first)) : first,
                                jumps ? first : last);
        }
        if (jumps) {
            groups.emplace_back(last, i + 1 < places.size() ? std::min(last + least, std::midpoint(last, places[i + 1].first))
                                                            : last + least);
        }
    }
    return groups;
}

}  // namespace

Comparison::Comparison(const Experiment& experiment, double model_resolution) : longest_(experiment.scene.stop.crack_length) {
    if (experiment.fields) {
        fields_.emplace(experiment);
        remarks_.push_back(fields_->remark());
    }
    if (!fields_ || measured(experiment.data.force) || measured(experiment.data.crack_length)) {
        add_curves(experiment);
    }
    if (fields_) {
        if (const auto& given = experiment.noise.displacement_field) {
            noise_.push_back(fmt::format("displacement_field {:.3g} mm", 1e3 * *given));
        }
        stations_.insert(stations_.end(), fields_->stations().begin(), fields_->stations().end());
    }
    counts_.resize(stations_.size(), 1.0);
    const std::string noise = noise_.empty() ? "as the fields have it" : fmt::format("{}", fmt::join(noise_, ", "));
    remarks_.push_back(fmt::format("{}: noise (one sigma): {}; weight {:g}.", experiment.name, noise, experiment.weight));
    if (std::ranges::all_of(stations_, [](const FitResidual& station) { return station.kind == "crack_length"; })) {
        throw bad_data(experiment, "crack_length", "constant",
                       "must grow by more than its noise, as there is no force to compare");
    }
    know_to(model_resolution);
}

double Comparison::sigma(std::size_t station, double model_resolution) const {
    if (station >= errors_.size()) {
        return stations_[station].sigma;  // a field's
    }
    const auto& [of_data, half, together] = errors_[station];
    const FitResidual& one = stations_[station];
    if (one.kind == "arrival" || one.kind == "break") {
        return std::hypot(of_data[0], model_resolution * one.measured) * std::sqrt(together);
    }
    if (one.kind == "force_at_length") {
        return Eigen::Vector3d(of_data[0], model_resolution * peak_force_,
                               model_resolution * longest_length_ * force_noise_ / length_noise_)
            .norm();
    }
    const bool is_force = one.kind == "force";
    const double of_place = place_error(is_force ? *forces_ : *lengths_, one.at, half, model_resolution * one.at);
    const double of_value = model_resolution * (is_force ? peak_force_ : longest_length_);
    return Eigen::Vector<double, 5>(of_data[0], of_data[1], of_data[2], of_place, of_value).norm();
}

Eigen::VectorXd Comparison::sigmas(double model_resolution) const {
    return Eigen::VectorXd::NullaryExpr(static_cast<Eigen::Index>(stations_.size()), [&](Eigen::Index station) {
        return sigma(static_cast<std::size_t>(station), model_resolution);
    });
}

void Comparison::know_to(double model_resolution) {
    for (std::size_t i = 0; i < stations_.size(); ++i) {
        stations_[i].sigma = sigma(i, model_resolution);
    }
}

void Comparison::add_curves(const Experiment& experiment) {
    const Curves& data = experiment.data;
    if (!measured(data.force) && !measured(data.crack_length)) {
        throw bad_data(experiment, "force", "absent", "a force or a crack_length column is needed to compare a model with");
    }
    by_time_ = !measured(data.displacement);
    by_length_ = by_time_ && !measured(data.time);
    if (by_length_) {
        add_path_stations(experiment);
        return;
    }
    abscissa_ = by_time_ ? data.time : data.displacement;
    tell_of_rows_without_place(experiment);
    const auto& materials = experiment.scene.materials;
    const bool remembers = std::ranges::any_of(materials, [](const auto& material) { return material.second.remembers(); });
    may_relax_ = !by_time_ && remembers;
    const bool moves = !by_time_ && experiment.scene.solver.kind == SolverKind::explicit_dynamics;
    if ((may_relax_ || moves) && measured(data.time)) {
        tell_of_hold(experiment, moves ? "in motion" : "of wood that remembers");
    }
    if (std::ranges::any_of(materials, [](const auto& material) { return material.second.viscoelastic.has_value(); }) &&
        !by_time_ && measured(data.force)) {
        tell_of_creep(experiment);
    }
    abscissa_noise_ = (by_time_ ? experiment.noise.time : experiment.noise.displacement).value_or(0.0);
    check_rises(experiment, abscissa_, abscissa_noise_, by_time_ ? "time" : "displacement");
    if (abscissa_noise_ > 0) {
        noise_.push_back(by_time_ ? fmt::format("time {:.3g} s", abscissa_noise_)
                                  : fmt::format("displacement {:.3g} mm", 1e3 * abscissa_noise_));
    }
    if (measured(data.force)) {
        add_force_stations(experiment);
    }
    if (measured(data.crack_length)) {
        add_crack_stations(experiment);
    }
}

// Rows of a hold count as those of another place do.
void Comparison::count_hold(Curve& rows) const {
    if (may_relax_) {
        rows.count_at_most(rows.usual_rows());
    }
}

double Comparison::noise_of(const Experiment& experiment, const char* what, const Curve& rows,
                            const std::optional<double>& given) {
    const bool force = std::string(what) == "force";
    const auto in_unit = [&](double sigma) { return fmt::format("{:.3g} {}", force ? sigma : 1e3 * sigma, force ? "N" : "mm"); };
    if (given) {
        noise_.push_back(fmt::format("{} {}", what, in_unit(*given)));
        constexpr std::size_t enough = 30;  // rows
        constexpr double too_much = 2;
        const double explained = std::hypot(*given, abscissa_noise_ * usual_slope(rows));
        if (const double seen = scatter(rows); rows.x().size() >= enough && seen > too_much * explained) {
            remarks_.push_back(
                fmt::format("{}: the rows of {} scatter by {} about their neighbours, {:.2g} times the noise that is given.",
                            experiment.name, what, in_unit(seen), seen / explained));
        }
        return *given;
    }
    const auto [low, high] = std::minmax_element(rows.y().begin(), rows.y().end());
    const double range = *high > *low ? *high - *low : std::abs(*high);
    const double sigma = std::max(scatter(rows), noise_floor * range);
    if (!(sigma > 0)) {
        throw bad_data(experiment, what, "0", "is zero throughout; its noise must be given");
    }
    noise_.push_back(fmt::format("{} {}", what, in_unit(sigma)));
    remarks_.push_back(fmt::format("{}: the noise of {} was not given; {} was estimated from the scatter of the rows.",
                                   experiment.name, what, in_unit(sigma)));
    return sigma;
}

void Comparison::add_force_stations(const Experiment& experiment) {
    Curve& rows = forces_.emplace(abscissa_, experiment.data.force);
    const double noise = noise_of(experiment, "force", rows, experiment.noise.force);
    rows.level_steps(noise);
    count_hold(rows);
    peak_force_ = largest(rows);
    tell_of_spikes(experiment, rows);
    const double from = rows.x().front(), to = rows.x().back();
    const int tiles = static_cast<int>(std::lround(1 / smoothing_window));
    const double usual = std::max(noise * rows.usual_error(), usual_step(rows));
    const auto fall = [usual](double before, double after) {
        const double by = std::abs(before) - std::abs(after);
        return by > clear * usual ? by : 0.0;
    };
    for (int i = 0; i < tiles; ++i) {
        const auto averaged =
            averaged_in(rows, std::lerp(from, to, static_cast<double>(i) / tiles),
                        std::lerp(from, to, static_cast<double>(i + 1) / tiles), smoothing_window * (to - from));
        force_tiles_.insert(force_tiles_.end(), averaged.begin(), averaged.end());
    }
    for (const auto& tile : force_tiles_) {
        const double at = std::midpoint(tile.first, tile.second), half = 0.5 * (tile.second - tile.first);
        FitResidual station{.experiment = experiment.name, .kind = "force", .at = at};
        station.measured = rows.mean(tile.first, tile.second);
        const double averaging = rows.error_of_mean(tile.first, tile.second);
        const double of_place = place_error(rows, at, half, abscissa_noise_) * averaging;
        const double of_sampling = half > 0 ? sampling_error(rows, tile.first, tile.second, fall) : 0.0;
        stations_.push_back(station);
        errors_.push_back({{noise * averaging, of_sampling, of_place}, half});
    }
    if (!measured(experiment.data.crack_length)) {  // else arrivals tell of it
        add_break(experiment, rows, noise, clear * usual);
    }
}

// Where one row alone, or few, have seen that the specimen breaks, they say that it has; this says when.
void Comparison::add_break(const Experiment& experiment, const Curve& rows, double noise, double least_fall) {
    constexpr double farthest = 0.1;  // of all that was measured: rows farther apart time nothing
    const std::size_t last = last_before_break(rows.y());
    if (last + 1 == rows.y().size()) {
        return;
    }
    const double x = rows.x()[last], apart = rows.x()[last + 1] - x, before = std::abs(rows.y()[last]);
    const bool at_once = before - std::abs(rows.y()[last + 1]) > std::max(least_fall, broken * peak_force_);
    if (!at_once || apart > farthest * (rows.x().back() - rows.x().front())) {
        return;
    }
    // It was anywhere between both rows, and the force that it took is known to the noise.
    const double of_force = noise * rows.error(last) / before * (x - rows.x().front());
    stations_.push_back({.experiment = experiment.name, .kind = "break", .at = x + 0.5 * apart, .measured = x + 0.5 * apart});
    errors_.push_back({{std::hypot(apart / std::sqrt(12.0), of_force, abscissa_noise_), 0, 0}});
}

// Rows stand by their number: nothing else orders them.
void Comparison::add_path_stations(const Experiment& experiment) {
    const Curves& data = experiment.data;
    if (!measured(data.force) || !measured(data.crack_length)) {
        throw bad_data(experiment, "displacement", "absent",
                       "a displacement or a time column, or force and crack_length both, are needed to compare a model with");
    }
    std::vector<double> number, force, length;
    for (std::size_t i = 0; i < data.force.size(); ++i) {
        if (!std::isnan(data.force[i]) && !std::isnan(data.crack_length[i])) {
            number.push_back(static_cast<double>(number.size()));
            force.push_back(data.force[i]);
            length.push_back(data.crack_length[i]);
        }
    }
    if (number.empty()) {
        throw bad_data(experiment, "crack_length", "absent", "no row has both a force and a crack length");
    }
    const Curve& forces = forces_.emplace(number, force);
    const Curve& lengths = lengths_.emplace(number, length);
    force_noise_ = noise_of(experiment, "force", forces, experiment.noise.force);
    length_noise_ = noise_of(experiment, "crack_length", lengths, experiment.noise.crack_length);
    peak_force_ = largest(forces);
    longest_length_ = largest(lengths);
    const std::size_t most = (number.size() + most_rows - 1) / most_rows;  // that are averaged
    for (std::size_t from = 0, to = 0; from < number.size(); from = to) {
        to = std::min(from + most, number.size());
        const auto count = static_cast<double>(to - from);
        const auto mean = [&](const std::vector<double>& values) {
            return std::accumulate(values.begin() + static_cast<std::ptrdiff_t>(from),
                                   values.begin() + static_cast<std::ptrdiff_t>(to), 0.0) /
                   count;
        };
        stations_.push_back(
            {.experiment = experiment.name, .kind = "force_at_length", .at = mean(length), .measured = mean(force)});
        errors_.push_back({{force_noise_ / std::sqrt(count), 0, 0}});
    }
}

void Comparison::add_crack_stations(const Experiment& experiment) {
    Curve& rows = lengths_.emplace(abscissa_, experiment.data.crack_length);
    const double noise = noise_of(experiment, "crack_length", rows, experiment.noise.crack_length);
    rows.level_steps(noise);
    count_hold(rows);
    longest_length_ = largest(rows);
    add_arrival_stations(experiment, rows, noise);
    add_length_stations(experiment, rows, noise);
}

void Comparison::add_arrival_stations(const Experiment& experiment, const Curve& rows, double noise) {
    const double from = rows.x().front();
    const double to = rows.x().back();
    // Few rows are taken as they are: a window would draw a jump's ends into the rows beside it, which the model's many rows do
    // not show.
    const bool sparse = smoothing_window * static_cast<double>(rows.x().size()) < rows_in_a_window;
    arrival_window_ = sparse ? 0.0 : smoothing_window * (to - from);
    // A crack that ends with a jump is no shorter from there on: all of the window sees the jump, in model and data alike.
    const GrowthByRows growth_by_rows(rows, noise, sparse ? smoothing_window * (to - from) : 0.0);
    arrival_end_ = growth_by_rows.ends_with_jump() ? to + arrival_window_ : to;
    const Curve crack = continued(rows.x(), rows.y(), arrival_end_).smoothed(arrival_window_);
    const double shortest = rows.mean(from, from + arrival_window_);
    // A test may end with a jump, which its last row alone has seen.
    double longest = std::max(rows.mean(to - arrival_window_, to), rows.y().back() - 3 * noise);
    if (longest_ && rows.y().back() >= *longest_) {  // beside where rows are cut off their noise has one side only
        longest = std::min(longest, *longest_ - 2 * noise);
    }
    const double growth = longest - shortest;
    if (!(growth > 3 * noise)) {
        remarks_.push_back(experiment.name +
                           ": the crack did not grow by more than its noise; its length is compared as it stands.");
        return;
    }
    pace_ = (to - from - arrival_window_) / growth;  // between the middles of the two windows
    const double close =
        std::max(std::clamp(growth / 24, near_stations, far_stations), line_averages * growth_by_rows.steady_step());
    const double spacing = std::max(std::min(close, growth / 2), growth / most_arrivals);
    const std::size_t first = stations_.size();
    std::vector<double> reach;  // how far a station shares its rows with others [m] or [s]
    for (int i = 1; shortest + i * spacing < longest; ++i) {
        const double length = shortest + i * spacing;
        const std::optional<double> arrival = crack.arrival(length);
        if (!arrival) {
            continue;
        }
        const double averaged = std::max(line_averages * rows_beside(rows, *arrival),
                                         0.5 + rows.rows(*arrival - 0.5 * arrival_window_, *arrival + 0.5 * arrival_window_));
        const double reach_of_length = noise * std::sqrt(line_averages / averaged);
        const double early = crack.arrival(length - reach_of_length).value_or(from);
        const double late = crack.arrival(length + reach_of_length).value_or(to);
        FitResidual station{.experiment = experiment.name, .kind = "arrival", .at = length, .measured = *arrival};
        // Where noise may hide, within two sigmas, that it came to the length with a jump, that was anywhere between its rows.
        const double first_place = crack.arrival(length - 2 * reach_of_length).value_or(from);
        const double last_place = crack.arrival(length + 2 * reach_of_length).value_or(to);
        const double of_jump = growth_by_rows.error_between(std::min(first_place, *arrival - 0.5 * arrival_window_),
                                                            std::max(last_place, *arrival + 0.5 * arrival_window_));
        // Just before a jump and behind it one side says little.
        const double of_length = std::max(*arrival - early, late - *arrival) / std::sqrt(line_averages);
        const double of_data_place = abscissa_noise_ / std::sqrt(averaged);
        stations_.push_back(station);
        const double least = one_place * smoothing_window * (to - from);
        errors_.push_back({{std::max({std::hypot(of_length, of_data_place), of_jump, least}), 0, 0}});
        reach.push_back(std::max(0.5 * arrival_window_, of_jump));
    }
    const std::vector<FitResidual> alone(stations_.begin() + static_cast<std::ptrdiff_t>(first), stations_.end());
    counts_.resize(first, 1.0);
    for (std::size_t i = first; i < stations_.size(); ++i) {
        const auto together = std::count_if(alone.begin(), alone.end(), [&](const FitResidual& other) {
            return std::abs(other.measured - stations_[i].measured) <= reach[i - first];
        });
        errors_[i].together = static_cast<double>(together);
        counts_.push_back(1.0 / static_cast<double>(together));
    }
}

// Where no arrival has been taken from.
void Comparison::add_length_stations(const Experiment& experiment, const Curve& rows, double noise) {
    std::vector<double> arrivals;
    for (const FitResidual& station : stations_) {
        if (station.kind == "arrival") {
            arrivals.push_back(station.measured);
        }
    }
    std::sort(arrivals.begin(), arrivals.end());
    const double first = rows.x().front(), last = rows.x().back();
    if (arrival_window_ > 0) {
        double from = first;
        const auto tile_up_to = [&](double to) {
            const auto tiles = static_cast<int>(std::lround((to - from) / arrival_window_));
            for (int i = 0; i < tiles; ++i) {
                const auto averaged = averaged_in(rows, std::lerp(from, to, static_cast<double>(i) / tiles),
                                                  std::lerp(from, to, static_cast<double>(i + 1) / tiles), arrival_window_);
                length_tiles_.insert(length_tiles_.end(), averaged.begin(), averaged.end());
            }
        };
        for (const double arrival : arrivals) {
            tile_up_to(arrival - 0.5 * arrival_window_);
            from = arrival + 0.5 * arrival_window_;
        }
        tile_up_to(last);
    } else {
        const Intervals places = places_of(rows);
        for (std::size_t i = 0; i < places.size(); ++i) {  // an arrival is taken from the rows on both sides of it
            const double before = places[i > 0 ? i - 1 : 0].first, after = places[std::min(i + 1, places.size() - 1)].second;
            if (std::none_of(arrivals.begin(), arrivals.end(), [&](double a) { return a >= before && a <= after; })) {
                length_tiles_.push_back(places[i]);
            }
        }
    }
    const double usual = noise * rows.usual_error();
    const auto jump = [&](double before, double after) { return after - before > clear * usual ? after - before : 0.0; };
    for (const auto& [from, to] : length_tiles_) {
        const double at = std::midpoint(from, to), half = 0.5 * (to - from);
        const double averaging = rows.error_of_mean(from, to);
        FitResidual station{.experiment = experiment.name, .kind = "crack_length", .at = at, .measured = rows.mean(from, to)};
        const double of_sampling = half > 0 ? sampling_error(rows, from, to, jump) : 0.0;
        const double of_place = place_error(rows, at, half, abscissa_noise_) * averaging;
        errors_.push_back({{noise * averaging, of_sampling, of_place}, half});
        stations_.push_back(station);
        counts_.push_back(1.0);
    }
}

Eigen::VectorXd Comparison::modelled(const Record& record, double slack_force) const {
    const bool only_fields = fields_ && fields_->stations().size() == stations_.size();
    std::vector<double> values = only_fields ? std::vector<double>{} : on_curves(record, slack_force);
    if (fields_) {
        const std::vector<double> of_fields = fields_->modelled(record);
        values.insert(values.end(), of_fields.begin(), of_fields.end());
    }
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

std::vector<double> Comparison::on_path(const Record& record, double slack_force) const {
    std::vector<double> times, forces, lengths;
    for (const Instant& instant : record.series) {
        times.push_back(instant.time);
        forces.push_back(instant.force);
        lengths.push_back(instant.crack_length);
    }
    if (record.driving.empty()) {  // in motion forces swing; a jump of both stays on the line between its ends
        for (std::vector<double>* column : {&forces, &lengths}) {
            const Curve smooth = Curve(times, *column).smoothed(smoothing_window * (times.back() - times.front()));
            std::ranges::transform(times, column->begin(), [&](double time) { return smooth.at(time); });
        }
    }
    if (record.status == RunStatus::split) {
        forces.push_back(slack_force);
        lengths.push_back(lengths.back());
    }
    const ForcePath path(lengths, forces, length_noise_, force_noise_);
    std::vector<double> values;
    for (std::size_t i = 0; i < errors_.size(); ++i) {
        const FitResidual& station = stations_[i];
        values.push_back(station.measured + force_noise_ * path.distance(station.at, station.measured));
    }
    return values;
}

std::vector<double> Comparison::on_curves(const Record& record, double slack_force) const {
    if (by_length_) {
        return on_path(record, slack_force);
    }
    std::vector<double> abscissa, forces, lengths;
    for (const Instant& instant : record.series) {
        abscissa.push_back(by_time_ ? instant.time : instant.displacement);
        forces.push_back(instant.force);
        lengths.push_back(instant.crack_length);
    }
    Curve force(abscissa, forces);
    if (record.status == RunStatus::split) {
        force.continue_with(slack_force);
    }
    const double end = *std::max_element(abscissa.begin(), abscissa.end());
    const std::size_t rows = abscissa.size();
    const bool ends_with_jump =
        rows > 1 && abscissa[rows - 1] - abscissa[rows - 2] < 1e-8 * end && lengths[rows - 1] > lengths[rows - 2];
    // So does one that ends the run by its length.
    const bool ends_run = longest_ && lengths[rows - 1] >= *longest_ * (1 - 1e-9);
    const Curve length = continued(abscissa, lengths, ends_with_jump || ends_run ? std::max(end, arrival_end_) : end);
    const Curve crack = length.smoothed(arrival_window_);
    const double longest = *std::max_element(crack.y().begin(), crack.y().end());
    std::vector<double> values;
    auto tile = length_tiles_.begin(), force_tile = force_tiles_.begin();
    for (const FitResidual& station : stations_) {
        if (station.kind == "force") {
            values.push_back(force.mean(force_tile->first, force_tile->second));
            ++force_tile;
        } else if (station.kind == "arrival") {
            values.push_back(crack.arrival(station.at).value_or(end + pace_ * (station.at - longest)));
        } else if (station.kind == "break") {
            values.push_back(break_of(abscissa, forces));
        } else if (station.kind == "crack_length") {
            values.push_back(length.mean(tile->first, tile->second));
            ++tile;
        }
    }
    return values;
}

}  // namespace crampfit

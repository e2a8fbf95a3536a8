// What a person should know of data: rows that are left out, stand at one place or go off alone.
#include "inverse/residuals.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace crampfit {

// Nothing says where the model has to be compared with them.
void Comparison::tell_of_rows_without_place(const Experiment& experiment) {
    const Curves& data = experiment.data;
    const auto has = [](const std::vector<double>& column, std::size_t i) { return !column.empty() && !std::isnan(column[i]); };
    std::size_t lost = 0, rows = 0;
    for (std::size_t i = 0; i < abscissa_.size(); ++i) {
        if (has(data.force, i) || has(data.crack_length, i)) {
            ++rows;
            lost += std::isnan(abscissa_[i]) ? 1 : 0;
        }
    }
    if (lost > 0) {
        remarks_.push_back(fmt::format("{}: {} of {} rows have no {} and are left out.", experiment.name, lost, rows,
                                       by_time_ ? "time" : "displacement"));
    }
}

// Force at displacements says nothing of how displacements creep.
void Comparison::tell_of_creep(const Experiment& experiment) {
    constexpr double one_force = 0.05, plain = 0.9;  // of the largest; of the rows
    const std::vector<double>& force = experiment.data.force;
    double most = 0;
    for (const double f : force) {
        most = std::max(most, std::isnan(f) ? 0.0 : std::abs(f));
    }
    double low = INFINITY, high = -INFINITY, largest = 0;  // displacements of these rows; of all
    std::ptrdiff_t held = 0, rows = 0;
    for (std::size_t i = 0; i < force.size(); ++i) {
        if (std::isnan(force[i]) || std::isnan(abscissa_[i])) {
            continue;
        }
        ++rows;
        largest = std::max(largest, std::abs(abscissa_[i]));
        if (std::abs(force[i]) > (1 - one_force) * most) {
            ++held;
            low = std::min(low, abscissa_[i]);
            high = std::max(high, abscissa_[i]);
        }
    }
    if (static_cast<double>(held) > plain * static_cast<double>(rows) && high - low > one_force * largest) {
        remarks_.push_back(fmt::format("{}: {} of {} rows have one force, as in a creep test: what is compared is force at each "
                                       "displacement, which says nothing of how that grows with time.",
                                       experiment.name, held, rows));
    }
}

// Rows at one displacement count as few there, whatever the wood does meanwhile.
void Comparison::tell_of_hold(const Experiment& experiment, const char* where) {
    constexpr double plain = 0.25;  // of the rows
    std::vector<double> places = abscissa_;
    std::erase_if(places, [](double place) { return std::isnan(place); });
    std::ranges::sort(places);
    if (places.empty()) {
        return;
    }
    const double window = smoothing_window * (places.back() - places.front());
    std::ptrdiff_t most = 0;
    double at = 0;
    for (auto first = places.begin(), last = first; first != places.end(); ++first) {
        last = std::find_if(last, places.end(), [&](double place) { return place > *first + window; });
        if (last - first > most) {
            most = last - first;
            at = *first;
        }
    }
    if (static_cast<double>(most) > plain * static_cast<double>(places.size())) {
        remarks_.push_back(
            fmt::format("{}: {} of {} rows stand at {:.3g} mm and count as those of another place do; {} they tell more by time: "
                        "leave displacement out.",
                        experiment.name, most, places.size(), 1e3 * at, where));
    }
}

// A force that goes up or down for one row alone, by more than any other row is: hardly a test's, and it speaks for all of a
// window.
void Comparison::tell_of_spikes(const Experiment& experiment, const Curve& rows) {
    constexpr double plain = 0.5;  // of the highest force
    const std::vector<double>& y = rows.y();
    for (std::size_t i = 1; i + 1 < y.size(); ++i) {
        const double off = y[i] - 0.5 * (y[i - 1] + y[i + 1]);
        if (std::abs(off) > plain * peak_force_ && std::abs(y[i + 1] - y[i - 1]) < 0.1 * std::abs(off)) {
            remarks_.push_back(fmt::format(
                "{}: one row alone, at {:.4g} {}, reads {:.4g} N, and those beside it {:.4g} and {:.4g} "
                "N; leave it out if the load cell did not mean it.",
                experiment.name, (by_time_ ? 1.0 : 1e3) * rows.x()[i], by_time_ ? "s" : "mm", y[i], y[i - 1], y[i + 1]));
        }
    }
}

}  // namespace crampfit

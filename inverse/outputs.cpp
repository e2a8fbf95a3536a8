#include "inverse/outputs.hpp"

#include "inverse/curve.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace crampfit {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

std::vector<double> column(const Record& record, double Instant::*member) {
    std::vector<double> values;
    for (const Instant& instant : record.series) {
        values.push_back(instant.*member);
    }
    return values;
}

double peak_force(const Record& record) {
    double peak = 0;
    for (const Instant& instant : record.series) {
        peak = std::max(peak, std::abs(instant.force));
    }
    return peak;
}

double initial_stiffness(const Record& record) {
    constexpr double begins = 1e-6;  // of the peak
    constexpr double start = 0.02;   // of the way to the peak: what stiffens or gives way later on must not count
    const auto size = [](const Instant& row) { return std::abs(row.force); };
    const Instant& peak = *std::ranges::max_element(record.series, {}, size);
    const auto first = std::ranges::find_if(record.series, [&](const Instant& row) { return size(row) > begins * size(peak); });
    const bool swings = std::ranges::any_of(record.series, [](const Instant& row) { return row.kinetic_energy > 0; });
    const double from = first == record.series.begin() ? first->displacement : std::prev(first)->displacement;
    const double far = swings ? peak.displacement : std::lerp(from, peak.displacement, start);
    const double half = 0.5 * size(peak);
    const double first_length = record.series.front().crack_length;
    double n = 0, u = 0, f = 0, uu = 0, uf = 0;
    double low = INFINITY, high = -INFINITY;
    for (const Instant& row : record.series) {
        const bool beyond = size(row) > half || row.displacement > far || row.crack_length > first_length;
        if (beyond && high > low) {
            break;  // but two places it takes for a slope
        }
        if (row.displacement < from) {
            continue;
        }
        low = std::min(low, row.displacement);
        high = std::max(high, row.displacement);
        n += 1;
        u += row.displacement;
        f += row.force;
        uu += row.displacement * row.displacement;
        uf += row.displacement * row.force;
    }
    return high > low ? (uf - u * f / n) / (uu - u * u / n) : none;
}

double work(const Record& record) {
    double sum = 0;
    for (std::size_t i = 1; i < record.series.size(); ++i) {
        const Instant& from = record.series[i - 1];
        const Instant& to = record.series[i];
        sum += 0.5 * (from.force + to.force) * (to.displacement - from.displacement);
    }
    return sum;
}

double at_displacement(const Record& record, double Instant::*member, double displacement) {
    const std::vector<double> displacements = column(record, &Instant::displacement);
    const double last = *std::max_element(displacements.begin(), displacements.end());
    if (displacement > last * (1 + 1e-9)) {
        const bool split = record.status == RunStatus::split;
        return !split ? none : member == &Instant::force ? 0.0 : record.series.back().*member;
    }
    return Curve(displacements, column(record, member)).at(std::min(displacement, last));
}

struct Arrest {
    double length = none;        // [m]
    double displacement = none;  // at which it moves on; none: not before the end [m]
};

// Between two places, to rounding, where something that holds at the second begins to.
template <class Holds>
double beginning(double from, double to, Holds holds) {
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (from + to);
        (holds(middle) ? to : from) = middle;
    }
    return to;
}

// Ends of rests lie between rows too, and move smoothly with the parameters.
Arrest arrest(const Record& record, int number) {
    constexpr double least_stretch = 0.02;  // of the displacement
    constexpr double slow = 0.1;            // of the mean pace
    const std::vector<double> u = column(record, &Instant::displacement);
    const std::vector<double> a = column(record, &Instant::crack_length);
    const Curve crack(u, a);
    const double pace = (a.back() - a.front()) / (u.back() - u.front());
    if (!(pace > 0)) {
        return {};
    }
    const double stretch = least_stretch * (u.back() - u.front());
    const double little = slow * pace * stretch;
    const auto goes_on = [&](double x) { return crack.at(x + stretch) - crack.at(x) >= little; };
    std::vector<double> places;  // between which the growth over a stretch is linear
    for (const double x : crack.x()) {
        places.push_back(x);
        places.push_back(x - stretch);
    }
    std::sort(places.begin(), places.end());
    int count = 0;
    bool rests = false;
    double before = u.front();
    for (const double x : places) {
        if (x <= before || x + stretch > u.back()) {
            continue;
        }
        const bool moves = goes_on(x);
        if (rests && moves) {
            const double last = beginning(before, x, goes_on), length = crack.at(last);
            before = beginning(last, last + stretch, [&](double there) { return crack.at(there) >= length + little; });
            rests = false;
            if (++count == number) {
                return {length, before};
            }
            continue;
        }
        rests = rests || (!moves && crack.at(x) > a.front());
        before = x;
    }
    return rests && count + 1 == number ? Arrest{a.back(), none} : Arrest{};
}

}  // namespace

double output_of(const Record& record, const StudyOutput& output) {
    switch (output.kind) {
    case StudyOutput::Kind::peak_force:
        return peak_force(record);
    case StudyOutput::Kind::initial_stiffness:
        return initial_stiffness(record);
    case StudyOutput::Kind::work_of_fracture:
        return work(record);
    case StudyOutput::Kind::force_at:
        return at_displacement(record, &Instant::force, output.at);
    case StudyOutput::Kind::crack_length_at:
        return at_displacement(record, &Instant::crack_length, output.at);
    case StudyOutput::Kind::arrest_length:
        return arrest(record, output.number).length;
    case StudyOutput::Kind::arrest_displacement:
        return arrest(record, output.number).displacement;
    }
    throw std::logic_error("an output that no run gives");
}

}  // namespace crampfit

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
    const double half = 0.5 * peak_force(record);
    const double first_length = record.series.front().crack_length;
    double n = 0, u = 0, f = 0, uu = 0, uf = 0;
    double low = INFINITY, high = -INFINITY;
    for (const Instant& row : record.series) {
        const bool beyond = std::abs(row.force) > half || row.crack_length > first_length;
        if (beyond && high > low) {
            break;  // but two places it takes for a slope
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

Arrest arrest(const Record& record, int number) {
    constexpr double least_stretch = 0.02;  // of the displacement
    constexpr double slow = 0.1;            // of the mean pace
    const std::vector<double> u = column(record, &Instant::displacement);
    const std::vector<double> a = column(record, &Instant::crack_length);
    const Curve crack(u, a);
    const double pace = (a.back() - a.front()) / (u.back() - u.front());
    const double stretch = least_stretch * (u.back() - u.front());
    const auto grown = [&](std::size_t from, double length) { return length - a[from] >= slow * pace * stretch; };
    int count = 0;
    for (std::size_t i = 0; pace > 0 && i < u.size() && u[i] + stretch <= u.back(); ++i) {
        if (a[i] <= a.front() || grown(i, crack.at(u[i] + stretch))) {
            continue;
        }
        std::size_t end = i;
        while (end + 1 < u.size() && !grown(end, crack.at(std::min(u[end] + stretch, u.back())))) {
            ++end;
        }
        while (end + 1 < u.size() && !grown(i, a[end + 1])) {
            ++end;
        }
        if (++count == number) {
            return {a[end], end + 1 < u.size() ? u[end] : none};
        }
        i = end;
    }
    return {};
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

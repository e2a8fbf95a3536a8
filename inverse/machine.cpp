#include "inverse/machine.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace crampfit {
namespace {

// What the row between two others would be.
Instant between(const Instant& a, const Instant& b, double s) {
    Instant row = a;
    for (double Instant::*number : {&Instant::time, &Instant::displacement, &Instant::force, &Instant::crack_length, &Instant::G,
                                    &Instant::K_I, &Instant::K_II, &Instant::strain_energy, &Instant::kinetic_energy,
                                    &Instant::fracture_energy, &Instant::external_work}) {
        row.*number = std::lerp(a.*number, b.*number, s);
    }
    row.tip = a.tip + s * (b.tip - a.tip);
    return row;
}

}  // namespace

Record as_recorded(const Record& record, const Machine& machine) {
    Record result = record;
    for (Frame& frame : result.frames) {
        const auto row =
            std::find_if(record.series.begin(), record.series.end() - 1, [&](const Instant& i) { return i.time >= frame.time; });
        frame.displacement += machine.compliance * row->force + machine.displacement_offset;
    }
    result.series.clear();
    result.reactions.clear();  // they go row by row with the series
    result.cracks.clear();
    double reached = -std::numeric_limits<double>::infinity();
    Instant before;
    bool behind = false;
    for (Instant row : record.series) {
        row.displacement += machine.compliance * row.force + machine.displacement_offset;
        row.force += machine.force_offset;
        if (row.displacement >= reached) {
            if (behind && row.displacement > before.displacement) {
                result.series.push_back(
                    between(before, row, (reached - before.displacement) / (row.displacement - before.displacement)));
            }
            result.series.push_back(row);
            reached = row.displacement;
        }
        behind = row.displacement < reached;
        before = row;
    }
    if (behind) {  // the run ends in a jump: it went at least as far
        before.displacement = reached;
        result.series.push_back(before);
    }
    return result;
}

std::vector<double> displacements_of_run(const Record& record, const Machine& machine, const std::vector<double>& recorded) {
    const auto seen = [&](const Instant& row) {
        return row.displacement + machine.compliance * row.force + machine.displacement_offset;
    };
    std::vector<double> displacements;
    for (const double at : recorded) {
        const auto after = std::ranges::find_if(record.series, [&](const Instant& row) { return seen(row) >= at; });
        if (after == record.series.end()) {
            displacements.push_back(std::numeric_limits<double>::infinity());
        } else if (after == record.series.begin()) {
            displacements.push_back(after->displacement);
        } else {
            const Instant& before = *std::prev(after);
            const double share = (at - seen(before)) / (seen(*after) - seen(before));
            displacements.push_back(std::lerp(before.displacement, after->displacement, share));
        }
    }
    return displacements;
}

}  // namespace crampfit

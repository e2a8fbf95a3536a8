#include "inverse/run_end.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "datasets/machine.hpp"
#include "forward/loading.hpp"
#include "inverse/curve.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

namespace crampfit {
namespace {

constexpr double rounding = 1e-9;  // of where a run ends
constexpr double clearly = 3.0;    // sigmas
constexpr double unbounded = std::numeric_limits<double>::infinity();

/// Where runs end at the latest, and by which key of the scene.
struct RunEnd {
    double at = unbounded;  // of the specimen [m], or [s]
    std::string key;

    void take(double other, const std::string& other_key) {
        if (other < at) {
            at = other;
            key = other_key;
        }
    }
};

RunEnd end_of_runs(const Scene& scene, bool by_time) {
    const std::optional<Drive> drive = measured_drive(scene);
    RunEnd end;
    if (scene.stop.displacement && !by_time) {
        end.take(*scene.stop.displacement, "stop.displacement");
    }
    if (scene.stop.displacement && by_time && drive && drive->comes_to(*scene.stop.displacement)) {
        end.take(*scene.stop.displacement / drive->speed, "stop.displacement");
    }
    if (scene.stop.time && by_time) {
        end.take(*scene.stop.time, "stop.time");
    }
    if (scene.stop.time && !by_time && drive) {
        end.take(drive->speed * std::min(*scene.stop.time, drive->until), "stop.time");
    }
    return end;
}

/// A number of the machine: from its lowest to its highest value.
struct Range {
    double low;
    double high;
};

Range range_of(const Study& study, std::size_t experiment, double Machine::*value) {
    const double given = study.experiments[experiment].machine.*value;
    for (const Parameter& parameter : study.parameters) {
        for (std::size_t k = 0; k < parameter.keys.size(); ++k) {
            const auto found = find_machine_number(study, parameter.keys[k], study.file.string(), "(any)");
            if (found && found->experiment == experiment && found->number->value == value) {
                const auto [low, high] =
                    std::minmax({parameter.factor(k) * parameter.lower, parameter.factor(k) * parameter.upper});
                return {low, high};
            }
        }
    }
    return {given, given};
}

// The farthest that the specimen may have been moved when the test recorded this row [m].
double farthest(double displacement, double force, const Range& compliance, const Range& force_offset, const Range& offset) {
    double of_machine = std::isnan(force) ? 0.0 : unbounded;
    for (const double c : {compliance.low, compliance.high}) {
        for (const double zero : {force_offset.low, force_offset.high}) {
            of_machine = std::min(of_machine, c * (force - zero));
        }
    }
    return displacement - (std::isnan(force) ? 0.0 : of_machine) - offset.low;
}

bool is_measured(const std::vector<double>& column) {
    return std::any_of(column.begin(), column.end(), [](double value) { return !std::isnan(value); });
}

std::string file_of(const Experiment& test) {
    return test.scene.file.empty() ? "scene of " + test.name : test.scene.file.string();
}

// Whether a parameter changes how fast the measured displacement is driven.
bool speed_is_fitted(const Study& study, std::size_t experiment) {
    const Scene& scene = study.experiments[experiment].scene;
    const std::optional<Drive> drive = measured_drive(scene);
    const auto changes_speed = [&](const std::string& key) {
        try {
            Scene other = scene;
            set_number(other, key, 2.0 * get_number(scene, key));
            const std::optional<Drive> of_other = measured_drive(other);
            return drive && of_other && of_other->speed != drive->speed;
        } catch (const InputError&) {
            return false;  // a key of another scene, or a number that may not be twice as large: no speed
        }
    };
    return std::ranges::any_of(study.parameters,
                               [&](const Parameter& parameter) { return std::ranges::any_of(parameter.keys, changes_speed); });
}

// A crack that has come to where each run ends is that long from there on, in data and runs alike; of forces from there on no run
// has anything to say. Returns from where on, infinite where it does not come there.
double cut_at_crack_length(const Experiment& test, const std::vector<double>& abscissa, bool by_time, CoveredData& covered) {
    Curves& data = covered.curves;
    if (!test.scene.stop.crack_length || !is_measured(data.crack_length)) {
        return unbounded;
    }
    const double longest = *test.scene.stop.crack_length;
    std::vector<std::pair<double, double>> rows;  // abscissa, crack length
    double most = 0;
    for (std::size_t i = 0; i < abscissa.size(); ++i) {
        if (!std::isnan(abscissa[i]) && !std::isnan(data.crack_length[i])) {
            rows.emplace_back(abscissa[i], data.crack_length[i]);
            most = std::max(most, data.crack_length[i]);
        }
    }
    if (most <= longest + clearly * test.noise.crack_length.value_or(0.0)) {
        return unbounded;
    }
    // It has come there at the row with the fewest others on the wrong side: noise and slips of single rows do not count.
    std::sort(rows.begin(), rows.end());
    const auto is_longer = [&](const auto& row) { return row.second > longest; };
    std::ptrdiff_t wrong = std::count_if(rows.begin(), rows.end(), std::not_fn(is_longer)), fewest = wrong;
    auto there = rows.begin();
    for (auto row = rows.begin(); row != rows.end(); ++row) {
        wrong += is_longer(*row) ? 1 : -1;
        if (wrong < fewest) {
            fewest = wrong;
            there = row + 1;
        }
    }
    if (there == rows.end()) {
        return unbounded;
    }
    const double beyond = there->first;
    const std::string stop_text = fmt::format("{:g} mm", 1e3 * longest);
    if (there == rows.begin()) {
        throw InputError(
            file_of(test), "stop.crack_length", stop_text,
            fmt::format("ends each run before the data begin, whose crack is longer from the first row on, up to {:g} mm",
                        1e3 * most));
    }
    for (std::size_t i = 0; i < abscissa.size(); ++i) {
        data.crack_length[i] = data.crack_length[i] > longest ? longest : data.crack_length[i];  // NaN stays
        if (abscissa[i] >= beyond && !data.force.empty()) {
            data.force[i] = std::nan("");
        }
    }
    covered.remark += fmt::format(
        "{}{}: stop.crack_length = {} ends the runs before the data, whose crack grows to {:.4g} mm: of rows from {:.4g} "
        "{} on counts that it is that long; a later stop would take them in.",
        covered.remark.empty() ? "" : " ", test.name, stop_text, 1e3 * most, (by_time ? 1.0 : 1e3) * beyond,
        by_time ? "s" : "mm");
    return beyond;
}

// The same of rows that have neither a displacement nor a time.
void cut_longer_rows(const Experiment& test, CoveredData& covered) {
    Curves& data = covered.curves;
    if (!test.scene.stop.crack_length || data.force.empty()) {
        return;
    }
    const double end = *test.scene.stop.crack_length;
    double shortest = unbounded, longest = 0;
    std::size_t left_out = 0;
    for (std::size_t i = 0; i < data.crack_length.size(); ++i) {
        const double length = data.crack_length[i];
        if (std::isnan(length) || std::isnan(data.force[i])) {
            continue;
        }
        shortest = std::min(shortest, length);
        longest = std::max(longest, length);
        if (length > end * (1 + rounding)) {
            data.crack_length[i] = data.force[i] = std::nan("");
            ++left_out;
        }
    }
    const std::string stop_text = fmt::format("{:g} mm", 1e3 * end);
    if (shortest > end && left_out > 0) {
        throw InputError(file_of(test), "stop.crack_length", stop_text,
                         fmt::format("ends each run before the data begin, whose crack is {:g} mm long or more", 1e3 * shortest));
    }
    if (left_out > 0) {
        covered.remark = fmt::format(
            "{}: stop.crack_length = {} ends the runs before the data, whose crack grows to {:.4g} mm: rows with a longer crack "
            "({}) are left out; a later stop would take them in.",
            test.name, stop_text, 1e3 * longest, left_out);
    }
}

std::string data_file_of(const Experiment& test) {
    return test.data_file.empty() ? "data of " + test.name : test.data_file.string();
}

// A crack that grew in the test needs one that may in the scene.
void check_growth(const Experiment& test) {
    const auto grows = [](const Crack& crack) { return crack.grows != Growth::none; };
    if (std::ranges::any_of(test.scene.cracks, grows)) {
        return;
    }
    std::vector<double> lengths;
    std::ranges::copy_if(test.data.crack_length, std::back_inserter(lengths), [](double length) { return !std::isnan(length); });
    if (test.scene.cracks.empty() && !lengths.empty() && std::ranges::max(lengths) > 0.0) {
        throw InputError(
            file_of(test), "cracks", "none",
            fmt::format("{} tells how long a crack is: give the scene one, or leave the column out", data_file_of(test)));
    }
    if (lengths.size() < 2) {
        return;
    }
    // The first and the last fifth of the readings: the range of many grows with their number. What scatter there is tells the
    // noise where it is not given.
    const auto few = static_cast<std::ptrdiff_t>(std::max<std::size_t>(1, lengths.size() / 5));
    const double first = std::accumulate(lengths.begin(), lengths.begin() + few, 0.0) / static_cast<double>(few);
    const double last = std::accumulate(lengths.end() - few, lengths.end(), 0.0) / static_cast<double>(few);
    double scatter = 0.0;
    for (std::size_t i = 1; i < lengths.size(); ++i) {
        scatter += std::pow(lengths[i] - lengths[i - 1], 2);
    }
    scatter = std::sqrt(0.5 * scatter / static_cast<double>(lengths.size() - 1));
    const double noise = test.noise.crack_length.value_or(scatter) * std::sqrt(2.0 / static_cast<double>(few));
    if (last - first > clearly * noise) {
        throw InputError(file_of(test), "cracks", test.scene.cracks.empty() ? "none" : "none that grows",
                         fmt::format("the crack of {} grows, from {:g} to {:g} mm: give the scene one that does, or leave the "
                                     "column out",
                                     data_file_of(test), 1e3 * first, 1e3 * last));
    }
}

// Wood that remembers was loaded as fast as the scene loads it. Of a soft machine the rate of the specimen is not known
// beforehand.
void check_rate(const Study& study, std::size_t experiment) {
    constexpr double most_apart = 1.25;  // of the rates
    const Experiment& test = study.experiments[experiment];
    const std::optional<Drive> drive = measured_drive(test.scene);
    const auto relaxes = [](const auto& wood) { return wood.second.viscoelastic.has_value(); };
    const bool stiff = range_of(study, experiment, &Machine::compliance).high == 0.0;
    const Curves& data = test.data;
    if (!drive || !stiff || std::ranges::none_of(test.scene.materials, relaxes) || !is_measured(data.displacement) ||
        !is_measured(data.time)) {
        return;
    }
    std::optional<std::size_t> first, last;  // rows of both, up to where the scene's drive or the test comes to a stand
    double farthest_row = 0;
    for (const double u : data.displacement) {
        farthest_row = std::isnan(u) ? farthest_row : std::max(farthest_row, u);
    }
    for (std::size_t i = 0; i < data.time.size(); ++i) {
        if (std::isnan(data.time[i]) || std::isnan(data.displacement[i])) {
            continue;
        }
        first = first ? first : i;
        last = i;
        if (data.displacement[i] > 0.9 * farthest_row) {
            break;
        }
    }
    if (!first) {
        return;
    }
    const double went = data.displacement[*last] - data.displacement[*first], took = data.time[*last] - data.time[*first];
    if (went > 0 && took > 0 && std::abs(std::log(went / took / drive->speed)) > std::log(most_apart)) {
        throw InputError(
            data_file_of(test), "time", fmt::format("{:.3g} mm in {:.3g} s", 1e3 * went, took),
            fmt::format("{} goes {:.3g} mm in that time: its wood remembers, and has to be loaded as fast as in the test",
                        file_of(test), 1e3 * drive->speed * took));
    }
}

// Where the force was highest the specimen has moved too.
void check_machine(const Study& study, std::size_t experiment, const Range& compliance, const Range& force_offset,
                   const Range& offset) {
    const Curves& data = study.experiments[experiment].data;
    if (data.force.empty() || data.displacement.empty() || compliance.low <= 0) {
        return;
    }
    std::size_t peak = 0;
    double most = 0;
    for (std::size_t i = 0; i < data.force.size(); ++i) {
        if (!std::isnan(data.displacement[i]) && data.force[i] > most) {
            peak = i;
            most = data.force[i];
        }
    }
    if (most > 0 && farthest(data.displacement[peak], most, compliance, force_offset, offset) <= 0) {
        throw InputError(study.file.string(), fmt::format("experiments.{}.compliance", study.experiments[experiment].name),
                         fmt::format("{:g} mm/N and more", 1e3 * compliance.low),
                         fmt::format("must leave the specimen some of the displacement: under the highest force, {:g} N at {:g} "
                                     "mm, the machine alone would give way by {:g} mm",
                                     most, 1e3 * data.displacement[peak], 1e3 * compliance.low * most));
    }
}

// What stands between the specimen and the record of an experiment, wherever its fitted numbers are in their bounds.
struct MachineRanges {
    Range compliance, force_offset, displacement_offset;
};

std::string text_of(const Scene& scene, const RunEnd& end) {
    if (end.key == "stop.crack_length") {
        return fmt::format("{:g} mm", 1e3 * *scene.stop.crack_length);
    }
    return end.key == "stop.time" ? fmt::format("{:g} s", *scene.stop.time)
                                  : fmt::format("{:g} mm", 1e3 * *scene.stop.displacement);
}

// Leaves out the rows that no run need come to.
void cut_rows(const Experiment& test, const std::vector<double>& abscissa, bool by_time, const MachineRanges& machine,
              CoveredData& covered) {
    const Curves& data = test.data;
    const RunEnd end = end_of_runs(test.scene, by_time);
    double first = unbounded, last = -unbounded, beyond = unbounded;  // of the rows, and of those that no run need come to
    for (std::size_t i = 0; i < abscissa.size(); ++i) {
        if (std::isnan(abscissa[i])) {
            continue;
        }
        const double force = data.force.empty() ? std::nan("") : data.force[i];
        const double at =
            by_time ? abscissa[i]
                    : farthest(abscissa[i], force, machine.compliance, machine.force_offset, machine.displacement_offset);
        first = std::min(first, abscissa[i]);
        last = std::max(last, abscissa[i]);
        if (at > end.at * (1 + rounding)) {
            beyond = std::min(beyond, abscissa[i]);
        }
    }
    if (beyond == unbounded) {
        return;
    }
    const char* const unit = by_time ? "s" : "mm";
    const double units = by_time ? 1.0 : 1e3;
    if (beyond <= first) {
        throw InputError(
            file_of(test), end.key, text_of(test.scene, end),
            fmt::format("ends each run before the data begin, which go from {:g} to {:g} {}", units * first, units * last, unit));
    }
    covered.remark +=
        fmt::format("{}{}: {} = {} ends the runs before the data, which go to {:.4g} {}: rows from {:.4g} {} on are left "
                    "out; a later stop would take them in.",
                    covered.remark.empty() ? "" : " ", test.name, end.key, text_of(test.scene, end), units * last, unit,
                    units * beyond, unit);
    for (std::size_t i = 0; i < abscissa.size(); ++i) {
        if (abscissa[i] >= beyond) {
            for (std::vector<double> Curves::*column :
                 {&Curves::time, &Curves::displacement, &Curves::force, &Curves::crack_length}) {
                if (!(covered.curves.*column).empty()) {
                    (covered.curves.*column)[i] = std::nan("");
                }
            }
        }
    }
}

// The first value of a column among the rows from a place on; infinite where there is none.
double first_from(const std::vector<double>& column, const std::vector<double>& abscissa, double from) {
    double first = unbounded;
    for (std::size_t i = 0; i < column.size(); ++i) {
        if (abscissa[i] >= from && !std::isnan(column[i])) {
            first = std::min(first, column[i]);
        }
    }
    return first;
}

// Leaves out the pictures that no run need come to. `grown` is from where on each run's crack has come to its end, as pictures
// are timed.
void cut_pictures(const Experiment& test, const MachineRanges& machine, double grown, CoveredData& covered) {
    MeasuredFields& fields = *covered.fields;
    const bool by_time = !fields.by_displacement;
    const Curves& data = test.data;
    std::optional<Curve> force;  // over the recorded displacement
    if (!by_time && is_measured(data.displacement) && is_measured(data.force)) {
        force.emplace(data.displacement, data.force);
    }
    RunEnd end = end_of_runs(test.scene, by_time);
    const double units = by_time ? 1.0 : 1e3;
    double beyond = unbounded;
    std::size_t left_out = 0;
    for (std::size_t k = 0; k < fields.instants.size(); ++k) {
        const double instant = fields.instants[k];
        const double at = by_time ? instant
                                  : farthest(instant, force ? force->at(instant) : std::nan(""), machine.compliance,
                                             machine.force_offset, machine.displacement_offset);
        if (at > end.at * (1 + rounding) || instant >= grown) {
            beyond = std::min(beyond, instant);
            ++left_out;
            fields.moved[k].assign(fields.moved[k].size(), Vec2::Constant(std::nan("")));
        }
    }
    if (left_out == 0) {
        return;
    }
    if (beyond >= grown) {
        end.key = "stop.crack_length";
    }
    const bool any_left = std::ranges::any_of(fields.moved, [](const std::vector<Vec2>& moved) {
        return std::ranges::any_of(moved, [](const Vec2& point) { return point.allFinite(); });
    });
    if (!any_left) {
        throw InputError(file_of(test), end.key, text_of(test.scene, end),
                         fmt::format("ends each run before the pictures of {}, from {:.4g} {} on", fields.file.string(),
                                     units * beyond, by_time ? "s" : "mm"));
    }
    covered.remark += fmt::format(
        "{}{}: {} = {} ends the runs before {} of {} pictures, from {:.4g} {} on: they are left out; a later stop would take "
        "them in.",
        covered.remark.empty() ? "" : " ", test.name, end.key, text_of(test.scene, end), left_out, fields.instants.size(),
        units * beyond, by_time ? "s" : "mm");
}

}  // namespace

CoveredData covered_data(const Study& study, std::size_t experiment) {
    const Experiment& test = study.experiments[experiment];
    check_growth(test);
    check_rate(study, experiment);
    const MachineRanges machine{range_of(study, experiment, &Machine::compliance),
                                range_of(study, experiment, &Machine::force_offset),
                                range_of(study, experiment, &Machine::displacement_offset)};
    check_machine(study, experiment, machine.compliance, machine.force_offset, machine.displacement_offset);
    const bool by_time = !is_measured(test.data.displacement);
    const std::vector<double>& abscissa = by_time ? test.data.time : test.data.displacement;
    CoveredData covered{test.data, test.fields, ""};
    if (speed_is_fitted(study, experiment)) {
        covered.remark = fmt::format("{}: its speed is fitted: a {} of the scene ends no run.", test.name,
                                     by_time ? "stop.displacement" : "stop.time");
    }
    double grown = unbounded;
    if (is_measured(abscissa)) {
        cut_rows(test, abscissa, by_time, machine, covered);
        grown = cut_at_crack_length(test, abscissa, by_time, covered);
    } else if (is_measured(test.data.crack_length)) {
        cut_longer_rows(test, covered);
    }
    if (covered.fields) {
        const bool as_pictures = by_time != covered.fields->by_displacement;
        const std::vector<double>& other = by_time ? test.data.displacement : test.data.time;
        cut_pictures(test, machine, as_pictures || grown == unbounded ? grown : first_from(other, abscissa, grown), covered);
    }
    return covered;
}

Study with_runs_to_the_data(Study study) {
    for (std::size_t i = 0; i < study.experiments.size(); ++i) {
        if (!speed_is_fitted(study, i)) {
            continue;
        }
        Experiment& test = study.experiments[i];
        const bool by_time = !is_measured(test.data.displacement);
        double last = 0.0;
        const auto take = [&](const std::vector<double>& instants) {
            for (const double instant : instants) {
                last = std::isnan(instant) ? last : std::max(last, instant);
            }
        };
        take(by_time ? test.data.time : test.data.displacement);
        if (test.fields && test.fields->by_displacement != by_time) {
            take(test.fields->instants);
        }
        if (last == 0.0) {
            continue;
        }
        std::optional<double>& stays = by_time ? test.scene.stop.time : test.scene.stop.displacement;
        stays = stays.value_or(last - (by_time ? 0.0 : range_of(study, i, &Machine::displacement_offset).low));
        (by_time ? test.scene.stop.displacement : test.scene.stop.time).reset();
    }
    return study;
}

}  // namespace crampfit

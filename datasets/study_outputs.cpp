#include "datasets/error.hpp"
#include "datasets/study_parts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <stdexcept>

namespace crampfit {
namespace {

using Kind = StudyOutput::Kind;

constexpr int most_arrests = 1000;
constexpr int curve_points = 20;

/// Outputs whose name says all.
const std::vector<std::pair<std::string, Kind>> plain_outputs{{"peak force", Kind::peak_force},
                                                              {"initial stiffness", Kind::initial_stiffness},
                                                              {"work of fracture", Kind::work_of_fracture}};
/// Outputs whose name ends with a displacement.
const std::vector<std::pair<std::string, Kind>> outputs_at{{"force at ", Kind::force_at},
                                                           {"crack length at ", Kind::crack_length_at}};
/// Outputs whose name ends with a number from 1.
const std::vector<std::pair<std::string, Kind>> numbered_outputs{{"arrest length ", Kind::arrest_length},
                                                                 {"arrest displacement ", Kind::arrest_displacement}};
/// Short for outputs at displacements spread over the run.
const std::vector<std::pair<std::string, Kind>> curves{{"force curve", Kind::force_at},
                                                       {"crack length curve", Kind::crack_length_at}};

[[noreturn]] void refuse(const Entry& entry, const std::string& name) {
    std::vector<std::string> offered;
    for (const auto& [known, kind] : plain_outputs) {
        offered.push_back(known);
    }
    for (const auto& [known, kind] : outputs_at) {
        offered.push_back(known + "0.5 mm");
    }
    for (const auto& [known, kind] : numbered_outputs) {
        offered.push_back(known + "1");
    }
    for (const auto& [known, kind] : curves) {
        offered.push_back(known);
    }
    entry.fail(fmt::format("must be one of \"{}\", with any displacement and number{}", fmt::join(offered, "\", \""),
                           suggestion(name, offered)));
}

double displacement_of(const Entry& entry, const std::string& text) {
    const Place place = entry.place();
    const double displacement = parse_quantity(text, dimension::length, place);
    if (!(displacement > 0)) {
        entry.fail("the displacement must be greater than 0");
    }
    return displacement;
}

int number_of(const Entry& entry, const std::string& text) {
    int number = 0;
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, number);
    if (error != std::errc() || rest != end || number < 1 || number > most_arrests) {
        entry.fail(fmt::format("must end with a whole number from 1 to {}", most_arrests));
    }
    return number;
}

std::vector<StudyOutput> curve(const Entry& entry, const std::string& name, Kind kind, const Study& study) {
    double end = 0;
    for (const Scene* scene : scenes_of(study)) {
        if (!scene->stop.displacement) {
            entry.fail(fmt::format("needs stop.displacement in {}, over which it is spread", scene->file.string()));
        }
        end = std::max(end, *scene->stop.displacement);
    }
    const std::string what = name.substr(0, name.rfind(' '));
    std::vector<StudyOutput> points;
    for (int i = 1; i <= curve_points; ++i) {
        const double at = end * i / curve_points;
        points.push_back({fmt::format("{} at {:.6g} mm", what, 1e3 * at), kind, at, 0});
    }
    return points;
}

std::vector<StudyOutput> read_output(const Entry& entry, const Study& study) {
    const std::string name = entry.text();
    for (const auto& [known, kind] : plain_outputs) {
        if (name == known) {
            return {{name, kind, 0, 0}};
        }
    }
    for (const auto& [known, kind] : curves) {
        if (name == known) {
            return curve(entry, name, kind, study);
        }
    }
    for (const auto& [known, kind] : outputs_at) {
        if (name.starts_with(known)) {
            return {{name, kind, displacement_of(entry, name.substr(known.size())), 0}};
        }
    }
    for (const auto& [known, kind] : numbered_outputs) {
        if (name.starts_with(known)) {
            return {{name, kind, 0, number_of(entry, name.substr(known.size()))}};
        }
    }
    refuse(entry, name);
}

}  // namespace

std::vector<StudyOutput> read_outputs(const Entry& list, const Study& study) {
    std::vector<StudyOutput> outputs;
    std::set<std::string> asked;
    for (const Entry& entry : list.list()) {
        if (!asked.insert(entry.text()).second) {
            entry.fail(fmt::format("\"{}\" is asked for twice", entry.text()));
        }
        for (const StudyOutput& output : read_output(entry, study)) {  // may be a point of a curve that is asked for, too
            if (std::ranges::none_of(outputs, [&](const StudyOutput& other) { return other.name == output.name; })) {
                outputs.push_back(output);
            }
        }
    }
    if (outputs.empty()) {
        list.fail("at least one output is needed");
    }
    return outputs;
}

const char* unit_of(StudyOutput::Kind kind) {
    switch (kind) {
    case Kind::peak_force:
    case Kind::force_at:
        return "N";
    case Kind::initial_stiffness:
        return "N/m";
    case Kind::work_of_fracture:
        return "J";
    case Kind::crack_length_at:
    case Kind::arrest_length:
    case Kind::arrest_displacement:
        return "m";
    }
    throw std::logic_error("an output without a unit");
}

const char* name(SensitivityMethod method) {
    switch (method) {
    case SensitivityMethod::local:
        return "local";
    case SensitivityMethod::morris:
        return "morris";
    case SensitivityMethod::sobol:
        return "sobol";
    }
    throw std::logic_error("a sensitivity method without a name");
}

}  // namespace crampfit

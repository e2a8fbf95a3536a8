#include "datasets/machine.hpp"

#include "datasets/error.hpp"
#include "datasets/keys.hpp"

#include <fmt/format.h>

namespace crampfit {

const std::vector<MachineNumber>& machine_numbers() {
    static const std::vector<MachineNumber> numbers{
        {"compliance", &Machine::compliance, limits::compliance, &Curves::displacement},
        {"force_offset", &Machine::force_offset, limits::force_offset, &Curves::force},
        {"displacement_offset", &Machine::displacement_offset, limits::displacement_offset, &Curves::displacement},
    };
    return numbers;
}

std::optional<FoundMachineNumber> find_machine_number(const Study& study, const std::string& key, const std::string& file,
                                                      const std::string& value) {
    const std::vector<std::string> parts = split_key(key, file, value);
    if (parts.front() != "experiments") {
        return std::nullopt;
    }
    const auto fail = [&](const std::string& reason) {
        throw InputError(file, key, value, "is no number of an experiment that can be adjusted: " + reason);
    };
    if (parts.size() != 3) {
        fail("the key must be experiments.NAME.compliance or the like");
    }
    std::size_t experiment = member_number(parts[1], study.experiments.size());
    std::vector<std::string> names;
    for (std::size_t i = 0; i < study.experiments.size(); ++i) {
        names.push_back(study.experiments[i].name);
        experiment = names.back() == parts[1] ? i : experiment;
    }
    if (experiment == study.experiments.size()) {
        fail(fmt::format("there is no experiment \"{}\"{}", parts[1], suggestion(parts[1], names)));
    }
    names.clear();
    for (const MachineNumber& number : machine_numbers()) {
        names.push_back(number.name);
        if (parts[2] != number.name) {
            continue;
        }
        if ((study.experiments[experiment].data.*number.column).empty()) {
            fail(fmt::format("the data have no {} column", number.column == &Curves::force ? "force" : "displacement"));
        }
        return FoundMachineNumber{experiment, &number};
    }
    fail(fmt::format("it must be compliance, force_offset or displacement_offset{}", suggestion(parts[2], names)));
    return std::nullopt;
}

}  // namespace crampfit

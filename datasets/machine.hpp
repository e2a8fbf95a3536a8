#pragma once

#include "datasets/experiment.hpp"
#include "datasets/limits.hpp"

#include <optional>
#include <string>
#include <vector>

namespace crampfit {

/// A number of a Machine.
struct MachineNumber {
    const char* name;  // as a study writes it
    double Machine::*value;
    NumberRule rule;
    std::vector<double> Curves::*column;  // of the data that it takes part in
};

/// All there are.
const std::vector<MachineNumber>& machine_numbers();

/// A number of an experiment's machine, found by its key.
struct FoundMachineNumber {
    std::size_t experiment;
    const MachineNumber* number;
};

/// Finds experiments.NAME.compliance and its like; an experiment goes by its name or its number from 0. Absent for a key of the
/// scenes. Throws InputError, which names `file` and `value`, for an experiment or a number that there is not, and where the
/// experiment's data lack the column that the number takes part in.
std::optional<FoundMachineNumber> find_machine_number(const Study& study, const std::string& key, const std::string& file,
                                                      const std::string& value);

}  // namespace crampfit

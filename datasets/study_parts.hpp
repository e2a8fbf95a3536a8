#pragma once

#include "datasets/experiment.hpp"
#include "datasets/keys.hpp"
#include "datasets/toml_reader.hpp"

#include <vector>

namespace crampfit {

/// The [[parameters]] of a study; each key must be a number of one of the experiments' scenes. Throws InputError.
std::vector<Parameter> read_parameters(const Entry& list, const std::vector<Experiment>& experiments);

}  // namespace crampfit

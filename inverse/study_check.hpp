#pragma once

#include "datasets/experiment.hpp"

namespace crampfit {

/// Throws InputError for a study that cannot be fitted whatever the runs give, or that asks for what is not there yet.
void check_study(const Study& study);

/// Throws InputError for a study of several models, where only one can be run.
void check_one_model(const Study& study);

/// Throws InputError for a study whose sensitivity cannot be told whatever the runs give.
void check_sensitivity_study(const Study& study);

}  // namespace crampfit

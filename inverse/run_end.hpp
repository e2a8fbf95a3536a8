#pragma once

#include "datasets/experiment.hpp"

#include <cstddef>
#include <optional>
#include <string>

namespace crampfit {

/// Data of which every run of the scene has something to say.
struct CoveredData {
    Curves curves;
    std::optional<MeasuredFields> fields;  // no point is followed in a picture that was left out
    std::string remark;                    // on what was left out, for a person; empty: nothing
};

/// The rows of an experiment's data up to where the scene's stop by displacement or time ends each run, whatever the parameters:
/// with the machine's numbers that are fitted anywhere in their bounds, and a compliance by the measured force. What follows a
/// run that ends there is unknown. From where the measured crack is as long as `stop.crack_length` only that counts. A run that
/// ends earlier, as the specimen splits or its crack is that long, goes on as Comparison has it. Pictures are left out as rows
/// are. Throws InputError, naming the stop, where no row or no picture is left.
CoveredData covered_data(const Study& study, std::size_t experiment);

/// With scenes whose runs come to the last row of their data where the speed of the measured edge or body is fitted: at another
/// speed the scene's own stop ends them elsewhere, and what follows would be their last force. A `stop.time` before the data end
/// stays where rows are compared by time, `stop.displacement` where they are by displacement.
Study with_runs_to_the_data(Study study);

}  // namespace crampfit

#pragma once

#include "datasets/record.hpp"

#include <array>
#include <filesystem>

namespace crampfit {

/// A column of the series, in a file and in a table.
struct SeriesColumn {
    const char* name;  // of the dataset
    const char* units;
    const char* header;  // of the table's column
    const char* description;
    double& (*value)(Instant&);
};

/// Columns of the table `series`, in its order.
extern const std::array<SeriesColumn, 13> series_columns;

/// A column of the crack-driving curve but the tip, in a file and in a table.
struct DrivingColumn {
    const char* name;
    const char* units;
    const char* header;
    const char* description;
    double CriticalLoad::*value;
};

extern const std::array<DrivingColumn, 5> driving_columns;

/// The number of the crack whose history is `Record::cracks[further]`, as an index into `Record::paths`.
std::size_t crack_number(const Record& record, std::size_t further);

/// What `read_record` gives, without the frames, which are most of a file.
Record read_record_without_frames(const std::filesystem::path& file);

}  // namespace crampfit

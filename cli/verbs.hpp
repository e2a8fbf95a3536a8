#pragma once

#include "cli/common.hpp"

#include <CLI/CLI.hpp>

#include <functional>

namespace crampfit::cli {

/// A verb of the command: its part of the command line, and what to do once that has been read.
struct Verb {
    CLI::App* arguments;
    std::function<ExitStatus()> run;
};

Verb simulate_verb(CLI::App& command, const CommonOptions& common);
Verb explain_verb(CLI::App& command, const CommonOptions& common);
Verb fit_verb(CLI::App& command, const CommonOptions& common);
Verb evaluate_verb(CLI::App& command, const CommonOptions& common);
Verb segment_verb(CLI::App& command, const CommonOptions& common);
Verb correlate_verb(CLI::App& command, const CommonOptions& common);
Verb track_verb(CLI::App& command, const CommonOptions& common);
Verb camera_verb(CLI::App& command, const CommonOptions& common);
Verb sensitivity_verb(CLI::App& command, const CommonOptions& common);
Verb csv_verb(CLI::App& command, const CommonOptions& common);
Verb report_verb(CLI::App& command, const CommonOptions& common);
Verb bench_verb(CLI::App& command, const CommonOptions& common);

}  // namespace crampfit::cli

#pragma once

#include <string>
#include <vector>

namespace crampfit {

enum class SensitivityStatus {
    finished,
    interrupted,  // by the user
    failed,       // no run ended well
};

const char* name(SensitivityStatus status);

struct StudiedParameter {
    std::string name;
    std::string key;   // several joined by a space
    std::string unit;  // of the numbers here and in the runs
    double initial = 0;
    double lower = 0;
    double upper = 0;
};

struct StudiedOutput {
    std::string name;
    std::string unit;  // SI
};

/// How one output answers to one parameter.
struct SensitivityIndex {
    std::string output;
    std::string parameter;
    std::string method;  // local, morris, sobol
    double value = 0;
    double lower_95 = 0;
    double upper_95 = 0;
    std::string kind;  // derivative: output's SI unit for each unit of the parameter; mu_star, sigma: output's SI unit for the
                       // whole way from lower to upper; elasticity, first, total: pure numbers
};

/// One forward evaluation of the study.
struct SensitivityRun {
    std::vector<double> parameters;  // in their units
    std::vector<double> outputs;     // SI; not a number where the run has no such output
    std::string status;
    double seconds = 0;
};

/// What a sensitivity study gives.
struct Sensitivity {
    SensitivityStatus status = SensitivityStatus::finished;
    std::string message;  // for a person: failed runs, what the numbers rest on
    std::vector<StudiedParameter> parameters;
    std::vector<StudiedOutput> outputs;
    std::vector<SensitivityIndex> indices;
    std::vector<SensitivityRun> runs;
    double seconds = 0;  // wall time [s]
    unsigned seed = 0;
    std::string study_text;
    std::string scene_settings;  // what --set changed in the scenes, as it stands on a command line
};

}  // namespace crampfit

#pragma once

#include "datasets/scene.hpp"

#include <optional>
#include <string>
#include <vector>

namespace crampfit {

/// Curves measured in a test, row by row. A column that was not measured is empty; a gap is a NaN.
struct Curves {
    std::vector<double> time;          // [s]
    std::vector<double> displacement;  // [m]
    std::vector<double> force;         // [N]
    std::vector<double> crack_length;  // [m]
};

/// Standard deviation of the measurement, one sigma.
struct Noise {
    std::optional<double> force;         // [N]
    std::optional<double> crack_length;  // [m]
    std::optional<double> displacement;  // [m]
    std::optional<double> time;          // [s]
};

/// What a test gave, and the scene that models it.
struct Experiment {
    std::string name;
    Scene scene;
    Curves data;
    Noise noise;
    double weight = 1.0;
    std::filesystem::path data_file;
};

enum class Scale { linear, logarithmic };

struct Prior {
    double mean = 0;  // SI
    double sd = 0;    // SI
};

struct Parameter {
    std::string name;
    std::vector<std::string> keys;  // dotted keys of the scenes, such as materials.EW.toughness
    double initial = 0;             // SI
    double lower = 0;               // SI
    double upper = 0;               // SI
    std::string unit;               // as the study wrote it; results are shown in it. Empty: a pure number
    double unit_factor = 1;         // SI per `unit`
    Scale scale = Scale::linear;
    std::optional<Prior> prior;
};

struct OptimizerChoice {
    std::string method = "auto";  // auto | ceres | an NLopt name
    int starts = 1;
    int max_runs = 500;
};

struct UncertaintyChoice {
    bool profile = false;
    int posterior = 0;  // samples
};

/// What is fitted to what.
struct Study {
    std::string title;
    std::vector<Experiment> experiments;
    std::vector<Parameter> parameters;
    OptimizerChoice optimizer;
    UncertaintyChoice uncertainty;
    std::filesystem::path file;
    std::string text;
};

} // namespace crampfit

#pragma once

#include "datasets/crack_paths.hpp"
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
    std::optional<double> force;                    // [N]
    std::optional<double> crack_length;             // [m]
    std::optional<double> displacement;             // [m]
    std::optional<double> time;                     // [s]
    std::optional<double> displacement_field = {};  // of each component, at each point [m]; absent: as the file has it
};

/// Displacement fields of a test's pictures against that of the unloaded specimen, in the specimen's coordinates. Each value is
/// the mean over a subset of pixels, which counts as a square.
struct MeasuredFields {
    std::filesystem::path file;
    std::filesystem::path times_file;  // of the pictures' instants; empty: the first has them
    std::vector<Vec2> places;          // [points] middles of the subsets, undeformed [m]
    std::vector<double> instants;      // [pictures] rising: times [s], or displacements of the loading [m]
    bool by_displacement = false;
    std::vector<std::vector<Vec2>> moved;    // [pictures][points] [m]; not a number where the point was lost
    std::vector<std::vector<double>> sigma;  // [pictures][points] standard error of each component [m]
    double subset = 0;                       // edge [m]
    double rotation = 0;                     // of the subsets, counter-clockwise [rad]
    int order = 1;                           // of the warp that each subset was followed with
    bool camera_moves = true;                // against the specimen, a little, as a whole: says nothing then
};

/// What stands between the specimen and what the test recorded.
struct Machine {
    double compliance = 0;           // displacement recorded for each force, beside the specimen's [m/N]
    double force_offset = 0;         // recorded where there is no force [N]
    double displacement_offset = 0;  // recorded where there is no displacement [m]
};

/// What a test gave, and the scene that models it.
struct Experiment {
    std::string name;
    Scene scene;
    Curves data;  // none of its columns, where fields are all there is
    std::optional<MeasuredFields> fields = {};
    std::optional<Photograph> photograph = {};  // to look at: no fit rests on it
    Noise noise;
    Machine machine;
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
    std::vector<std::string> keys;  // dotted keys: of the scenes, such as materials.EW.toughness, or of an experiment's machine
    std::vector<double> factors;    // [keys] times the parameter's value, that of each key; empty: all 1
    double initial = 0;             // SI
    double lower = 0;               // SI
    double upper = 0;               // SI
    std::string unit;               // as the study wrote it; results are shown in it. Empty: a pure number
    double unit_factor = 1;         // SI per `unit`
    Scale scale = Scale::linear;
    std::optional<Prior> prior;

    double factor(std::size_t key) const { return factors.empty() ? 1.0 : factors[key]; }
};

/// What a residual r, in standard deviations, adds to the misfit.
enum class Loss {
    squares,  // r^2
    huber,    // r^2 up to a bend, then straight (Huber 1964)
    cauchy,   // c^2 ln(1 + (r/c)^2): far outliers hardly count
};

struct OptimizerChoice {
    std::string method = "auto";  // auto | ceres | an NLopt name
    Loss loss = Loss::squares;
    int starts = 1;
    int max_runs = 500;
};

struct UncertaintyChoice {
    bool profile = false;
    int posterior = 0;  // samples
};

/// A number that a run gives, as a sensitivity study asks for it.
struct StudyOutput {
    enum class Kind {
        peak_force,           // largest |force| [N]
        initial_stiffness,    // slope of force over displacement before the crack moves [N/m]
        work_of_fracture,     // area under force over displacement [J]
        force_at,             // at a displacement [N]
        crack_length_at,      // at a displacement [m]
        arrest_length,        // at which the growing crack comes to stand for the n-th time [m]
        arrest_displacement,  // at which it moves on from there [m]
    };

    std::string name;  // as the study wrote it
    Kind kind = Kind::peak_force;
    double at = 0;   // displacement [m]
    int number = 0;  // of the arrest, from 1
};

const char* unit_of(StudyOutput::Kind kind);  // SI

enum class SensitivityMethod { local, morris, sobol };

const char* name(SensitivityMethod method);

struct SensitivityChoice {
    SensitivityMethod method = SensitivityMethod::local;
    int samples = 0;  // sobol: rows of each of the two sample matrices; morris: trajectories; 0: as many as the method needs
};

/// What a scene must be asked for so that its record can be compared with measured fields: the displacement of each subset, of
/// `samples_a_subset` places in it, as correlation averages them, at each picture's instant.
Probes probes_for(const MeasuredFields& fields);

/// How the displacements at these places make that of the subset: what fitting them with a polynomial of the warp's order gives
/// at its middle [samples_a_subset].
std::vector<double> subset_weights(int order);

inline constexpr int samples_a_side = 5;
inline constexpr int samples_a_subset = samples_a_side * samples_a_side;

/// One of several models that a study compares: its scenes differ by the value of one key.
struct ModelChoice {
    std::string name;           // the value
    std::vector<Scene> scenes;  // [experiments]
};

/// What is fitted to what, or, for a sensitivity study, which outputs are asked for.
struct Study {
    std::string title;
    std::vector<Experiment> experiments;
    std::optional<Scene> scene;  // of a study without data; `experiments` is empty then
    std::vector<StudyOutput> outputs;
    std::vector<Parameter> parameters;
    OptimizerChoice optimizer;
    UncertaintyChoice uncertainty;
    SensitivityChoice sensitivity;
    std::string compared_key;          // of the scenes
    std::vector<ModelChoice> models;   // to be compared; empty where the scenes are taken as they are
    std::optional<double> time_limit;  // of one run of one scene [s]; absent: none
    std::vector<std::pair<std::string, std::string>> scene_settings;  // --set for the scenes, as they were given
    std::filesystem::path file;
    std::string text;
};

/// The scenes that a study runs: the one that it stands on, or those of its experiments.
std::vector<const Scene*> scenes_of(const Study& study);

}  // namespace crampfit

#pragma once

#include "datasets/experiment.hpp"
#include "datasets/fit.hpp"
#include "datasets/record.hpp"
#include "datasets/scene.hpp"
#include "datasets/sensitivity.hpp"

#include <filesystem>
#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

namespace crampfit {

/// Overrides of a file's keys, as --set gives them: dotted key and TOML value or bare text.
using Overrides = std::vector<std::pair<std::string, std::string>>;

/// Reads and checks a scene (INTERFACE.md). Throws InputError for anything that is not right.
Scene read_scene(const std::filesystem::path& file, const Overrides& overrides = {});
Scene parse_scene(const std::string& text, const std::filesystem::path& file, const Overrides& overrides = {});

/// Reads and checks a study, its scenes and its data.
Study read_study(const std::filesystem::path& file, const Overrides& overrides = {});

/// Sets one number of a checked scene by its dotted key, such as materials.EW.toughness or cracks.0.advance, in SI; the same
/// rules hold as when reading. Throws InputError for a key that is no number of this scene.
void set_number(Scene& scene, const std::string& key, double value);
double get_number(const Scene& scene, const std::string& key);

/// Curves with units in the header: time [s], displacement [mm], force [N], crack_length [mm]; any subset, any unit.
Curves read_curves(const std::filesystem::path& file);
void write_curves(const Curves& curves, const std::filesystem::path& file);

// HDF5: self-describing (units, shapes, program version, input text), written under a temporary name and renamed when whole.
void write(const Specimen& specimen, const std::filesystem::path& file);
void write(const Record& record, const std::filesystem::path& file);
void write(const Fit& fit, const std::filesystem::path& file);
void write(const Sensitivity& sensitivity, const std::filesystem::path& file);
Specimen read_specimen(const std::filesystem::path& file);
Record read_record(const std::filesystem::path& file);
Fit read_fit(const std::filesystem::path& file);
Sensitivity read_sensitivity(const std::filesystem::path& file);

/// Prints a table of any of these files as CSV (INTERFACE.md: series, path, crack1, parameters, runs, residuals, indices, ...).
void print_table(const std::filesystem::path& file, const std::string& table, std::ostream& out);

}  // namespace crampfit

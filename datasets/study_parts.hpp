#pragma once

#include "datasets/experiment.hpp"
#include "datasets/keys.hpp"
#include "datasets/toml_reader.hpp"

#include <string>
#include <vector>

namespace crampfit {

/// What a parameter's key leads to: a number in each scene that has it, or of an experiment's machine. Empty for a key that leads
/// to no number. A number may have several keys (edges.top and edges.0), which lead to the same place.
std::vector<const double*> numbers_at(const Study& study, const std::string& key);

/// The parameter with a number among these, if any.
const Parameter* owner_of(const std::vector<const double*>& numbers, const std::vector<Parameter>& parameters,
                          const Study& study);

/// The [[parameters]] of a study; each key must be a number of one of its scenes or of an experiment's machine. `initial` may be
/// left out where the study stands on a scene alone, and is the scene's value then. Throws InputError.
std::vector<Parameter> read_parameters(const Entry& list, const Study& study);

/// The `outputs` of a study. Throws InputError.
std::vector<StudyOutput> read_outputs(const Entry& list, const Study& study);

/// How pictures of `rows` pixels' height lie on the specimen: `pixel`, `offset` and `rotation` of a table, or as the file of what
/// was seen in them has it, whose `pixel` is used where the table gives none. Throws InputError.
Placement read_placement(const Entry& entry, const std::optional<double>& pixel, int rows);

/// The `photograph` of an experiment: what to draw its crack over, and the file that `crampfit track` wrote. The picture itself
/// is not read. Throws InputError.
Photograph read_photograph(const Entry& entry, const Scene& scene);

/// The `fields` of an experiment: the file that `crampfit correlate` wrote, or a table that also says how the picture lies on the
/// specimen. Throws InputError.
MeasuredFields read_measured_fields(const Entry& entry, const Scene& scene);

}  // namespace crampfit

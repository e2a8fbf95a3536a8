#pragma once

#include "datasets/numbers.hpp"
#include "datasets/scene.hpp"
#include "datasets/toml_reader.hpp"

#include <map>
#include <string>
#include <vector>

namespace crampfit {

// The sections of a scene, one reader each. All throw InputError.

Model read_model(const Entry& model);
std::map<std::string, Material> read_materials(const Entry& materials, PlaneCondition plane);
SpecimenPlan read_specimen_plan(const Entry& specimen, const std::map<std::string, Material>& materials);
std::vector<Edge> read_edges(const Entry& edges, const Vec2& specimen_size);
std::vector<Body> read_bodies(const Entry& bodies);
std::vector<Crack> read_cracks(const Entry& cracks, const Vec2& specimen_size);
SolverChoice read_solver(const Entry& solver);
Stop read_stop(const Entry& stop);
Output read_output(const Entry& output);

/// A circle or a polygon, from a table that has one of these two keys (among others).
Shape read_shape(const Entry& parent);

/// How the density exponents that the scene gives are called, with what they may be.
std::map<std::string, SceneNumber> exponent_numbers(const DensityExponents& exponents);

/// The elastic constants of a material of this kind by key, with what each may be.
std::map<std::string, SceneNumber> elastic_numbers(const Material& material);

/// The numbers of a material's memory by key within the material, such as yield_stress and prony.0.g.
std::map<std::string, SceneNumber> memory_numbers(const Material& material);

/// Throws InputError when latewood and transition together are longer than a ring.
void check_rings(const Rings& rings, const Place& place, const std::string& value);

}  // namespace crampfit

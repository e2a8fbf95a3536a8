#pragma once

#include "forward/discretisation.hpp"

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace crampfit {

/// How the wood of a discretisation changes with one number of the scene's materials ("materials.EW.E"), however it is mixed in a
/// cell: by central differences of the map from the numbers to the wood, which is smooth and in closed form, with a step of
/// 1e-5 of the number. Their error is of the order of 1e-10.
class MaterialSlope {
  public:
    /// Of these numbers. Throws InputError where the scene has none of that name. `body` must outlive them.
    static std::vector<MaterialSlope> of(const Scene& scene, const std::vector<std::string>& keys, const Discretisation& body);

    /// Of the same numbers for a part of the specimen that has its lower left corner there. `part` must outlive them.
    static std::vector<MaterialSlope> of(const std::vector<MaterialSlope>& whole, const Discretisation& part, const Vec2& corner);

    /// Stiffness of a cell's points [Pa / the number's unit].
    const Eigen::Matrix3d& stiffness(int cell) const { return stiffness_[cell]; }

    /// `uniaxial_moduli` of a cell's points [Pa / the number's unit].
    const Vec2& moduli(int cell) const { return moduli_[cell]; }

    /// Of a piece of an uneven cell.
    const Unevenness& unevenness(int cell, const PointBox& box) const;

    /// The map with the number more or less by `step`.
    const MaterialMap& materials(bool more) const { return more ? more_ : less_; }
    double step() const { return step_; }

    /// Of `opening_modulus`.
    double opening_modulus(const Vec2& centre, const Vec2& half, const Vec2& along) const;

  private:
    MaterialSlope(const Scene& scene, const std::string& key, const Discretisation& body);
    MaterialSlope(const MaterialSlope& whole, const Discretisation& part, const Vec2& corner);
    static void look_at_cells(std::vector<MaterialSlope>& numbers, const Discretisation& body);
    Unevenness between(const Unevenness& less, const Unevenness& more) const;

    double step_;
    std::shared_ptr<const Scene> more_scene_, less_scene_;
    MaterialMap more_, less_;
    std::vector<Eigen::Matrix3d> stiffness_;  // [cells]
    std::vector<Vec2> moduli_;                // [cells]
    const Discretisation* body_;
    std::vector<int> uneven_of_cell_;                                 // [cells] the place of its unevenness, or -1
    std::vector<Unevenness> uneven_;                                  // of whole cells
    mutable std::map<std::pair<int, PointBox>, Unevenness> in_part_;  // of their pieces, as they were asked for
};

}  // namespace crampfit

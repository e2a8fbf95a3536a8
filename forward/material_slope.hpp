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
    /// Throws InputError where the scene has no such number. `body` must outlive this.
    MaterialSlope(const Scene& scene, const std::string& key, const Discretisation& body);

    /// The same number for a part of the specimen that has its lower left corner there. `part` must outlive this.
    MaterialSlope(const MaterialSlope& whole, const Discretisation& part, const Vec2& corner);

    /// Stiffness of a cell's points [Pa / the number's unit].
    const Eigen::Matrix3d& stiffness(int cell) const { return stiffness_[cell]; }

    /// Of a piece of an uneven cell.
    const Unevenness& unevenness(int cell, const PointBox& box) const;

    /// The map with the number more or less by `step`.
    const MaterialMap& materials(bool more) const { return more ? more_ : less_; }
    double step() const { return step_; }

    /// Of `opening_modulus`.
    double opening_modulus(const Vec2& centre, const Vec2& half, const Vec2& along) const;

  private:
    void find_stiffness();
    double step_;
    std::shared_ptr<const Scene> more_scene_, less_scene_;
    MaterialMap more_, less_;
    std::vector<Eigen::Matrix3d> stiffness_;  // [cells]
    const Discretisation* body_;
    mutable std::map<std::pair<int, PointBox>, Unevenness> unevenness_;  // as they were asked for
};

}  // namespace crampfit

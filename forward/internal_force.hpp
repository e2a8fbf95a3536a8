#pragma once

#include "forward/discretisation.hpp"

#include <vector>

namespace crampfit {

/// Adds the internal forces of all points to `force` (one entry a field): f_k -= V P grad N_k, with the stress P from the
/// displacements. Cells that hold all their points on four common fields are taken a cell at a time, side by side; the others,
/// next to a crack or a cutout, point by point.
class InternalForce {
  public:
    InternalForce(const Discretisation& body, bool rotates);

    /// Call after points changed their fields.
    void sort_cells();

    void add(const std::vector<Vec2>& displacement, std::vector<Vec2>& force) const;

    /// Strain energy of all points [J].
    double energy(const std::vector<Vec2>& displacement) const;

  private:
    // Adds the forces of the whole cells, or, without `force`, returns their strain energy [J].
    template <int PointsPerCell, bool Rotates>
    double visit_whole_cells(const std::vector<Vec2>& displacement, std::vector<Vec2>* force) const;
    double visit_whole_cells(const std::vector<Vec2>& displacement, std::vector<Vec2>* force) const;

    const Discretisation& body_;
    bool rotates_;
    std::vector<int> whole_cells_;
    std::vector<int> loose_points_;
};

} // namespace crampfit

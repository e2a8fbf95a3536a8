#pragma once

#include "datasets/displacement_field.hpp"
#include "imaging/gray_picture.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace crampfit {

/// How far it is from a place to the picture's border in a direction of length one [px].
double to_border(const Eigen::Vector2d& from, const Eigen::Vector2d& direction, int columns, int rows);

/// The specimen as a picture shows it before an even dark ground, which reaches in from the picture's corners, and its notches,
/// which do from its sides. All of the picture where there is none.
class Silhouette {
  public:
    explicit Silhouette(const FinePicture& picture);

    /// 0 on the ground [rows x columns].
    const std::vector<std::uint8_t>& mask() const { return mask_; }

    /// How far it is from a place of the specimen to its edge, or to the picture's border, in a direction of length one [px].
    double to_edge(const Eigen::Vector2d& from, const Eigen::Vector2d& direction) const;

    /// The same of where a crack began that comes from about there: at a notch's root, if one lies within 15 degrees.
    double to_mouth(const Eigen::Vector2d& tip, const Eigen::Vector2d& direction) const;

    /// Of each point of a lattice, whether its subset or those beside it may reach over the edge.
    std::vector<bool> subsets_at_edge(const PointLattice& lattice, int subset) const;

  private:
    int columns_, rows_;
    std::vector<std::uint8_t> mask_;
};

}  // namespace crampfit

#pragma once

#include "forward/deformation.hpp"

#include <span>

namespace crampfit {

/// Elasticity of a rectangle of wood in a cell whose displacement is bilinear between the cell's corners. With F the gradient in
/// the rectangle's middle, R its turn, c = u_0 - u_1 - u_2 + u_3 of the corners, d = R^T c and e Biot's strain (without `rotates`
/// the small strain and R = 1) its energy is e . S e / 2 + e . G d + d . H d / 2.
class BilinearPiece {
  public:
    struct Wood {
        Eigen::Matrix3d S = Eigen::Matrix3d::Zero();                          // [J]
        Eigen::Matrix<double, 3, 2> G = Eigen::Matrix<double, 3, 2>::Zero();  // [N]
        Mat2 H = Mat2::Zero();                                                // [N/m]
    };

    /// `middle`: of the rectangle, in cells from the cell's lower left corner. `fields`: those that move the corners.
    BilinearPiece(const Wood& wood, const Vec2& middle, const Vec2& cell, std::span<const int> fields,
                  const std::vector<Vec2>& displacement, bool rotates);

    double energy() const { return 0.5 * (s_.dot(strain_) + t_.dot(d_)); }  // [J]

    /// Slope of the energy by the displacements [N].
    Eigen::Matrix<double, 8, 1> force() const;

    /// Slope of that force [N/m]; `geometric` as in `elastic_tangent`.
    Eigen::Matrix<double, 8, 8> tangent(bool geometric) const;

  private:
    // Differentials go by R^T dF, counted xx, xy, yx, yy, and R^T dc.
    Wood wood_;
    bool rotates_;
    Eigen::Vector3d strain_;
    Vec2 d_;
    double u_ = 0, v_ = 0, w_ = 0, trace_ = 1;              // U_xx, U_yy, U_xy per trace, and the trace, of the stretch
    Eigen::Matrix<double, 3, 4> B_;                         // of strain
    Eigen::RowVector4d spin_ = Eigen::RowVector4d::Zero();  // of the turn
    Eigen::Vector3d s_;                                     // slope of the energy by strain
    Vec2 t_;                                                // by d
    double moment_ = 0;                                     // by the turn, which takes left_of(d) from d
    Eigen::Vector4d p_;                                     // by R^T dF
    Mat2 turn_ = Mat2::Identity();
    std::array<Vec2, 4> slope_;  // of the corners' shape functions [1/m]
};

}  // namespace crampfit

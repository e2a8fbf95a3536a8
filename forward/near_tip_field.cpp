#include "forward/near_tip_field.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace crampfit {

NearTipField::NearTipField(const Eigen::Matrix3d& compliance) : a_(compliance) {
    // a11 s^4 - 2 a16 s^3 + (2 a12 + a66) s^2 - 2 a26 s + a22 = 0, for s over the fourth root of a22 / a11. Of roots that meet
    // only half the digits are found, but all of their sum and product, and the field depends on these.
    const double size = std::sqrt(std::sqrt(a_(1, 1) / a_(0, 0)));
    const double share = 1.0 / (a_(0, 0) * size * size);
    Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(4, 4);
    companion.diagonal(-1).setOnes();
    companion.col(3) << -1.0, 2.0 * a_(1, 2) * share / size, -(2.0 * a_(0, 1) + a_(2, 2)) * share, 2.0 * a_(0, 2) * share * size;
    const Eigen::VectorXcd roots = companion.eigenvalues();
    int found = 0;
    for (const Complex& root : roots)
        if (root.imag() > 0.0 && found < 2) s_[found++] = size * root;
}

NearTipField near_tip_field(const Eigen::Matrix3d& stiffness, const Vec2& ahead) {
    return NearTipField(in_axes(stiffness, ahead).inverse());
}

}  // namespace crampfit

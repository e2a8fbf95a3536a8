#pragma once

#include <Eigen/Core>

namespace crampfit {

/// A part of the unit cube about a centre, seen as a unit cube itself. Vectors are [parameters].
struct Window {
    Eigen::VectorXd low, high;

    /// What lies within a half width of a centre along each axis.
    Window(const Eigen::VectorXd& centre, const Eigen::VectorXd& half_width)
        : low((centre - half_width).cwiseMax(0.0)), high((centre + half_width).cwiseMin(1.0)) {}
    Window(const Eigen::VectorXd& centre, const Eigen::VectorXd& below, const Eigen::VectorXd& above)
        : low((centre - below).cwiseMax(0.0)), high((centre + above).cwiseMin(1.0)) {}
    Window(const Eigen::VectorXd& centre, double half_width)
        : Window(centre, Eigen::VectorXd::Constant(centre.size(), half_width)) {}

    Eigen::VectorXd width() const { return high - low; }
    Eigen::VectorXd inside(const Eigen::VectorXd& y) const {
        return low + y.cwiseProduct(width());
    }                                                        // of the cube, from the window's y
    Eigen::VectorXd share(const Eigen::VectorXd& x) const {  // and back
        return (x - low).cwiseQuotient(width().cwiseMax(1e-300)).cwiseMax(0.0).cwiseMin(1.0);
    }
};

}  // namespace crampfit

#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

namespace crampfit {

/// A part of the unit cube seen as a unit cube itself, y to x = origin + axes y: along the cube's own axes, or askew to them and
/// then reaching out of the cube where it must. Vectors are [parameters].
struct Window {
    Eigen::VectorXd origin;
    Eigen::MatrixXd axes;  // columns: the window's edges [parameters x parameters], not singular

    /// All of the cube.
    explicit Window(Eigen::Index parameters)
        : origin(Eigen::VectorXd::Zero(parameters)), axes(Eigen::MatrixXd::Identity(parameters, parameters)) {}

    /// With these edges about a centre.
    Window(const Eigen::VectorXd& centre, const Eigen::MatrixXd& edges)
        : origin(centre - 0.5 * edges.rowwise().sum()), axes(edges) {}

    /// What lies within the cube and so far from a centre along each of its axes, to either side.
    static Window around(const Eigen::VectorXd& centre, const Eigen::VectorXd& below, const Eigen::VectorXd& above) {
        Window window(centre.size());
        window.origin = (centre - below).cwiseMax(0.0);
        window.axes = ((centre + above).cwiseMin(1.0) - window.origin).asDiagonal();
        return window;
    }
    static Window around(const Eigen::VectorXd& centre, const Eigen::VectorXd& half_width) {
        return around(centre, half_width, half_width);
    }

    Eigen::VectorXd inside(const Eigen::VectorXd& y) const { return origin + axes * y; }  // of the cube, from the window's y
    Eigen::VectorXd share(const Eigen::VectorXd& x) const { return axes.partialPivLu().solve(x - origin); }  // and back
    Eigen::VectorXd centre() const { return origin + 0.5 * axes.rowwise().sum(); }
};

}  // namespace crampfit

#pragma once

#include "imaging/virtual_camera.hpp"

#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <functional>

/// A displacement in the picture's plane and its gradient [px], x right and y down.
struct PlaneField {
    crampfit::PlaneDisplacement displacement;
    std::function<Eigen::Matrix2d(const crampfit::Vec2&)> gradient;  // du_i / dx_j
};

/// Displacement `shift` + a polynomial of the distance from `origin` with the coefficients of dx, dy, dx^2, dx dy,
/// dy^2.
inline PlaneField polynomial_field(const crampfit::Vec2& origin, const std::array<double, 5>& u, const std::array<double, 5>& v,
                                   const crampfit::Vec2& shift = {0, 0}) {
    using crampfit::Vec2;
    const auto value = [origin](const std::array<double, 5>& c, const Vec2& place) {
        const Vec2 d = place - origin;
        return c[0] * d.x() + c[1] * d.y() + c[2] * d.x() * d.x() + c[3] * d.x() * d.y() + c[4] * d.y() * d.y();
    };
    const auto slope = [origin](const std::array<double, 5>& c, const Vec2& place) {
        const Vec2 d = place - origin;
        return Eigen::RowVector2d(c[0] + 2 * c[2] * d.x() + c[3] * d.y(), c[1] + c[3] * d.x() + 2 * c[4] * d.y());
    };
    return {[=](const Vec2& place) { return Vec2(shift + Vec2(value(u, place), value(v, place))); },
            [=](const Vec2& place) {
                Eigen::Matrix2d gradient;
                gradient << slope(u, place), slope(v, place);
                return gradient;
            }};
}

/// The field around the tip of a straight crack with free faces in isotropic wood, first term (Williams 1957; Anderson
/// 2005, "Fracture Mechanics", table 2.2), and a rigid motion. The crack runs from `tip` back against `angle`;
/// `opening` and `sliding` are the jumps across its faces at 100 px behind the tip [px].
inline crampfit::PlaneDisplacement crack_field(const crampfit::Vec2& tip, double angle, double opening, double sliding,
                                               const crampfit::Vec2& shift = {0, 0}, double kappa = 2.0) {
    using crampfit::Vec2;
    const Eigen::Rotation2D<double> turn(angle);
    const double first = opening / (2 * (kappa + 1) * 10), second = sliding / (2 * (kappa + 1) * 10);
    return [=](const Vec2& place) {
        const Vec2 local = turn.inverse() * (place - tip);
        const double root = std::sqrt(local.norm()), half = std::atan2(local.y(), local.x()) / 2;
        const double c = std::cos(half), s = std::sin(half);
        const Vec2 u(first * root * c * (kappa - 1 + 2 * s * s) + second * root * s * (kappa + 1 + 2 * c * c),
                     first * root * s * (kappa + 1 - 2 * c * c) - second * root * c * (kappa - 1 - 2 * s * s));
        return Vec2(turn * u + shift);
    };
}

#pragma once

#include "datasets/scene.hpp"

#include <Eigen/Geometry>

namespace crampfit {

/// How a test's pictures lie on the specimen. Pixels count from the centre of the upper left one, x to the right and y down.
struct Placement {
    double pixel = 0;            // edge of a pixel [m]
    Vec2 offset = Vec2::Zero();  // of the picture's lower left corner in the specimen [m]
    double rotation = 0;         // of the picture about that corner, counter-clockwise [rad]
    int rows = 0;                // of the picture

    Vec2 turned(const Vec2& v) const { return Eigen::Rotation2Dd(rotation) * v; }
    Vec2 place(double x, double y) const { return offset + turned(pixel * Vec2(x + 0.5, rows - 0.5 - y)); }
    Vec2 pixel_at(const Vec2& place) const {
        const Vec2 in_pixels = Eigen::Rotation2Dd(-rotation) * (place - offset) / pixel;
        return {in_pixels.x() - 0.5, rows - 0.5 - in_pixels.y()};
    }
    Vec2 displacement(double u, double v) const { return turned(pixel * Vec2(u, -v)); }
};

}  // namespace crampfit

#include "forward/deformation.hpp"

#include <Eigen/LU>

#include <algorithm>

namespace crampfit {

Mat2 mean_gradient(const Discretisation& body, const Box& box, const std::vector<Vec2>& field) {
    Mat2 sum = Mat2::Zero();
    int points = 0;
    body.for_points_in(box, [&](int p) {
        sum += gradient_at(body, p, field);
        ++points;
    });
    return sum / std::max(1, points);
}

Mat2 seen_gradient_at(const Discretisation& body, int p, const std::vector<Vec2>& displacement, bool rotates) {
    const Mat2 at_point = gradient_at(body, p, displacement);
    const int c = body.points.cell[p];
    const Layout& layout = body.layout;
    if (layout.degree > 1 || !body.cell_is_whole(c)) return at_point;
    const auto node = body.points.node[p];
    const Vec2 arm = body.points.position[p] - layout.cell_corner(c) - 0.5 * layout.cell;  // from the cell's middle
    Vec2 q = Vec2::Zero();
    for (int k = 0; k < 4; ++k) q += crosswise_sign[k] / layout.cell.prod() * displacement[node[k]];
    const Mat2 in_middle = at_point - q * Vec2(arm.y(), arm.x()).transpose();
    const Mat2 turn = rotates ? Polar(in_middle).turn : Mat2(Mat2::Identity());
    q = turn.transpose() * q;
    const Eigen::Matrix3d S = body.points.stiffness_of(p).inverse();
    const Eigen::Vector3d by_x = q.x() * arm.y() / S(0, 0) * S.col(0);  // strain of the stress along x, and along y
    const Eigen::Vector3d by_y = q.y() * arm.x() / S(1, 1) * S.col(1);
    // Shear is made of how the sides turn: along x they bend with y as q_x has it, along y with x as q_y has it.
    const double bend_x = q.x() * arm.x(), bend_y = q.y() * arm.y();
    Mat2 more;
    more << by_x[0] + by_y[0], bend_x - bend_y + by_x[2], bend_y - bend_x + by_y[2], by_x[1] + by_y[1];
    return in_middle + turn * more;
}

}  // namespace crampfit

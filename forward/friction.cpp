#include "forward/friction.hpp"

#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <vector>

namespace crampfit {

namespace {

constexpr int most_directions = 60;
constexpr double linear_balance = 1e-9;  // of the right side: far below what one step of Newton's method leaves

}  // namespace

// With t along the surface, n its normal, k its curvature and d what the place has gone, the spring's stretch is
//     e = e_before + share d.t,   share = depth / (depth - depth_before) of a place that did not touch before,
// and dn = k t (t.dx), dt = -k n (t.dx), d(depth) = -n.dx give the slopes below.
Drag drag(const Pressing& pressing, double coefficient, double stiffness, const Grip& before) {
    Drag result;
    const Vec2& n = pressing.normal;
    const Vec2 t = left_of(n);
    const bool is_new = pressing.depth_before < 0.0;
    const double way = pressing.depth - pressing.depth_before;
    const double share = is_new ? pressing.depth / way : 1.0;
    const double along = pressing.gone.dot(t);
    const double trial = before.stretch + share * along;
    result.limit = coefficient * pressing.force;
    const double longest = result.limit / stiffness;
    result.stretch = std::clamp(trial, -longest, longest);
    const double slid = trial - result.stretch;

    const double force = -stiffness * result.stretch;
    result.force = force * t;
    Vec2 slope;  // of the force along t
    if (slid == 0.0) {
        const double share_slope = is_new ? -pressing.depth_before / (way * way) : 0.0;  // by depth
        const double with_arc = share * (1.0 - pressing.curvature * pressing.gone.dot(n));
        slope = -stiffness * (with_arc * t - along * share_slope * n);
        result.stiffness = std::max(0.0, stiffness * with_arc);
    } else {
        slope = std::copysign(coefficient * pressing.stiffness, trial) * n;
    }
    result.tangent = -t * slope.transpose() + force * pressing.curvature * n * t.transpose();
    result.energy = 0.5 * stiffness * result.stretch * result.stretch;
    // The work of the force, as it goes evenly from then to now, less what the spring takes: 1/2 k (e_before + e) (e - e_before +
    // slid).
    result.dissipated = 0.5 * stiffness * (before.stretch + result.stretch) * slid;
    return result;
}

Eigen::VectorXd solve_with_remainder(const Eigen::VectorXd& right,
                                     const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& inverse,
                                     const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& remainder) {
    // x = M^-1 y with (1 + E M^-1) y = right, y among right, E M^-1 right, ...: an orthonormal basis by Arnoldi's method.
    const double size = right.norm();
    if (size == 0.0) return right;
    std::vector<Eigen::VectorXd> basis{right / size};
    Eigen::MatrixXd image = Eigen::MatrixXd::Zero(most_directions + 1, most_directions);
    Eigen::VectorXd share;
    for (int k = 0; k < most_directions; ++k) {
        Eigen::VectorXd next = basis[k] + remainder(inverse(basis[k]));
        for (int i = 0; i <= k; ++i) {
            image(i, k) = basis[i].dot(next);
            next -= image(i, k) * basis[i];
        }
        image(k + 1, k) = next.norm();
        const auto known = image.topLeftCorner(k + 2, k + 1);
        const Eigen::VectorXd wanted = size * Eigen::VectorXd::Unit(k + 2, 0);
        share = known.householderQr().solve(wanted);
        if ((known * share - wanted).norm() <= linear_balance * size) break;
        basis.push_back(next / image(k + 1, k));
    }
    Eigen::VectorXd y = Eigen::VectorXd::Zero(right.size());
    for (int k = 0; k < share.size(); ++k) y += share[k] * basis[k];
    return inverse(y);
}

}  // namespace crampfit

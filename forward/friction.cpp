#include "forward/friction.hpp"

#include <Eigen/LU>
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
    const double counted = pressing.in_steps ? slid + (1.0 - share) * along : slid;
    result.dissipated = 0.5 * stiffness * (before.stretch + result.stretch) * counted;
    return result;
}

namespace {

Drag drag_at(const RubbingPlace& place, const Vec2& step) {
    const Vec2 apart = place.apart + step;
    const double depth = -apart.dot(place.normal);
    if (depth <= 0.0) return {};
    const double before = std::min(0.0, -place.apart_before.dot(place.normal));
    return drag({place.normal, 0.0, place.stiffness * depth, place.stiffness, depth, before, apart - place.apart_before},
                place.coefficient, place.stiffness, {0, place.stretch});
}

// The step of a place that goes h + C x its own force.
Vec2 step_of(const RubbingPlace& place, const Mat2& compliance, const Vec2& h, const Vec2& guess) {
    const Vec2 n = place.normal, t = left_of(n);
    Mat2 frame;
    frame << n, t;
    const Mat2 C = frame.transpose() * compliance * frame;
    const Vec2 free = frame.transpose() * h;
    const Vec2 apart = frame.transpose() * place.apart;
    const double k = place.stiffness;
    if (apart.x() + free.x() >= 0.0) return h;  // open
    // How much of the way counts for friction, from the step before: it changes little.
    const double before = place.apart_before.dot(n), depth = -(apart.x() + guess.dot(n));
    const double share = before > 0.0 ? std::max(depth, 0.0) / (std::max(depth, 0.0) + before) : 1.0;
    const double base = place.stretch + share * (apart.y() - place.apart_before.dot(t));
    Mat2 grips = Mat2::Identity();
    grips.col(0) += k * C.col(0);
    grips.col(1) += k * share * C.col(1);
    const Vec2 gripped = grips.inverse() * (free - C * Vec2(k * apart.x(), k * base));
    const double normal = -k * (apart.x() + gripped.x()), along = -k * (base + share * gripped.y());
    if (normal >= 0.0 && std::abs(along) <= place.coefficient * normal) return frame * gripped;
    for (const double sign : {std::copysign(1.0, along), -std::copysign(1.0, along)}) {
        const Vec2 way = C * Vec2(1.0, sign * place.coefficient);
        const double force = -k * (apart.x() + free.x()) / (1.0 + k * way.x());
        const Vec2 slid = free + way * force;
        if (force >= 0.0 && -sign * k * (base + share * slid.y()) >= place.coefficient * force) return frame * slid;
    }
    return frame * gripped;
}

}  // namespace

Vec2 RubbingPlace::force(const Vec2& step) const {
    return std::max(0.0, -stiffness * (apart + step).dot(normal)) * normal + drag_at(*this, step).force;
}

Eigen::VectorXd balance_of_rubbing(const std::vector<RubbingPlace>& places, const Eigen::MatrixXd& compliance,
                                   const Eigen::VectorXd& without) {
    constexpr int most_rounds = 4000;
    constexpr double settled = 1e-11;                            // of the largest force
    std::vector<Mat2> own(places.size()), freed(places.size());  // compliances; and without its joint's spring
    for (std::size_t i = 0; i < places.size(); ++i) {
        own[i] = compliance.block<2, 2>(2 * i, 2 * i);
        freed[i] = (Mat2::Identity() - places[i].joint * own[i]).inverse();
    }
    Eigen::VectorXd forces = Eigen::VectorXd::Zero(without.size());
    Eigen::VectorXd steps = without;
    for (int round = 0; round < most_rounds; ++round) {
        double change = 0.0;
        for (std::size_t i = 0; i < places.size(); ++i) {
            const auto at = static_cast<Eigen::Index>(2 * i);
            const Vec2 h = without.segment<2>(at) + compliance.middleRows<2>(at) * forces - own[i] * forces.segment<2>(at);
            const Vec2 step = step_of(places[i], freed[i] * own[i], freed[i] * h, steps.segment<2>(at));
            const Vec2 force = places[i].force(step) + places[i].joint * step;
            change = std::max(change, (force - forces.segment<2>(at)).cwiseAbs().maxCoeff());
            forces.segment<2>(at) = force;
            steps.segment<2>(at) = step;
        }
        if (change <= settled * forces.cwiseAbs().maxCoeff()) break;
    }
    return forces;
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

#include "forward/bilinear_piece.hpp"

namespace crampfit {

BilinearPiece::BilinearPiece(const Wood& wood, const Vec2& middle, const Vec2& cell, std::span<const int> fields,
                             const std::vector<Vec2>& displacement, bool rotates)
    : wood_(wood), rotates_(rotates) {
    const double x = middle.x(), y = middle.y();
    slope_ = {Vec2((y - 1.0) / cell.x(), (x - 1.0) / cell.y()), Vec2((1.0 - y) / cell.x(), -x / cell.y()),
              Vec2(-y / cell.x(), (1.0 - x) / cell.y()), Vec2(y / cell.x(), x / cell.y())};
    Mat2 gradient = Mat2::Zero();
    Vec2 across = Vec2::Zero();
    for (int k = 0; k < 4; ++k) {
        gradient += displacement[fields[k]] * slope_[k].transpose();
        across += crosswise_sign[k] * displacement[fields[k]];
    }
    if (rotates_) {
        const Polar polar(gradient);
        turn_ = polar.turn;
        trace_ = polar.trace;
        strain_ << polar.stretch(0, 0) - 1.0, polar.stretch(1, 1) - 1.0, 2.0 * polar.stretch(0, 1);
        B_ = polar.strain_slope();
        spin_ << 0, -1.0 / trace_, 1.0 / trace_, 0;
        u_ = polar.stretch(0, 0) / trace_;
        v_ = polar.stretch(1, 1) / trace_;
        w_ = polar.stretch(0, 1) / trace_;
    } else {
        strain_ << gradient(0, 0), gradient(1, 1), gradient(0, 1) + gradient(1, 0);
        B_ << 1, 0, 0, 0, 0, 0, 0, 1, 0, 1, 1, 0;
    }
    d_ = turn_.transpose() * across;
    s_ = wood_.S * strain_ + wood_.G * d_;
    t_ = wood_.G.transpose() * strain_ + wood_.H * d_;
    moment_ = -t_.dot(left_of(d_));
    p_ = B_.transpose() * s_ + moment_ * spin_.transpose();
}

Eigen::Matrix<double, 8, 1> BilinearPiece::force() const {
    const Mat2 P = turn_ * (Mat2() << p_[0], p_[1], p_[2], p_[3]).finished();
    const Vec2 pull = turn_ * t_;
    Eigen::Matrix<double, 8, 1> force;
    for (int k = 0; k < 4; ++k) force.segment<2>(2 * k) = P * slope_[k] + crosswise_sign[k] * pull;
    return force;
}

Eigen::Matrix<double, 8, 8> BilinearPiece::tangent(bool geometric) const {
    Eigen::Matrix<double, 3, 6> strain_slope;
    strain_slope << B_, Eigen::Matrix<double, 3, 2>::Zero();
    Eigen::Matrix<double, 2, 6> d_slope;
    d_slope << -left_of(d_) * spin_, Mat2::Identity();
    Eigen::Matrix<double, 6, 6> second = strain_slope.transpose() * wood_.G * d_slope;
    second += second.transpose().eval();
    second += strain_slope.transpose() * wood_.S * strain_slope + d_slope.transpose() * wood_.H * d_slope;
    if (rotates_ && geometric) {
        // As in `elastic_tangent`: B and the spin change with the stretch, d turns, and so does all of the force.
        const double difference = (s_[1] - s_[0]) / trace_, twice = 2.0 * s_[2] / trace_;
        const Eigen::RowVector4d d_u(1.0 - u_, -w_, w_, -u_), d_v(-v_, w_, -w_, 1.0 - v_), d_w(-w_, u_, v_, -w_);
        const Vec2 t_turned = left_of(t_);
        const Eigen::Vector4d p_turned(-p_[2], -p_[3], p_[0], p_[1]);
        second.row(1).head<4>() += difference * d_w + twice * d_u;
        second.row(2).head<4>() += twice * d_v - difference * d_w;
        second.topLeftCorner<4, 4>() += p_turned * spin_ - t_.dot(d_) * spin_.transpose() * spin_ -
                                        moment_ / trace_ * spin_.transpose() * Eigen::RowVector4d(1, 0, 0, 1);
        second.topRightCorner<4, 2>() += spin_.transpose() * t_turned.transpose();
        second.bottomLeftCorner<2, 4>() += t_turned * spin_;
    }
    Eigen::Matrix<double, 6, 8> rates;  // from displacements
    for (int k = 0; k < 4; ++k) {
        rates.block<2, 2>(0, 2 * k) = slope_[k] * turn_.col(0).transpose();
        rates.block<2, 2>(2, 2 * k) = slope_[k] * turn_.col(1).transpose();
        rates.block<2, 2>(4, 2 * k) = crosswise_sign[k] * turn_.transpose();
    }
    return rates.transpose() * second * rates;
}

}  // namespace crampfit

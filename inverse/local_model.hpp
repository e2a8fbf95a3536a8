#pragma once

#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

namespace crampfit {

/// Residuals as polynomials of the parameters, fitted by least squares to the runs within `reach` of a centre. Runs of
/// a noisy model scatter about it, and the scatter is what the model's own noise is.
class LocalModel {
  public:
    /// Linear, or quadratic where the runs are many enough to tell curvature from scatter. `reach` is a part of the
    /// box, along each axis. Absent where the usable runs about `centre` [parameters] do not span all directions.
    static std::optional<LocalModel> fit(std::span<const Run> runs, const Eigen::VectorXd& centre, double reach);

    Eigen::VectorXd residuals(const Eigen::VectorXd& x) const;  // [residuals]
    Eigen::MatrixXd jacobian() const;                           // at the centre [residuals x parameters]

    /// Standard errors of the Jacobian [residuals x parameters]; 0 where nothing is left to tell.
    Eigen::MatrixXd jacobian_errors() const {
        return scatter_.rowwise().norm() / std::sqrt(std::max(1, freedom_)) * slope_error_.transpose();
    }

    /// What the fit leaves of each run's residuals [residuals x runs].
    const Eigen::MatrixXd& scatter() const { return scatter_; }
    int freedom() const { return freedom_; }  // runs less the fitted terms

  private:
    enum class Order { linear, squares, full };

    static std::optional<LocalModel> fit(const std::vector<Run>& near, const Eigen::VectorXd& centre, double reach, Order order);
    Eigen::VectorXd terms(const Eigen::VectorXd& x) const;

    Order order_ = Order::linear;
    Eigen::VectorXd centre_;
    double reach_ = 0;
    Eigen::MatrixXd coefficients_;  // [terms x residuals]: constant, linear, squares, products
    Eigen::MatrixXd scatter_;
    Eigen::VectorXd slope_error_;  // of each column, for scatter of one a run [parameters]
    int freedom_ = 0;
};

/// The point [parameters] within `radius` of `centre` along each axis, and within the unit cube, at which the model's
/// sum of squares is least.
Eigen::VectorXd lowest_point(const LocalModel& model, const Eigen::VectorXd& centre, double radius);

}  // namespace crampfit

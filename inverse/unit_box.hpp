#pragma once

#include "datasets/experiment.hpp"

#include <Eigen/Core>

#include <vector>

namespace crampfit {

/// The parameters' box as the unit cube, which is what is searched: x = (p - lower) / (upper - lower), or on a log
/// scale x = ln(p / lower) / ln(upper / lower). Vectors are [parameters].
class UnitBox {
  public:
    explicit UnitBox(std::vector<Parameter> parameters) : parameters_(std::move(parameters)) {}

    Eigen::Index size() const { return static_cast<Eigen::Index>(parameters_.size()); }
    const std::vector<Parameter>& parameters() const { return parameters_; }

    double value(Eigen::Index j, double x) const;      // SI, never outside the bounds
    double share(Eigen::Index j, double value) const;  // and back: x of an SI value
    double slope(Eigen::Index j, double x) const;      // dp/dx, SI
    Eigen::VectorXd values(const Eigen::VectorXd& x) const;
    Eigen::VectorXd initial() const;  // in the unit cube

  private:
    const Parameter& parameter(Eigen::Index j) const { return parameters_[static_cast<std::size_t>(j)]; }

    std::vector<Parameter> parameters_;
};

/// The point x in the parameters' own units [parameters].
std::vector<double> in_units(const UnitBox& box, const Eigen::VectorXd& x);

}  // namespace crampfit

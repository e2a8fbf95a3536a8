#include "inverse/differences.hpp"
#include "inverse/minimize.hpp"

#include <ceres/ceres.h>

namespace crampfit {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The residuals as Ceres asks for them. A point that could not be run is a `false`, and Ceres takes a shorter step.
class Residuals : public ceres::CostFunction {
  public:
    Residuals(Objective& objective, Eigen::Index residuals) : objective_(objective) {
        set_num_residuals(static_cast<int>(residuals));
        mutable_parameter_block_sizes()->push_back(static_cast<int>(objective.parameters()));
    }

    bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
        const Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(parameters[0], objective_.parameters());
        const auto here = objective_.at(x);
        if (!here || !here->usable()) {
            return false;
        }
        Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()) = here->residuals;
        if (jacobians && jacobians[0]) {
            const auto derivative = jacobian(objective_, x);
            // Ceres calls a derivative that cannot be had an error and prints it. Zeros end it as quietly, and we
            // remember.
            lost_derivative_ = !derivative;
            Eigen::Map<RowMajor>(jacobians[0], num_residuals(), objective_.parameters()) =
                derivative.value_or(Eigen::MatrixXd::Zero(num_residuals(), objective_.parameters()));
        }
        return true;
    }

    bool lost_derivative() const { return lost_derivative_; }

  private:
    Objective& objective_;
    mutable bool lost_derivative_ = false;
};

/// Ends a descent that has come down to the model's noise: rejected steps one after another, each a small part of the
/// difference step, tell nothing any more, and each costs a run.
class NoiseFloor : public ceres::IterationCallback {
  public:
    ceres::CallbackReturnType operator()(const ceres::IterationSummary& iteration) override {
        rejected_ = iteration.step_is_successful ? 0 : rejected_ + 1;
        const bool small = iteration.step_norm < 0.1 * difference_step;
        return rejected_ >= 3 && small ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
    }

  private:
    int rejected_ = 0;
};

}  // namespace

Solution minimize_with_ceres(Objective& objective, const Eigen::VectorXd& start) {
    const auto first = objective.at(start);
    if (!first || !first->usable()) {
        return {false, "the run at the start failed"};
    }
    Eigen::VectorXd x = start;
    ceres::Problem problem;
    auto* residuals = new Residuals(objective, first->residuals.size());  // the problem owns it
    problem.AddResidualBlock(residuals, nullptr, x.data());
    for (int j = 0; j < static_cast<int>(objective.parameters()); ++j) {
        problem.SetParameterLowerBound(x.data(), j, 0.0);
        problem.SetParameterUpperBound(x.data(), j, 1.0);
    }
    NoiseFloor noise_floor;
    ceres::Solver::Options options;
    options.callbacks.push_back(&noise_floor);
    options.initial_trust_region_radius = 10;  // from afar, a whole Gauss-Newton step would overshoot
    options.linear_solver_type = ceres::DENSE_QR;
    options.line_search_interpolation_type = ceres::QUADRATIC;  // needs no Jacobian at trial points
    options.max_num_iterations = 1000;                          // the budget of runs is what ends a long descent
    options.function_tolerance = 1e-4;  // of the misfit: with hundreds of residuals, a small part of a standard error
    options.parameter_tolerance = 1e-8;
    options.gradient_tolerance = 1e-12;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (residuals->lost_derivative()) {
        return {false, "too many runs failed around a point to have the derivative there"};
    }
    const bool converged = summary.termination_type == ceres::CONVERGENCE || summary.termination_type == ceres::USER_SUCCESS;
    return {converged && !objective.exhausted(), summary.message};
}

}  // namespace crampfit

#pragma once

#include "datasets/experiment.hpp"
#include "datasets/fit.hpp"
#include "inverse/objective.hpp"
#include "inverse/residuals.hpp"
#include "inverse/scene_runs.hpp"
#include "inverse/unit_box.hpp"

#include <string>
#include <vector>

namespace crampfit {

// Displacements at which a crack moves differ by this much from grid to grid: in explicit dynamics for vibration and for arrests
// between cells, at equilibrium for the second-order error that is left after extrapolation (wedge sample on
// cells of 0.1 and 0.05 mm: 1.184 and 1.181 mm, single states by more).
inline constexpr double solver_resolution = 0.02;

/// A study made ready to be run at any point of its unit cube: one Comparison an experiment.
class StudyModel {
  public:
    /// Throws InputError for what cannot be fitted: bounds, noise, options, keys that no scene has, data with nothing
    /// in it. The study must outlive this.
    StudyModel(const Study& study, Forward forward, double model_resolution, const std::atomic<bool>* stop);

    /// Runs every experiment's scene at x [parameters]. A run that fails, by status or exception, is an unusable
    /// Evaluation.
    Evaluation evaluate(const Eigen::VectorXd& x, int threads) const { return at(box_.values(x), threads); }

    /// The same with the parameters' values, SI.
    Evaluation at(const Eigen::VectorXd& values, int threads) const;

    const UnitBox& box() const { return box_; }
    std::vector<int> curve_lengths() const;                       // stations of each measured curve, in order
    std::vector<FitResidual> residuals(const Evaluation&) const;  // of a usable evaluation, without priors
    std::string remarks() const;                                  // on the data, for a person

  private:
    const Study& study_;
    UnitBox box_;
    std::vector<Comparison> comparisons_;  // one an experiment
    SceneRuns runs_;
};

}  // namespace crampfit

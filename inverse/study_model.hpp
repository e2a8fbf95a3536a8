#pragma once

#include "datasets/experiment.hpp"
#include "inverse/fit.hpp"
#include "inverse/objective.hpp"
#include "inverse/residuals.hpp"
#include "inverse/unit_box.hpp"

#include <string>
#include <utility>
#include <vector>

namespace crampfit {

/// A study made ready to be run at any point of its unit cube: one Comparison an experiment, and which scene takes
/// which key.
class StudyModel {
  public:
    /// Throws InputError for what cannot be fitted: bounds, noise, options, keys that no scene has, data with nothing
    /// in it. The study must outlive this.
    StudyModel(const Study& study, Forward forward, double model_resolution, const std::atomic<bool>* stop);

    /// Runs every experiment's scene at x [parameters]. A run that fails, by status or exception, is an unusable
    /// Evaluation.
    Evaluation evaluate(const Eigen::VectorXd& x, int threads) const;

    const UnitBox& box() const { return box_; }
    std::vector<int> curve_lengths() const;                       // stations of each measured curve, in order
    std::vector<FitResidual> residuals(const Evaluation&) const;  // of a usable evaluation, without priors
    std::string remarks() const;                                  // on the data, for a person

  private:
    struct Outcome {
        std::string status;
        bool good = false;
        Eigen::VectorXd modelled;
        double seconds = 0;
    };

    Outcome run(std::size_t experiment, const Eigen::VectorXd& values) const;

    const Study& study_;
    Forward forward_;
    const std::atomic<bool>* stop_;
    UnitBox box_;
    std::vector<Comparison> comparisons_;                                      // one an experiment
    std::vector<std::vector<std::pair<Eigen::Index, std::string>>> settings_;  // parameter and key, for each experiment
};

}  // namespace crampfit

#pragma once

#include "datasets/experiment.hpp"
#include "datasets/sensitivity.hpp"
#include "inverse/objective.hpp"
#include "inverse/scene_runs.hpp"
#include "inverse/unit_box.hpp"

#include <Eigen/Core>

#include <vector>

namespace crampfit {

/// The outputs of a study, of one scene after the other, as a function of its parameters.
class OutputModel {
  public:
    /// Throws InputError for what cannot be run. The study must outlive this; `stop` may be null.
    OutputModel(const Study& study, Forward forward, const std::atomic<bool>* stop);

    const UnitBox& box() const { return box_; }
    const std::vector<StudiedOutput>& names() const { return names_; }

    /// With the parameters' values, SI. `residuals` are the outputs; empty when a scene's run failed.
    Evaluation at(const Eigen::VectorXd& values, int threads) const;

  private:
    const Study& study_;
    SceneRuns runs_;
    UnitBox box_;
    std::vector<StudiedOutput> names_;
};

}  // namespace crampfit

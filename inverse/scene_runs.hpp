#pragma once

#include "datasets/experiment.hpp"
#include "inverse/forward.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace crampfit {

/// The scenes of a study, made ready to be run with any values of its parameters.
class SceneRuns {
  public:
    /// Throws InputError for a key that no scene has. The study must outlive this; `stop` may be null.
    SceneRuns(const Study& study, Forward forward, const std::atomic<bool>* stop);

    struct Outcome {
        std::string status;
        std::optional<Record> record;  // of a run that ended well: finite numbers to the end
        double seconds = 0;
    };

    std::size_t size() const { return scenes_.size(); }

    /// Runs a scene with the parameters' values [parameters], SI. A failure of any kind is a status.
    Outcome run(std::size_t scene, const Eigen::VectorXd& values) const;

  private:
    std::vector<const Scene*> scenes_;
    Forward forward_;
    const std::atomic<bool>* stop_;
    std::optional<double> time_limit_;  // [s]
    std::vector<std::vector<std::pair<Eigen::Index, std::string>>> settings_;  // parameter and key, for each scene
};

}  // namespace crampfit

#pragma once

#include "datasets/experiment.hpp"
#include "datasets/machine.hpp"
#include "inverse/forward.hpp"

#include <Eigen/Core>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace crampfit {

/// Whether a run that went like this was ended by a time limit [s] below this one; absent: there is none now.
bool had_less_time(const std::string& status, std::optional<double> limit);

/// The scenes of a study, made ready to be run with any values of its parameters. A scene is not run again where nothing changes
/// but the machine that it is tested on, or another scene: the last records of each are kept.
class SceneRuns {
  public:
    /// Throws InputError for a key that no scene has. The study must outlive this; `stop` may be null.
    SceneRuns(const Study& study, Forward forward, const std::atomic<bool>* stop);

    struct Outcome {
        std::string status;
        std::shared_ptr<const Record> record;  // of a run that ended well: finite numbers to the end; null for others
        Machine machine;                       // that the record has been seen through
        double seconds = 0;
    };

    std::size_t size() const { return scenes_.size(); }

    /// Runs a scene with the parameters' values [parameters], SI. A failure of any kind is a status.
    Outcome run(std::size_t scene, const Eigen::VectorXd& values) const;

  private:
    struct Setting {
        Eigen::Index parameter;
        double factor;
        std::string key;                            // of the scene
        const MachineNumber* of_machine = nullptr;  // instead of a key
    };
    struct Kept;

    struct Asked {
        std::vector<double> numbers;   // that are set in the scene
        std::vector<double> pictures;  // where its probes are read [s] or [m]
        bool operator==(const Asked&) const = default;
    };
    Outcome run_scene(std::size_t scene, const Asked& asked) const;
    Outcome once(std::size_t scene, const Asked& asked) const;

    std::vector<const Scene*> scenes_;
    std::vector<Machine> machines_;  // of the experiments; none for a scene alone
    Forward forward_;
    const std::atomic<bool>* stop_;
    std::optional<double> time_limit_;            // [s]
    std::vector<std::vector<Setting>> settings_;  // of each scene
    std::shared_ptr<Kept> kept_;
};

}  // namespace crampfit

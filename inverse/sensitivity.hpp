#pragma once

#include "datasets/experiment.hpp"
#include "datasets/sensitivity.hpp"
#include "inverse/farm.hpp"
#include "inverse/forward.hpp"
#include "inverse/run_store.hpp"

#include <atomic>
#include <functional>
#include <optional>

namespace crampfit {

struct SensitivityProgress {
    int runs = 0;  // forward runs that have ended
    int planned = 0;
    int failed = 0;
    std::string failure;  // why the run that has just ended failed, and the command that runs it again; empty: it did not
};

struct SensitivityOptions {
    int threads = 0;                                           // forward runs side by side; 0: one a core
    Forward forward;                                           // empty: crampfit::simulate
    std::function<void(const SensitivityProgress&)> progress;  // after every forward run, one call at a time; may be empty
    const std::atomic<bool>* stop_requested = nullptr;         // set from outside: the study ends with what it has
    unsigned seed = 1;                                         // of everything that is drawn at random
    RunKeeping keeping;                                        // of the forward runs, as they end
    Farm* farm = nullptr;  // runs of the same study elsewhere, of no other `forward` than crampfit::simulate

    /// Throws InputError naming the option that is out of range.
    void validate() const;
};

/// How the study's outputs answer to its parameters, by the study's method; parameters go evenly over their box, on a log scale
/// where they have one. A study of experiments gives the outputs of each experiment's scene.
/// A picture or specimen file must have been read into each `scene.specimen.map` before.
/// The result depends on the study and the seed, not on the number of threads. A forward run that fails is recorded and left out.
/// Throws InputError for a study that cannot be made as it asks, before anything runs.
Sensitivity study_sensitivity(const Study& study, const SensitivityOptions& options = {});

/// The outputs that `study_sensitivity` looks at, for those who drive the study themselves. It keeps a copy of the study; `stop`
/// may be null. Throws as `study_sensitivity` does.
StudyFunction output_function(const Study& study, const std::atomic<bool>* stop = nullptr);

/// What they are called. Throws as `study_sensitivity` does.
std::vector<std::string> output_names(const Study& study);

/// Their derivatives by the parameters. Absent where there are none, or a run failed.
std::optional<Eigen::MatrixXd> output_slopes(const Study& study, const Eigen::VectorXd& values,
                                             const std::atomic<bool>* stop = nullptr);

}  // namespace crampfit

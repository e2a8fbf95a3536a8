#pragma once

#include "datasets/experiment.hpp"
#include "datasets/fit.hpp"
#include "inverse/farm.hpp"
#include "inverse/forward.hpp"
#include "inverse/run_store.hpp"

#include <atomic>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace crampfit {

/// Where a fit stands. One forward run is one evaluation of the whole study: every experiment's scene once.
struct FitProgress {
    int runs = 0;              // forward runs that have ended
    int max_runs = 0;          // where the fit stops at the latest
    double best_misfit = 0;    // sum of squared weighted residuals; infinite until a run has ended well
    std::vector<double> best;  // parameters of the best run, in their units, in the study's order; empty until then
    std::string stage;         // what is going on, in a word or two: "starts", "descent", "polish", "uncertainty"
    double seconds = 0;        // since the fit began [s]
    std::string failure;       // why the run that has just ended failed, and the command that runs it again; empty: it did not
};

struct FitOptions {
    int threads = 0;                                    // forward runs side by side; 0: one a core
    Forward forward;                                    // empty: crampfit::simulate
    bool cheap_runs = false;                            // of `forward`: profile and posterior may make thousands
    std::function<void(const FitProgress&)> progress;   // after every forward run and weighing, one call at a time; may be empty
    const std::atomic<bool>* stop_requested = nullptr;  // set from outside: the fit ends with what it has
    unsigned seed = 1;                                  // of everything that is drawn at random
    RunKeeping keeping;                                 // of the forward runs, as they end
    // Of models that are compared: WideSearch::deviance, and the same of the fit itself.
    std::function<void(double wide, double here)> tell_wide_deviance;
    Farm* farm = nullptr;  // runs of the same study elsewhere, of no other `forward` than crampfit::simulate

    /// Throws InputError naming the option that is out of range.
    void validate() const;
};

/// Adjusts the study's parameters until the simulations match the experiments.
/// A picture or specimen file must have been read into each `scene.specimen.map` before.
/// The result depends on the study and the seed, not on the number of threads. A forward run that fails is recorded in
/// `Fit::runs` and the fit goes on. Throws InputError for a study that cannot be fitted as it asks, before anything
/// runs.
Fit fit_study(const Study& study, const FitOptions& options = {});

/// The residuals that `fit_study` makes small, for those who drive the study themselves. It keeps a copy of the study; `stop` may
/// be null. Throws as `fit_study` does.
StudyFunction fit_function(const Study& study, const std::atomic<bool>* stop = nullptr);

/// How many they are. Throws as `fit_study` does.
std::size_t residual_count(const Study& study);

/// Their derivatives by the parameters. Absent where there are none, or a run failed.
std::optional<Eigen::MatrixXd> fit_slopes(const Study& study, const Eigen::VectorXd& values,
                                          const std::atomic<bool>* stop = nullptr);

}  // namespace crampfit

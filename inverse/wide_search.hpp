#pragma once

#include "inverse/fit.hpp"
#include "inverse/study_runs.hpp"

#include <Eigen/Core>

#include <functional>
#include <memory>
#include <string>

namespace crampfit {

/// The same study on cells twice as wide, where a run costs a fifth: a search begins there, and how far that grid's best point is
/// off tells of the grid.
class WideSearch {
  public:
    /// All that is given must outlive this. `look` is called after each run.
    WideSearch(const Study& study, const FitOptions& options, RunStore& store, std::function<void()> look);

    /// Where a search on the study's own cells begins (`StudyRuns::find_start`). False where that is not worth while, or where
    /// nothing was found.
    bool find_start(const std::function<void(const std::string&)>& stage);

    /// Searches as `StudyRuns::descend` does, from the study's own starting points. False where nothing was found.
    bool descend(const std::function<void(const std::string&)>& stage);

    /// What its best point makes of the data, -2 ln of the likelihood but for a constant; not a number where nothing was
    /// searched.
    double deviance() const;

    /// Its best point, where it found one [parameters], of the unit cube.
    const Eigen::VectorXd& best() const { return runs_->objective().best()->x; }

    /// What was done, for a person; empty where nothing was.
    std::string method() const;

    /// The study at a point [parameters], of the unit cube, on cells twice as wide.
    Evaluation at(const Eigen::VectorXd& x);

  private:
    bool make_runs();

    const Study study_;
    const FitOptions& options_;
    RunStore& store_;
    std::function<void()> look_;
    std::unique_ptr<StudyRuns> runs_;  // null: not searched there
};

}  // namespace crampfit

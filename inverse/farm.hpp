#pragma once

#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <atomic>
#include <functional>

namespace crampfit {

/// What a study gives with these values of its parameters [parameters], SI, on so many threads.
using StudyFunction = std::function<Evaluation(const Eigen::VectorXd& values, int threads)>;

/// Other processes that evaluate the same study, with the same bits.
class Farm {
  public:
    virtual ~Farm() = default;

    virtual int places() const = 0;  // evaluations that go on side by side

    /// Which of the models that the study compares is evaluated from now on; 0 where it compares none.
    virtual void choose_model(int model) = 0;

    /// Waits for a free place. May be called from several threads at a time.
    virtual Evaluation evaluate(const Eigen::VectorXd& values) = 0;
};

/// Evaluates on `threads` threads of this process and in the places of a farm at the same time. What is asked for alone stays
/// here, where the walks are that it may go on from.
class Sharing {
  public:
    Sharing(StudyFunction here, int threads, Farm* farm) : here_(std::move(here)), threads_(threads), farm_(farm) {}

    /// Evaluations that go on side by side.
    int places() const { return threads_ + (farm_ ? farm_->places() : 0); }

    Evaluation operator()(const Eigen::VectorXd& values, int threads);

  private:
    StudyFunction here_;
    int threads_;
    Farm* farm_;
    std::atomic<int> busy_{0};  // threads of this process
};

}  // namespace crampfit

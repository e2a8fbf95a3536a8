#pragma once

#include <Eigen/Core>

#include <atomic>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace crampfit {

/// What one forward evaluation of the study gave.
struct Evaluation {
    std::string status;         // of the runs, for a person
    Eigen::VectorXd residuals;  // sigma-scaled and weighted, priors last [residuals]; empty when a run failed
    Eigen::VectorXd modelled;   // at the stations [stations], SI; empty when a run failed
    double misfit = std::numeric_limits<double>::infinity();  // sum of the squared residuals
    double seconds = 0;                                       // of the forward runs

    bool usable() const { return residuals.size() > 0; }
};

/// One entry of the ledger: a point of the unit cube and what came out there.
struct Run {
    Eigen::VectorXd x;  // [parameters], 0..1
    std::shared_ptr<const Evaluation> evaluation;
};

/// The study as a function on the unit cube. The same point is never run twice, no more runs are made than the budget
/// has, and what is recorded does not depend on the number of threads.
class Objective {
  public:
    /// Evaluates a point with so many threads. Called from several threads at a time; must give the same for the same
    /// point.
    using Evaluate = std::function<Evaluation(const Eigen::VectorXd& x, int threads)>;
    using OnRun = std::function<void(const Run&)>;

    /// `on_run` is called once after each run, one call at a time; it may be empty. `stop` may be null.
    Objective(Eigen::Index parameters, Evaluate evaluate, int budget, int threads, const std::atomic<bool>* stop = nullptr,
              OnRun on_run = {});

    /// Evaluates points side by side. A point that was not run, for lack of budget or because of a stop, gives a null.
    std::vector<std::shared_ptr<const Evaluation>> at(std::span<const Eigen::VectorXd> points);
    std::shared_ptr<const Evaluation> at(const Eigen::VectorXd& point);

    /// An objective that shares what has been run but has a ledger and a budget of its own: searches on branches may
    /// run side by side, and joined in a fixed order they leave the same ledger however they were scheduled.
    Objective branch(int budget, int threads) const;
    void join(const Objective& branch);

    /// Puts what `judge` makes of each run in the place of what it was. Not while branches are at work; those made before keep
    /// what they have.
    void judge_anew(const std::function<Evaluation(const Run&)>& judge);

    Eigen::Index parameters() const { return parameters_; }
    const std::vector<Run>& runs() const { return runs_; }
    const Run* best() const;  // least misfit, the first of equals; null while no run was usable
    int threads() const { return threads_; }
    int budget_left() const { return budget_ - spent_; }
    void set_budget_left(int runs) { budget_ = spent_ + runs; }
    bool stopped() const;  // the user wants an end
    const std::atomic<bool>* stop() const;
    bool exhausted() const { return stopped() || budget_left() <= 0; }

  private:
    using Key = std::vector<double>;
    struct Shared;

    std::shared_ptr<const Evaluation> run(const Eigen::VectorXd& point, int threads) const;

    Eigen::Index parameters_;
    std::shared_ptr<Shared> shared_;
    int budget_;
    int threads_;
    int spent_ = 0;
    std::vector<Run> runs_;                                   // in the order asked for
    std::map<Key, std::shared_ptr<const Evaluation>> known_;  // what this ledger has
};

}  // namespace crampfit

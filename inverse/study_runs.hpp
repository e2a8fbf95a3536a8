#pragma once

#include "inverse/fit.hpp"
#include "inverse/kept_walks.hpp"
#include "inverse/objective.hpp"
#include "inverse/run_store.hpp"
#include "inverse/search.hpp"
#include "inverse/study_model.hpp"
#include "inverse/walk_descent.hpp"

#include <functional>
#include <string>
#include <vector>

namespace crampfit {

/// The study with each scene on cells twice as wide, on that grid alone, and without frames.
Study on_wide_cells(const Study& study);

/// A study on one grid as a fit runs it: its walks, where runs go on from one another, and all runs that were made.
class StudyRuns {
  public:
    /// `widening`: how many times as wide as the fit's own these cells are; the store keeps runs of all grids. All that is given
    /// must outlive this. `on_weighing` is told the best run once all are weighed anew. Throws InputError for a study that cannot
    /// be fitted.
    StudyRuns(const Study& study, const FitOptions& options, RunStore& store, double widening, Objective::OnRun on_run,
              Objective::OnRun on_weighing = {});
    StudyRuns(const StudyRuns&) = delete;
    StudyRuns& operator=(const StudyRuns&) = delete;

    /// Steps along walks from `initial`, and from further points as long as the noise does not explain the misfit, up to `starts`
    /// (descend_by_walks), weighed by what the residuals say of the model's resolution.
    SearchResult descend(int starts, const Eigen::VectorXd& initial, const std::function<void(const std::string&)>& stage);
    /// The same from the study's initial values, and from others where these do not explain the data.
    SearchResult descend(const std::function<void(const std::string&)>& stage);
    /// The same as far as a search that goes on from there needs it: what the model knows at worst explains the data, or the way
    /// that the crack goes is the best one.
    SearchResult find_start(const std::function<void(const std::string&)>& stage);

    /// By the study's method, from `initial`, and from the best run on, weighed by what the residuals say of the model's
    /// resolution, as `descend` does; without walks less thoroughly.
    SearchResult search(const Eigen::VectorXd& initial, const std::function<void(const std::string&)>& stage);

    /// `descend` from the best run on. Whether that ended by its own criterion.
    bool descend_again();

    /// The parameters' values at a point of the unit cube [parameters], SI.
    std::vector<double> values_at(const Eigen::VectorXd& x) const;

    bool only_toughness() const { return only_toughness_; }
    bool has_walks() const { return has_walks_; }  // whether runs near one are cheap
    bool by_walks() const { return by_walks_; }    // whether the search goes along them
    const KeptWalks& walks() const { return walks_; }
    const Nearby& nearby() const { return nearby_; }
    const StudyModel& model() const { return model_; }
    Objective& objective() { return objective_; }

  private:
    Forward forward() const;
    int all_starts() const;
    double left_by_noise() const;
    SearchResult descend_at_worst(int starts, const Eigen::VectorXd& initial,
                                  const std::function<void(const std::string&)>& stage);
    Near by_walk_of(Forward (KeptWalks::*runs)(const std::vector<double>&) const);
    Lowest recall(const Eigen::VectorXd& point, const Window& window, bool rough, const std::function<Lowest()>& search);
    bool weigh_anew(double least_change);
    void judge_runs();
    bool heed_data(bool converged, const std::function<bool()>& descend);
    bool is_left_over() const;
    bool descend_as_weighed(bool last);
    bool weigh_and_descend(bool converged, bool ended_early);
    bool know_better(bool converged, const std::function<void()>& look, const std::function<bool()>& descend);
    void settle();
    Evaluation run(const Eigen::VectorXd& x, int share);
    Eigen::VectorXd key_of(const Eigen::VectorXd& values) const;

    const Study& study_;
    const FitOptions& options_;
    RunStore& store_;
    double widening_;
    int threads_;
    KeptWalks walks_;
    bool only_toughness_;
    bool has_walks_;
    bool by_walks_;
    bool in_order_;  // the same bits for any number of threads: runs that go on from one another are made one after the other
    double most_resolution_ = solver_resolution;  // that the data leave open
    StudyModel model_;
    Nearby nearby_;
    Sharing shared_;
    Objective objective_;
    Objective::OnRun on_weighing_;
};

}  // namespace crampfit

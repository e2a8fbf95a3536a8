#pragma once

#include "datasets/experiment.hpp"
#include "datasets/fit.hpp"
#include "inverse/objective.hpp"
#include "inverse/residuals.hpp"
#include "inverse/scene_runs.hpp"
#include "inverse/uncertainty.hpp"
#include "inverse/unit_box.hpp"

#include <string>
#include <vector>

namespace crampfit {

// Displacements at which a crack moves differ by up to this much from grid to grid: in explicit dynamics for vibration and for
// arrests between cells, at equilibrium for the second-order error that is left after extrapolation (wedge sample on cells of 0.1
// and 0.05 mm: 1.184 and 1.181 mm, single states by more). How much of it a fit needs, its residuals tell.
inline constexpr double solver_resolution = 0.02;

/// A study made ready to be run at any point of its unit cube: one Comparison an experiment.
class StudyModel {
  public:
    /// Throws InputError for what cannot be fitted: bounds, noise, options, keys that no scene has, data with nothing
    /// in it. The study must outlive this.
    StudyModel(const Study& study, Forward forward, double model_resolution, const std::atomic<bool>* stop);

    /// Runs every experiment's scene at x [parameters]. A run that fails, by status or exception, is an unusable
    /// Evaluation.
    Evaluation evaluate(const Eigen::VectorXd& x, int threads) const { return at(box_.values(x), threads); }

    /// The same with the parameters' values, SI.
    Evaluation at(const Eigen::VectorXd& values, int threads) const;

    /// Weighs what has been modelled with these values anew, where it is usable: residuals and misfit.
    void weigh(Evaluation& evaluation, const Eigen::VectorXd& values) const;

    /// How well the model is taken to know what it says (Comparison); from `set_resolution` on runs are weighed by it.
    double resolution() const { return resolution_; }
    void set_resolution(double resolution);

    /// Whether priors weigh, as they do unless told otherwise.
    bool counts_priors() const { return counts_priors_; }
    void count_priors(bool yes) { counts_priors_ = yes; }
    bool has_priors() const { return residual_count() > station_count(); }

    /// The most by which another resolution would change the sigma of a measurement, as a part of it.
    double change_of_sigma(double resolution) const;

    /// The resolution up to `most` that makes a usable evaluation's residuals most likely: what they have beyond the data's noise
    /// is the model's; stations that share their rows count as one measurement (Comparison::counts). Maximum likelihood of a
    /// component of variance, `parameters` degrees of freedom being the fit's (Harville 1977, Maximum likelihood approaches to
    /// variance component estimation, J. Am. Stat. Assoc. 72).
    double likely_resolution(const Evaluation& evaluation, double most) const;

    /// That resolution and how likely residuals are by it: -2 ln of the likelihood and of what priors say, but for a constant.
    struct Knowledge {
        double resolution, deviance;
    };
    Knowledge likely_knowledge(const Evaluation& evaluation, double most) const;

    const UnitBox& box() const { return box_; }
    std::size_t residual_count() const;  // of the data, and one a prior
    MeasuredCurves curves() const;
    std::vector<FitResidual> residuals(const Evaluation&) const;  // of a usable evaluation, without priors
    std::string remarks() const;                                  // on the data, for a person

  private:
    std::size_t station_count() const;
    double deviance(const Evaluation& evaluation, double resolution) const;  // of the data

    const Study& study_;
    std::vector<Experiment> tests_;      // with what runs can be compared with
    std::vector<std::string> left_out_;  // of the data, for a person
    double resolution_;
    bool counts_priors_ = true;
    double prior_weight_ =
        1;  // the mean of a measurement's, as Uncertainty::prior_weight: a factor on all weights changes nothing
    UnitBox box_;
    std::vector<Comparison> comparisons_;  // one an experiment
    SceneRuns runs_;
};

}  // namespace crampfit

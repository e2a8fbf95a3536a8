#pragma once

#include "datasets/crack_paths.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace crampfit {

enum class FitStatus {
    converged,
    run_limit,  // max_runs was used up
    interrupted,
    failed,  // no forward run ended
};

const char* name(FitStatus status);

struct FittedParameter {
    std::string name;
    std::string key;   // several joined by a space
    double value = 0;  // in `unit`
    std::string unit;
    double standard_error = 0;
    double lower_95 = 0;
    double upper_95 = 0;
    double initial = 0;
    bool at_bound = false;
};

/// One forward evaluation of the whole study.
struct FitRun {
    std::vector<double> parameters;  // in the parameters' units
    double misfit = 0;               // sum of squared weighted residuals; infinite when a run failed
    std::string status;
    double seconds = 0;
};

/// One data point of one experiment against the model at the best parameters.
struct FitResidual {
    std::string experiment;
    std::string kind;     // "force", "force_at_length", "break", "arrival", "crack_length", or a component of a displacement
                          // field, "u_x" or "u_y"
    double at = 0;        // displacement [m] or time [s]; crack length [m] for arrival and force_at_length
    double measured = 0;  // SI
    double modelled = 0;  // SI
    double sigma = 0;     // SI
    double residual = 0;  // (modelled - measured) / sigma
};

/// Whether what is left of one measured curve looks like noise.
struct FitCheck {
    std::string experiment;
    std::string kind;  // as of its residuals
    int points = 0;
    double chi_square = 0;         // sum of squared residuals
    double p_chi_square = 1;       // how often noise alone makes it as large
    double autocorrelation = 0;    // of neighbouring residuals
    double p_autocorrelation = 1;  // how often white noise makes it as large
};

/// How far one modelled curve is from the measured one, at the stations of the residuals. To look at: no fit rests on these.
struct CurveDistance {
    std::string experiment;
    std::string kind;          // "force" or "arrival"
    double area_measured = 0;  // under the curve, SI: of force over displacement the work [J]
    double area_modelled = 0;  // the same
    double area_between = 0;   // the same, of the absolute difference
    double frechet = 0;        // Frechet distance, both axes divided by the measured range
};

/// One of the models that a study compares.
struct ComparedModel {
    std::string name;
    std::string status;          // of its fit
    double misfit = 0;           // sum of squared weighted residuals; infinite when no run ended well
    std::vector<double> values;  // of the parameters, in their units
    double aic = 0;              // Akaike's information criterion; infinite when no run ended well
    double bic = 0;              // Bayesian information criterion
    double weight = 0;           // Akaike weight: of the evidence, all together 1
};

/// One point of a parameter's profile: the least misfit with that parameter held.
struct ProfilePoint {
    std::string parameter;
    double value = 0;  // of the parameter, in its unit
    double misfit = 0;
};

/// One sample of the posterior.
struct PosteriorSample {
    std::vector<double> parameters;  // in the parameters' units
    double misfit = 0;
};

/// What a fit gives.
struct Fit {
    FitStatus status = FitStatus::converged;
    std::string message;  // sentences for a person, a space after each
    std::string method;   // what did the work, and why it was chosen
    std::vector<FittedParameter> parameters;
    Eigen::MatrixXd covariance;  // in the parameters' units
    Eigen::MatrixXd correlation;
    double misfit = 0;  // sum of squared weighted residuals
    double reduced_chi_square = 0;
    std::vector<FitResidual> residuals;
    std::vector<FitCheck> checks;          // of each curve
    std::vector<CurveDistance> distances;  // of each curve
    std::vector<ComparedModel> models;     // best first; empty where none were compared
    std::vector<CrackPaths> crack_paths;   // of each experiment; empty where they were not asked for
    std::vector<ProfilePoint> profile;     // of each parameter, if asked for
    std::vector<PosteriorSample> posterior;
    std::vector<FitRun> runs;
    double seconds = 0;  // wall time [s]
    unsigned seed = 0;
    std::string study_text;
    std::string scene_settings;  // what --set changed in the scenes, as it stands on a command line
};

/// How far the photographed paths of all experiments together are from those of a model; the cracks are left out.
SimulatedPath together(const Fit& fit, const std::string& model);

/// The sentences of a fit's message, each by itself.
std::vector<std::string> sentences(const std::string& message);

}  // namespace crampfit

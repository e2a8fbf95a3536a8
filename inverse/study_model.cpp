#include "inverse/study_model.hpp"

#include "datasets/error.hpp"
#include "inverse/pool.hpp"
#include "inverse/run_end.hpp"
#include "inverse/study_check.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>

namespace crampfit {
namespace {

// What cannot be fitted whatever the data hold is refused first.
const Study& checked(const Study& study) {
    check_study(study);
    return study;
}

// The number whose square is the loss of r, with the sign of r. The bends are those at which a fit to normal noise has 95 % of
// the efficiency of least squares (Holland and Welsch 1977, table 1).
double softened(double r, Loss loss) {
    constexpr double huber = 1.345, cauchy = 2.385;
    switch (loss) {
    case Loss::squares:
        return r;
    case Loss::huber:
        return std::abs(r) <= huber ? r : std::copysign(std::sqrt(huber * (2 * std::abs(r) - huber)), r);
    case Loss::cauchy:
        return std::copysign(cauchy * std::sqrt(std::log1p(r * r / (cauchy * cauchy))), r);
    }
    throw std::logic_error("a loss without a formula");
}

}  // namespace

StudyModel::StudyModel(const Study& study, Forward forward, double model_resolution, const std::atomic<bool>* stop)
    : study_(checked(study)), tests_(study.experiments), resolution_(model_resolution), box_(study.parameters),
      runs_(study, std::move(forward), stop) {
    for (std::size_t i = 0; i < tests_.size(); ++i) {
        const CoveredData covered = covered_data(study, i);
        tests_[i].data = covered.curves;
        tests_[i].fields = covered.fields;
        left_out_.push_back(covered.remark);
    }
    for (const Experiment& experiment : tests_) {
        comparisons_.emplace_back(experiment, model_resolution);
    }
    double weights = 0, squares = 0;
    for (std::size_t i = 0; i < tests_.size(); ++i) {
        const auto count = static_cast<double>(comparisons_[i].stations().size());
        weights += count * tests_[i].weight;
        squares += count * tests_[i].weight * tests_[i].weight;
    }
    prior_weight_ = squares / weights;
    const std::size_t stations = station_count();
    if (stations < study.parameters.size()) {
        throw InputError(study.file.empty() ? "study" : study.file.string(), "parameters",
                         std::to_string(study.parameters.size()),
                         "must be no more than the points to compare, of which the data gives " + std::to_string(stations));
    }
}

void StudyModel::set_resolution(double resolution) {
    resolution_ = resolution;
    for (Comparison& comparison : comparisons_) {
        comparison.know_to(resolution);
    }
}

double StudyModel::change_of_sigma(double resolution) const {
    double most = 0;
    for (const Comparison& comparison : comparisons_) {
        const Eigen::VectorXd others = comparison.sigmas(resolution);
        for (Eigen::Index k = 0; k < others.size(); ++k) {
            most = std::max(most, std::abs(others[k] / comparison.stations()[static_cast<std::size_t>(k)].sigma - 1));
        }
    }
    return most;
}

double StudyModel::deviance(const Evaluation& evaluation, double resolution) const {
    double measurements = 0;
    for (const Comparison& comparison : comparisons_) {
        measurements += std::accumulate(comparison.counts().begin(), comparison.counts().end(), 0.0);
    }
    const double share = 1.0 - static_cast<double>(box_.size()) / measurements;  // of them that the fit leaves free
    double sum = 0;
    Eigen::Index row = 0;
    for (std::size_t i = 0; i < comparisons_.size(); ++i) {
        const Comparison& comparison = comparisons_[i];
        const Eigen::VectorXd sigmas = comparison.sigmas(resolution);
        for (std::size_t k = 0; k < comparison.stations().size(); ++k) {
            const double sigma = sigmas[static_cast<Eigen::Index>(k)];
            const double off = evaluation.modelled[row++] - comparison.stations()[k].measured;
            const double r = softened(off / sigma, study_.optimizer.loss);
            sum += study_.experiments[i].weight * (r * r + share * comparison.counts()[k] * 2 * std::log(sigma));
        }
    }
    return sum;
}

StudyModel::Knowledge StudyModel::likely_knowledge(const Evaluation& evaluation, double most) const {
    constexpr double least = 1e-5;  // far below what any grid or gauge knows
    constexpr int steps = 40;
    Knowledge likely{0.0, deviance(evaluation, 0.0)};
    for (int i = 0; i <= steps && most > least; ++i) {
        const double resolution = least * std::pow(most / least, static_cast<double>(i) / steps);
        const double here = deviance(evaluation, resolution);
        if (here < likely.deviance) {
            likely = {resolution, here};
        }
    }
    likely.deviance +=
        evaluation.residuals.tail(evaluation.residuals.size() - evaluation.modelled.size()).squaredNorm();  // priors
    return likely;
}

double StudyModel::likely_resolution(const Evaluation& evaluation, double most) const {
    return likely_knowledge(evaluation, most).resolution;
}

Evaluation StudyModel::at(const Eigen::VectorXd& values, int threads) const {
    struct Outcome {
        std::string status;
        double seconds = 0;
        std::optional<Eigen::VectorXd> modelled;
    };
    std::vector<Outcome> outcomes(comparisons_.size());
    parallel_for(static_cast<int>(outcomes.size()), threads, [&](int i) {
        const auto k = static_cast<std::size_t>(i);
        const SceneRuns::Outcome run = runs_.run(k, values);
        outcomes[k] = {run.status, run.seconds, {}};
        if (run.record) {
            outcomes[k].modelled = comparisons_[k].modelled(*run.record, run.machine.force_offset);
        }
    });
    Evaluation result;
    std::vector<double> modelled;
    bool good = true;
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
        const Outcome& outcome = outcomes[i];
        result.seconds += outcome.seconds;
        const std::string who = outcomes.size() > 1 ? study_.experiments[i].name + ": " : "";
        result.status += (result.status.empty() ? "" : "; ") + who + outcome.status;
        good = good && outcome.modelled;
        if (good) {
            modelled.insert(modelled.end(), outcome.modelled->begin(), outcome.modelled->end());
        }
    }
    if (good) {
        result.modelled = Eigen::Map<Eigen::VectorXd>(modelled.data(), static_cast<Eigen::Index>(modelled.size()));
        weigh(result, values);
    }
    return result;
}

void StudyModel::weigh(Evaluation& evaluation, const Eigen::VectorXd& values) const {
    if (evaluation.modelled.size() == 0) {
        return;
    }
    std::vector<double> residuals;
    Eigen::Index row = 0;
    for (std::size_t i = 0; i < comparisons_.size(); ++i) {
        const double weight = std::sqrt(study_.experiments[i].weight);
        for (const FitResidual& station : comparisons_[i].stations()) {
            residuals.push_back(weight *
                                softened((evaluation.modelled[row++] - station.measured) / station.sigma, study_.optimizer.loss));
        }
    }
    for (Eigen::Index j = 0; j < box_.size(); ++j) {
        if (const auto& prior = box_.parameters()[static_cast<std::size_t>(j)].prior) {
            residuals.push_back(counts_priors_ ? std::sqrt(prior_weight_) * (values[j] - prior->mean) / prior->sd : 0.0);
        }
    }
    evaluation.residuals = Eigen::Map<Eigen::VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size()));
    evaluation.misfit = evaluation.residuals.squaredNorm();
}

std::size_t StudyModel::station_count() const {
    std::size_t count = 0;
    for (const Comparison& comparison : comparisons_) {
        count += comparison.stations().size();
    }
    return count;
}

std::size_t StudyModel::residual_count() const {
    const std::vector<Parameter>& parameters = box_.parameters();
    const auto has_prior = [](const Parameter& parameter) { return parameter.prior.has_value(); };
    return station_count() + static_cast<std::size_t>(std::count_if(parameters.begin(), parameters.end(), has_prior));
}

MeasuredCurves StudyModel::curves() const {
    MeasuredCurves curves;
    for (std::size_t i = 0; i < comparisons_.size(); ++i) {
        const std::vector<FitResidual>& stations = comparisons_[i].stations();
        for (const char* kind : {"force", "force_at_length", "break", "arrival", "crack_length", "u_x", "u_y"}) {
            const auto count = std::count_if(stations.begin(), stations.end(),
                                             [kind](const FitResidual& station) { return station.kind == kind; });
            if (count > 0) {
                curves.lengths.push_back(static_cast<int>(count));
                curves.roots.push_back(std::sqrt(tests_[i].weight));
            }
        }
    }
    return curves;
}

std::vector<FitResidual> StudyModel::residuals(const Evaluation& evaluation) const {
    std::vector<FitResidual> result;
    for (const Comparison& comparison : comparisons_) {
        result.insert(result.end(), comparison.stations().begin(), comparison.stations().end());
    }
    for (std::size_t i = 0; i < result.size(); ++i) {
        result[i].modelled = evaluation.modelled[static_cast<Eigen::Index>(i)];
        result[i].residual = (result[i].modelled - result[i].measured) / result[i].sigma;
    }
    return result;
}

std::string StudyModel::remarks() const {
    std::string text;
    for (std::size_t i = 0; i < comparisons_.size(); ++i) {
        text += left_out_[i].empty() ? "" : left_out_[i] + " ";
        for (const std::string& remark : comparisons_[i].remarks()) {
            text += remark + " ";
        }
    }
    return text;
}

}  // namespace crampfit

#include "inverse/study_model.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "inverse/pool.hpp"
#include "inverse/study_check.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

namespace crampfit {
namespace {

using Settings = std::vector<std::vector<std::pair<Eigen::Index, std::string>>>;

// Which experiments' scenes know each key; a scene without latewood has no use for its toughness. Some scene must.
Settings find_settings(const Study& study) {
    Settings settings(study.experiments.size());
    for (std::size_t j = 0; j < study.parameters.size(); ++j) {
        for (const std::string& key : study.parameters[j].keys) {
            std::optional<InputError> unknown;
            bool found = false;
            for (std::size_t i = 0; i < study.experiments.size(); ++i) {
                try {
                    get_number(study.experiments[i].scene, key);
                    settings[i].emplace_back(static_cast<Eigen::Index>(j), key);
                    found = true;
                } catch (const InputError& error) {
                    unknown = error;
                }
            }
            if (!found) {
                throw *unknown;
            }
        }
    }
    return settings;
}

bool finite(const Record& record) {
    return std::all_of(record.series.begin(), record.series.end(), [](const Instant& instant) {
        return std::isfinite(instant.time) && std::isfinite(instant.displacement) && std::isfinite(instant.force) &&
               std::isfinite(instant.crack_length);
    });
}

}  // namespace

StudyModel::StudyModel(const Study& study, Forward forward, double model_resolution, const std::atomic<bool>* stop)
    : study_(study), forward_(std::move(forward)), stop_(stop), box_(study.parameters) {
    check_study(study);
    settings_ = find_settings(study);
    std::size_t stations = 0;
    for (const Experiment& experiment : study.experiments) {
        comparisons_.emplace_back(experiment, model_resolution);
        stations += comparisons_.back().stations().size();
    }
    if (stations < study.parameters.size()) {
        throw InputError(
            study.file.empty() ? "study" : study.file.string(), "parameters", std::to_string(study.parameters.size()),
            "must be no more than the points to compare, of which the data gives " + std::to_string(stations));
    }
}

StudyModel::Outcome StudyModel::run(std::size_t experiment, const Eigen::VectorXd& values) const {
    const auto begin = std::chrono::steady_clock::now();
    Outcome outcome;
    try {
        Scene scene = study_.experiments[experiment].scene;
        for (const auto& [parameter, key] : settings_[experiment]) {
            set_number(scene, key, values[parameter]);
        }
        const Record record = forward_(scene, stop_);
        const bool ended = record.status == RunStatus::finished || record.status == RunStatus::split;
        outcome.status = name(record.status);
        if (record.series.empty()) {
            outcome.status += ": the run gave no instants";
        } else if (!finite(record)) {
            outcome.status += ": the run gave numbers that are not finite";
        } else if (!ended) {
            outcome.status += record.message.empty() ? "" : ": " + record.message;
        } else {
            outcome.modelled = comparisons_[experiment].modelled(record);
            outcome.good = true;
        }
    } catch (const std::exception& error) {
        outcome.status = error.what();
    }
    outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return outcome;
}

Evaluation StudyModel::evaluate(const Eigen::VectorXd& x, int threads) const {
    const Eigen::VectorXd values = box_.values(x);
    std::vector<Outcome> outcomes(comparisons_.size());
    parallel_for(static_cast<int>(outcomes.size()), threads, [&](int i) {
        const auto k = static_cast<std::size_t>(i);
        outcomes[k] = run(k, values);
    });
    Evaluation result;
    std::vector<double> residuals, modelled;
    bool good = true;
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
        const Outcome& outcome = outcomes[i];
        result.seconds += outcome.seconds;
        const std::string who = outcomes.size() > 1 ? study_.experiments[i].name + ": " : "";
        result.status += (result.status.empty() ? "" : "; ") + who + outcome.status;
        good = good && outcome.good;
        for (Eigen::Index s = 0; s < outcome.modelled.size(); ++s) {
            const FitResidual& station = comparisons_[i].stations()[static_cast<std::size_t>(s)];
            modelled.push_back(outcome.modelled[s]);
            residuals.push_back(std::sqrt(study_.experiments[i].weight) * (outcome.modelled[s] - station.measured) /
                                station.sigma);
        }
    }
    if (!good) {
        return result;
    }
    for (Eigen::Index j = 0; j < box_.size(); ++j) {
        if (const auto& prior = box_.parameters()[static_cast<std::size_t>(j)].prior) {
            residuals.push_back((values[j] - prior->mean) / prior->sd);
        }
    }
    result.residuals = Eigen::Map<Eigen::VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size()));
    result.modelled = Eigen::Map<Eigen::VectorXd>(modelled.data(), static_cast<Eigen::Index>(modelled.size()));
    result.misfit = result.residuals.squaredNorm();
    return result;
}

std::vector<int> StudyModel::curve_lengths() const {
    std::vector<int> lengths;
    for (const Comparison& comparison : comparisons_) {
        for (const char* kind : {"force", "arrival"}) {
            const auto count = std::count_if(comparison.stations().begin(), comparison.stations().end(),
                                             [kind](const FitResidual& station) { return station.kind == kind; });
            if (count > 0) {
                lengths.push_back(static_cast<int>(count));
            }
        }
    }
    return lengths;
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
    for (const Comparison& comparison : comparisons_) {
        for (const std::string& remark : comparison.remarks()) {
            text += remark + " ";
        }
    }
    return text;
}

}  // namespace crampfit

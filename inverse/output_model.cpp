#include "inverse/output_model.hpp"

#include "inverse/outputs.hpp"
#include "inverse/pool.hpp"
#include "inverse/study_check.hpp"

namespace crampfit {
namespace {

const Study& checked(const Study& study) {
    check_sensitivity_study(study);
    return study;
}

}  // namespace

OutputModel::OutputModel(const Study& study, Forward forward, const std::atomic<bool>* stop)
    : study_(checked(study)), runs_(study, std::move(forward), stop), box_(study.parameters) {
    for (std::size_t i = 0; i < runs_.size(); ++i) {
        for (const StudyOutput& output : study.outputs) {
            names_.push_back(
                {runs_.size() > 1 ? study.experiments[i].name + ": " + output.name : output.name, unit_of(output.kind)});
        }
    }
}

Evaluation OutputModel::at(const Eigen::VectorXd& values, int threads) const {
    std::vector<SceneRuns::Outcome> outcomes(runs_.size());
    parallel_for(static_cast<int>(outcomes.size()), threads,
                 [&](int i) { outcomes[static_cast<std::size_t>(i)] = runs_.run(static_cast<std::size_t>(i), values); });
    Evaluation result;
    std::vector<double> outputs;
    bool good = true;
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
        const SceneRuns::Outcome& outcome = outcomes[i];
        const std::string who = outcomes.size() > 1 ? study_.experiments[i].name + ": " : "";
        result.status += (result.status.empty() ? "" : "; ") + who + outcome.status;
        result.seconds += outcome.seconds;
        good = good && outcome.record;
        for (std::size_t k = 0; good && k < study_.outputs.size(); ++k) {
            outputs.push_back(output_of(*outcome.record, study_.outputs[k]));
        }
    }
    if (good) {
        result.residuals = Eigen::Map<Eigen::VectorXd>(outputs.data(), static_cast<Eigen::Index>(outputs.size()));
    }
    return result;
}

}  // namespace crampfit

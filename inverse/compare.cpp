#include "inverse/compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {
namespace {

FitOptions options_of(const Study& study, std::size_t number, FitOptions options) {
    if (!options.keeping.file.empty() && number > 0) {
        options.keeping.file += fmt::format(".{}", number);
    }
    if (options.farm) {
        options.farm->choose_model(static_cast<int>(number));
    }
    if (options.progress) {
        options.progress = [tell = options.progress, name = study.models[number].name](FitProgress progress) {
            progress.stage = name + ": " + progress.stage;
            tell(progress);
        };
    }
    return options;
}

// The part of -2 ln L that says how sharply a model speaks.
double spread(const Fit& fit) {
    double sum = 0;
    for (const FitResidual& residual : fit.residuals) {
        sum += 2 * std::log(residual.sigma);
    }
    return sum;
}

ComparedModel compared(const std::string& model, const Fit& fit) {
    ComparedModel row;
    row.name = model;
    row.status = name(fit.status);
    row.misfit = fit.misfit;
    for (const FittedParameter& parameter : fit.parameters) {
        row.values.push_back(parameter.value);
    }
    return row;
}

// All models have the same data and parameters.
void weigh(std::vector<ComparedModel>& models, const std::vector<double>& spreads, double unexplained, std::size_t points) {
    const auto k = static_cast<double>(models.front().values.size());
    double least = std::numeric_limits<double>::infinity(), sum = 0;
    for (std::size_t i = 0; i < models.size(); ++i) {
        ComparedModel& model = models[i];
        const double deviance = model.misfit / unexplained + spreads[i];
        model.aic = deviance + 2 * k;
        model.bic = deviance + k * std::log(static_cast<double>(std::max<std::size_t>(1, points)));
        least = std::min(least, model.aic);
    }
    for (ComparedModel& model : models) {
        model.weight = std::isfinite(model.aic) ? std::exp(-0.5 * (model.aic - least)) : 0.0;
        sum += model.weight;
    }
    for (ComparedModel& model : models) {
        model.weight /= std::max(sum, std::numeric_limits<double>::min());
    }
    std::stable_sort(models.begin(), models.end(), [](const auto& a, const auto& b) { return a.aic < b.aic; });
}

}  // namespace

Study model_of(const Study& study, std::size_t model) {
    Study one = study;
    one.models.clear();
    for (std::size_t i = 0; i < one.experiments.size(); ++i) {
        one.experiments[i].scene = study.models[model].scenes[i];
    }
    one.scene_settings.emplace_back(study.compared_key, study.models[model].name);
    return one;
}

Fit fit_models(const Study& study, const FitOptions& options) {
    if (study.models.empty()) {
        return fit_study(study, options);
    }
    Fit best;
    std::vector<ComparedModel> models;
    std::vector<double> spreads;  // beyond that of the sharpest model
    double unexplained = std::numeric_limits<double>::infinity(), seconds = 0;
    bool interrupted = false;
    for (std::size_t i = 0; i < study.models.size() && !interrupted; ++i) {
        Fit fit = fit_study(model_of(study, i), options_of(study, i, options));
        models.push_back(compared(study.models[i].name, fit));
        spreads.push_back(fit.residuals.empty() ? std::numeric_limits<double>::infinity() : spread(fit));
        unexplained = std::min(unexplained, fit.reduced_chi_square);
        seconds += fit.seconds;
        interrupted = fit.status == FitStatus::interrupted;
        if (i == 0 || fit.misfit + spreads.back() < best.misfit + spread(best)) {
            best = std::move(fit);
        }
    }
    const double sharpest = *std::min_element(spreads.begin(), spreads.end());
    for (double& beyond : spreads) {
        beyond = std::isfinite(beyond) ? beyond - sharpest : 0.0;
    }
    weigh(models, spreads, std::max(1.0, unexplained), best.residuals.size());
    if (models.size() > 1) {
        constexpr double plain = 2;  // of AIC: less, and both have support (Burnham and Anderson 2002, section 2.6)
        const ComparedModel &first = models[0], &second = models[1];
        const char* verdict =
            second.aic - first.aic > plain
                ? "{0} \"{1}\" explains the data best, with {2:.2g} of the evidence; next \"{3}\" with {4:.2g}. {5}"
                : "The data do not tell {0} \"{1}\" from \"{3}\": {2:.2g} and {4:.2g} of the evidence. {5}";
        std::string failed;
        for (const ComparedModel& model : models) {
            if (!std::isfinite(model.aic)) {
                failed += fmt::format("{}\"{}\"", failed.empty() ? "" : ", ", model.name);
            }
        }
        if (!failed.empty()) {
            failed = "Of " + failed + " no run ended well, so that nothing is said of it. ";
        }
        if (std::isfinite(second.aic)) {
            best.message = fmt::format(fmt::runtime(verdict), study.compared_key, first.name, first.weight, second.name,
                                       second.weight, failed + best.message);
        } else {
            best.message = fmt::format("{} \"{}\" has nothing to be compared with. {}{}", study.compared_key, first.name, failed,
                                       best.message);
        }
    }
    best.models = std::move(models);
    best.seconds = seconds;
    best.status = interrupted ? FitStatus::interrupted : best.status;
    return best;
}

}  // namespace crampfit

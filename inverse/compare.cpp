#include "inverse/compare.hpp"

#include "inverse/uncertainty.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>

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

// How many neighbouring residuals count as one.
double neighbours_as_one(const Fit& fit) {
    Eigen::VectorXd off(static_cast<Eigen::Index>(fit.residuals.size()));
    std::vector<int> lengths;
    for (std::size_t i = 0; i < fit.residuals.size(); ++i) {
        const FitResidual& one = fit.residuals[i];
        off[static_cast<Eigen::Index>(i)] = (one.modelled - one.measured) / one.sigma;
        const bool goes_on = i > 0 && one.experiment == fit.residuals[i - 1].experiment && one.kind == fit.residuals[i - 1].kind;
        if (!goes_on) {
            lengths.push_back(0);
        }
        ++lengths.back();
    }
    return correlation_time(off, lengths);
}

// All models have the same data and parameters. `together`: so many neighbouring residuals count as one.
void weigh(std::vector<ComparedModel>& models, const std::vector<double>& spreads, double unexplained, double together,
           std::size_t points) {
    const auto k = static_cast<double>(models.front().values.size());
    double least = std::numeric_limits<double>::infinity(), sum = 0;
    for (std::size_t i = 0; i < models.size(); ++i) {
        ComparedModel& model = models[i];
        const double deviance = (model.misfit / unexplained + spreads[i]) / together;
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

std::string weight_text(double weight) { return weight > 0.99 ? "more than 0.99" : fmt::format("{:.2g}", weight); }

// -2 ln of a model's likelihood, on cells twice as wide and on the study's.
struct OnTwoGrids {
    double wide, here;
};

// What the data say of the best two; `grids`: of each model, as far as that is known.
std::string verdict(const std::string& key, const std::vector<ComparedModel>& models,
                    const std::map<std::string, OnTwoGrids>& grids, double together) {
    constexpr double plain = 2;  // of AIC: less, and both have support (Burnham and Anderson 2002, section 2.6)
    const ComparedModel &first = models[0], &second = models[1];
    if (second.aic - first.aic <= plain) {
        return fmt::format("The data do not tell {} \"{}\" from \"{}\": {} and {} of the evidence. ", key, first.name,
                           second.name, weight_text(first.weight), weight_text(second.weight));
    }
    std::string text = fmt::format("{} \"{}\" explains the data best, with {} of the evidence; next \"{}\" with {}. ", key,
                                   first.name, weight_text(first.weight), second.name, weight_text(second.weight));
    // What a grid half as fine changes from model to model may be left on this one (left_by_grid), and what it changes in the
    // best one itself may be so in another that is as near to it.
    const auto best = grids.find(first.name);
    if (best == grids.end()) {
        return text;
    }
    const double own = std::abs(best->second.wide - best->second.here) / together;
    std::vector<std::string> otherwise, near;
    for (const ComparedModel& other : models) {
        const auto found = grids.find(other.name);
        const double here = other.aic - first.aic;
        const double there = found == grids.end() ? std::nan("") : (found->second.wide - best->second.wide) / together;
        if (std::abs(there - here) > here) {
            otherwise.push_back(fmt::format("\"{}\" ({:+.2g} there, {:+.2g} here)", other.name, there, here));
        } else if (here > 0 && here < own) {
            near.push_back(fmt::format("\"{}\" ({:.2g})", other.name, here));
        }
    }
    if (!otherwise.empty()) {
        text += fmt::format("The grid may decide that: by cells twice as wide AIC tells it otherwise from {}. ",
                            fmt::join(otherwise, ", "));
    }
    if (!near.empty()) {
        text +=
            fmt::format("The grid may decide that: halving the cells has changed AIC by {:.2g}, more than it is ahead of {}. ",
                        own, fmt::join(near, ", "));
    }
    text += otherwise.empty() && near.empty() ? "" : "Finer cells would tell. ";
    return text;
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
    std::map<std::string, OnTwoGrids> grids;
    std::vector<double> spreads;  // beyond that of the sharpest model
    double unexplained = std::numeric_limits<double>::infinity(), seconds = 0;
    bool interrupted = false;
    for (std::size_t i = 0; i < study.models.size() && !interrupted; ++i) {
        FitOptions own = options_of(study, i, options);
        own.tell_wide_deviance = [&, i](double wide, double here) { grids[study.models[i].name] = {wide, here}; };
        Fit fit = fit_study(model_of(study, i), own);
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
    const double together = best.residuals.empty() ? 1.0 : neighbours_as_one(best);
    weigh(models, spreads, std::max(1.0, unexplained), together, best.residuals.size());
    if (models.size() > 1) {
        std::string failed;
        for (const ComparedModel& model : models) {
            if (!std::isfinite(model.aic)) {
                failed += fmt::format("{}\"{}\"", failed.empty() ? "" : ", ", model.name);
            }
        }
        if (!failed.empty()) {
            failed = "Of " + failed + " no run ended well, so that nothing is said of it. ";
        }
        const std::string said = std::isfinite(models[1].aic) ? verdict(study.compared_key, models, grids, together)
                                                              : fmt::format("{} \"{}\" has nothing to be compared with. ",
                                                                            study.compared_key, models[0].name);
        best.message = said + failed + best.message;
    }
    best.models = std::move(models);
    best.seconds = seconds;
    best.status = interrupted ? FitStatus::interrupted : best.status;
    return best;
}

}  // namespace crampfit

#include "cli/chart.hpp"
#include "cli/html.hpp"
#include "cli/progress.hpp"
#include "cli/report_pages.hpp"
#include "inverse/lack_of_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace crampfit::cli {

namespace {

using Kind = ChartSeries::Kind;

constexpr std::size_t most_bars_of_error = 120;  // beyond, bars hide the points
constexpr std::size_t most_pairs = 15;           // of parameters whose samples are drawn against each other
constexpr std::size_t most_samples = 1500;       // in one drawing

std::string with_unit(const std::string& name, const std::string& unit) {
    return unit.empty() ? name : fmt::format("{} [{}]", name, unit);
}

// ---- data against model

/// What is left of one measured curve, by the place that it was compared at.
struct Comparison {
    std::string experiment;
    std::string kind;
    std::vector<FitResidual> rows;
};

std::vector<Comparison> comparisons(const Fit& fit) {
    std::vector<Comparison> all;
    for (const FitResidual& row : fit.residuals) {
        const auto same = [&](const Comparison& other) { return other.experiment == row.experiment && other.kind == row.kind; };
        auto found = std::ranges::find_if(all, same);
        if (found == all.end()) found = all.insert(all.end(), {row.experiment, row.kind, {}});
        found->rows.push_back(row);
    }
    for (Comparison& comparison : all) std::ranges::stable_sort(comparison.rows, {}, &FitResidual::at);
    return all;
}

std::vector<double> column(const Comparison& comparison, double FitResidual::*member) {
    std::vector<double> values;
    for (const FitResidual& row : comparison.rows) values.push_back(row.*member);
    return values;
}

bool is_field(const Comparison& comparison) { return comparison.kind.starts_with("u_"); }

/// Displacements of points are many and at few instants: they are drawn over what the model has.
std::string field_figure(const Comparison& comparison) {
    const ScaledUnit micrometre{1e-6, "um"};
    return draw({.title = fmt::format("{}: {} of the displacement fields", comparison.experiment, comparison.kind),
                 .x_label = "Fitted [um]",
                 .y_label = "Measured [um]",
                 .series = {{.colour = colour::black,
                             .kind = Kind::points,
                             .x = scaled(column(comparison, &FitResidual::modelled), micrometre),
                             .y = scaled(column(comparison, &FitResidual::measured), micrometre)}}});
}

/// An arrival is drawn the way that people draw it: crack length over the displacement of its arrival.
std::string comparison_figure(const Comparison& comparison) {
    const bool arrival = comparison.kind == "arrival", length = comparison.kind == "crack_length",
               by_length = comparison.kind == "force_at_length";
    const ScaledUnit millimetre{1e-3, "mm"};
    const std::vector<double> measured = column(comparison, &FitResidual::measured),
                              modelled = column(comparison, &FitResidual::modelled);
    const ScaledUnit unit = arrival || length ? millimetre : unit_for(measured, units::force);
    const std::vector<double> at = scaled(column(comparison, &FitResidual::at), millimetre);
    const std::vector<double> sigma = comparison.rows.size() <= most_bars_of_error
                                          ? scaled(column(comparison, &FitResidual::sigma), unit)
                                          : std::vector<double>{};
    Chart chart{.title = fmt::format("{}: {}", comparison.experiment,
                                     arrival     ? "arrival of the crack"
                                     : length    ? "crack length"
                                     : by_length ? "force at crack length"
                                                 : comparison.kind),
                .x_label = by_length ? "Crack length [mm]" : "Displacement [mm]",
                .y_label = arrival || length ? "Crack length [mm]" : fmt::format("Force [{}]", unit.symbol)};
    ChartSeries data{.label = sigma.empty() ? "measured" : "measured, ± sigma", .colour = colour::black, .kind = Kind::points};
    ChartSeries model{.label = "fitted", .colour = colour::vermillion};
    data.x = arrival ? scaled(measured, unit) : at;
    data.y = arrival ? at : scaled(measured, unit);
    (arrival ? data.x_error : data.y_error) = sigma;
    model.x = arrival ? scaled(modelled, unit) : at;
    model.y = arrival ? at : scaled(modelled, unit);
    chart.series = {data};
    if (!by_length) chart.series.push_back(model);  // many forces at one length: the residuals tell
    return draw(chart);
}

std::string residuals_figure(const Comparison& comparison) {
    const bool by_length = comparison.kind == "arrival" || comparison.kind == "force_at_length";
    const bool field = is_field(comparison);
    const std::vector<double> at = scaled(column(comparison, field ? &FitResidual::modelled : &FitResidual::at), {1e-3, "mm"});
    return draw(
        {.title = fmt::format("{}: residuals of {}", comparison.experiment,
                              comparison.kind == "crack_length"      ? "crack length"
                              : comparison.kind == "force_at_length" ? "force at crack length"
                                                                     : comparison.kind),
         .x_label = by_length ? "Crack length [mm]"
                    : field   ? "Displacement of the point, fitted [mm]"
                              : "Displacement [mm]",
         .y_label = "(fitted − measured) / sigma [–]",
         .series = {{.colour = colour::blue, .kind = Kind::points, .x = at, .y = column(comparison, &FitResidual::residual)}},
         .y_levels = {-2, 0, 2}});
}

std::string comparisons_section(const Fit& fit) {
    std::vector<std::string> drawings;
    for (const Comparison& comparison : comparisons(fit)) {
        if (comparison.kind == "break") continue;  // a single number: the checks have it
        drawings.push_back(is_field(comparison) ? field_figure(comparison) : comparison_figure(comparison));
        drawings.push_back(residuals_figure(comparison));
    }
    if (drawings.empty()) return {};
    return section(
        "Data against model",
        paragraph("At the best parameters. Of residuals that are noise, 95 of 100 lie between the outer dashed lines. Data "
                  "without a displacement are compared by time: read ms in place of mm of displacement.") +
            figures(drawings));
}

std::string checks_section(const Fit& fit) {
    if (fit.checks.empty()) return {};
    std::vector<std::vector<std::string>> rows;
    for (const FitCheck& check : fit.checks)
        rows.push_back({check.experiment, check.kind, std::to_string(check.points), fmt::format("{:.4g}", check.chi_square),
                        fmt::format("{:.2g}", check.p_chi_square), fmt::format("{:.2f}", check.autocorrelation),
                        fmt::format("{:.2g}", check.p_autocorrelation)});
    return section("Is what is left noise?",
                   table("Small p: noise alone would hardly leave as much (chi-square), or as much in a row (autocorrelation).",
                         {"Experiment", "Curve", "Points", "Chi-square", "p of it", "Autocorrelation", "p of it"}, rows));
}

std::string distances_section(const Fit& fit) {
    if (fit.distances.empty()) return {};
    std::vector<std::vector<std::string>> rows;
    for (const CurveDistance& distance : fit.distances)
        rows.push_back({distance.experiment, distance.kind, fmt::format("{:.4g}", distance.area_measured),
                        fmt::format("{:.4g}", distance.area_modelled), fmt::format("{:.3g}", distance.area_between),
                        fmt::format("{:.3g}", distance.frechet)});
    return section(
        "How far the curves are apart",
        table("Areas in SI: under force over displacement it is the work in J. Frechet distance with both axes divided by the "
              "measured range. The fit does not rest on these.",
              {"Experiment", "Curve", "Area, measured", "Area, modelled", "Area between", "Frechet distance"}, rows));
}

std::string models_section(const Fit& fit) {
    if (fit.models.empty()) return {};
    std::vector<std::string> heads{"Model", "Ended", "Misfit", "AIC", "BIC", "Weight"};
    const bool photographed =
        std::ranges::any_of(fit.crack_paths, [](const CrackPaths& paths) { return !paths.photographed.empty(); });
    if (photographed) heads.insert(heads.end(), {"Path off by, mean [mm]", "At most [mm]"});
    std::vector<std::vector<std::string>> rows;
    for (const ComparedModel& model : fit.models) {
        rows.push_back({model.name, model.status, fmt::format("{:.4g}", model.misfit), fmt::format("{:.4g}", model.aic),
                        fmt::format("{:.4g}", model.bic), fmt::format("{:.3g}", model.weight)});
        const SimulatedPath all = together(fit, model.name);
        if (photographed)
            rows.back().insert(rows.back().end(), {millimetres(all.mean_distance), millimetres(all.largest_distance)});
    }
    return section(
        "Which model the data speak for",
        table(
            "The best one first; parameters, curves and intervals on this page are its. Akaike weights share out the evidence of "
            "the data; photographed paths are no part of it.",
            heads, rows));
}

// ---- parameters

std::string parameters_section(const Fit& fit) {
    std::vector<std::vector<std::string>> rows;
    for (const FittedParameter& parameter : fit.parameters)
        rows.push_back({parameter.name, fmt::format("{:.5g}", parameter.value), parameter.unit,
                        fmt::format("{:.3g}", parameter.standard_error),
                        fmt::format("{:.4g} to {:.4g}", parameter.lower_95, parameter.upper_95),
                        fmt::format("{:.4g}", parameter.initial), parameter.at_bound ? "yes" : "no", parameter.key});
    return section("Parameters",
                   table("Best values with their 95 % intervals",
                         {"Parameter", "Value", "Unit", "Standard error", "95 % interval", "Initial", "At a bound", "Key"},
                         rows));
}

std::string profiles_section(const Fit& fit) {
    std::vector<std::string> drawings;
    for (const FittedParameter& parameter : fit.parameters) {
        ChartSeries series{.colour = colour::blue};
        for (const ProfilePoint& point : fit.profile)
            if (point.parameter == parameter.name) {
                series.x.push_back(point.value);
                series.y.push_back(point.misfit - fit.misfit);
            }
        if (series.x.empty()) continue;
        ChartSeries points = series;
        points.kind = Kind::points;
        drawings.push_back(draw({.title = "Profile of " + parameter.name,
                                 .x_label = with_unit(parameter.name, parameter.unit),
                                 .y_label = "Rise of the misfit [–]",
                                 .series = {series, points},
                                 .x_levels = {parameter.lower_95, parameter.value, parameter.upper_95}}));
    }
    return drawings.empty()
               ? ""
               : section("Profile likelihood", paragraph("The least misfit with one parameter held. Dashed: best value "
                                                         "and 95 % interval.") +
                                                   figures(drawings));
}

std::vector<double> samples_of(const Fit& fit, std::size_t parameter) {
    std::vector<double> values;
    for (const PosteriorSample& sample : fit.posterior) values.push_back(sample.parameters[parameter]);
    return values;
}

std::string histogram(const FittedParameter& parameter, const std::vector<double>& values) {
    const auto [low, high] = std::ranges::minmax(values);
    const auto bins = static_cast<std::size_t>(std::clamp(std::sqrt(static_cast<double>(values.size())), 5.0, 40.0));
    const double width = (high - low) / static_cast<double>(bins);
    if (!(width > 0) || !std::isfinite(width)) return {};
    ChartSeries series{.colour = colour::blue, .kind = Kind::bars, .x = {}, .y = std::vector<double>(bins, 0.0)};
    for (std::size_t i = 0; i < bins; ++i) series.x.push_back(low + (static_cast<double>(i) + 0.5) * width);
    for (const double value : values)
        if (std::isfinite(value)) ++series.y[std::min(bins - 1, static_cast<std::size_t>((value - low) / width))];
    return draw({.title = "Posterior of " + parameter.name,
                 .x_label = with_unit(parameter.name, parameter.unit),
                 .y_label = "Samples [–]",
                 .series = {series},
                 .x_levels = {parameter.lower_95, parameter.value, parameter.upper_95}});
}

std::string posterior_section(const Fit& fit) {
    if (fit.posterior.empty()) return {};
    std::vector<std::string> drawings;
    std::vector<std::vector<double>> samples;
    for (std::size_t i = 0; i < fit.parameters.size(); ++i)
        drawings.push_back(histogram(fit.parameters[i], samples.emplace_back(samples_of(fit, i))));
    const std::size_t stride = 1 + fit.posterior.size() / most_samples;
    std::size_t pairs = 0;
    for (std::size_t j = 1; j < samples.size(); ++j)
        for (std::size_t i = 0; i < j && pairs < most_pairs; ++i, ++pairs) {
            ChartSeries cloud{.colour = colour::blue, .kind = Kind::points};
            for (std::size_t k = 0; k < fit.posterior.size(); k += stride) {
                cloud.x.push_back(samples[i][k]);
                cloud.y.push_back(samples[j][k]);
            }
            const FittedParameter &a = fit.parameters[i], &b = fit.parameters[j];
            drawings.push_back(draw({.title = fmt::format("{} and {}", a.name, b.name),
                                     .x_label = with_unit(a.name, a.unit),
                                     .y_label = with_unit(b.name, b.unit),
                                     .series = {cloud}}));
        }
    return section("Posterior", paragraph(fmt::format("{} samples. Dashed: best value and 95 % interval of the table above.",
                                                      fit.posterior.size())) +
                                    figures(drawings));
}

/// From orange (-1) through white to blue (+1), pale enough for black figures.
std::string correlation_colour(double value) {
    const double part = std::isfinite(value) ? std::clamp(std::abs(value), 0.0, 1.0) : 0.0;
    const int full[2][3] = {{230, 159, 0}, {86, 180, 233}};
    const auto& ink = full[value < 0 ? 0 : 1];
    const auto mixed = [&](int i) { return static_cast<int>(std::lround(std::lerp(255.0, ink[i], part))); };
    return fmt::format("#{:02X}{:02X}{:02X}", mixed(0), mixed(1), mixed(2));
}

std::string correlation_section(const Fit& fit) {
    if (fit.correlation.size() == 0) return section("Correlation", paragraph("There is no estimate of the covariance."));
    std::string markup = "<div class=\"scroll\"><table>\n<caption>Near 1 or −1: the data hardly tell the two "
                         "apart</caption>\n<thead><tr><td></td>";
    for (const FittedParameter& parameter : fit.parameters)
        markup += fmt::format("<th scope=\"col\">{}</th>", escaped(parameter.name));
    markup += "</tr></thead>\n<tbody>\n";
    for (Eigen::Index i = 0; i < fit.correlation.rows(); ++i) {
        markup += fmt::format("<tr><th scope=\"row\">{}</th>", escaped(fit.parameters[static_cast<std::size_t>(i)].name));
        for (Eigen::Index j = 0; j < fit.correlation.cols(); ++j)
            markup += fmt::format("<td class=\"number\" style=\"background:{}\">{:.2f}</td>",
                                  correlation_colour(fit.correlation(i, j)), fit.correlation(i, j));
        markup += "</tr>\n";
    }
    return section("Correlation", markup + "</tbody></table></div>\n");
}

// ---- runs

std::string runs_section(const Fit& fit) {
    if (fit.runs.empty()) return {};
    ChartSeries runs{.label = "a run", .colour = colour::black, .kind = Kind::points};
    ChartSeries best{.label = "best so far", .colour = colour::vermillion};
    std::map<std::string, int> ends;
    double least = INFINITY;
    const std::size_t stride = 1 + fit.runs.size() / (2 * most_samples);
    for (std::size_t i = 0; i < fit.runs.size(); ++i) {
        least = std::min(least, fit.runs[i].misfit);
        ++ends[fit.runs[i].status];
        if (i % stride == 0 || i + 1 == fit.runs.size()) {
            runs.x.push_back(static_cast<double>(i + 1));
            runs.y.push_back(fit.runs[i].misfit);
            best.y.push_back(least);
        }
    }
    best.x = runs.x;
    std::vector<std::vector<std::string>> rows;
    for (const auto& [status, count] : ends) rows.push_back({status, std::to_string(count)});
    return section("Runs", figures({draw({.title = "Misfit of each forward run",
                                          .x_label = "Forward run [–]",
                                          .y_label = "Misfit [–]",
                                          .caption = "Runs that failed have no misfit and are not drawn.",
                                          .series = {runs, best},
                                          .log_y = true}),
                                    table("How the runs ended", {"Status", "Runs"}, rows)}));
}

std::string summary(const Fit& fit) {
    std::string markup;
    const std::string lack = lack_of_fit(fit.checks);
    for (const std::string& sentence : sentences(fit.message)) {
        const bool is_end = markup.empty();  // how the fit ended comes first
        const bool warns = is_end ? fit.status != FitStatus::converged : lack.find(sentence) != std::string::npos;
        markup += warns ? fmt::format("<p class=\"warning\">{}</p>\n", escaped(sentence)) : paragraph(sentence);
    }
    double seconds = 0;
    for (const FitRun& run : fit.runs) seconds += run.seconds;
    return markup + facts({{"Ended", name(fit.status)},
                           {"Method", fit.method},
                           {"Misfit", fmt::format("{:.4g}, sum of squared weighted residuals; {:.3g} for each degree of freedom",
                                                  fit.misfit, fit.reduced_chi_square)},
                           {"Cost", fmt::format("{} forward runs in {} of computing, {} by the clock", fit.runs.size(),
                                                duration_text(seconds), duration_text(fit.seconds))},
                           {"Seed", std::to_string(fit.seed)}});
}

}  // namespace

std::string fit_page(const Fit& fit, const Origin& origin) {
    const std::string title = title_of(fit.study_text, origin);
    return page(title, heading(title, "Fit", origin) + summary(fit) + models_section(fit) + parameters_section(fit) +
                           paths_section(fit) + comparisons_section(fit) + checks_section(fit) + distances_section(fit) +
                           correlation_section(fit) + profiles_section(fit) + posterior_section(fit) + runs_section(fit) +
                           repeat_section(fit.study_text, "fit", "study.toml", origin, fit.scene_settings));
}

}  // namespace crampfit::cli

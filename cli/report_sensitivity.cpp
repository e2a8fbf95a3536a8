#include "cli/chart.hpp"
#include "cli/html.hpp"
#include "cli/progress.hpp"
#include "cli/report_pages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace crampfit::cli {

namespace {

std::string parameters_section(const Sensitivity& sensitivity) {
    std::vector<std::vector<std::string>> rows;
    for (const StudiedParameter& parameter : sensitivity.parameters)
        rows.push_back({parameter.name, fmt::format("{:.4g}", parameter.initial), fmt::format("{:.4g}", parameter.lower),
                        fmt::format("{:.4g}", parameter.upper), parameter.unit, parameter.key});
    return section("Parameters", table("What was varied", {"Parameter", "Initial", "Lower", "Upper", "Unit", "Key"}, rows));
}

std::string unit_of(const Sensitivity& sensitivity, const SensitivityIndex& index) {
    const auto unit = [](const auto& list, const std::string& name) {
        const auto found = std::ranges::find_if(list, [&](const auto& member) { return member.name == name; });
        return found == list.end() || found->unit.empty() ? "1" : found->unit;
    };
    const std::string of_output = unit(sensitivity.outputs, index.output);
    if (index.kind == "mu_star" || index.kind == "sigma") return of_output;
    return index.kind == "derivative" ? fmt::format("{} / ({})", of_output, unit(sensitivity.parameters, index.parameter)) : "–";
}

/// A table with an interval drawn in each row; bars of one output and kind share a scale.
std::string indices_section(const Sensitivity& sensitivity) {
    using OfKind = std::pair<std::string, std::string>;
    std::map<OfKind, std::pair<double, double>> ranges;
    for (const SensitivityIndex& index : sensitivity.indices) {
        auto& [low, high] = ranges[{index.output, index.kind}];
        for (const double value : {index.value, index.lower_95, index.upper_95})
            if (std::isfinite(value)) {
                low = std::min(low, value);
                high = std::max(high, value);
            }
    }
    std::string markup =
        "<div class=\"scroll\"><table>\n<caption>Indices with their 95 % intervals; bars of one output and kind share a "
        "scale, the thin line is 0</caption>\n<thead><tr>";
    for (const char* head : {"Output", "Parameter", "Method", "Kind", "Value", "95 % interval", "Unit", ""})
        markup += fmt::format("<th scope=\"col\">{}</th>", head);
    markup += "</tr></thead>\n<tbody>\n";
    for (const SensitivityIndex& index : sensitivity.indices) {
        const auto [low, high] = ranges[{index.output, index.kind}];
        const auto at = [low = low, high = high](double value) {
            return high > low ? 5 + 130 * (value - low) / (high - low) : 5;
        };
        const bool has_interval = std::isfinite(index.lower_95) && std::isfinite(index.upper_95);
        markup += fmt::format(
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td>{}</td>",
            escaped(index.output), escaped(index.parameter), escaped(index.method), escaped(index.kind),
            std::isfinite(index.value) ? fmt::format("{:.4g}", index.value) : "–",
            has_interval ? fmt::format("{:.4g} to {:.4g}", index.lower_95, index.upper_95) : "–",
            escaped(unit_of(sensitivity, index)));
        markup += fmt::format("<td><svg class=\"bar\" viewBox=\"0 0 140 14\" aria-hidden=\"true\"><path d=\"M{:.1f} 0V14\" "
                              "stroke=\"#777\" />",
                              at(0));
        if (has_interval)
            markup += fmt::format("<path d=\"M{:.1f} 7H{:.1f}\" stroke=\"{}\" stroke-width=\"3\" />", at(index.lower_95),
                                  at(index.upper_95), colour::blue);
        if (std::isfinite(index.value))
            markup += fmt::format("<circle cx=\"{:.1f}\" cy=\"7\" r=\"4\" fill=\"{}\" />", at(index.value), colour::blue);
        markup += "</svg></td></tr>\n";
    }
    return section("Indices", markup + "</tbody></table></div>\n");
}

std::string runs_section(const Sensitivity& sensitivity) {
    std::map<std::string, int> ends;
    for (const SensitivityRun& run : sensitivity.runs) ++ends[run.status];
    std::vector<std::vector<std::string>> rows;
    for (const auto& [status, count] : ends) rows.push_back({status, std::to_string(count)});
    return section("Runs", table("How the runs ended", {"Status", "Runs"}, rows));
}

}  // namespace

std::string sensitivity_page(const Sensitivity& sensitivity, const Origin& origin) {
    const std::string title = title_of(sensitivity.study_text, origin);
    std::string body =
        heading(title, "Sensitivity", origin) + paragraph(fmt::format("{}: {}", name(sensitivity.status), sensitivity.message));
    body += facts({{"Cost", fmt::format("{} forward runs in {}", sensitivity.runs.size(), duration_text(sensitivity.seconds))},
                   {"Seed", std::to_string(sensitivity.seed)}});
    body += parameters_section(sensitivity) + indices_section(sensitivity) + runs_section(sensitivity);
    return page(title,
                body + repeat_section(sensitivity.study_text, "sensitivity", "study.toml", origin, sensitivity.scene_settings));
}

}  // namespace crampfit::cli

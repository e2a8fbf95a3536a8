#include "cli/chart.hpp"
#include "cli/html.hpp"
#include "cli/progress.hpp"
#include "cli/report_pages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace crampfit::cli {

namespace {

using Kind = ChartSeries::Kind;

std::vector<double> column(const Record& record, double Instant::*member) {
    std::vector<double> values;
    for (const Instant& instant : record.series) values.push_back(instant.*member);
    return values;
}

/// What the curves of a record are drawn over.
struct Abscissa {
    std::vector<double> values;  // in the label's unit
    std::string label;
    double Instant::*member;
    ScaledUnit unit;
};

Abscissa over_displacement(const Record& record) {
    const std::vector<double> values = column(record, &Instant::displacement);
    const ScaledUnit unit = unit_for(values, units::length);
    return {scaled(values, unit), fmt::format("Displacement [{}]", unit.symbol), &Instant::displacement, unit};
}

Abscissa over_time(const Record& record) {
    const std::vector<double> values = column(record, &Instant::time);
    const ScaledUnit unit = unit_for(values, units::time);
    return {scaled(values, unit), fmt::format("Time [{}]", unit.symbol), &Instant::time, unit};
}

/// Whether displacement says the time: then one set of curves is enough.
bool is_steady(const Record& record) {
    const Instant& end = record.series.back();
    if (!(std::abs(end.displacement) > 0 && end.time > 0)) return false;
    return std::ranges::all_of(record.series, [&](const Instant& instant) {
        return std::abs(instant.displacement / end.displacement - instant.time / end.time) < 0.01;
    });
}

/// One quantity of the series, named as people do.
struct Quantity {
    const char* label;
    const char* colour;
    double Instant::*member;
    Kind kind = Kind::line;
};

/// A marker on the curve of `member` for each frame of the slider.
void add_frame_marks(Chart& chart, const Record& record, const Abscissa& abscissa, double Instant::*member,
                     const ScaledUnit& unit) {
    const std::vector<std::size_t> frames = shown_frames(record);
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const Instant& instant = instant_of(record, record.frames[frames[i]]);
        chart.series.push_back({.colour = colour::vermillion,
                                .kind = Kind::points,
                                .x = {instant.*abscissa.member / abscissa.unit.factor},
                                .y = {instant.*member / unit.factor},
                                .frame = static_cast<int>(i)});
        chart.last_frame = static_cast<int>(i);
    }
}

Chart chart_of(const Record& record, const Abscissa& abscissa, const std::string& title, const std::vector<ScaledUnit>& choices,
               const std::vector<Quantity>& quantities) {
    std::vector<double> all;
    for (const Quantity& quantity : quantities) std::ranges::copy(column(record, quantity.member), std::back_inserter(all));
    const ScaledUnit unit = unit_for(all, choices);
    Chart chart{.title = title, .x_label = abscissa.label, .y_label = fmt::format("{} [{}]", title, unit.symbol)};
    for (const Quantity& quantity : quantities)
        chart.series.push_back({.label = quantities.size() > 1 ? quantity.label : "",
                                .colour = quantity.colour,
                                .kind = quantity.kind,
                                .x = abscissa.values,
                                .y = scaled(column(record, quantity.member), unit)});
    if (quantities.size() == 1) add_frame_marks(chart, record, abscissa, quantities.front().member, unit);
    return chart;
}

/// Lines of the further cracks beside the tracked one's.
void add_cracks(Chart& chart, const Record& record, const Abscissa& abscissa, std::vector<double> CrackHistory::*member,
                double factor) {
    const char* const inks[] = {colour::blue, colour::green, colour::orange, colour::purple};
    if (!record.cracks.empty()) chart.series.front().label = "tracked crack";
    for (std::size_t i = 0; i < record.cracks.size(); ++i)
        chart.series.push_back({.label = fmt::format("crack{}", i + 1),
                                .colour = inks[i % std::size(inks)],
                                .x = abscissa.values,
                                .y = scaled(record.cracks[i].*member, {factor, ""})});
}

std::vector<std::string> curves(const Record& record, const Abscissa& abscissa) {
    const std::vector<ScaledUnit> toughness_unit{{1, "J/m²"}};
    Chart length = chart_of(record, abscissa, "Crack length", {{1e-3, "mm"}}, {{"", colour::black, &Instant::crack_length}});
    add_cracks(length, record, abscissa, &CrackHistory::length, 1e-3);
    Chart rate = chart_of(record, abscissa, "Energy release rate G", toughness_unit, {{"", colour::black, &Instant::G}});
    add_cracks(rate, record, abscissa, &CrackHistory::G, 1);
    return {draw(chart_of(record, abscissa, "Force", units::force, {{"", colour::black, &Instant::force}})), draw(length),
            draw(rate),
            draw(chart_of(record, abscissa, "Stress intensity factors", units::stress_intensity,
                          {{"K_I, opening", colour::blue, &Instant::K_I}, {"K_II, sliding", colour::orange, &Instant::K_II}})),
            draw(chart_of(record, abscissa, "Energies", units::energy,
                          {{"work of the loading", colour::black, &Instant::external_work, Kind::dashed},
                           {"strain", colour::blue, &Instant::strain_energy},
                           {"fracture", colour::vermillion, &Instant::fracture_energy},
                           {"kinetic", colour::green, &Instant::kinetic_energy}}))};
}

/// What carries the crack on from each place of its way, which in equilibrium is known.
std::vector<std::string> driving_figures(const Record& record) {
    if (record.driving.empty()) return {};
    std::vector<double> length, displacement, G, toughness;
    for (const CriticalLoad& load : record.driving) {
        length.push_back(1e3 * load.crack_length);
        displacement.push_back(1e3 * load.displacement);
        G.push_back(load.G);
        toughness.push_back(load.toughness);
    }
    const std::string along = "Crack length [mm]";
    return {draw({.title = "Displacement at which the crack moves on",
                  .x_label = along,
                  .y_label = "Displacement [mm]",
                  .caption = "Where the line falls, the crack jumps under rising displacement.",
                  .series = {{.x = length, .y = displacement}}}),
            draw({.title = "Energy release rate and toughness along the way",
                  .x_label = along,
                  .y_label = "G, toughness [J/m²]",
                  .caption = "G at the tip when the crack moves on, and the toughness over its next advance.",
                  .series = {{.label = "G at the tip", .colour = colour::blue, .x = length, .y = G},
                             {.label = "toughness", .colour = colour::vermillion, .x = length, .y = toughness}}})};
}

std::string curves_section(const Record& record) {
    if (record.series.empty()) return section("Curves", paragraph("The record holds no saved instant."));
    const bool moves = std::ranges::any_of(record.series, [](const Instant& instant) { return instant.displacement != 0; });
    std::string markup;
    if (moves) markup += figures(curves(record, over_displacement(record)));
    if (!moves || !is_steady(record)) markup += figures(curves(record, over_time(record)));
    else if (const Instant& end = record.series.back(); end.time > 0)
        markup += paragraph(fmt::format("The loading is steady, at {:.4g} mm/s: displacement tells the time.",
                                        1e3 * end.displacement / end.time));
    std::string all = section("Curves", markup);
    if (const std::vector<std::string> driving = driving_figures(record); !driving.empty())
        all += section("What drives the crack", figures(driving));
    return all;
}

std::string summary(const Record& record) {
    std::vector<std::pair<std::string, std::string>> rows{{"Ended", fmt::format("{}: {}", name(record.status), record.message)}};
    double rest = 0.0;  // of the work, in no column of the record [J]
    if (!record.series.empty()) {
        const auto peak =
            std::ranges::max_element(record.series, {}, [](const Instant& instant) { return std::abs(instant.force); });
        rows.push_back({"Largest force", fmt::format("{:.4g} N at {:.4g} mm", peak->force, 1e3 * peak->displacement)});
        rows.push_back({"Crack length", fmt::format("from {:.4g} mm to {:.4g} mm", 1e3 * record.series.front().crack_length,
                                                    1e3 * record.series.back().crack_length)});
        const Instant& last = record.series.back();
        rows.push_back({"Work of the loading",
                        fmt::format("{:.4g} mJ, of which {:.4g} mJ went into new crack faces and {:.4g} mJ are strain energy",
                                    1e3 * last.external_work, 1e3 * last.fracture_energy, 1e3 * last.strain_energy)});
        rest = last.external_work - last.fracture_energy - last.strain_energy - last.kinetic_energy;
        if (rest <= 0.01 * std::abs(last.external_work)) rest = 0.0;
    }
    const std::string freed =
        rest > 0.0 ? fmt::format(", but for {:.4g} mJ that jumps of the crack set free or that was dissipated", 1e3 * rest) : "";
    rows.push_back({"Energy balance", fmt::format("work and energies differ by at most {:.2g} % of the largest{}",
                                                  100 * record.worst_energy_imbalance, freed)});
    rows.push_back({"Cost", fmt::format("{} points, {} steps, {}", record.points, record.steps, duration_text(record.seconds))});
    return facts(rows);
}

}  // namespace

std::string record_page(const Record& record, const Origin& origin) {
    const std::string title = title_of(record.scene_text, origin);
    std::string body = heading(title, "Simulation", origin) + summary(record) + specimen_section(record) + curves_section(record);
    body += section("What was modelled, and why", verbatim(record.explanation));
    body += repeat_section(record.scene_text, "simulate", "scene.toml", origin);
    return page(title, body);
}

}  // namespace crampfit::cli

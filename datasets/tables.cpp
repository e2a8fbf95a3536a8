#include "datasets/tables.hpp"

#include "datasets/crack_track.hpp"
#include "datasets/displacement_field.hpp"
#include "datasets/error.hpp"
#include "datasets/hdf5.hpp"
#include "datasets/io.hpp"
#include "datasets/record_file.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <ostream>

namespace crampfit {

namespace {

using Row = std::vector<std::string>;

/// What is printed: the header, then the rest.
using Table = std::vector<Row>;

/// A table that a file has; made when it is asked for.
struct Offer {
    std::string name;
    std::function<Table()> make;
};

/// The shortest text that reads back as the same bits.
std::string text_of(double number) { return fmt::format("{}", number); }

/// As in RFC 4180 (Shafranovich 2005), section 2, but a line ends with a line feed alone.
std::string quoted_if_needed(const std::string& field) {
    if (field.find_first_of(",\"\r\n") == std::string::npos) return field;
    std::string quoted = "\"";
    for (const char character : field) quoted += character == '"' ? "\"\"" : std::string(1, character);
    return quoted + '"';
}

void print(const Table& table, std::ostream& out) {
    for (const Row& row : table) {
        const char* separator = "";
        for (const std::string& field : row) {
            out << separator << quoted_if_needed(field);
            separator = ",";
        }
        out << '\n';
    }
}

// ---- tables of a record

Table series_table(const Record& record) {
    Table table(1);
    for (const SeriesColumn& column : series_columns) table.front().push_back(column.header);
    for (Instant instant : record.series) {
        Row& row = table.emplace_back();
        for (const SeriesColumn& column : series_columns) row.push_back(text_of(column.value(instant)));
    }
    return table;
}

Table path_table(const std::vector<Vec2>& path) {
    Table table{{"x_m", "y_m"}};
    for (const Vec2& vertex : path) table.push_back({text_of(vertex.x()), text_of(vertex.y())});
    return table;
}

Table crack_table(const Record& record, const CrackHistory& crack) {
    Table table{
        {"time_s", "displacement_m", "crack_length_m", "tip_x_m", "tip_y_m", "G_J_m2", "K_I_Pa_sqrt_m", "K_II_Pa_sqrt_m"}};
    for (std::size_t i = 0; i < record.series.size(); ++i) {
        const Instant& instant = record.series[i];
        Row& row = table.emplace_back();
        for (const double value : {instant.time, instant.displacement, crack.length[i], crack.tip[i].x(), crack.tip[i].y(),
                                   crack.G[i], crack.K_I[i], crack.K_II[i]})
            row.push_back(text_of(value));
    }
    return table;
}

Table reactions_table(const Record& record) {
    Table table{{"time_s"}};
    for (const ReactionHistory& reaction : record.reactions) {
        table.front().push_back(reaction.name + "_x_N");
        table.front().push_back(reaction.name + "_y_N");
    }
    for (std::size_t i = 0; i < record.series.size(); ++i) {
        Row& row = table.emplace_back(Row{text_of(record.series[i].time)});
        for (const ReactionHistory& reaction : record.reactions) {
            row.push_back(text_of(reaction.force[i].x()));
            row.push_back(text_of(reaction.force[i].y()));
        }
    }
    return table;
}

Table driving_table(const Record& record) {
    Table table{{"tip_x_m", "tip_y_m"}};
    for (const DrivingColumn& column : driving_columns) table.front().push_back(column.header);
    for (const CriticalLoad& load : record.driving) {
        Row& row = table.emplace_back(Row{text_of(load.tip.x()), text_of(load.tip.y())});
        for (const DrivingColumn& column : driving_columns) row.push_back(text_of(load.*column.value));
    }
    return table;
}

std::vector<Offer> offers(const Record& record) {
    std::vector<Offer> offers{{"series", [&] { return series_table(record); }}};
    // A specimen without a crack has no path.
    if (const auto tracked = static_cast<std::size_t>(record.tracked_crack); tracked < record.paths.size())
        offers.push_back({"path", [&record, tracked] { return path_table(record.paths[tracked]); }});
    for (std::size_t i = 0; i < record.cracks.size(); ++i) {
        offers.push_back({fmt::format("crack{}", i + 1), [&record, i] { return crack_table(record, record.cracks[i]); }});
        offers.push_back(
            {fmt::format("path{}", i + 1), [&record, i] { return path_table(record.paths.at(crack_number(record, i))); }});
    }
    offers.push_back({"driving", [&] { return driving_table(record); }});
    offers.push_back({"reactions", [&] { return reactions_table(record); }});
    return offers;
}

// ---- tables of a fit

Table parameters_table(const Fit& fit) {
    Table table{{"name", "key", "value", "unit", "standard_error", "lower_95", "upper_95", "initial", "at_bound"}};
    for (const FittedParameter& parameter : fit.parameters)
        table.push_back({parameter.name, parameter.key, text_of(parameter.value), parameter.unit,
                         text_of(parameter.standard_error), text_of(parameter.lower_95), text_of(parameter.upper_95),
                         text_of(parameter.initial), parameter.at_bound ? "true" : "false"});
    return table;
}

Table runs_table(const Fit& fit) {
    Table table(1);
    for (const FittedParameter& parameter : fit.parameters) table.front().push_back(parameter.name);
    table.front().insert(table.front().end(), {"misfit", "status", "seconds"});
    for (const FitRun& run : fit.runs) {
        Row& row = table.emplace_back();
        for (const double value : run.parameters) row.push_back(text_of(value));
        row.insert(row.end(), {text_of(run.misfit), run.status, text_of(run.seconds)});
    }
    return table;
}

Table residuals_table(const Fit& fit) {
    Table table{{"experiment", "kind", "at", "measured", "modelled", "sigma", "residual"}};
    for (const FitResidual& residual : fit.residuals)
        table.push_back({residual.experiment, residual.kind, text_of(residual.at), text_of(residual.measured),
                         text_of(residual.modelled), text_of(residual.sigma), text_of(residual.residual)});
    return table;
}

Table correlation_table(const Fit& fit) {
    Table table{{"parameter"}};
    for (const FittedParameter& parameter : fit.parameters) table.front().push_back(parameter.name);
    for (Eigen::Index i = 0; i < fit.correlation.rows(); ++i) {
        Row& row = table.emplace_back(Row{fit.parameters[static_cast<std::size_t>(i)].name});
        for (Eigen::Index j = 0; j < fit.correlation.cols(); ++j) row.push_back(text_of(fit.correlation(i, j)));
    }
    return table;
}

Table checks_table(const Fit& fit) {
    Table table{{"experiment", "kind", "points", "chi_square", "p_chi_square", "autocorrelation", "p_autocorrelation"}};
    for (const FitCheck& check : fit.checks)
        table.push_back({check.experiment, check.kind, std::to_string(check.points), text_of(check.chi_square),
                         text_of(check.p_chi_square), text_of(check.autocorrelation), text_of(check.p_autocorrelation)});
    return table;
}

Table distances_table(const Fit& fit) {
    Table table{{"experiment", "kind", "area_measured", "area_modelled", "area_between", "frechet"}};
    for (const CurveDistance& distance : fit.distances)
        table.push_back({distance.experiment, distance.kind, text_of(distance.area_measured), text_of(distance.area_modelled),
                         text_of(distance.area_between), text_of(distance.frechet)});
    return table;
}

Table models_table(const Fit& fit) {
    Table table{{"model", "status", "misfit", "AIC", "BIC", "weight"}};
    for (const FittedParameter& parameter : fit.parameters) table.front().push_back(parameter.name);
    for (const ComparedModel& model : fit.models) {
        Row& row = table.emplace_back();
        row.insert(row.end(), {model.name, model.status});
        for (const double number : {model.misfit, model.aic, model.bic, model.weight}) row.push_back(text_of(number));
        for (const double value : model.values) row.push_back(text_of(value));
    }
    return table;
}

Table paths_table(const Fit& fit) {
    Table table{{"experiment", "model", "crack", "x_m", "y_m"}};
    const auto add = [&](const CrackPaths& paths, const std::string& model, const std::string& crack,
                         const std::vector<Vec2>& vertices) {
        for (const Vec2& vertex : vertices)
            table.push_back({paths.experiment, model, crack, text_of(vertex.x()), text_of(vertex.y())});
    };
    for (const CrackPaths& paths : fit.crack_paths) {
        add(paths, "", "photographed", paths.photographed);
        for (const SimulatedPath& simulated : paths.simulated)
            for (std::size_t i = 0; i < simulated.cracks.size(); ++i)
                add(paths, simulated.model, std::to_string(i), simulated.cracks[i]);
    }
    return table;
}

Table path_distances_table(const Fit& fit) {
    Table table{{"experiment", "model", "mean_m", "largest_m", "compared_length_m", "status"}};
    for (const CrackPaths& paths : fit.crack_paths)
        for (const SimulatedPath& simulated : paths.simulated)
            table.push_back({paths.experiment, simulated.model, text_of(simulated.mean_distance),
                             text_of(simulated.largest_distance), text_of(simulated.compared_length), simulated.status});
    return table;
}

Table profile_table(const Fit& fit) {
    Table table{{"parameter", "value", "misfit"}};
    for (const ProfilePoint& point : fit.profile) table.push_back({point.parameter, text_of(point.value), text_of(point.misfit)});
    return table;
}

Table posterior_table(const Fit& fit) {
    Table table(1);
    for (const FittedParameter& parameter : fit.parameters) table.front().push_back(parameter.name);
    table.front().push_back("misfit");
    for (const PosteriorSample& sample : fit.posterior) {
        Row& row = table.emplace_back();
        for (const double value : sample.parameters) row.push_back(text_of(value));
        row.push_back(text_of(sample.misfit));
    }
    return table;
}

std::vector<Offer> offers(const Fit& fit) {
    return {{"parameters", [&] { return parameters_table(fit); }},
            {"runs", [&] { return runs_table(fit); }},
            {"residuals", [&] { return residuals_table(fit); }},
            {"correlation", [&] { return correlation_table(fit); }},
            {"checks", [&] { return checks_table(fit); }},
            {"distances", [&] { return distances_table(fit); }},
            {"models", [&] { return models_table(fit); }},
            {"paths", [&] { return paths_table(fit); }},
            {"path_distances", [&] { return path_distances_table(fit); }},
            {"profile", [&] { return profile_table(fit); }},
            {"posterior", [&] { return posterior_table(fit); }}};
}

// ---- tables of a sensitivity study

Table indices_table(const Sensitivity& sensitivity) {
    Table table{{"output", "parameter", "method", "value", "lower_95", "upper_95", "kind"}};
    for (const SensitivityIndex& index : sensitivity.indices)
        table.push_back({index.output, index.parameter, index.method, text_of(index.value), text_of(index.lower_95),
                         text_of(index.upper_95), index.kind});
    return table;
}

Table runs_table(const Sensitivity& sensitivity) {
    Table table(1);
    for (const StudiedParameter& parameter : sensitivity.parameters) table.front().push_back(parameter.name);
    for (const StudiedOutput& output : sensitivity.outputs) table.front().push_back(output.name);
    table.front().insert(table.front().end(), {"status", "seconds"});
    for (const SensitivityRun& run : sensitivity.runs) {
        Row& row = table.emplace_back();
        for (const double value : run.parameters) row.push_back(text_of(value));
        for (const double value : run.outputs) row.push_back(text_of(value));
        row.insert(row.end(), {run.status, text_of(run.seconds)});
    }
    return table;
}

std::vector<Offer> offers(const Sensitivity& sensitivity) {
    return {{"indices", [&] { return indices_table(sensitivity); }}, {"runs", [&] { return runs_table(sensitivity); }}};
}

// ---- tables of a specimen

Table borders_table(const Specimen& specimen) {
    Table table{{"ring", "x_px", "y_px"}};
    for (const BorderPolyline& border : specimen.borders)
        for (const Eigen::Vector2d& point : border.points)
            table.push_back({std::to_string(border.ring), fmt::format("{:.2f}", point.x()), fmt::format("{:.2f}", point.y())});
    return table;
}

/// Without a scale a width in mm is not a number.
Table rings_table(const Specimen& specimen) {
    Table table{{"ring", "width_mm", "latewood_fraction"}};
    const double millimetres = specimen.pixel > 0 ? 1e3 * specimen.pixel : std::numeric_limits<double>::quiet_NaN();
    for (const RingFigures& ring : specimen.rings)
        table.push_back({std::to_string(ring.ring), text_of(ring.width * millimetres), text_of(ring.latewood_fraction)});
    return table;
}

/// At some hundred places along the longer side.
Table orientation_table(const Specimen& specimen) {
    Table table{{"x_px", "y_px", "radial_deg", "coherency"}};
    if (specimen.orientation.empty()) return table;
    const int step = std::max(1, std::max(specimen.columns, specimen.rows) / 100);
    for (int y = step / 2; y < specimen.rows; y += step) {
        for (int x = step / 2; x < specimen.columns; x += step) {
            const std::size_t at = static_cast<std::size_t>(y) * specimen.columns + x;
            const double degrees = specimen.orientation[at] * 180 / std::numbers::pi;
            const double coherency = specimen.coherency.empty() ? 1 : specimen.coherency[at];
            table.push_back(
                {std::to_string(x), std::to_string(y), fmt::format("{:.3f}", degrees), fmt::format("{:.4f}", coherency)});
        }
    }
    return table;
}

// ---- tables of displacement fields, which may be too large to be held at once

void print_points(const std::filesystem::path& file, std::ostream& out) {
    print({{"image", "x_px", "y_px", "u_px", "v_px", "exx", "eyy", "exy", "zncc", "sigma_px", "status"}}, out);
    read_fields(file, [&](const FieldSeries& series, int image, const DisplacementField& field) {
        for (int point = 0; point < series.lattice.count(); ++point) {
            const auto i = static_cast<std::size_t>(point);
            fmt::print(out, "{},{},{},{},{},{},{},{},{},{},{}\n", image, series.lattice.x(point), series.lattice.y(point),
                       field.u[i], field.v[i], field.exx[i], field.eyy[i], field.exy[i], field.zncc[i], field.sigma[i],
                       name(field.status[i]));
        }
    });
}

/// As `read_curves` reads it, for the data of an experiment; gaps are empty.
Table curves_table(const Curves& curves) {
    struct Column {
        const char* head;
        const std::vector<double>& values;
        double unit;  // SI
    };
    Table table(1);
    for (const Column& column : {Column{"time [s]", curves.time, 1},
                                 {"displacement [mm]", curves.displacement, 1e-3},
                                 {"force [N]", curves.force, 1},
                                 {"crack_length [mm]", curves.crack_length, 1e-3}}) {
        if (column.values.empty()) continue;
        table.resize(column.values.size() + 1);
        table.front().push_back(column.head);
        for (std::size_t i = 0; i < column.values.size(); ++i)
            table[i + 1].push_back(std::isnan(column.values[i]) ? "" : text_of(column.values[i] / column.unit));
    }
    return table;
}

std::vector<Offer> offers(const Specimen& specimen) {
    return {{"borders", [&] { return borders_table(specimen); }},
            {"rings", [&] { return rings_table(specimen); }},
            {"orientation", [&] { return orientation_table(specimen); }}};
}

Table image_table(const std::string& reference, const std::vector<std::string>& images) {
    Table table{{"image", "file"}, {"reference", reference}};
    for (std::size_t i = 0; i < images.size(); ++i) table.push_back({std::to_string(i), images[i]});
    return table;
}

// ---- tables of a crack track

Table tip_table(const CrackTrack& track) {
    Table table{{"image", "time_s", "tip_x_px", "tip_y_px", "crack_length_m", "sigma_m", "status"}};
    const double pixel = track.pixel.value_or(CrackTip::unknown);
    for (std::size_t i = 0; i < track.tips.size(); ++i) {
        const CrackTip& tip = track.tips[i];
        table.push_back({std::to_string(i), text_of(track.time.empty() ? CrackTip::unknown : track.time[i]), text_of(tip.tip.x()),
                         text_of(tip.tip.y()), text_of(tip.length * pixel), text_of(tip.sigma * pixel), name(tip.status)});
    }
    return table;
}

Table ways_table(const CrackTrack& track) {
    Table table{{"image", "x_px", "y_px"}};
    for (std::size_t i = 0; i < track.tips.size(); ++i)
        for (const Vec2& point : track.tips[i].way)
            table.push_back({std::to_string(i), fmt::format("{:.2f}", point.x()), fmt::format("{:.2f}", point.y())});
    return table;
}

std::vector<Offer> offers(const CrackTrack& track) {
    return {{"series", [&] { return tip_table(track); }},
            {"ways", [&] { return ways_table(track); }},
            {"images", [&] { return image_table(track.reference, track.images); }},
            {"experiment", [&] { return curves_table(curves_of(track)); }}};
}

template <class Result>
std::vector<std::string> names_of(const Result& result) {
    std::vector<std::string> names;
    for (const Offer& offer : offers(result)) names.push_back(offer.name);
    return names;
}

void print_one_of(const std::vector<Offer>& offers, const std::filesystem::path& file, const std::string& wanted,
                  std::ostream& out) {
    std::vector<std::string> names;
    for (const Offer& offer : offers) {
        names.push_back(offer.name);
        if (offer.name != wanted) continue;
        const Table table = offer.make();
        if (table.front().empty())  // a track without clock, load and scale
            throw InputError(file.string(), "table", wanted, "has no column: give `crampfit track` --times, --load or --pixel");
        return print(table, out);
    }
    throw InputError(file.string(), "table", wanted,
                     names.empty() ? "this file has no tables" : fmt::format("must be one of: {}", fmt::join(names, ", ")));
}

}  // namespace

std::vector<std::string> table_names(const Record& record) { return names_of(record); }
std::vector<std::string> table_names(const Fit& fit) { return names_of(fit); }
std::vector<std::string> table_names(const Sensitivity& sensitivity) { return names_of(sensitivity); }

void print_table(const Record& record, const std::string& table, std::ostream& out) {
    print_one_of(offers(record), "the record", table, out);
}
void print_table(const Fit& fit, const std::string& table, std::ostream& out) {
    print_one_of(offers(fit), "the fit", table, out);
}
void print_table(const Sensitivity& sensitivity, const std::string& table, std::ostream& out) {
    print_one_of(offers(sensitivity), "the sensitivity study", table, out);
}

void print_table(const std::filesystem::path& file, const std::string& table, std::ostream& out) {
    const std::string kind = hdf5::open(file).attribute("kind");
    if (kind == "record") {
        const Record record = read_record_without_frames(file);
        print_one_of(offers(record), file, table, out);
    } else if (kind == "fit") {
        const Fit fit = read_fit(file);
        print_one_of(offers(fit), file, table, out);
    } else if (kind == "specimen") {
        const Specimen specimen = read_specimen(file);
        print_one_of(offers(specimen), file, table, out);
    } else if (kind == "field" && table == "points") {
        print_points(file, out);
    } else if (kind == "field") {
        const FieldSeries series = read_field_series(file);
        const auto images = [&] { return image_table(series.reference, series.images); };
        print_one_of({{"points", {}}, {"images", images}}, file, table, out);
    } else if (kind == "track") {
        const CrackTrack track = read_crack_track(file);
        print_one_of(offers(track), file, table, out);
    } else if (kind == "sensitivity") {
        const Sensitivity sensitivity = read_sensitivity(file);
        print_one_of(offers(sensitivity), file, table, out);
    } else {
        print_one_of({}, file, table, out);
    }
}

}  // namespace crampfit

#include "cli/html.hpp"
#include "cli/plane_figure.hpp"
#include "cli/report_pages.hpp"
#include "datasets/crack_track.hpp"
#include "datasets/displacement_field.hpp"
#include "datasets/specimen.hpp"

#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace crampfit::cli {

namespace {

using Kind = ChartSeries::Kind;
using Fact = std::pair<std::string, std::string>;

constexpr int map_pixels = 900;          // of a specimen, along the longer side
constexpr std::size_t most_images = 24;  // of a slider
constexpr int most_strokes_a_side = 18;  // of radial directions
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

std::string share_text(double part) { return fmt::format("{:.1f} %", 100 * part); }

std::string number_or_dash(double value, const char* format) {
    return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "–";
}

double median(std::vector<double> values) {
    std::erase_if(values, [](double value) { return !std::isfinite(value); });
    if (values.empty()) return no_number;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

std::string file_name(const std::string& path) { return std::filesystem::path(path).filename().string(); }

/// Over the pixels' outer edges, of which the first one's centre is the origin.
ChartPicture over_pixels(double left, double top, double right, double bottom, const std::vector<std::uint8_t>& png,
                         int frame = always) {
    return {.address = png_address(png), .left = left, .right = right, .bottom = bottom, .top = top, .frame = frame};
}

std::string pixel_text(const std::optional<double>& pixel) {
    return pixel ? fmt::format("{:.5g} um", 1e6 * *pixel) : "size not known";
}

// ---- a specimen

/// By how much less a picture of so many bytes must be along its sides.
double to_fit(std::size_t bytes, std::size_t allowed) {
    return std::min(0.9, std::sqrt(static_cast<double>(allowed) / static_cast<double>(bytes)));
}

/// A map as coarse as it takes to keep to `most_picture_bytes`.
std::vector<std::uint8_t> small_png(const cv::Mat& map) {
    for (double pixels = map_pixels;;) {
        std::vector<std::uint8_t> bytes = png_of(shrunk(map, pixels / std::max(map.cols, map.rows)));
        if (bytes.size() <= most_picture_bytes || pixels < 2) return bytes;
        pixels *= to_fit(bytes.size(), most_picture_bytes);
    }
}

/// A picture with the colour of each pixel of wood, white where there is none.
template <class ColourOf>
std::vector<std::uint8_t> wood_png(const Specimen& specimen, const ColourOf& colour_of) {
    cv::Mat map(specimen.rows, specimen.columns, CV_8UC3, cv::Scalar::all(255));
    for (int y = 0; y < specimen.rows; ++y)
        for (int x = 0; x < specimen.columns; ++x) {
            const std::size_t at = static_cast<std::size_t>(y) * specimen.columns + x;
            if (specimen.label[at] != Specimen::void_label) map.at<Colour>(y, x) = colour_of(at);
        }
    return small_png(map);
}

ChartPicture over_specimen(const Specimen& specimen, const std::vector<std::uint8_t>& png) {
    return over_pixels(-0.5, -0.5, specimen.columns - 0.5, specimen.rows - 0.5, png);
}

void add_borders(Chart& chart, const Specimen& specimen) {
    for (const BorderPolyline& border : specimen.borders) {
        ChartSeries& line = chart.series.emplace_back(ChartSeries{.colour = colour::vermillion});
        if (&border == &specimen.borders.front()) line.label = "ring borders";
        for (const Eigen::Vector2d& point : border.points) {
            line.x.push_back(point.x());
            line.y.push_back(point.y());
        }
    }
}

/// Short strokes along the radial direction, on a lattice.
void add_directions(Chart& chart, const Specimen& specimen) {
    if (specimen.orientation.empty()) return;
    const int step = std::max(1, std::max(specimen.columns, specimen.rows) / most_strokes_a_side);
    ChartSeries strokes{.label = "radial direction", .colour = colour::blue};
    for (int y = step / 2; y < specimen.rows; y += step)
        for (int x = step / 2; x < specimen.columns; x += step) {
            const std::size_t at = static_cast<std::size_t>(y) * specimen.columns + x;
            if (specimen.label[at] == Specimen::void_label) continue;
            const double angle = specimen.orientation[at], half = 0.3 * step;
            for (const double end : {-half, half, no_number}) {  // what is no number lifts the pen
                strokes.x.push_back(x + end * std::cos(angle));
                strokes.y.push_back(y - end * std::sin(angle));
            }
        }
    chart.series.push_back(std::move(strokes));
}

std::string wood_figure(const Specimen& specimen) {
    const double last = std::max<double>(1, static_cast<double>(specimen.classes.size()) - 1);
    const auto wood = [&](std::size_t at) {
        return wood_colour((specimen.label[at] + (specimen.grade.empty() ? 0.0 : specimen.grade[at])) / last);
    };
    Chart chart = pixel_chart("Wood, ring borders and radial direction");
    chart.pictures.push_back(over_specimen(specimen, wood_png(specimen, wood)));
    add_borders(chart, specimen);
    add_directions(chart, specimen);
    if (specimen.classes.size() > 1) chart.legend_markup = wood_bar(specimen.classes.front(), specimen.classes.back());
    return draw(chart);
}

/// Of a map of numbers, where the specimen has it.
std::string number_figure(const Specimen& specimen, const std::vector<float>& values, const std::string& title,
                          const std::string& text) {
    if (values.empty()) return {};
    std::vector<double> of_wood;
    for (std::size_t at = 0; at < values.size(); ++at)
        if (specimen.label[at] != Specimen::void_label) of_wood.push_back(values[at]);
    const auto [low, high] = most_of({of_wood});
    Chart chart = pixel_chart(title);
    chart.pictures.push_back(
        over_specimen(specimen, wood_png(specimen, [&](std::size_t at) { return scale_colour(values[at], low, high); })));
    chart.legend_markup = scale_bar(text, low, high);
    return draw(chart);
}

std::string rings_section(const Specimen& specimen) {
    if (specimen.rings.empty()) return section("Rings", paragraph("No ring lies between two borders."));
    const double unit = specimen.pixel > 0 ? 1e3 * specimen.pixel : 1;
    const std::string width_label = specimen.pixel > 0 ? "Width [mm]" : "Width [px]";
    std::vector<double> number, width, latewood;
    std::vector<std::vector<std::string>> rows;
    for (const RingFigures& ring : specimen.rings) {
        number.push_back(static_cast<double>(ring.ring));
        width.push_back(unit * ring.width);
        latewood.push_back(ring.latewood_fraction);
        rows.push_back({std::to_string(ring.ring), fmt::format("{:.4g}", width.back()), fmt::format("{:.3f}", latewood.back())});
    }
    const auto over_rings = [&](const std::string& title, const std::string& label, const std::vector<double>& values) {
        return draw(
            {.title = title,
             .x_label = "Ring, from the pith outward",
             .y_label = label,
             .series = {{.kind = Kind::dashed, .x = number, .y = values}, {.kind = Kind::points, .x = number, .y = values}}});
    };
    return section("Rings", figures({over_rings("Ring width", width_label, width),
                                     over_rings("Latewood fraction", "Latewood, of a ring's area", latewood)}) +
                                table("Rings between two borders", {"Ring", width_label, "Latewood fraction"}, rows));
}

std::vector<Fact> facts_of(const Specimen& specimen) {
    const double all = static_cast<double>(specimen.label.size());
    std::vector<Fact> rows{
        {"Picture", fmt::format("{} x {} pixels, {}", specimen.columns, specimen.rows,
                                pixel_text(specimen.pixel > 0 ? std::optional(specimen.pixel) : std::nullopt))}};
    std::map<std::uint8_t, std::size_t> labels, features;
    for (const std::uint8_t label : specimen.label) ++labels[label];
    for (const std::uint8_t feature : specimen.feature) ++features[feature];
    for (const auto& [label, count] : labels)
        rows.push_back({label == Specimen::void_label ? "No wood" : specimen.classes.at(label),
                        share_text(static_cast<double>(count) / all) + " of the picture"});
    if (std::ranges::any_of(specimen.grade, [](float grade) { return grade > 0; }))
        rows.push_back({"Transition wood", share_text(static_cast<double>(std::ranges::count_if(
                                                          specimen.grade, [](float grade) { return grade > 0 && grade < 1; })) /
                                                      all) +
                                               " of the picture, counted to the class that it grades from"});
    const std::pair<Feature, const char*> kinds[] = {{Feature::background, "Background"},
                                                     {Feature::crack, "Crack"},
                                                     {Feature::mark, "Marks"},
                                                     {Feature::ray, "Rays"},
                                                     {Feature::resin_canal, "Resin canals"}};
    for (const auto& [kind, name] : kinds)
        if (const std::size_t count = features[static_cast<std::uint8_t>(kind)]; count > 0)
            rows.push_back({name, share_text(static_cast<double>(count) / all) + " of the picture"});
    rows.push_back(
        {"Rings", fmt::format("{} borders, {} rings between two of them", specimen.borders.size(), specimen.rings.size())});
    return rows;
}

// ---- displacement fields

/// One map of a field: what it shows, and in what.
struct FieldMap {
    const char* title;
    const char* text;  // of its scale
    std::vector<double> DisplacementField::*values;
};

constexpr FieldMap field_maps[] = {{"Displacement u, to the right", "u [px]", &DisplacementField::u},
                                   {"Displacement v, down the picture", "v [px]", &DisplacementField::v},
                                   {"Strain exx", "du/dx [1]", &DisplacementField::exx},
                                   {"Strain eyy", "dv/dy [1]", &DisplacementField::eyy},
                                   {"Strain exy", "(du/dy + dv/dx) / 2 [1]", &DisplacementField::exy}};

/// What is kept of each image: a row of the table, and the maps of those that the slider shows.
struct SeenFields {
    FieldSeries series;
    std::vector<std::vector<std::string>> rows;
    std::vector<int> shown;                              // images
    std::vector<std::vector<std::vector<double>>> maps;  // [map][shown][point]
};

/// The reason for which most points of an image were lost.
std::string commonest_loss(const DisplacementField& field) {
    std::map<PointStatus, int> lost;
    for (const PointStatus status : field.status)
        if (status != PointStatus::ok) ++lost[status];
    const auto most = std::ranges::max_element(lost, {}, [](const auto& entry) { return entry.second; });
    return most == lost.end() ? "–" : fmt::format("{} ({})", name(most->first), most->second);
}

std::string instant_text(const std::vector<double>& values, int image, double unit) {
    return values.empty() ? "–" : number_or_dash(values[static_cast<std::size_t>(image)] / unit, "{:.5g}");
}

SeenFields see_fields(const std::filesystem::path& file) {
    SeenFields seen;
    seen.maps.resize(std::size(field_maps));
    read_fields(file, [&](const FieldSeries& series, int image, const DisplacementField& field) {
        seen.series = series;
        const std::size_t followed = static_cast<std::size_t>(std::ranges::count(field.status, PointStatus::ok));
        const double all = static_cast<double>(field.status.size());
        seen.rows.push_back({std::to_string(image), file_name(series.images[static_cast<std::size_t>(image)]),
                             instant_text(series.time, image, 1), instant_text(series.displacement, image, 1e-3),
                             share_text(static_cast<double>(followed) / all), number_or_dash(median(field.zncc), "{:.4f}"),
                             number_or_dash(median(field.sigma), "{:.4f}"), commonest_loss(field)});
        // Evenly spread, the last among them.
        const std::size_t count = series.images.size(), kept = std::min(count, most_images),
                          at = static_cast<std::size_t>(image) + 1;
        if (at * kept / count == (at - 1) * kept / count) return;
        seen.shown.push_back(image);
        for (std::size_t map = 0; map < std::size(field_maps); ++map) seen.maps[map].push_back(field.*field_maps[map].values);
    });
    return seen;
}

/// A pixel a point, made so large that a browser does not blur them.
cv::Mat lattice_picture(const PointLattice& lattice, const std::vector<double>& values, double low, double high) {
    cv::Mat map(lattice.rows, lattice.columns, CV_8UC3, cv::Scalar::all(255));
    for (int point = 0; point < lattice.count(); ++point)
        if (const double value = values[static_cast<std::size_t>(point)]; std::isfinite(value))
            map.at<Colour>(point / lattice.columns, point % lattice.columns) = scale_colour(value, low, high);
    const int larger = 400 / std::max(lattice.rows, lattice.columns);
    if (larger > 1) cv::resize(map, map, {}, larger, larger, cv::INTER_NEAREST);
    return map;
}

std::string field_figure(const SeenFields& seen, std::size_t map) {
    const PointLattice& lattice = seen.series.lattice;
    const auto [low, high] = most_of(seen.maps[map]);
    Chart chart = pixel_chart(field_maps[map].title);
    const double half = 0.5 * lattice.step;
    const std::size_t allowed = most_picture_bytes / std::size(field_maps);
    for (double factor = 1;;) {
        std::size_t bytes = 0;
        chart.pictures.clear();
        for (std::size_t i = 0; i < seen.shown.size(); ++i) {
            const std::vector<std::uint8_t> png = png_of(shrunk(lattice_picture(lattice, seen.maps[map][i], low, high), factor));
            bytes += png.size();
            chart.pictures.push_back(over_pixels(lattice.first_x - half, lattice.first_y - half,
                                                 lattice.x(lattice.count() - 1) + half, lattice.y(lattice.count() - 1) + half,
                                                 png, static_cast<int>(i)));
        }
        if (bytes <= allowed || factor * std::max(lattice.columns, lattice.rows) < 2) break;
        factor *= to_fit(bytes, allowed);
    }
    chart.last_frame = static_cast<int>(seen.shown.size()) - 1;
    chart.legend_markup = scale_bar(field_maps[map].text, low, high);
    return draw(chart);
}

std::string fields_section(const SeenFields& seen) {
    std::vector<std::string> sentences, drawings;
    for (const int image : seen.shown) {
        const std::vector<std::string>& row = seen.rows[static_cast<std::size_t>(image)];
        sentences.push_back(
            fmt::format("Image {} of {}: {}, {} of the points followed", image + 1, seen.rows.size(), row[1], row[4]));
    }
    for (std::size_t map = 0; map < std::size(field_maps); ++map) drawings.push_back(field_figure(seen, map));
    return section("Displacements and strains",
                   paragraph("At the places of the points in the reference; where it is white a point was lost, or lacks the "
                             "neighbours that a strain takes.") +
                       slider("Image", sentences) + figures(drawings));
}

// ---- a crack

/// Crack length or force over the images, by their time where it is known.
struct Along {
    std::vector<double> values;
    std::string label;
};

Along along_images(const CrackTrack& track) {
    if (!track.time.empty()) return {track.time, "Time [s]"};
    Along numbers{{}, "Image"};
    for (std::size_t i = 0; i < track.tips.size(); ++i) numbers.values.push_back(static_cast<double>(i));
    return numbers;
}

std::vector<std::string> track_curves(const CrackTrack& track) {
    const Along along = along_images(track);
    const double unit = track.pixel ? 1e3 * *track.pixel : 1;
    ChartSeries lengths{.kind = Kind::points, .x = along.values};
    for (const CrackTip& tip : track.tips) {
        lengths.y.push_back(unit * tip.length);
        lengths.y_error.push_back(std::isfinite(tip.sigma) ? unit * tip.sigma : 0);
    }
    std::vector<std::string> drawings{draw({.title = "Crack length",
                                            .x_label = along.label,
                                            .y_label = track.pixel ? "Crack length [mm]" : "Crack length [px]",
                                            .caption = "Bars are standard errors.",
                                            .series = {lengths}})};
    const bool has_way = !track.displacement.empty();
    if (!track.force.empty())
        drawings.push_back(draw({.title = "Force at the images",
                                 .x_label = has_way ? "Displacement [mm]" : along.label,
                                 .y_label = "Force [N]",
                                 .series = {{.kind = Kind::points,
                                             .x = has_way ? scaled(track.displacement, {1e-3, "mm"}) : along.values,
                                             .y = track.force}}}));
    return drawings;
}

std::string way_figure(const CrackTrack& track) {
    Chart chart = pixel_chart("Crack and its tips, in the reference");
    ChartSeries tips{.label = "tips", .colour = colour::blue, .kind = Kind::points};
    for (const CrackTip& tip : track.tips) {
        tips.x.push_back(tip.tip.x());
        tips.y.push_back(tip.tip.y());
    }
    if (track.columns > 0) {
        const double right = track.columns - 0.5, bottom = track.rows - 0.5;
        chart.series.push_back({.label = "border of the picture",
                                .colour = colour::gray,
                                .x = {-0.5, right, right, -0.5, -0.5},
                                .y = {-0.5, -0.5, bottom, bottom, -0.5}});
    }
    ChartSeries way{.label = "crack", .colour = colour::vermillion};
    for (const Vec2& vertex : path_of(track)) {
        way.x.push_back(vertex.x());
        way.y.push_back(vertex.y());
    }
    chart.series.push_back(std::move(way));
    chart.series.push_back(std::move(tips));
    return draw(chart);
}

std::string tips_table(const CrackTrack& track) {
    const double unit = track.pixel ? 1e3 * *track.pixel : 1;
    const std::string length_unit = track.pixel ? "mm" : "px";
    std::vector<std::vector<std::string>> rows;
    for (std::size_t i = 0; i < track.tips.size(); ++i) {
        const CrackTip& tip = track.tips[i];
        rows.push_back({std::to_string(i), file_name(track.images[i]), instant_text(track.time, static_cast<int>(i), 1),
                        number_or_dash(tip.tip.x(), "{:.2f}"), number_or_dash(tip.tip.y(), "{:.2f}"),
                        number_or_dash(unit * tip.length, "{:.4g}"), number_or_dash(unit * tip.sigma, "{:.2g}"),
                        name(tip.status)});
    }
    return table("Tips",
                 {"Image", "File", "Time [s]", "x [px]", "y [px]", fmt::format("Crack length [{}]", length_unit),
                  fmt::format("Standard error [{}]", length_unit), "Status"},
                 rows);
}

}  // namespace

std::string specimen_page(const Specimen& specimen, const Origin& origin) {
    const std::string title = specimen.source.empty() ? origin.file.filename().string() : file_name(specimen.source);
    const std::string maps = figures(
        {wood_figure(specimen), number_figure(specimen, specimen.density, "Density", "Density [kg/m³]"),
         number_figure(specimen, specimen.coherency, "How plainly the picture shows its radial direction", "Coherency [1]")});
    return page(title,
                heading(title, "Specimen", origin) + facts(facts_of(specimen)) + section("Wood", maps) + rings_section(specimen));
}

std::string field_page(const std::filesystem::path& file, const Origin& origin) {
    const SeenFields seen = see_fields(file);
    const FieldSeries series = seen.shown.empty() ? read_field_series(file) : seen.series;
    const std::string title = "Displacements against " + file_name(series.reference);
    std::string body = heading(title, "Displacement field", origin);
    body += facts(
        {{"Images", std::to_string(series.images.size())},
         {"Pixel", pixel_text(series.pixel)},
         {"Points", fmt::format("{} x {}, {} pixels apart", series.lattice.columns, series.lattice.rows, series.lattice.step)},
         {"Subset", fmt::format("{} pixels, warp of order {}", series.subset, series.order)}});
    if (!seen.shown.empty()) body += fields_section(seen);
    body += section("Images", table("How points were followed",
                                    {"Image", "File", "Time [s]", "Displacement [mm]", "Followed", "Correlation, median",
                                     "Standard error of u and v, median [px]", "Lost, mostly for"},
                                    seen.rows));
    return page(title, body);
}

std::string track_page(const CrackTrack& track, const Origin& origin) {
    const std::string title = "Crack in " + file_name(track.reference);
    const auto found = std::ranges::count(track.tips, TipStatus::ok, &CrackTip::status);
    std::vector<Fact> rows{{"Tips", fmt::format("found in {} of {} images", found, track.tips.size())},
                           {"Pixel", pixel_text(track.pixel)}};
    if (track.clock)
        rows.push_back({"Clocks", fmt::format("load time = {:.6g} s + {:.8g} image time; {}", track.clock->offset,
                                              track.clock->rate, track.clock->reason)});
    std::vector<std::string> drawings = track_curves(track);
    drawings.push_back(way_figure(track));
    return page(title, heading(title, "Crack track", origin) + facts(rows) + section("Crack", figures(drawings)) +
                           section("Images", tips_table(track)));
}

}  // namespace crampfit::cli

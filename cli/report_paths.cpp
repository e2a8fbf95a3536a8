#include "cli/html.hpp"
#include "cli/plane_figure.hpp"
#include "cli/report_pages.hpp"

#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace crampfit::cli {

namespace {

constexpr int figure_pixels = 900;    // along the longer side
constexpr double around = 0.08;       // of a close-up, on each side, of its longer side
constexpr double least_aspect = 0.5;  // of a close-up, shorter to longer side

/// What a figure shows of one experiment.
struct Sight {
    const CrackPaths* paths;
    std::string title;
    Vec2 low, high;                   // corners [m]
    std::vector<std::size_t> models;  // by their place in `paths->simulated`
};

const char* colour_of(std::size_t model) {
    const char* const inks[] = {colour::vermillion, colour::blue, colour::green, colour::orange, colour::purple};
    return inks[model % std::size(inks)];
}

std::string label_of(const SimulatedPath& simulated) { return simulated.model.empty() ? "simulated" : simulated.model; }

/// The corners of what holds these paths, within the picture.
std::pair<Vec2, Vec2> corners_about(const CrackPaths& paths, const std::vector<std::size_t>& models) {
    Vec2 low = Vec2::Constant(INFINITY), high = -low;
    const auto include = [&](const std::vector<Vec2>& line) {
        for (const Vec2& vertex : line) {
            low = low.cwiseMin(vertex);
            high = high.cwiseMax(vertex);
        }
    };
    include(paths.photographed);
    for (const std::size_t model : models) std::ranges::for_each(paths.simulated[model].cracks, include);
    const double longer = (high - low).maxCoeff();
    const Vec2 margin = (0.5 * (Vec2::Constant(least_aspect * longer) - (high - low))).cwiseMax(around * longer);
    return {(low - margin).cwiseMax(paths.picture.low), (high + margin).cwiseMin(paths.picture.high)};
}

bool any_path(const CrackPaths& paths) {
    return !paths.photographed.empty() ||
           std::ranges::any_of(paths.simulated, [](const SimulatedPath& s) { return !s.cracks.empty(); });
}

/// All paths over the whole specimen, then each over the photographed one, near by.
std::vector<Sight> sights_of(const CrackPaths& paths) {
    std::vector<std::size_t> all;
    for (std::size_t i = 0; i < paths.simulated.size(); ++i) all.push_back(i);
    std::vector<Sight> sights{{&paths, paths.experiment + (paths.on_photograph ? ": photograph" : ": wood of the model"),
                               paths.picture.low, paths.picture.high, all}};
    const auto [low, high] = corners_about(paths, all);
    for (const std::size_t model : all)
        if (!paths.simulated[model].cracks.empty() && (low.array() < high.array()).all())
            sights.push_back(
                {&paths, fmt::format("{}: {}", paths.experiment, label_of(paths.simulated[model])), low, high, {model}});
    return sights;
}

/// A part of the picture, as a PNG of at most so many pixels a side; its corners become those of whole pixels.
std::vector<std::uint8_t> cut_out(Sight& sight, int longer_side) {
    const PlanePicture& picture = sight.paths->picture;
    const cv::Mat whole(picture.rows, picture.columns, CV_8U, const_cast<std::uint8_t*>(picture.gray.data()));
    const Vec2 pixel = (picture.high - picture.low).cwiseQuotient(Vec2(picture.columns, picture.rows));
    const Vec2 first = (sight.low - picture.low).cwiseQuotient(pixel), last = (sight.high - picture.low).cwiseQuotient(pixel);
    const int left = static_cast<int>(std::floor(first.x())), right = static_cast<int>(std::ceil(last.x()));
    const int bottom = static_cast<int>(std::floor(first.y())), top = static_cast<int>(std::ceil(last.y()));
    const cv::Rect part =
        cv::Rect(cv::Point(left, picture.rows - top), cv::Point(right, picture.rows - bottom)) & cv::Rect({0, 0}, whole.size());
    sight.low = picture.low + pixel.cwiseProduct(Vec2(part.x, picture.rows - part.y - part.height));
    sight.high = picture.low + pixel.cwiseProduct(Vec2(part.x + part.width, picture.rows - part.y));
    const cv::Mat shown = shrunk(whole(part), longer_side / static_cast<double>(std::max(part.width, part.height)));
    cv::Mat pale;  // lines stand out from it
    shown.convertTo(pale, CV_8U, 0.65, 0.35 * 255);
    return png_of(pale);
}

std::string figure(const Sight& sight, const std::vector<std::uint8_t>& png) {
    const CrackPaths& paths = *sight.paths;
    Chart chart = plane_chart(sight.title);
    chart.pictures.push_back(picture_between(sight.low, sight.high, png));
    for (const std::size_t model : sight.models)
        for (std::size_t crack = 0; crack < paths.simulated[model].cracks.size(); ++crack) {
            chart.series.push_back(path_line(paths.simulated[model].cracks[crack], colour_of(model)));
            chart.series.back().label = crack == 0 ? label_of(paths.simulated[model]) : "";
        }
    if (!paths.photographed.empty()) {  // last: through its gaps one sees what it lies on
        chart.series.push_back(path_line(paths.photographed, colour::black));
        chart.series.back().label = "photographed";
        chart.series.back().kind = ChartSeries::Kind::dashed;
    }
    return draw(chart);
}

/// Pictures as coarse as it takes to keep together to `most_picture_bytes`.
std::vector<std::string> draw_sights(std::vector<Sight> sights) {
    for (double pixels = figure_pixels;;) {
        std::vector<std::string> drawings;
        std::size_t bytes = 0;
        for (Sight& sight : sights) {
            const std::vector<std::uint8_t> png = cut_out(sight, static_cast<int>(pixels));
            bytes += png.size();
            drawings.push_back(figure(sight, png));
        }
        if (bytes <= most_picture_bytes || pixels < 2) return drawings;
        pixels *= std::min(0.9, std::sqrt(static_cast<double>(most_picture_bytes) / static_cast<double>(bytes)));
    }
}

std::string distances_table(const std::vector<CrackPaths>& all) {
    std::vector<std::vector<std::string>> rows;
    for (const CrackPaths& paths : all)
        for (const SimulatedPath& simulated : paths.simulated)
            rows.push_back({paths.experiment, label_of(simulated), millimetres(simulated.mean_distance),
                            millimetres(simulated.largest_distance), millimetres(simulated.compared_length), simulated.status});
    return table("Distance of the photographed path from the simulated one, where both have grown",
                 {"Experiment", "Path", "Mean [mm]", "Largest [mm]", "Over [mm]", "Its run ended"}, rows);
}

}  // namespace

std::string millimetres(double metres) { return std::isfinite(metres) ? fmt::format("{:.3f}", 1e3 * metres) : "–"; }

std::string paths_section(const Fit& fit) {
    std::vector<Sight> sights;
    bool tracked = false, on_photograph = false;
    for (const CrackPaths& paths : fit.crack_paths)
        if (any_path(paths)) {
            std::ranges::move(sights_of(paths), std::back_inserter(sights));
            tracked = tracked || !paths.photographed.empty();
            on_photograph = on_photograph || paths.on_photograph;
        }
    if (sights.empty()) return {};
    const std::string where = on_photograph ? " A photograph under load shows a gap beside the place where the wood parted." : "";
    return section("Crack paths", paragraph("At the best parameters, in the undeformed specimen." + where) +
                                      (tracked ? distances_table(fit.crack_paths) : "") +
                                      figures(draw_sights(std::move(sights))));
}

}  // namespace crampfit::cli

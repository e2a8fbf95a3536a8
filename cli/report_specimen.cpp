#include "cli/html.hpp"
#include "cli/plane_figure.hpp"
#include "cli/report_pages.hpp"

#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit::cli {

namespace {

constexpr std::size_t most_frames = 40;
constexpr int frame_pixels = 440;  // along the longer side

/// A rectangle of the specimen's plane [m].
struct View {
    Vec2 low{INFINITY, INFINITY}, high{-INFINITY, -INFINITY};

    /// A point's rectangle of this size; one that is nowhere is left out.
    void include(const Vec2& point, const Vec2& size) {
        if (!point.allFinite()) return;
        low = low.cwiseMin(point - 0.5 * size);
        high = high.cwiseMax(point + 0.5 * size);
    }
    bool contains(const Vec2& point) const {
        return (point - low).minCoeff() >= 0 && (high - point).minCoeff() >= 0;  // false for what is not a number
    }
    /// Not beyond the rectangle of `body` and its size on each side: a run that went unstable throws points far away.
    void keep_near(const View& body) {
        const Vec2 size = body.high - body.low;
        low = low.cwiseMax(body.low - size);
        high = high.cwiseMin(body.high + size);
    }
};

/// Distance between neighbouring points along one axis [m]: the middle one, since points beside a cutout stand off the lattice;
/// 0 where no two stand in a row.
double spacing(const std::vector<Vec2>& points, int along) {
    std::vector<std::pair<long, double>> ordered;
    for (const Vec2& point : points) ordered.emplace_back(std::lround(1e9 * point[1 - along]), point[along]);
    std::ranges::sort(ordered);
    std::vector<double> steps;
    for (std::size_t i = 1; i < ordered.size(); ++i)
        if (ordered[i].first == ordered[i - 1].first && ordered[i].second > ordered[i - 1].second)
            steps.push_back(ordered[i].second - ordered[i - 1].second);
    if (steps.empty()) return 0;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::ranges::nth_element(steps, middle);
    return *middle;
}

Vec2 spacing(const std::vector<Vec2>& points) {
    Vec2 both(spacing(points, 0), spacing(points, 1));
    if (!(both.maxCoeff() > 0)) both.setConstant(1e-3);
    return (both.array() > 0).select(both, both.maxCoeff());
}

/// A PNG with each point as a small rectangle of its colour, on white.
std::vector<std::uint8_t> draw_points(const std::vector<Vec2>& points, const std::vector<Colour>& colours, const Vec2& spacing_of,
                                      const View& view, int longer_side = frame_pixels) {
    const Vec2 size = view.high - view.low;
    if (!size.allFinite()) return {};
    const double scale = longer_side / size.maxCoeff();  // [px/m]
    cv::Mat picture(std::max(1, static_cast<int>(std::lround(size.y() * scale))),
                    std::max(1, static_cast<int>(std::lround(size.x() * scale))), CV_8UC3, cv::Scalar::all(255));
    const cv::Rect whole(0, 0, picture.cols, picture.rows);
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (!view.contains(points[i])) continue;
        // Outward to whole pixels, and a little overlap: what is stretched shows no seams.
        const Vec2 low = (points[i] - 0.53 * spacing_of - view.low) * scale,
                   high = (points[i] + 0.53 * spacing_of - view.low) * scale;
        const cv::Point corner(static_cast<int>(std::floor(low.x())), picture.rows - static_cast<int>(std::ceil(high.y())));
        const cv::Point opposite(static_cast<int>(std::ceil(high.x())), picture.rows - static_cast<int>(std::floor(low.y())));
        picture(cv::Rect(corner, opposite) & whole).setTo(cv::Scalar(colours[i]));
    }
    return png_of(picture);
}

// ---- the undeformed specimen

ChartPicture picture_over(const View& view, const std::vector<std::uint8_t>& bytes, int frame = always) {
    return picture_between(view.low, view.high, bytes, frame);
}

/// The first crack grows with the slider: its vertices are what frames hold. Others stand as they ended.
std::string map_figure(const Record& record, const std::vector<std::size_t>& frames, const Vec2& spacing_of) {
    Chart chart = plane_chart(record.point_position.empty() ? "Crack path" : "Specimen and crack path, undeformed");
    const auto [least, most] = std::ranges::minmax_element(record.point_latewood);
    const bool two_woods = !record.point_latewood.empty() && *least < *most;
    if (!record.point_position.empty()) {
        View view;
        std::vector<Colour> colours;
        for (std::size_t i = 0; i < record.point_position.size(); ++i) {
            view.include(record.point_position[i], spacing_of);
            colours.push_back(wood_colour(record.point_latewood[i]));
        }
        chart.pictures.push_back(picture_over(view, draw_points(record.point_position, colours, spacing_of, view)));
    }
    for (std::size_t i = 0; i < record.paths.size(); ++i)
        if (i > 0 || frames.empty())
            chart.series.push_back(path_line(record.paths[i], i == 0 ? colour::vermillion : colour::blue));
    for (std::size_t i = 0; i < frames.size(); ++i)
        chart.series.push_back(path_line(record.frames[frames[i]].crack, colour::vermillion, static_cast<int>(i)));
    chart.last_frame = static_cast<int>(frames.size()) - 1;
    if (two_woods) chart.legend_markup = wood_bar("first (earlywood)", "last (latewood)");
    return draw(chart);
}

// ---- the deformed specimen

/// Magnification at which the largest displacement is some 5 % of the specimen; 1 where it can be seen as it is.
double readable_magnification(const Record& record, const std::vector<std::size_t>& frames, double extent) {
    double largest = 0;
    for (const std::size_t frame : frames)
        for (const Eigen::Vector2f& moved : record.frames[frame].moved)
            if (moved.allFinite()) largest = std::max<double>(largest, moved.norm());
    if (largest == 0 || largest > 0.01 * extent) return 1;
    const double wanted = 0.05 * extent / largest;
    const double power = std::pow(10, std::floor(std::log10(wanted)));
    double magnification = power;
    for (const double step : {2.0, 5.0})
        if (step * power <= wanted) magnification = step * power;
    return magnification;
}

/// Largest principal stress of each point in the plane [Pa].
std::vector<double> principal_stress(const Frame& frame) {
    std::vector<double> values;
    for (const Eigen::Vector4f& stress : frame.stress)
        values.push_back(0.5 * (stress[0] + stress[1]) + std::hypot(0.5 * (stress[0] - stress[1]), stress[2]));
    return values;
}

std::vector<Vec2> deformed(const Record& record, const Frame& frame, double magnification) {
    std::vector<Vec2> places = record.point_position;
    for (std::size_t i = 0; i < places.size(); ++i) places[i] += magnification * frame.moved[i].cast<double>();
    return places;
}

/// The frames' pictures, so coarse that together they keep to `most_picture_bytes`.
std::vector<std::vector<std::uint8_t>> draw_frames(const std::vector<std::vector<Vec2>>& places,
                                                   const std::vector<std::vector<Colour>>& colours, const Vec2& spacing_of,
                                                   const View& view) {
    for (int pixels = frame_pixels;; pixels /= 2) {
        std::vector<std::vector<std::uint8_t>> pictures;
        std::size_t bytes = 0;
        for (std::size_t i = 0; i < places.size(); ++i)
            bytes += pictures.emplace_back(draw_points(places[i], colours[i], spacing_of, view, pixels)).size();
        if (bytes <= most_picture_bytes) return pictures;
    }
}

std::string deformed_figure(const Record& record, const std::vector<std::size_t>& frames, const Vec2& spacing_of) {
    View body;
    for (const Vec2& point : record.point_position) body.include(point, spacing_of);
    View view = body;
    const double magnification = readable_magnification(record, frames, (body.high - body.low).maxCoeff());
    std::vector<std::vector<Vec2>> places;
    std::vector<std::vector<double>> stresses;
    for (const std::size_t frame : frames) {
        places.push_back(deformed(record, record.frames[frame], magnification));
        stresses.push_back(principal_stress(record.frames[frame]));
        for (const Vec2& place : places.back()) view.include(place, spacing_of);
    }
    view.keep_near(body);
    const auto [low, high] = most_of(stresses);
    std::vector<std::vector<Colour>> colours;
    for (const std::vector<double>& frame : stresses) {
        colours.emplace_back();
        for (const double stress : frame) colours.back().push_back(scale_colour(stress, low, high));
    }
    const std::vector<std::vector<std::uint8_t>> pictures = draw_frames(places, colours, spacing_of, view);
    Chart chart = plane_chart(magnification == 1 ? "Deformed specimen, displacements as they are"
                                                 : fmt::format("Deformed specimen, displacements {:g} times", magnification));
    for (std::size_t i = 0; i < frames.size(); ++i)
        chart.pictures.push_back(picture_over(view, pictures[i], static_cast<int>(i)));
    chart.last_frame = static_cast<int>(frames.size()) - 1;
    const ScaledUnit unit = unit_for({low, high}, units::stress);
    chart.legend_markup = scale_bar(fmt::format("Largest principal stress [{}], tension positive", unit.symbol),
                                    low / unit.factor, high / unit.factor);
    return draw(chart);
}

std::vector<std::string> sentences_of(const Record& record, const std::vector<std::size_t>& frames) {
    const ScaledUnit clock = unit_for({record.frames.back().time}, units::time);
    std::vector<std::string> sentences;
    for (const std::size_t at : frames) {
        const Frame& frame = record.frames[at];
        std::string& text =
            sentences.emplace_back(fmt::format("Frame {} of {}: {:.4g} {}, displacement {:.4g} mm", at + 1, record.frames.size(),
                                               frame.time / clock.factor, clock.symbol, 1e3 * frame.displacement));
        if (!record.series.empty()) {
            const Instant& instant = instant_of(record, frame);
            const double force = std::round(1e3 * instant.force) / 1e3 + 0.0;  // no -0.000
            text += fmt::format(", force {:.3f} N, crack {:.3f} mm", force, 1e3 * instant.crack_length);
        }
    }
    return sentences;
}

}  // namespace

std::vector<std::size_t> shown_frames(const Record& record) {
    if (record.point_position.empty()) return {};
    const std::size_t count = std::min(record.frames.size(), most_frames);
    std::vector<std::size_t> frames;
    for (std::size_t i = 0; i < count; ++i)
        frames.push_back(count == 1 ? record.frames.size() - 1 : i * (record.frames.size() - 1) / (count - 1));
    return frames;
}

const Instant& instant_of(const Record& record, const Frame& frame) {
    // Rows of one time are a jump of the crack: the tip tells them apart.
    const auto distance = [&](const Instant& instant) {
        const bool knows_tip = record.tracked_crack == 0 && !frame.crack.empty();
        return std::pair(std::abs(instant.time - frame.time), knows_tip ? (instant.tip - frame.crack.back()).norm() : 0.0);
    };
    return *std::ranges::min_element(record.series, {}, distance);
}

std::string specimen_section(const Record& record) {
    const std::vector<std::size_t> frames = shown_frames(record);
    const Vec2 spacing_of = spacing(record.point_position);
    std::vector<std::string> drawings{map_figure(record, frames, spacing_of)};
    std::string markup;
    if (frames.empty()) markup = paragraph("The record holds no frames; \"frames\" under [output] of the scene asks for them.");
    else {
        drawings.push_back(deformed_figure(record, frames, spacing_of));
        markup = slider("Frame", sentences_of(record, frames));
    }
    return section("Specimen and crack", markup + figures(drawings));
}

}  // namespace crampfit::cli

#include "imaging/field_preview.hpp"

#include "datasets/error.hpp"
#include "datasets/whole_file.hpp"

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr int legend_height = 40;  // [px]
constexpr int least_width = 260;   // of one map, so that the legend has room [px]

struct Range {
    double low;
    double high;
};

Range range_of(const std::vector<double>& values) {
    Range range{1, 0};
    for (const double value : values)
        if (!std::isnan(value))
            range = range.low > range.high ? Range{value, value} : Range{std::min(range.low, value), std::max(range.high, value)};
    return range;
}

cv::Mat faded(const FinePicture& picture) {
    const cv::Mat gray(picture.rows, picture.columns, CV_32F, const_cast<float*>(picture.gray.data()));
    cv::Mat bytes, colour;
    gray.convertTo(bytes, CV_8U, 0.5, 100);
    cv::cvtColor(bytes, colour, cv::COLOR_GRAY2BGR);
    return colour;
}

/// All colours from low to high, a column each.
cv::Mat colour_scale() {
    cv::Mat ramp(1, 256, CV_8U), colours;
    for (int i = 0; i < 256; ++i) ramp.at<std::uint8_t>(0, i) = static_cast<std::uint8_t>(i);
    cv::applyColorMap(ramp, colours, cv::COLORMAP_VIRIDIS);
    return colours;
}

void draw_legend(cv::Mat& map, const cv::Mat& colours, const std::string& name, const Range& range) {
    const cv::Mat legend = map.rowRange(map.rows - legend_height, map.rows);
    cv::Mat bar;
    cv::resize(colours, bar, {map.cols - 20, 10}, 0, 0, cv::INTER_LINEAR);
    bar.copyTo(legend(cv::Rect(10, 4, bar.cols, bar.rows)));
    const std::string text = range.low > range.high ? name + ": no point was followed"
                                                    : fmt::format("{} from {:.4g} to {:.4g} px", name, range.low, range.high);
    cv::putText(legend, text, {10, 31}, cv::FONT_HERSHEY_SIMPLEX, 0.45, {0, 0, 0}, 1, cv::LINE_AA);
}

cv::Mat draw_map(const FinePicture& reference, const PointLattice& lattice, const std::vector<double>& values,
                 const std::string& name) {
    cv::Mat map(reference.rows + legend_height, std::max(reference.columns, least_width), CV_8UC3, cv::Scalar::all(255));
    cv::Mat picture = map(cv::Rect(0, 0, reference.columns, reference.rows));
    faded(reference).copyTo(picture);
    const cv::Mat colours = colour_scale();
    const Range range = range_of(values);
    const int size = std::max(2, lattice.step - 1);
    for (int point = 0; point < lattice.count(); ++point) {
        const double value = values[static_cast<std::size_t>(point)];
        const cv::Point place(lattice.x(point), lattice.y(point));
        if (std::isnan(value)) {
            cv::drawMarker(picture, place, {0, 0, 200}, cv::MARKER_TILTED_CROSS, std::min(6, size));
            continue;
        }
        const double part = range.high > range.low ? (value - range.low) / (range.high - range.low) : 0.5;
        const auto colour = colours.at<cv::Vec3b>(0, static_cast<int>(std::lround(255 * part)));
        cv::rectangle(picture, cv::Rect(place.x - size / 2, place.y - size / 2, size, size), colour, cv::FILLED);
    }
    draw_legend(map, colours, name, range);
    return map;
}

void write_drawing(const cv::Mat& drawing, const std::filesystem::path& file) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(file.extension().string(), drawing, bytes);
    write_whole_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace

void require_picture_name(const std::filesystem::path& file, const std::string& option) {
    if (!cv::haveImageWriter(file.string()))
        throw InputError("command line", option, file.string(), "must end as a picture does, such as .png");
    require_writable(file);
}

void draw_field(const FinePicture& reference, const PointLattice& lattice, const DisplacementField& field,
                const std::filesystem::path& file) {
    cv::Mat both;
    cv::hconcat(draw_map(reference, lattice, field.u, "u"), draw_map(reference, lattice, field.v, "v"), both);
    write_drawing(both, file);
}

void draw_track(const FinePicture& image, const std::vector<CrackTip>& tips, const std::filesystem::path& file) {
    cv::Mat drawing = faded(image);
    const auto pixel = [](const Vec2& place) {
        return cv::Point(static_cast<int>(std::lround(place.x())), static_cast<int>(std::lround(place.y())));
    };
    for (const CrackTip& tip : tips)
        if (tip.status == TipStatus::ok) cv::circle(drawing, pixel(tip.tip), 3, {200, 80, 0}, 1, cv::LINE_AA);
    const CrackTip& last = tips.back();
    std::vector<Vec2> way = last.way;
    if (last.status == TipStatus::ok) {
        cv::drawMarker(drawing, pixel(last.tip), {0, 0, 220}, cv::MARKER_CROSS, 15, 2);
        if (way.empty()) way = {last.tip - last.length * Vec2(std::cos(last.angle), std::sin(last.angle)), last.tip};
    }
    for (std::size_t i = 1; i < way.size(); ++i) cv::line(drawing, pixel(way[i - 1]), pixel(way[i]), {0, 0, 220}, 1, cv::LINE_AA);
    write_drawing(drawing, file);
}

}  // namespace crampfit

#include "cli/plane_figure.hpp"

#include "cli/html.hpp"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace crampfit::cli {

namespace {

constexpr int steps = 16;  // of a scale

Colour between(const Colour& a, const Colour& b, double part) {
    Colour mixed;
    for (int i = 0; i < 3; ++i) mixed[i] = static_cast<std::uint8_t>(std::lround(std::lerp(a[i], b[i], part)));
    return mixed;
}

std::vector<Colour> make_scale() {
    cv::Mat grays(1, steps, CV_8U), colours;
    for (int i = 0; i < steps; ++i) grays.at<std::uint8_t>(0, i) = static_cast<std::uint8_t>(255 * i / (steps - 1));
    cv::applyColorMap(grays, colours, cv::COLORMAP_CIVIDIS);
    return {colours.begin<Colour>(), colours.end<Colour>()};
}

const std::vector<Colour>& scale() {
    static const std::vector<Colour> colours = make_scale();
    return colours;
}

std::string hexadecimal(const Colour& colour) { return fmt::format("#{:02X}{:02X}{:02X}", colour[2], colour[1], colour[0]); }

/// A row of colours over its ends' names.
std::string colour_bar(const std::string& text, const std::string& low, const std::string& high,
                       const std::vector<Colour>& colours) {
    std::string svg;
    const double width = 240.0 / static_cast<double>(colours.size());
    for (std::size_t i = 0; i < colours.size(); ++i)
        svg += fmt::format("<rect x=\"{:.2f}\" y=\"0\" width=\"{:.2f}\" height=\"10\" fill=\"{}\" />",
                           width * static_cast<double>(i), width + 0.3, hexadecimal(colours[i]));
    return fmt::format(
        "<figcaption>{0}<svg viewBox=\"0 0 440 26\" role=\"img\" aria-label=\"{0}: {1} to {2}\">{3}"
        "<text x=\"0\" y=\"23\">{1}</text><text x=\"240\" y=\"23\" text-anchor=\"end\">{2}</text></svg></figcaption>\n",
        escaped(text), escaped(low), escaped(high), svg);
}

}  // namespace

Chart plane_chart(const std::string& title) {
    return {.title = title, .x_label = "x [mm]", .y_label = "y [mm]", .equal_scales = true};
}

Chart pixel_chart(const std::string& title) {
    return {.title = title, .x_label = "x [px]", .y_label = "y [px]", .equal_scales = true, .y_down = true};
}

ChartSeries path_line(const std::vector<Vec2>& path, const char* ink, int frame) {
    ChartSeries line{.colour = ink, .frame = frame};
    for (const Vec2& vertex : path) {
        line.x.push_back(1e3 * vertex.x());
        line.y.push_back(1e3 * vertex.y());
    }
    return line;
}

ChartPicture picture_between(const Vec2& low, const Vec2& high, const std::vector<std::uint8_t>& png, int frame) {
    return {.address = png_address(png),
            .left = 1e3 * low.x(),
            .right = 1e3 * high.x(),
            .bottom = 1e3 * low.y(),
            .top = 1e3 * high.y(),
            .frame = frame};
}

std::vector<std::uint8_t> png_of(const cv::Mat& picture) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".png", picture, bytes, {cv::IMWRITE_PNG_COMPRESSION, 9});
    return bytes;
}

cv::Mat shrunk(const cv::Mat& picture, double factor) {
    if (factor >= 1) return picture;
    const auto side = [&](int pixels) { return std::max(1, static_cast<int>(std::lround(factor * pixels))); };
    cv::Mat smaller;
    cv::resize(picture, smaller, {side(picture.cols), side(picture.rows)}, 0, 0, cv::INTER_AREA);
    return smaller;
}

Colour wood_colour(double latewood) {
    const Colour pale(0xB4, 0xDD, 0xF0), middle(0x62, 0x9A, 0xC4), dark(0x1D, 0x3F, 0x6B);
    const double part = std::clamp(latewood, 0.0, 1.0);
    return part < 0.5 ? between(pale, middle, 2 * part) : between(middle, dark, 2 * part - 1);
}

std::string wood_bar(const std::string& low, const std::string& high) {
    std::vector<Colour> wood;
    for (int i = 0; i < steps; ++i) wood.push_back(wood_colour(static_cast<double>(i) / (steps - 1)));
    return colour_bar("Material", low, high, wood);
}

Colour scale_colour(double value, double low, double high) {
    const double part = high > low && std::isfinite(value) ? std::clamp((value - low) / (high - low), 0.0, 1.0) : 0.0;
    return scale()[static_cast<std::size_t>(std::min(steps - 1.0, part * steps))];
}

std::string scale_bar(const std::string& text, double low, double high) {
    return colour_bar(text, fmt::format("{:.3g} or less", low), fmt::format("{:.3g} or more", high), scale());
}

std::pair<double, double> most_of(const std::vector<std::vector<double>>& values) {
    std::vector<double> all;
    for (const std::vector<double>& some : values)
        std::ranges::copy_if(some, std::back_inserter(all), [](double value) { return std::isfinite(value); });
    if (all.empty()) return {0, 0};
    const auto quantile = [&](double part) {
        const auto at = all.begin() + std::lround(part * static_cast<double>(all.size() - 1));
        std::ranges::nth_element(all, at);
        return *at;
    };
    return {quantile(0.01), quantile(0.99)};
}

}  // namespace crampfit::cli

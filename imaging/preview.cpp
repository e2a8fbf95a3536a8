#include "imaging/preview.hpp"

#include "datasets/error.hpp"
#include "imaging/pixels.hpp"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

const cv::Scalar border_colour(0, 0, 255), direction_colour(0, 200, 0);  // blue, green, red

cv::Mat photograph(const std::filesystem::path& image) {
    cv::Mat pixels = read_pixels(image, {"command line", "IMAGE"});
    double brightest = 0;
    cv::minMaxLoc(pixels.reshape(1), nullptr, &brightest);
    if (pixels.depth() == CV_16U) pixels.convertTo(pixels, CV_8U, 255 / std::max(brightest, 1.0));
    if (pixels.channels() == 1) cv::cvtColor(pixels, pixels, cv::COLOR_GRAY2BGR);
    return pixels;
}

void tint(cv::Mat& picture, const cv::Mat& mask, const cv::Scalar& colour) {
    cv::Mat tinted;
    cv::addWeighted(picture, 0.5, cv::Mat(picture.size(), CV_8UC3, colour), 0.5, 0, tinted);
    tinted.copyTo(picture, mask);
}

void draw_features(cv::Mat& picture, const Specimen& specimen) {
    if (specimen.feature.empty()) return;
    const cv::Mat feature(specimen.rows, specimen.columns, CV_8U, const_cast<std::uint8_t*>(specimen.feature.data()));
    tint(picture, feature == static_cast<double>(Feature::background), {255, 128, 0});
    tint(picture, feature == static_cast<double>(Feature::crack), {255, 0, 255});
    tint(picture, feature == static_cast<double>(Feature::mark), {0, 255, 255});
    tint(picture, feature == static_cast<double>(Feature::ray), {0, 160, 0});
    tint(picture, feature == static_cast<double>(Feature::resin_canal), {255, 0, 0});
}

void draw_borders(cv::Mat& picture, const Specimen& specimen, int thickness) {
    for (const BorderPolyline& border : specimen.borders) {
        std::vector<cv::Point> points;
        for (const Eigen::Vector2d& p : border.points)
            points.emplace_back(static_cast<int>(std::lround(16 * p.x())), static_cast<int>(std::lround(16 * p.y())));
        cv::polylines(picture, points, false, border_colour, thickness, cv::LINE_AA, 4);
        const cv::Point label = points[points.size() / 2] / 16 + cv::Point(2, -2);
        cv::putText(picture, std::to_string(border.ring), label, cv::FONT_HERSHEY_SIMPLEX, 0.35 * thickness, border_colour,
                    thickness, cv::LINE_AA);
    }
}

void draw_directions(cv::Mat& picture, const Specimen& specimen, int thickness) {
    if (specimen.orientation.empty()) return;
    const int step = std::max(12, std::max(specimen.columns, specimen.rows) / 40);
    for (int y = step / 2; y < specimen.rows; y += step)
        for (int x = step / 2; x < specimen.columns; x += step) {
            const std::size_t at = static_cast<std::size_t>(y) * specimen.columns + x;
            const double angle = specimen.orientation[at], half = 0.3 * step;
            const cv::Point2d along(half * std::cos(angle), -half * std::sin(angle));
            const cv::Point2d middle(x, y);
            cv::line(picture, middle - along, middle + along, direction_colour, thickness, cv::LINE_AA);
        }
}

cv::Mat class_map(const Specimen& specimen) {
    cv::Mat map(specimen.rows, specimen.columns, CV_8UC3, cv::Scalar(255, 128, 0));
    const cv::Vec3d early(190, 225, 240), late(30, 60, 110);  // blue, green, red
    const double last = std::max<double>(1, static_cast<double>(specimen.classes.size()) - 1);
    for (int y = 0; y < specimen.rows; ++y)
        for (int x = 0; x < specimen.columns; ++x) {
            const std::uint8_t label = specimen.label[static_cast<std::size_t>(y) * specimen.columns + x];
            if (label != Specimen::void_label) map.at<cv::Vec3b>(y, x) = early + (label / last) * (late - early);
        }
    return map;
}

}  // namespace

void check_preview_name(const std::filesystem::path& preview) {
    const auto fail = [&] {
        throw InputError("command line", "--preview", preview.string(), "must end as a picture does, such as .png");
    };
    try {
        if (!cv::haveImageWriter(preview.string())) fail();
    } catch (const cv::Exception&) {
        fail();
    }
}

void write_preview(const std::filesystem::path& image, const Specimen& specimen, const std::filesystem::path& preview) {
    check_preview_name(preview);
    cv::Mat picture = photograph(image);
    const int thickness = std::max(1, std::max(picture.cols, picture.rows) / 2500);
    draw_features(picture, specimen);
    draw_directions(picture, specimen, thickness);
    draw_borders(picture, specimen, thickness);
    cv::Mat both;
    if (picture.cols > picture.rows) cv::vconcat(picture, class_map(specimen), both);
    else cv::hconcat(picture, class_map(specimen), both);
    bool written = false;
    try {
        written = cv::imwrite(preview.string(), both);
    } catch (const cv::Exception&) {
    }
    if (!written) throw InputError("command line", "--preview", preview.string(), "cannot be written");
}

}  // namespace crampfit

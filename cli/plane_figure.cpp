#include "cli/plane_figure.hpp"

#include "cli/html.hpp"

namespace crampfit::cli {

Chart plane_chart(const std::string& title) {
    return {.title = title, .x_label = "x [mm]", .y_label = "y [mm]", .equal_scales = true};
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

}  // namespace crampfit::cli

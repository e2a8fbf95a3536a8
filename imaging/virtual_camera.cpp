#include "imaging/virtual_camera.hpp"

#include "datasets/error.hpp"
#include "imaging/random_field.hpp"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace crampfit {
namespace {

constexpr double border = 100;         // of pattern around the picture, to move into it [px]
constexpr int most_trials = 200;       // of the search for where a place came from
constexpr double close_enough = 1e-9;  // [px]

enum Stream : std::uint64_t { spot_x, spot_y, spot_strength, first_noise };

/// The place x that has moved to `seen`: the fixed point of x = seen - u(x), which contracts as the gradient of u is
/// below
/// 1. In an open crack either side points to the other, and there is none.
std::optional<Vec2> origin_of(const Vec2& seen, const PlaneDisplacement& displacement) {
    Vec2 place = seen;
    for (int i = 0; i < most_trials; ++i) {
        const Vec2 next = seen - displacement(place);
        if ((next - place).squaredNorm() < close_enough * close_enough) return next;
        place = next;
    }
    return std::nullopt;
}

}  // namespace

void VirtualCameraOptions::validate() const {
    const auto require = [](bool holds, const char* option, double value, const char* rule) {
        const std::string name = option;
        if (!holds)
            throw InputError(name.starts_with("--") ? "command line" : "virtual camera", name, fmt::format("{}", value), rule);
    };
    require(columns > 0 && columns <= 16384, "columns", columns, "must be from 1 to 16384");
    require(rows > 0 && rows <= 16384, "rows", rows, "must be from 1 to 16384");
    require(spot_radius >= 0.5 && spot_radius <= 100, "--spot", spot_radius, "must be from 0.5 to 100 pixels");
    require(mean >= 0 && mean <= 255, "mean", mean, "must be from 0 to 255");
    require(contrast > 0 && contrast <= 255, "--contrast", contrast, "must be above 0, and 255 at most");
    require(noise >= 0 && noise <= 255, "--noise", noise, "must be from 0 to 255");
    require(gap_gray >= 0 && gap_gray <= 255, "gap_gray", gap_gray, "must be from 0 to 255");
    require(blur >= 0 && blur <= 20, "--blur", blur, "must be from 0 to 20 pixels");
    require(samples >= 1 && samples <= 10, "samples", samples, "must be from 1 to 10");
}

VirtualCamera::VirtualCamera(const VirtualCameraOptions& options, Surface surface)
    : options_(options), surface_(std::move(surface)), cell_(2 * options.spot_radius) {
    options.validate();
    if (surface_) return;
    const RandomField random(options.seed);
    cells_across_ = static_cast<int>(std::ceil((options.columns + 2 * border) / cell_));
    const int cells_down = static_cast<int>(std::ceil((options.rows + 2 * border) / cell_));
    // Spots of strength a, one in a square of edge c, leave a variance of a^2 pi radius^2 / c^2.
    const double strength = options.contrast * cell_ / (options.spot_radius * std::sqrt(std::numbers::pi));
    for (int row = 0; row < cells_down; ++row)
        for (int column = 0; column < cells_across_; ++column) {
            const std::uint64_t index = spots_.size();
            spots_.push_back({static_cast<float>((column + random.uniform(spot_x, index)) * cell_ - border),
                              static_cast<float>((row + random.uniform(spot_y, index)) * cell_ - border),
                              static_cast<float>(strength * random.normal(spot_strength, index))});
        }
}

double VirtualCamera::pattern(const Vec2& place) const {
    constexpr int reach = 3;  // squares: six radii, where a spot is 1e-8 of its strength
    const int column = static_cast<int>(std::floor((place.x() + border) / cell_));
    const int row = static_cast<int>(std::floor((place.y() + border) / cell_));
    const int cells_down = static_cast<int>(spots_.size()) / cells_across_;
    const double falloff = 1 / (2 * options_.spot_radius * options_.spot_radius);
    double gray = options_.mean;
    for (int j = std::max(0, row - reach); j <= std::min(cells_down - 1, row + reach); ++j)
        for (int i = std::max(0, column - reach); i <= std::min(cells_across_ - 1, column + reach); ++i) {
            const Spot& spot = spots_[static_cast<std::size_t>(j * cells_across_ + i)];
            const double dx = place.x() - static_cast<double>(spot.x), dy = place.y() - static_cast<double>(spot.y);
            gray += static_cast<double>(spot.strength) * std::exp(-falloff * (dx * dx + dy * dy));
        }
    return gray;
}

GrayPicture VirtualCamera::photograph(std::uint64_t shot) const {
    return photograph([](const Vec2&) { return Vec2(0, 0); }, shot);
}

double VirtualCamera::gray_of(const std::optional<Vec2>& origin, const Coverage& covered) const {
    if (!origin || (covered && !covered(*origin))) return options_.gap_gray;
    return surface_ ? surface_(*origin) : pattern(*origin);
}

/// Over the pixel's square. Where its neighbours show that nothing jumps there, what lies in it follows from them.
double VirtualCamera::mean_gray(int x, int y, const Origins& origins, const PlaneDisplacement& displacement,
                                const Coverage& covered) const {
    constexpr double least_jump = 0.005;  // change of the displacement from one step to the next [px]
    const auto at = [&](int column, int row) -> const std::optional<Vec2>& {
        return origins[static_cast<std::size_t>(std::clamp(row, 0, options_.rows - 1) * options_.columns +
                                                std::clamp(column, 0, options_.columns - 1))];
    };
    const std::optional<Vec2>& middle = at(x, y);
    bool smooth = x > 0 && y > 0 && x + 1 < options_.columns && y + 1 < options_.rows && middle;
    Eigen::Matrix2d slope;
    for (const int axis : {0, 1}) {
        const std::optional<Vec2>&before = at(x - (axis == 0), y - (axis == 1)), &after = at(x + (axis == 0), y + (axis == 1));
        smooth = smooth && before && after && (*before - 2 * *middle + *after).norm() < least_jump;
        if (smooth) slope.col(axis) = 0.5 * (*after - *before);
    }
    double sum = 0;
    const int side = options_.samples;
    for (int j = 0; j < side; ++j)
        for (int i = 0; i < side; ++i) {
            const Vec2 offset((i + 0.5) / side - 0.5, (j + 0.5) / side - 0.5);
            sum += gray_of(smooth ? std::optional<Vec2>(*middle + slope * offset) : origin_of(Vec2(x, y) + offset, displacement),
                           covered);
        }
    return sum / (side * side);
}

GrayPicture VirtualCamera::photograph(const PlaneDisplacement& displacement, std::uint64_t shot, const Coverage& covered) const {
    Origins origins;
    for (int y = 0; y < options_.rows; ++y)
        for (int x = 0; x < options_.columns; ++x) origins.push_back(origin_of(Vec2(x, y), displacement));
    cv::Mat light(options_.rows, options_.columns, CV_64F);
    for (int y = 0; y < options_.rows; ++y)
        for (int x = 0; x < options_.columns; ++x)
            light.at<double>(y, x) = options_.samples == 1
                                         ? gray_of(origins[static_cast<std::size_t>(y * options_.columns + x)], covered)
                                         : mean_gray(x, y, origins, displacement, covered);
    if (options_.blur > 0) cv::GaussianBlur(light, light, {}, options_.blur);
    const RandomField random(options_.seed);
    GrayPicture picture{options_.columns, options_.rows, {}};
    for (int y = 0; y < options_.rows; ++y)
        for (int x = 0; x < options_.columns; ++x) {
            const double gray = light.at<double>(y, x) + options_.noise * random.normal(first_noise + shot, picture.gray.size());
            picture.gray.push_back(static_cast<std::uint8_t>(std::lround(std::clamp(gray, 0.0, 255.0))));
        }
    return picture;
}

}  // namespace crampfit

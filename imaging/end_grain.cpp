#include "imaging/end_grain.hpp"

#include "datasets/error.hpp"
#include "imaging/random_field.hpp"
#include "imaging/ring_geometry.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

namespace crampfit {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double largest_pixel_count = 0x1p28;

// Far from those of the ring geometry, which draws from the same field.
enum Stream : std::uint64_t { ray_place = 100, ray_start, ray_plane, cell_texture, patch_texture, pixel_noise };

// A patch of like brightness spans about this many cells, and a cell's texture is this much longer than wide.
constexpr double cells_per_patch = 40;
constexpr double cell_elongation = 3;

void require(bool holds, const char* option, double value, const char* rule) {
    if (!holds) {
        std::ostringstream text;
        text << value;
        throw InputError("end grain", option, text.str(), rule);
    }
}

bool positive(double value) { return std::isfinite(value) && value > 0; }
bool not_negative(double value) { return std::isfinite(value) && value >= 0; }

int pixels(double length, double pixel) { return static_cast<int>(std::lround(length / pixel)); }

/// What the eye sees of the wood's structure at a place, from geometry and random fields.
class Appearance {
  public:
    Appearance(const EndGrainOptions& options, const RingGeometry& rings, const RandomField& random)
        : options_(options), random_(random), outermost_(rings.outermost()), rays_(around(options.ray_spacing)),
          files_(around(options.cell_size)), patches_(around(cells_per_patch * options.cell_size)) {}

    /// Colour in even light, without the camera's noise.
    Bgr colour(const RingGeometry::Place& place, double degree) const {
        const double ray = options_.ray_contrast * ray_cover(place);
        const double change = brightness_change(place);
        Bgr colour{};
        for (std::size_t i = 0; i < 3; ++i) {
            const double wood = options_.earlywood[i] + degree * (options_.latewood[i] - options_.earlywood[i]);
            colour[i] = wood + ray * (options_.ray[i] - wood);
        }
        // Scaling keeps the hue and changes the gray by `change`.
        const double gray = std::max(1.0, 0.114 * colour[0] + 0.587 * colour[1] + 0.299 * colour[2]);
        for (double& channel : colour) {
            channel *= 1 + change / gray;
        }
        return colour;
    }

  private:
    /// How many things of a size stand side by side around the outermost ring.
    std::int64_t around(double spacing) const { return std::max<std::int64_t>(1, std::llround(2 * pi * outermost_ / spacing)); }

    /// Cells stand in files that run along the rays.
    double brightness_change(const RingGeometry::Place& place) const {
        const double turn = place.angle / (2 * pi);
        const double cell = cell_elongation * options_.cell_size;
        const double patch = cells_per_patch * options_.cell_size;
        const double files = static_cast<double>(files_), patches = static_cast<double>(patches_);
        return options_.texture * random_.smooth(cell_texture, place.distance / cell, turn * files, files_) +
               options_.mottle * random_.smooth(patch_texture, place.distance / patch, turn * patches, patches_);
    }

    /// Part of the pixel that rays cover, 0..1. One ray may stand in each sector around the pith; it begins at a
    /// distance that is uniform up to the outermost ring, which keeps the mean spacing the same at every distance.
    double ray_cover(const RingGeometry::Place& place) const {
        const double sectors = static_cast<double>(rays_);
        const double turn = place.angle / (2 * pi) * sectors;
        const double sector_width = 2 * pi * place.distance / sectors;
        const double seen_width = std::max(options_.ray_width, options_.pixel);
        const auto here = static_cast<std::int64_t>(std::floor(turn));
        double cover = 0;
        for (std::int64_t sector = here - 1; sector <= here + 1; ++sector) {
            const auto ray = static_cast<std::uint64_t>(((sector % rays_) + rays_) % rays_);
            if (place.distance < outermost_ * random_.uniform(ray_start, ray)) {
                continue;
            }
            const double centre = static_cast<double>(sector) + random_.uniform(ray_place, ray);
            const double offset = (turn - centre) * sector_width / seen_width;
            const double in_plane = random_.smooth(ray_plane + 1000 * (ray + 1), place.distance / options_.ray_length);
            cover = std::max(cover, std::exp(-4 * std::numbers::ln2 * offset * offset) * std::clamp(in_plane, 0.0, 1.0));
        }
        return cover * options_.ray_width / seen_width;
    }

    const EndGrainOptions& options_;
    const RandomField& random_;
    double outermost_;
    std::int64_t rays_, files_, patches_;
};

/// Mean density degree over a pixel, from 4 x 4 places in it. Within a pixel the warped radius is as good as linear.
double mean_degree(const RingGeometry& rings, const RingGeometry::Place& centre, double pixel) {
    constexpr int places = 4;
    double sum = 0;
    for (int i = 0; i < places; ++i) {
        for (int j = 0; j < places; ++j) {
            const Vec2 offset = pixel * (Vec2(i + 0.5, j + 0.5) / places - Vec2(0.5, 0.5));
            sum += rings.degree(centre.radius + centre.gradient.dot(offset), centre.angle);
        }
    }
    return sum / (places * places);
}

std::uint8_t to_byte(double value) { return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0))); }

}  // namespace

void EndGrainOptions::validate() const {
    require(positive(pixel), "pixel", pixel, "must be a positive length");
    for (const double side : {size.x(), size.y()}) {
        require(positive(side), "size", side, "must be a positive length");
        require(side / pixel < largest_pixel_count, "size", side, "must be less than 2^28 pixels");
        require(std::abs(side / pixel - std::round(side / pixel)) < 1e-6 * side / pixel, "size", side,
                "must be a whole number of pixels");
    }
    require(size.x() / pixel * (size.y() / pixel) <= largest_pixel_count, "pixel", pixel,
            "must be large enough for a picture of at most 2^28 pixels");
    require(std::isfinite(pith.x()) && std::isfinite(pith.y()) && pith.norm() < 1e6 * size.norm(), "pith", pith.norm(),
            "must lie within a million sizes of the block");
    require(positive(period) && period >= pixel, "period", period, "must be at least one pixel");
    require(not_negative(period_sd) && period_sd <= period / 2, "period_sd", period_sd, "must lie within 0 and half a period");
    require(latewood_fraction > 0 && latewood_fraction < 1, "latewood_fraction", latewood_fraction, "must lie within 0 and 1");
    require(not_negative(latewood_fraction_sd) &&
                std::sqrt(3.0) * latewood_fraction_sd < std::min(latewood_fraction, 1 - latewood_fraction),
            "latewood_fraction_sd", latewood_fraction_sd,
            "must leave each ring EW and LW: sqrt(3) times it is the largest deviation from the mean");
    require(not_negative(transition), "transition", transition, "must be 0 or a length");
    require(not_negative(onset_roughness), "onset_roughness", onset_roughness, "must be 0 or a length");
    require(positive(waviness_length), "waviness_length", waviness_length, "must be a positive length");
    require(not_negative(waviness) && RingGeometry::steepness(*this) < 0.9, "waviness", waviness,
            "must be small against the period, or rings would cross");
    require(positive(ray_spacing), "ray_spacing", ray_spacing, "must be a positive length");
    require(not_negative(ray_width), "ray_width", ray_width, "must be 0 or a length");
    require(positive(ray_length), "ray_length", ray_length, "must be a positive length");
    require(ray_contrast >= 0 && ray_contrast <= 1, "ray_contrast", ray_contrast, "must lie within 0 and 1");
    const std::pair<const char*, const Bgr&> colours[] = {{"earlywood", earlywood}, {"latewood", latewood}, {"ray", ray}};
    for (const auto& [name, colour] : colours) {
        for (const double channel : colour) {
            require(channel >= 0 && channel <= 255, name, channel, "must lie within 0 and 255");
        }
    }
    require(positive(cell_size), "cell_size", cell_size, "must be a positive length");
    require(not_negative(texture), "texture", texture, "must not be negative");
    require(not_negative(mottle), "mottle", mottle, "must not be negative");
    require(not_negative(noise), "noise", noise, "must not be negative");
    require(std::abs(illumination) < 1, "illumination", illumination, "must lie within -1 and 1");
}

EndGrain grow_end_grain(const EndGrainOptions& options) {
    options.validate();
    const RandomField random(options.seed);
    const RingGeometry rings(options, random);
    const Appearance appearance(options, rings, random);

    EndGrain grown;
    grown.columns = pixels(options.size.x(), options.pixel);
    grown.rows = pixels(options.size.y(), options.pixel);
    grown.rings = rings.rings();
    grown.borders = rings.borders();
    const std::size_t count = static_cast<std::size_t>(grown.columns) * static_cast<std::size_t>(grown.rows);
    grown.bgr.reserve(3 * count);
    grown.degree.reserve(count);
    Specimen& truth = grown.truth;
    truth.columns = grown.columns;
    truth.rows = grown.rows;
    truth.pixel = options.pixel;
    truth.classes = {"EW", "LW"};
    truth.source = "synthetic end grain, seed " + std::to_string(options.seed);

    for (int row = 0; row < grown.rows; ++row) {
        for (int column = 0; column < grown.columns; ++column) {
            const Vec2 position = options.pixel * Vec2(column + 0.5, grown.rows - row - 0.5);
            const RingGeometry::Place place = rings.at(position);
            const double degree = mean_degree(rings, place, options.pixel);
            const double light = 1 + options.illumination * (position.x() / options.size.x() - 0.5);
            for (const double channel : appearance.colour(place, degree)) {
                grown.bgr.push_back(to_byte(light * channel + options.noise * random.normal(pixel_noise, grown.bgr.size())));
            }
            const double direction = std::atan2(place.gradient.y(), place.gradient.x());
            grown.degree.push_back(static_cast<float>(degree));
            truth.label.push_back(degree < 1 ? 0 : 1);
            truth.grade.push_back(degree < 1 ? static_cast<float>(degree) : 0.0f);
            truth.orientation.push_back(static_cast<float>(direction < 0 ? direction + pi : direction));
        }
    }

    grown.gray.resize(count);
    const cv::Mat colour(grown.rows, grown.columns, CV_8UC3, grown.bgr.data());
    cv::Mat gray(grown.rows, grown.columns, CV_8UC1, grown.gray.data());
    cv::cvtColor(colour, gray, cv::COLOR_BGR2GRAY);
    return grown;
}

}  // namespace crampfit

#include "forward/material_map.hpp"

#include "forward/geometry.hpp"
#include "forward/transition_wood.hpp"

#include "datasets/error.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <unordered_map>

namespace crampfit {

namespace {

// The first axis of a symmetric matrix.
Vec2 first_axis(const Eigen::Matrix2d& tensor) {
    const double angle = 0.5 * std::atan2(2.0 * tensor(0, 1), tensor(0, 0) - tensor(1, 1));
    return {std::cos(angle), std::sin(angle)};
}

// The direction in which matrices on a square lattice change most: the first axis of their structure tensor.
Vec2 steepest(const std::vector<Eigen::Matrix3d>& value, int side) {
    Eigen::Matrix2d tensor = Eigen::Matrix2d::Zero();
    for (int j = 0; j + 1 < side; ++j) {
        for (int i = 0; i + 1 < side; ++i) {
            const Eigen::Matrix3d* at = &value[static_cast<std::size_t>(j) * side + i];
            const Eigen::Matrix3d by_x = at[1] + at[side + 1] - at[0] - at[side];
            const Eigen::Matrix3d by_y = at[side] + at[side + 1] - at[0] - at[1];
            tensor(0, 0) += by_x.cwiseProduct(by_x).sum();
            tensor(0, 1) += by_x.cwiseProduct(by_y).sum();
            tensor(1, 1) += by_y.cwiseProduct(by_y).sum();
        }
    }
    return first_axis(tensor);
}

// Where in a rectangle a sample lies, -1 .. 1: one in each of `side` x `side` tiles, row by row, none of whose neighbours in a
// row or column of a quarter lies on a line of the grid with it, and mirror images of one another. In the middles of the tiles a
// boundary along the grid would be seen to half a tile only, and all bands of rings that fit the grid would be wrong alike.
Vec2 place_of_sample(int k, int side) {
    const auto along = [&](int tile, int other) {
        const int steps = (side + 1) / 2;  // of the other's rows up to the middle
        const double step = (std::min(other, side - 1 - other) + 0.5) / steps - 0.5;
        const int half = 2 * tile + 1 < side ? 1 : 2 * tile + 1 > side ? -1 : 0;
        return (2.0 * (tile + half * step) + 1.0) / side - 1.0;
    };
    return {along(k % side, k / side), along(k / side, k % side)};
}

// Places in different parts differ by rounding: by less than this power of two, of half a rectangle.
constexpr int same_place = -36;

Vec2 rounded(const Vec2& x, double unit) { return unit * (x / unit).array().round().matrix(); }

// A rectangle, and for an unevenness the spread of its places.
using Rectangle = std::array<std::int64_t, 6>;

Rectangle rectangle(const Vec2& centre, const Vec2& half, const Vec2& spread) {
    constexpr double part = 1e-3, length = 1e-15;  // of half the rectangle, and [m]
    Rectangle found;
    for (int axis = 0; axis < 2; ++axis) {
        found[axis] = std::llround(centre[axis] / (part * half[axis]));
        found[2 + axis] = std::llround(half[axis] / length);
        found[4 + axis] = std::llround(spread[axis] / part);
    }
    return found;
}

}  // namespace

// Wood by its grade between two materials, from a table of what `mix` makes: a cubic through four entries is within 2e-10 of it,
// the moduli 1000 apart, and takes a tenth of the time.
class MaterialMap::Transition {
  public:
    Transition(const MaterialMap& map, int first) {
        for (int k = 0; k <= steps; ++k) {
            const LocalWood wood = map.mix(first, first + 1, k / double{steps});
            Entry& entry = entries_.emplace_back();
            entry << wood.elasticity.coefficients, wood.poisson_ratios, wood.density, wood.toughness, wood.latewood, 0.0;
        }
    }

    LocalWood at(double grade) const {
        const double place = steps * grade;
        const int first = std::clamp(static_cast<int>(place) - 1, 0, steps - 3);
        const double t = place - first, a = t - 1.0, b = t - 2.0, c = t - 3.0;
        const Entry* e = &entries_[first];
        const Entry found = (t * (a * (b * e[3] / 6.0 - c * e[2] / 2.0) + b * c * e[1] / 2.0) - a * b * c / 6.0 * e[0]).eval();
        LocalWood wood;
        wood.elasticity.coefficients = found.head<6>();
        wood.poisson_ratios = found.segment<2>(6);
        wood.density = found[8];
        wood.toughness = found[9];
        wood.latewood = found[10];
        wood.filled = 1.0;
        return wood;
    }

  private:
    static constexpr int steps = 1024;
    using Entry = Eigen::Vector<double, 12>;  // the last of no use
    std::vector<Entry> entries_;
};

struct MaterialMap::Known {
    struct Hash {
        std::size_t operator()(const Rectangle& r) const {
            std::size_t all = 0;
            for (const std::int64_t number : r) all = (all ^ static_cast<std::size_t>(number)) * 0x9e3779b97f4a7c15u;
            return all ^ (all >> 32);
        }
    };
    template <class Value>
    using Table = std::unordered_map<Rectangle, Value, Hash>;

    // What a table has of a rectangle, or else what is found; parts may be looked at side by side.
    template <class Value, class Find>
    Value of(Table<Value>& table, const Rectangle& where, const Find& find) {
        std::unique_lock lock(mutex);
        if (const auto known = table.find(where); known != table.end()) return known->second;
        lock.unlock();
        const Value found = find();
        lock.lock();
        return table.emplace(where, found).first->second;
    }

    std::mutex mutex;
    Table<LocalWood> average;
    Table<Unevenness> unevenness;
};

MaterialMap MaterialMap::part(const Vec2& corner) const {
    MaterialMap part = *this;
    part.corner_ += corner;
    part.is_part_ = true;
    return part;
}

MaterialMap::MaterialMap(const Scene& scene) : scene_(scene), known_(std::make_shared<Known>()) {
    const SpecimenPlan& plan = scene.specimen;
    if (plan.map) {
        for (const std::string& name : plan.map->classes) materials_.push_back(scene.materials.at(name));
        picture_offset_ = plan.picture ? plan.picture->offset : plan.file_offset;
        const double angle = plan.picture ? plan.picture->rotation : plan.file_rotation;
        picture_cos_ = std::cos(angle);
        picture_sin_ = std::sin(angle);
        finest_ = plan.map->pixel;
        homogeneous_ = false;
    } else if (plan.rings) {
        materials_ = {scene.materials.at("EW"), scene.materials.at("LW")};
        homogeneous_ = false;
    } else {
        materials_ = {scene.materials.at(plan.material)};
    }
    for (int k = 0; k < static_cast<int>(materials_.size()); ++k) pure_.push_back(mix(k, k, 0.0));
    orthotropic_ = std::any_of(materials_.begin(), materials_.end(), [](const Material& m) { return m.orthotropic.has_value(); });
    remembers_ = std::any_of(materials_.begin(), materials_.end(), [](const Material& m) { return m.remembers(); });
    const bool graded = (plan.rings && plan.rings->transition > 0.0) || (plan.map && !plan.map->grade.empty());
    if (remembers_) check_memory(graded);
    for (int k = 0; graded && k + 1 < static_cast<int>(materials_.size()); ++k)
        transition_.push_back(std::make_shared<Transition>(*this, k));
    if (!orthotropic_) return;
    check_radial_direction();
    if (plan.pith) homogeneous_ = false;
    if (plan.radial)
        for (LocalWood& wood : pure_) wood.elasticity.normal = {std::cos(*plan.radial), std::sin(*plan.radial)};
    for (int k = 0; graded && k + 1 < static_cast<int>(materials_.size()); ++k) check_transition(k);
}

void MaterialMap::check_radial_direction() const {
    const SpecimenPlan& plan = scene_.specimen;
    const bool given = plan.radial || plan.pith;
    const bool mapped = plan.map && !plan.map->orientation.empty();
    if (plan.rings || given != mapped) return;
    throw InputError(scene_.file.string(), given ? "specimen.radial" : "specimen", plan.file.string(),
                     given
                         ? "the map of the radial direction in the specimen says it already; leave radial or pith out"
                         : "orthotropic wood needs its radial direction: give specimen.radial or specimen.pith, or a map of it");
}

void MaterialMap::check_transition(int first) const {
    constexpr int steps = 32;
    for (int k = 1; k < steps; ++k) {
        const Material wood =
            transition_wood(materials_[first], materials_[first + 1], scene_.specimen.density_exponents, k / double{steps});
        const auto broken = wood.orthotropic ? broken_rule(*wood.orthotropic) : std::nullopt;
        if (broken)
            throw InputError(scene_.file.string(), "specimen.density_exponents",
                             fmt::format("transition wood of {:.4g} kg/m^3", wood.density), broken->rule);
    }
}

void MaterialMap::check_memory(bool graded) const {
    if (graded)
        throw InputError(
            scene_.file.string(),
            scene_.specimen.rings     ? "specimen.rings.transition"
            : scene_.specimen.picture ? "specimen.between"
                                      : "specimen.file",
            scene_.specimen.rings ? fmt::format("{:g} mm", scene_.specimen.rings->transition * 1e3) : "transition wood",
            "not available with viscoelastic or plastic wood: how such wood goes over into other wood is not known; leave the "
            "transition out, or give it a class and a material of its own");
    for (const auto& [name, material] : scene_.materials)
        if (orthotropic_ && material.orthotropic)
            throw InputError(scene_.file.string(), "materials." + name + ".kind", "orthotropic",
                             "not available beside viscoelastic or plastic wood; use \"isotropic\"");
}

LocalWood MaterialMap::mix(int first, int second, double grade) const {
    const Material material =
        first == second ? materials_[first]
                        : transition_wood(materials_[first], materials_[second], scene_.specimen.density_exponents, grade);
    LocalWood wood;
    wood.density = material.density;
    wood.toughness = material.toughness;
    if (material.orthotropic) {
        wood.elasticity = layered(plane_stiffness(material, scene_.model.plane), Vec2::UnitX());
        wood.poisson_ratios = {material.orthotropic->nu_LR, material.orthotropic->nu_LT};
    } else {
        wood.elasticity = layered(plane_elasticity(material.youngs_modulus, material.poisson_ratio, scene_.model.plane));
        wood.poisson_ratios.setConstant(material.poisson_ratio);
    }
    wood.filled = 1.0;
    wood.material = grade == 0.0 ? first : -1;
    const double last = std::max<double>(1.0, static_cast<double>(materials_.size()) - 1.0);
    wood.latewood = (first + grade * (second - first)) / last;
    return wood;
}

// Where a map of it does not say.
Vec2 MaterialMap::radial_direction(const Vec2& x) const {
    const SpecimenPlan& plan = scene_.specimen;
    if (plan.radial) return {std::cos(*plan.radial), std::sin(*plan.radial)};
    const Vec2 arm = x - (plan.rings ? plan.rings->pith : *plan.pith);
    return arm.isZero() ? Vec2::UnitX() : Vec2(arm.normalized());
}

WoodArea::Sample MaterialMap::in_rings(const Vec2& x) const {
    const Rings& rings = *scene_.specimen.rings;
    const double turns = (x - rings.pith).norm() / rings.period;
    const double phase = turns - std::floor(turns);
    const double latewood_start = 1.0 - rings.latewood_fraction;
    if (phase > latewood_start) return {1};
    const double width = rings.transition / rings.period;
    if (width > 0.0 && phase > latewood_start - width) return {0, 1.0 - (latewood_start - phase) / width};
    return {0};
}

// From the picture's lower left corner, to the right and up.
Vec2 MaterialMap::in_pixels(const Vec2& x) const {
    const Vec2 arm = x - picture_offset_;
    return Vec2(picture_cos_ * arm.x() + picture_sin_ * arm.y(), -picture_sin_ * arm.x() + picture_cos_ * arm.y()) /
           scene_.specimen.map->pixel;
}

std::size_t MaterialMap::pixel_at(const Vec2& x) const {
    const Specimen& map = *scene_.specimen.map;
    const Vec2 place = in_pixels(x);
    const int column = std::clamp(static_cast<int>(std::floor(place.x())), 0, map.columns - 1);
    const int up = std::clamp(static_cast<int>(std::floor(place.y())), 0, map.rows - 1);
    return static_cast<std::size_t>(map.rows - 1 - up) * map.columns + column;
}

WoodArea::Sample MaterialMap::in_picture(const Vec2& x) const {
    const Specimen& map = *scene_.specimen.map;
    const std::size_t at = pixel_at(x);
    if (map.label[at] == Specimen::void_label) return {};
    WoodArea::Sample here{map.label[at], map.grade.empty() ? 0.0 : map.grade[at]};
    if (!orthotropic_ || map.orientation.empty()) return here;
    const double c = std::cos(map.orientation[at]), s = std::sin(map.orientation[at]);
    here.radial = {picture_cos_ * c - picture_sin_ * s, picture_sin_ * c + picture_cos_ * s};
    return here;
}

LocalWood MaterialMap::at(const Vec2& x) const { return wood_of(sample_at(x + corner_)); }

WoodArea::Sample MaterialMap::sample_at(const Vec2& x) const {
    WoodArea::Sample here = scene_.specimen.map ? in_picture(x) : scene_.specimen.rings ? in_rings(x) : WoodArea::Sample{0};
    const bool mapped = scene_.specimen.map && !scene_.specimen.map->orientation.empty();
    if (orthotropic_ && !mapped && here.wood >= 0) here.radial = radial_direction(x);
    return here;
}

LocalWood MaterialMap::wood_of(const WoodArea::Sample& sample) const {
    if (sample.wood < 0) return {};
    LocalWood wood = sample.grade > 0.0 ? transition_[sample.wood]->at(sample.grade) : pure_[sample.wood];
    if (orthotropic_) wood.elasticity.normal = sample.radial;
    return wood;
}

bool MaterialMap::has_wood_at(const Vec2& x) const {
    return !scene_.specimen.map || scene_.specimen.map->label[pixel_at(x + corner_)] != Specimen::void_label;
}

bool MaterialMap::is_seen(const Vec2& x) const {
    if (!scene_.specimen.map) return true;
    constexpr double rounding = 1.0;  // of the picture's edge, in pixels
    const Vec2 place = in_pixels(x + corner_), size(scene_.specimen.map->columns, scene_.specimen.map->rows);
    return (place.array() >= -rounding).all() && (place.array() <= size.array() + rounding).all();
}

// The wood of a rectangle that lies within one band of the rings; null where it may hold others.
const LocalWood* MaterialMap::band_around(const Vec2& centre, const Vec2& half) const {
    if (!scene_.specimen.rings || scene_.specimen.map || orthotropic_) return nullptr;
    const Rings& rings = *scene_.specimen.rings;
    const double turns = (centre - rings.pith).norm() / rings.period;
    const double reach = half.norm() / rings.period;
    const double low = turns - reach - std::floor(turns), high = turns + reach - std::floor(turns);
    const double latewood_start = 1.0 - rings.latewood_fraction;
    if (low > 0.0 && high < latewood_start - rings.transition / rings.period) return &pure_[0];
    return low > latewood_start && high < 1.0 ? &pure_[1] : nullptr;
}

// Across the layers about a rectangle that holds more than one wood. In a picture: the direction in which the wood, smoothed over
// a few of its pixels, changes most. Differences from pixel to pixel would not do: at steps of an edge they see 45 degrees, and
// nothing of it between (4 degrees too little for an edge that runs 10 degrees off the pixels).
Vec2 MaterialMap::layer_normal(const Vec2& centre, const Vec2& half) const {
    if (!scene_.specimen.map) return radial_direction(centre);
    constexpr int reach = 7;       // of the smoothing, in samples
    constexpr double width = 2.0;  // standard deviation of its Gaussian, in samples
    const Specimen& map = *scene_.specimen.map;
    const double spacing = std::max(half.maxCoeff() / 8.0, map.pixel);
    const int inner = std::max(1, static_cast<int>(std::lround(2.0 * half.maxCoeff() / spacing)));
    const int side = inner + 2 * reach;
    Eigen::ArrayXXd wood(side, side);
    double sum = 0.0;
    int filled = 0;
    for (int j = 0; j < side; ++j) {
        for (int i = 0; i < side; ++i) {
            const std::size_t at = pixel_at(centre + spacing * (Vec2(i, j) - Vec2::Constant(0.5 * (side - 1))));
            const bool there = map.label[at] != Specimen::void_label;
            wood(i, j) = there ? map.label[at] + (map.grade.empty() ? 0.0 : map.grade[at]) : -1.0;
            sum += there ? wood(i, j) : 0.0;
            filled += there;
        }
    }
    wood = (wood < 0.0).select(sum / std::max(filled, 1), wood);  // where nothing is, nothing changes
    const Eigen::ArrayXd kernel = Eigen::ArrayXd::LinSpaced(2 * reach + 1, -reach, reach);
    const Eigen::ArrayXd smooth = (-(kernel / width).square() / 2.0).exp(), slope = kernel * smooth;
    Eigen::ArrayXXd by_x(inner, side), by_y(inner, side);
    for (int i = 0; i < inner; ++i) {
        by_x.row(i) = slope.matrix().transpose() * wood.middleRows(i, 2 * reach + 1).matrix();
        by_y.row(i) = smooth.matrix().transpose() * wood.middleRows(i, 2 * reach + 1).matrix();
    }
    Eigen::Matrix2d tensor = Eigen::Matrix2d::Zero();
    for (int j = 0; j < inner; ++j) {
        const Eigen::ArrayXd x = by_x.middleCols(j, 2 * reach + 1).matrix() * smooth.matrix();
        const Eigen::ArrayXd y = by_y.middleCols(j, 2 * reach + 1).matrix() * slope.matrix();
        tensor(0, 0) += x.square().sum();
        tensor(0, 1) += (x * y).sum();
        tensor(1, 1) += y.square().sum();
    }
    return first_axis(tensor);
}

// Sixteen samples a side see the place of a boundary along the grid to 1/256 of the area's width (`place_of_sample`); a picture
// is seen at twice its own resolution, four at least: its borders may lie anywhere in a cell.
int MaterialMap::samples_a_side(const Vec2& half) const {
    // One more sample than twice a whole number of pixels would put some of them on the edges of pixels.
    constexpr double rounding = 1e-6;
    const int fit = finest_ > 0.0 ? static_cast<int>(std::ceil(4.0 * half.maxCoeff() / finest_ - rounding)) : 16;
    return std::clamp(fit, 4, 16);
}

std::vector<double> MaterialMap::shares(const Vec2& middle, const Vec2& half) const {
    const Vec2 centre = middle + corner_;
    std::vector<double> shares(materials_.size(), 0.0);
    const LocalWood* all = homogeneous_ ? &pure_[0] : band_around(centre, half);
    if (all) {
        shares[all->material] = 1.0;
        return shares;
    }
    const int samples = samples_a_side(half);
    double filled = 0.0;
    for (int k = 0; k < samples * samples; ++k) {
        const Vec2 place = place_of_sample(k, samples);
        const LocalWood here = wood_of(sample_at(centre + place.cwiseProduct(half)));
        if (here.filled == 0.0) continue;
        shares[here.material] += 1.0;
        filled += 1.0;
    }
    for (double& share : shares) share /= std::max(1.0, filled);
    return shares;
}

LocalWood MaterialMap::average(const Vec2& centre, const Vec2& half) const {
    WoodArea area{centre, half};
    return average(area);
}

LocalWood MaterialMap::average(WoodArea& area) const {
    if (homogeneous_) return pure_[0];
    if (const LocalWood* wood = band_around(area.centre + corner_, area.half)) return *wood;
    if (!is_part_) return find_average(area);
    WoodArea shared = in_specimen(area);
    const LocalWood found =
        known_->of(known_->average, rectangle(shared.centre, shared.half, Vec2::Zero()), [&] { return find_average(shared); });
    area.samples = std::move(shared.samples);
    return found;
}

// An area of a part, which gives its samples away, with its place in the specimen: to the same bits for all parts.
WoodArea MaterialMap::in_specimen(WoodArea& area) const {
    const double unit = std::ldexp(1.0, std::ilogb(area.half.minCoeff()) + same_place);
    return {rounded(area.centre + corner_, unit), rounded(area.half, unit), std::move(area.samples)};
}

// How many samples an area has a side.
int MaterialMap::sample(WoodArea& area) const {
    const int side = samples_a_side(area.half);
    if (!area.samples.empty()) return side;
    area.samples.reserve(side * side);
    for (int k = 0; k < side * side; ++k) {
        const Vec2 place = place_of_sample(k, side);
        area.samples.push_back(sample_at(area.centre + place.cwiseProduct(area.half)));
    }
    return side;
}

LocalWood MaterialMap::find_average(WoodArea& area) const {
    const int samples = sample(area);
    LocalWood sum;
    std::vector<LayeredElasticity> elasticities;  // of orthotropic wood
    double least = 1.0, most = 0.0;               // latewood: layers lie as it does, whatever the moduli
    for (const WoodArea::Sample& one : area.samples) {
        const LocalWood here = wood_of(one);
        if (here.filled > 0.0) {
            least = std::min(least, here.latewood);
            most = std::max(most, here.latewood);
        }
        sum.elasticity.coefficients += here.elasticity.coefficients;
        if (orthotropic_) elasticities.push_back(here.elasticity);
        sum.density += here.density;
        sum.toughness += here.toughness;
        sum.poisson_ratios += here.poisson_ratios;
        sum.latewood += here.latewood;
        sum.filled += here.filled;
    }
    if (sum.filled == 0.0) return sum;
    const double share = 1.0 / sum.filled;  // means over what is there; the void only thins the point
    sum.elasticity.coefficients *= share;
    sum.mixed = least < most;
    const std::optional<Vec2> normal = sum.mixed ? std::optional(layer_normal(area.centre, area.half)) : std::nullopt;
    if (orthotropic_) average_elasticity(elasticities, samples, normal, sum.elasticity);
    else if (normal) sum.elasticity.normal = *normal;
    sum.density *= share;
    sum.toughness *= share;
    sum.poisson_ratios *= share;
    sum.latewood *= share;
    sum.filled /= static_cast<double>(samples) * samples;
    return sum;
}

Unevenness MaterialMap::unevenness(WoodArea& area, const LocalWood& average, const Vec2& spread) const {
    if (!average.mixed || average.filled < 1.0) return {};
    if (!is_part_) return find_unevenness(area, average, spread);
    WoodArea shared = in_specimen(area);
    const Vec2 exact = rounded(spread, std::ldexp(1.0, same_place));
    const Unevenness found = known_->of(known_->unevenness, rectangle(shared.centre, shared.half, exact),
                                        [&] { return find_unevenness(shared, average, exact); });
    area.samples = std::move(shared.samples);
    return found;
}

Unevenness MaterialMap::find_unevenness(WoodArea& area, const LocalWood& average, const Vec2& spread) const {
    using Coefficients = LayeredElasticity::Coefficients;
    const int samples = sample(area);
    const Vec2 normal = average.elasticity.normal;
    const Coefficients of_average = average.elasticity.coefficients;
    const double no_other_wood = orthotropic_ ? 0.01 : 1e-12;  // grain that turns within the cell is none
    bool all_alike = true;
    Coefficients mean = Coefficients::Zero();
    Eigen::Matrix<double, 3, 2> first = Eigen::Matrix<double, 3, 2>::Zero();              // means of E', r and p, times x and y
    Eigen::Vector3d second = Eigen::Vector3d::Zero(), seconds = Eigen::Vector3d::Zero();  // means of E' and 1, times xx, xy, yy
    const double share = 1.0 / (samples * samples);
    for (int k = 0; k < samples * samples; ++k) {
        const Vec2 place = place_of_sample(k, samples);
        const LocalWood here = wood_of(area.samples[k]);
        const Coefficients wood =
            orthotropic_ ? layered(here.elasticity.stiffness(), normal).coefficients : here.elasticity.coefficients;
        const Coefficients d = wood - of_average;
        all_alike = all_alike && std::max({std::abs(d[0]) / of_average[0], std::abs(d[2]) / of_average[2],
                                           std::abs(d[3]) / of_average[3], std::abs(d[1])}) < no_other_wood;
        const Vec2 x = spread.cwiseProduct(area.half).cwiseProduct(place);
        const Eigen::Vector3d xx(x.x() * x.x(), x.x() * x.y(), x.y() * x.y());
        mean += share * wood;
        first.col(0) += share * x.x() * Eigen::Vector3d(wood[0], wood[1], wood[4]);
        first.col(1) += share * x.y() * Eigen::Vector3d(wood[0], wood[1], wood[4]);
        second += share * wood[0] * xx;
        seconds += share * xx;
    }
    if (all_alike) return {};
    // All in the axes n, s of the layers; strain is counted nn, ss, 2 ns.
    Eigen::Matrix3d turn;  // of strain, from x, y
    const double nx = normal.x(), ny = normal.y();
    turn << nx * nx, ny * ny, nx * ny, ny * ny, nx * nx, -nx * ny, -2.0 * nx * ny, 2.0 * nx * ny, nx * nx - ny * ny;
    const Eigen::Matrix3d C = LayeredElasticity{mean, Vec2::UnitX()}.stiffness();
    const Eigen::Matrix3d more = C - LayeredElasticity{of_average, Vec2::UnitX()}.stiffness();
    // The strain of q, by x and by y; of it ss.
    Eigen::Matrix<double, 3, 2> by_x, by_y;
    by_x << 0, 0, 0, 1, 1, 0;
    by_y << 1, 0, 0, 0, 0, 1;
    by_x = turn * by_x;
    by_y = turn * by_y;
    const Eigen::RowVector2d along_x = by_x.row(1), along_y = by_y.row(1);
    const Eigen::RowVector2d stretch = first(0, 0) * along_x + first(0, 1) * along_y;  // mean of E' b, with b q that strain
    Eigen::Matrix2d contraction;                                                       // means of r b and p b
    contraction << first(1, 0) * along_x + first(1, 1) * along_y, first(2, 0) * along_x + first(2, 1) * along_y;
    // Mean of m S by x, y with moments m.
    const auto squares = [](const auto& x, const auto& y, const auto& stiffness, const Eigen::Vector3d& moments) {
        const auto across = (x.transpose() * stiffness * y).eval();
        return (moments[0] * x.transpose() * stiffness * x + moments[1] * (across + across.transpose()) +
                moments[2] * y.transpose() * stiffness * y)
            .eval();
    };
    Eigen::Matrix2d bending;
    if (spread == Vec2::Ones()) {
        // A whole cell's sides are free to curve: with q come strains a that vary linearly, those of e_xx by x, e_yy by y and 2
        // e_xy by both, so that the energy is least. Their mean, weighted with E', is none: a strain that is the same all over
        // the cell does not set them off. Without it, or with a the same for each wood, an oblique boundary makes the energy of
        // some strain and q negative.
        Eigen::Matrix<double, 3, 6> x = Eigen::Matrix<double, 3, 6>::Zero(), y = x;  // slopes of strain, by q and a
        x.leftCols<2>() << 0, 0, 0, 1, 1, 0;
        y.leftCols<2>() << 1, 0, 0, 0, 0, 1;
        x(0, 2) = y(1, 3) = x(2, 4) = y(2, 5) = 1.0;
        x = turn * x;
        y = turn * y;
        Eigen::Matrix<double, 3, 6> along;  // e_ss: slopes, and in the middle
        along << x.row(1), y.row(1), Eigen::RowVector<double, 6>::Zero();
        along.row(2).tail<4>() = -first.row(0) / mean[0] * along.topRightCorner<2, 4>();
        Eigen::Matrix3d moments;
        moments << second[0], second[1], first(0, 0), second[1], second[2], first(0, 1), first(0, 0), first(0, 1), mean[0];
        Eigen::Matrix3d across = C;
        across(1, 1) -= mean[0];
        const Eigen::Matrix<double, 6, 6> all = along.transpose() * moments * along + squares(x, y, across, seconds);
        const Eigen::Matrix<double, 4, 2> free = all.bottomRightCorner<4, 4>().ldlt().solve(all.bottomLeftCorner<4, 2>());
        const Vec2 moduli = uniaxial_moduli(turn.transpose() * C * turn);
        bending = all.topLeftCorner<2, 2>() - all.topRightCorner<2, 4>() * free;
        bending.diagonal() -= Vec2(moduli.x() * seconds[2], moduli.y() * seconds[0]);
    } else {
        bending = squares(along_x, along_y, Eigen::Matrix<double, 1, 1>(1.0), Eigen::Vector3d(second - mean[0] * seconds)) +
                  squares(by_x, by_y, more, seconds);
    }
    Eigen::Matrix<double, 2, 3> tractions;  // nn and ns, of strain
    tractions << C.row(0), C.row(2);
    Eigen::Matrix<double, 3, 2> coupling = tractions.transpose() * contraction;
    coupling.row(1) += stretch;
    Eigen::Matrix2d stiffness;  // of the tractions' own strains
    stiffness << C(0, 0), C(0, 2), C(2, 0), C(2, 2);
    Unevenness found;
    found.coupling = turn.transpose() * coupling;
    found.bending = bending + contraction.transpose() * stiffness * contraction;
    if (more.norm() > 1e-12 * C.norm()) found.stretch = turn.transpose() * more * turn;
    return found;
}

// Samples of a square lattice whose own layers need not run the same way; void has none. `normal` is across layers of different
// wood.
void MaterialMap::average_elasticity(const std::vector<LayeredElasticity>& samples, int side, const std::optional<Vec2>& normal,
                                     LayeredElasticity& mean) const {
    constexpr double as_good_as_parallel = 0.01;  // sine of an angle from the middle one; taken for straight its square is lost
    const LayeredElasticity* first = nullptr;
    bool alike = true;
    Eigen::Matrix2d normals = Eigen::Matrix2d::Zero();
    for (const LayeredElasticity& wood : samples) {
        if (wood.coefficients[0] == 0.0) continue;
        if (!first) first = &wood;
        alike = alike && wood.coefficients == first->coefficients;
        normals += wood.normal * wood.normal.transpose();
    }
    if (const Vec2 middle = first_axis(normals); alike && std::ranges::all_of(samples, [&](const LayeredElasticity& wood) {
                                                     return wood.coefficients[0] == 0.0 ||
                                                            std::abs(cross(wood.normal, middle)) < as_good_as_parallel;
                                                 })) {
        mean = {first->coefficients, middle};
        return;
    }
    std::vector<Eigen::Matrix3d> stiffness;
    for (const LayeredElasticity& wood : samples)
        stiffness.push_back(wood.coefficients[0] == 0.0 ? Eigen::Matrix3d(Eigen::Matrix3d::Zero()) : wood.stiffness());
    mean.normal = normal ? *normal : steepest(stiffness, side);
    mean.coefficients.setZero();
    int count = 0;
    for (const Eigen::Matrix3d& C : stiffness) {
        if (C(0, 0) == 0.0) continue;
        mean.coefficients += layered(C, mean.normal).coefficients;
        ++count;
    }
    mean.coefficients /= count;
}

}  // namespace crampfit

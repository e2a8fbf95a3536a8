#include "forward/material_map.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace crampfit {

PlaneElasticity plane_elasticity(double youngs_modulus, double poisson_ratio, PlaneCondition plane) {
    const double mu = youngs_modulus / (2.0 * (1.0 + poisson_ratio));
    const double lambda = youngs_modulus * poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio));
    return {plane == PlaneCondition::strain ? lambda : 2.0 * lambda * mu / (lambda + 2.0 * mu), mu};
}

namespace {

// The direction in which values on a square lattice change most: the first axis of their structure tensor.
Vec2 steepest(const std::vector<double>& value, int side) {
    Eigen::Matrix2d tensor = Eigen::Matrix2d::Zero();
    for (int j = 0; j + 1 < side; ++j) {
        for (int i = 0; i + 1 < side; ++i) {
            const double* at = &value[static_cast<std::size_t>(j) * side + i];
            const Vec2 slope(at[1] + at[side + 1] - at[0] - at[side], at[side] + at[side + 1] - at[0] - at[1]);
            tensor += slope * slope.transpose();
        }
    }
    // Angle of the first axis of a symmetric matrix.
    const double angle = 0.5 * std::atan2(2.0 * tensor(0, 1), tensor(0, 0) - tensor(1, 1));
    return {std::cos(angle), std::sin(angle)};
}

} // namespace

LayeredElasticity layered(const PlaneElasticity& isotropic) {
    const auto& [l, m] = isotropic;
    const double a = 1.0 / (l + 2.0 * m);
    return {{4.0 * m * (l + m) * a, l * a, a, 1.0 / m}, Vec2::UnitX()};
}

Eigen::Matrix3d LayeredElasticity::stiffness() const {
    const auto& [e, r, a, b] = std::tuple(coefficients[0], coefficients[1], coefficients[2], coefficients[3]);
    Eigen::Matrix3d across;  // in n, s
    across << 1.0 / a, r / a, 0, r / a, e + r * r / a, 0, 0, 0, 1.0 / b;
    const double cc = normal.x() * normal.x();
    const double ss = normal.y() * normal.y();
    const double cs = normal.x() * normal.y();
    Eigen::Matrix3d turn;  // strain nn, ss, 2 ns from strain xx, yy, 2 xy
    turn << cc, ss, cs, ss, cc, -cs, -2 * cs, 2 * cs, cc - ss;
    return turn.transpose() * across * turn;
}

MaterialMap::MaterialMap(const Scene& scene) : scene_(scene) {
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
}

LocalWood MaterialMap::mix(int first, int second, double grade) const {
    const IsotropicMaterial& a = materials_[first];
    const IsotropicMaterial& b = materials_[second];
    LocalWood wood;
    wood.density = a.density + grade * (b.density - a.density);
    // How far along the power law through both ends this density lies; equal densities leave the geometric mean's share.
    const double log_span = std::log(b.density / a.density);
    const double share = std::abs(log_span) > 1e-12 ? std::log(wood.density / a.density) / log_span : grade;
    const double modulus = a.youngs_modulus * std::pow(b.youngs_modulus / a.youngs_modulus, share);
    wood.toughness = a.toughness * std::pow(b.toughness / a.toughness, share);
    wood.poisson_ratio = a.poisson_ratio + grade * (b.poisson_ratio - a.poisson_ratio);
    wood.elasticity = layered(plane_elasticity(modulus, wood.poisson_ratio, scene_.model.plane));
    wood.filled = 1.0;
    const double last = std::max<double>(1.0, static_cast<double>(materials_.size()) - 1.0);
    wood.latewood = (first + grade * (second - first)) / last;
    return wood;
}

LocalWood MaterialMap::in_rings(const Vec2& x) const {
    const Rings& rings = *scene_.specimen.rings;
    const double turns = (x - rings.pith).norm() / rings.period;
    const double phase = turns - std::floor(turns);
    const double latewood_start = 1.0 - rings.latewood_fraction;
    if (phase > latewood_start) return pure_[1];
    const double width = rings.transition / rings.period;
    if (width > 0.0 && phase > latewood_start - width) return mix(0, 1, 1.0 - (latewood_start - phase) / width);
    return pure_[0];
}

LocalWood MaterialMap::in_picture(const Vec2& x) const {
    const Specimen& map = *scene_.specimen.map;
    const Vec2 arm = x - picture_offset_;
    const Vec2 in_picture(picture_cos_ * arm.x() + picture_sin_ * arm.y(), -picture_sin_ * arm.x() + picture_cos_ * arm.y());
    const int column = std::clamp(static_cast<int>(std::floor(in_picture.x() / map.pixel)), 0, map.columns - 1);
    const int up = std::clamp(static_cast<int>(std::floor(in_picture.y() / map.pixel)), 0, map.rows - 1);
    const std::size_t at = static_cast<std::size_t>(map.rows - 1 - up) * map.columns + column;
    const int label = map.label[at];
    if (label == Specimen::void_label) return {};
    const double grade = map.grade.empty() ? 0.0 : map.grade[at];
    return grade > 0.0 ? mix(label, label + 1, grade) : pure_[label];
}

LocalWood MaterialMap::at(const Vec2& x) const {
    if (scene_.specimen.map) return in_picture(x);
    if (scene_.specimen.rings) return in_rings(x);
    return pure_[0];
}

LocalWood MaterialMap::average(const Vec2& centre, const Vec2& half) const {
    if (homogeneous_) return pure_[0];
    // Sixteen samples a side see a boundary's place to 1/32 of the area's width; a picture is seen at twice its own resolution.
    const int fit = finest_ > 0.0 ? static_cast<int>(std::ceil(4.0 * half.maxCoeff() / finest_)) : 16;
    const int samples = std::clamp(fit, 2, 16);
    LocalWood sum;
    std::vector<double> modulus(static_cast<std::size_t>(samples) * samples, 0.0);
    for (int j = 0; j < samples; ++j) {
        for (int i = 0; i < samples; ++i) {
            const Vec2 place((2.0 * i + 1.0) / samples - 1.0, (2.0 * j + 1.0) / samples - 1.0);
            const LocalWood here = at(centre + place.cwiseProduct(half));
            modulus[static_cast<std::size_t>(j) * samples + i] = here.plane_modulus();
            sum.elasticity.coefficients += here.elasticity.coefficients;
            sum.density += here.density;
            sum.toughness += here.toughness;
            sum.poisson_ratio += here.poisson_ratio;
            sum.latewood += here.latewood;
            sum.filled += here.filled;
        }
    }
    if (sum.filled == 0.0) return sum;
    const double share = 1.0 / sum.filled;  // means over what is there; the void only thins the point
    sum.elasticity.coefficients *= share;
    sum.elasticity.normal = steepest(modulus, samples);
    sum.density *= share;
    sum.toughness *= share;
    sum.poisson_ratio *= share;
    sum.latewood *= share;
    sum.filled /= static_cast<double>(samples) * samples;
    return sum;
}

} // namespace crampfit

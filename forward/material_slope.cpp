#include "forward/material_slope.hpp"

#include "datasets/io.hpp"
#include "forward/cracks.hpp"

#include <cmath>

namespace crampfit {

namespace {

constexpr double relative_step = 1e-5;

double step_of(const Scene& scene, const std::string& key) {
    const double value = get_number(scene, key);
    return relative_step * (value != 0.0 ? std::abs(value) : 1.0);
}

std::shared_ptr<const Scene> shifted(Scene scene, const std::string& key, double by) {
    set_number(scene, key, get_number(scene, key) + by);
    return std::make_shared<Scene>(std::move(scene));
}

}  // namespace

MaterialSlope::MaterialSlope(const Scene& scene, const std::string& key, const Discretisation& body)
    : step_(step_of(scene, key)), more_scene_(shifted(scene, key, step_)), less_scene_(shifted(scene, key, -step_)),
      more_(*more_scene_), less_(*less_scene_), body_(&body) {}

MaterialSlope::MaterialSlope(const MaterialSlope& whole, const Discretisation& part, const Vec2& corner)
    : step_(whole.step_), more_scene_(whole.more_scene_), less_scene_(whole.less_scene_), more_(whole.more_.part(corner)),
      less_(whole.less_.part(corner)), body_(&part) {}

std::vector<MaterialSlope> MaterialSlope::of(const Scene& scene, const std::vector<std::string>& keys,
                                             const Discretisation& body) {
    std::vector<MaterialSlope> numbers;
    for (const std::string& key : keys) numbers.push_back({scene, key, body});
    look_at_cells(numbers, body);
    return numbers;
}

std::vector<MaterialSlope> MaterialSlope::of(const std::vector<MaterialSlope>& whole, const Discretisation& part,
                                             const Vec2& corner) {
    std::vector<MaterialSlope> numbers;
    for (const MaterialSlope& number : whole) numbers.push_back({number, part, corner});
    look_at_cells(numbers, part);
    return numbers;
}

void MaterialSlope::look_at_cells(std::vector<MaterialSlope>& numbers, const Discretisation& body) {
    for (MaterialSlope& number : numbers) {
        number.stiffness_.assign(body.layout.cells(), Eigen::Matrix3d::Zero());
        number.moduli_.assign(body.layout.cells(), Vec2::Zero());
        number.uneven_of_cell_.assign(body.layout.cells(), -1);
    }
    for (int c = 0; c < body.layout.cells(); ++c) {
        if (body.points.first_of_cell[c] == body.points.first_of_cell[c + 1]) continue;
        WoodArea area = body.area_of_cell(c);
        for (MaterialSlope& number : numbers) {
            const LocalWood less = number.less_.average(area), more = number.more_.average(area);
            const Eigen::Matrix3d of_less = less.elasticity.stiffness(), of_more = more.elasticity.stiffness();
            number.stiffness_[c] = (of_more - of_less) / (2.0 * number.step_);
            if (of_more != of_less)
                number.moduli_[c] = (uniaxial_moduli(of_more) - uniaxial_moduli(of_less)) / (2.0 * number.step_);
            if (!more.mixed || !body.cell_is_full(c) || body.layout.degree > 1) continue;
            number.uneven_of_cell_[c] = static_cast<int>(number.uneven_.size());
            number.uneven_.push_back(
                number.between(body.unevenness_of(number.less_, area, less), body.unevenness_of(number.more_, area, more)));
        }
    }
}

Unevenness MaterialSlope::between(const Unevenness& less, const Unevenness& more) const {
    const double span = 2.0 * step_;
    return {(more.stretch - less.stretch) / span, (more.coupling - less.coupling) / span, (more.bending - less.bending) / span};
}

const Unevenness& MaterialSlope::unevenness(int cell, const PointBox& box) const {
    const int side = body_->layout.per_side, whole = uneven_of_cell_[cell];
    if (whole >= 0 && box == PointBox{0, 0, side, side}) return uneven_[whole];
    const auto [known, missing] = in_part_.try_emplace({cell, box});
    const auto of = [&](const MaterialMap& materials) {
        return body_->unevenness_of(materials, cell, box, body_->wood_of_cell(materials, cell));
    };
    if (missing) known->second = between(of(less_), of(more_));
    return known->second;
}

double MaterialSlope::opening_modulus(const Vec2& centre, const Vec2& half, const Vec2& along) const {
    const auto of = [&](const MaterialMap& materials) { return crampfit::opening_modulus(materials, centre, half, along); };
    return (of(more_) - of(less_)) / (2.0 * step_);
}

}  // namespace crampfit

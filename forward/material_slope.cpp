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
      more_(*more_scene_), less_(*less_scene_), body_(&body) {
    find_stiffness();
}

MaterialSlope::MaterialSlope(const MaterialSlope& whole, const Discretisation& part, const Vec2& corner)
    : step_(whole.step_), more_scene_(whole.more_scene_), less_scene_(whole.less_scene_), more_(whole.more_.part(corner)),
      less_(whole.less_.part(corner)), body_(&part) {
    find_stiffness();
}

void MaterialSlope::find_stiffness() {
    stiffness_.assign(body_->layout.cells(), Eigen::Matrix3d::Zero());
    for (int c = 0; c < body_->layout.cells(); ++c) {
        if (body_->points.first_of_cell[c] == body_->points.first_of_cell[c + 1]) continue;
        const auto of = [&](const MaterialMap& materials) { return body_->wood_of_cell(materials, c).elasticity.stiffness(); };
        stiffness_[c] = (of(more_) - of(less_)) / (2.0 * step_);
    }
}

const Unevenness& MaterialSlope::unevenness(int cell, const PointBox& box) const {
    const auto known = unevenness_.find({cell, box});
    if (known != unevenness_.end()) return known->second;
    const auto of = [&](const MaterialMap& materials) {
        return body_->unevenness_of(materials, cell, box, body_->wood_of_cell(materials, cell));
    };
    const Unevenness more = of(more_), less = of(less_);
    const double span = 2.0 * step_;
    return unevenness_[{cell, box}] = {(more.stretch - less.stretch) / span, (more.coupling - less.coupling) / span,
                                       (more.bending - less.bending) / span};
}

double MaterialSlope::opening_modulus(const Vec2& centre, const Vec2& half, const Vec2& along) const {
    const auto of = [&](const MaterialMap& materials) { return crampfit::opening_modulus(materials, centre, half, along); };
    return (of(more_) - of(less_)) / (2.0 * step_);
}

}  // namespace crampfit

#include "forward/material_slope.hpp"

#include "datasets/io.hpp"
#include "forward/cracks.hpp"

#include <cmath>

namespace crampfit {

namespace {

constexpr double relative_step = 1e-5;

Scene with_number(Scene scene, const std::string& key, double value) {
    set_number(scene, key, value);
    return scene;
}

} // namespace

struct MaterialSlope::Shifted {
    Scene scene;
    MaterialMap materials;

    Shifted(const Scene& original, const std::string& key, double value)
        : scene(with_number(original, key, value)), materials(scene) {}
};

MaterialSlope::MaterialSlope(const Scene& scene, const std::string& key, const Discretisation& body) : body_(&body) {
    const double value = get_number(scene, key);
    step_ = relative_step * (value != 0.0 ? std::abs(value) : 1.0);
    more_ = std::make_shared<Shifted>(scene, key, value + step_);
    less_ = std::make_shared<Shifted>(scene, key, value - step_);
    stiffness_.assign(body.layout.cells(), Eigen::Matrix3d::Zero());
    for (int c = 0; c < body.layout.cells(); ++c) {
        if (body.points.first_of_cell[c] == body.points.first_of_cell[c + 1]) continue;
        const auto of = [&](const Shifted& s) { return body.wood_of_cell(s.materials, c).elasticity.stiffness(); };
        stiffness_[c] = (of(*more_) - of(*less_)) / (2.0 * step_);
    }
}

const Unevenness& MaterialSlope::unevenness(int cell, const PointBox& box) const {
    const auto known = unevenness_.find({cell, box});
    if (known != unevenness_.end()) return known->second;
    const auto of = [&](const MaterialMap& materials) { return body_->unevenness_of(materials, cell, box, body_->wood_of_cell(materials, cell)); };
    const Unevenness more = of(more_->materials), less = of(less_->materials);
    const double span = 2.0 * step_;
    return unevenness_[{cell, box}] = {(more.stretch - less.stretch) / span, (more.coupling - less.coupling) / span,
                                       (more.bending - less.bending) / span};
}

const MaterialMap& MaterialSlope::materials(bool more) const { return (more ? more_ : less_)->materials; }

double MaterialSlope::opening_modulus(const Vec2& centre, const Vec2& half, const Vec2& along) const {
    const auto of = [&](const Shifted& s) { return crampfit::opening_modulus(s.materials, centre, half, along); };
    return (of(*more_) - of(*less_)) / (2.0 * step_);
}

} // namespace crampfit

#include "datasets/error.hpp"
#include "forward/explicit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {

void ExplicitSolver::place_bodies() {
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
        const Body& rigid = scene_.bodies[b];
        if (rigid.contact.kind != Contact::Kind::frictionless) continue;
        SlidingBody sliding(rigid.shape, body_);
        sliding.limit_frequency(mass_, plan_.added_frequency_squared);
        const double depth = std::max(sliding.deepest(displacement_), 0.0);
        const bool swallows = std::any_of(body_.points.position.begin(), body_.points.position.end(),
                                          [&](const Vec2& x) { return inside(rigid.shape, x) &&
                                              nearest_on_outline(rigid.shape, x).distance > body_.layout.cell.maxCoeff(); });
        if (swallows || depth > body_.layout.cell.maxCoeff())
            throw InputError(scene_.file.string(), "bodies." + rigid.name, fmt::format("overlap of {:.3g} mm", depth * 1e3),
                             "a sliding body must not overlap the specimen at the start");
        sliding_.push_back(std::move(sliding));
        sliding_driver_.push_back(boundary_.first_body() + static_cast<int>(b));
    }
}

// Over the step that begins now: in the step in which it stops a driver goes just as far as it should.
Vec2 ExplicitSolver::mean_velocity_of(int driver) const {
    return boundary_.velocity_of(driver) *
           std::clamp((boundary_.travel_time(driver) - time_) / plan_.time_step, 0.0, 1.0);
}

void ExplicitSolver::adopt(const std::vector<CrackFields::NewField>& fields, double softness) {
    for (const auto& [added, from] : fields) {
        displacement_.push_back(displacement_[from]);
        velocity_.push_back(velocity_[from]);
        acceleration_.push_back(acceleration_[from]);
        force_.push_back(Vec2::Zero());
    }
    boundary_.hold_further_fields(cracks_);
    mass_ = field_masses(body_, cracks_.fields());
    internal_force_.sort_cells();
    ties_.take_in(cracks_, mass_, displacement_, false, softness);
}

} // namespace crampfit

#include "forward/explicit.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace crampfit {

void ExplicitSolver::place_bodies() {
    if (slides_on_faces(scene_)) face_facets_.emplace(scene_, body_, cracks_);
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
        const Body& rigid = scene_.bodies[b];
        if (rigid.contact.kind == Contact::Kind::bonded) continue;
        SlidingBody sliding(rigid.shape, body_, rigid.contact.coefficient, face_facets_ ? &*face_facets_ : nullptr);
        sliding.limit_frequency(mass_, plan_.added_frequency_squared);
        sliding_.push_back(std::move(sliding));
        sliding_driver_.push_back(boundary_.first_body() + static_cast<int>(b));
    }
}

// On the way from here to there in time: in the step in which it stops a driver goes just as far as it should.
Vec2 ExplicitSolver::mean_velocity_of(int driver, double from, double to) const {
    return boundary_.velocity_of(driver) * std::clamp((boundary_.travel_time(driver) - from) / (to - from), 0.0, 1.0);
}

// Which nodes move with from then on, until the forces of the next step.
Vec2 ExplicitSolver::velocity_at_end_of_step(int driver) const {
    const double dt = plan_.time_step;
    return mean_velocity_of(driver, time_ + (lag() < 0.0 ? dt : 0.0), time_ + (lag() > 0.0 ? dt : 2.0 * dt));
}

void ExplicitSolver::list_held() {
    held_axes_.assign(cracks_.fields(), 0);
    for (const Boundary::Held& h : boundary_.held)
        held_axes_[h.field] = static_cast<std::uint8_t>(held_axes_[h.field] | 1 << h.axis);
}

// Of a part that moves at the start; edges and bodies hold on to what they hold.
void ExplicitSolver::start_parts() {
    const auto& parts = scene_.specimen.parts;
    if (parts.size() > 1) part_contact_.emplace(body_, mass_, plan_.added_frequency_squared);
    for (int p = 0; p < body_.points.count() && !parts.empty(); ++p)
        for (const int field : body_.points.node[p])
            for (int axis = 0; axis < 2; ++axis)
                if (!(held_axes_[field] >> axis & 1)) velocity_[field][axis] = parts[body_.points.part[p]].velocity[axis];
    for (std::size_t n = 0; n < mass_.size(); ++n)
        for (int axis = 0; axis < 2; ++axis)
            if (!(held_axes_[n] >> axis & 1)) books_.work += 0.5 * mass_[n] * velocity_[n][axis] * velocity_[n][axis];
}

void ExplicitSolver::start(const std::function<Vec2(const Vec2&)>& displacement,
                           const std::function<Vec2(const Vec2&)>& velocity) {
    for (int f = 0; f < cracks_.fields(); ++f) {
        const Vec2 x = body_.layout.node_position(cracks_.node_of_field[f]);
        displacement_[f] = displacement(x);
        velocity_[f] = velocity(x);
    }
    for (const Boundary::Held& h : boundary_.held) velocity_[h.field][h.axis] = boundary_.velocity_of(h.driver)[h.axis];
    normals_.turn(displacement_);
    std::fill(force_.begin(), force_.end(), Vec2::Zero());
    inner_forces(0.0);
    carried_ = velocity_;
    for (std::size_t n = 0; n < mass_.size(); ++n) {
        if (mass_[n] == 0.0) continue;
        acceleration_[n] = force_[n] / mass_[n];
        for (int axis = 0; axis < 2; ++axis)
            if (held_axes_[n] >> axis & 1) acceleration_[n][axis] = 0.0;
        carried_[n] -= lag() * plan_.time_step * acceleration_[n];
    }
    std::fill(acceleration_.begin(), acceleration_.end(), Vec2::Zero());
    velocity_ = carried_;
    if (mapping_.is_used() && !mapping_.nodes_carry()) mapping_.hand_back(velocity_, {mass_, held_axes_, team_});
    books_ = {};
    const EnergyBooks at_start = energies();
    books_.work = at_start.strain + at_start.kinetic + at_start.damped + at_start.fracture;
}

// Points that go to another field take their momentum along, as in an impact without rebound. Where no others are with them,
// their motion is the field's.
void ExplicitSolver::carry_over(const std::vector<CrackFields::Move>& moves) {
    struct Arrival {
        double mass = 0.0;
        Vec2 displacement = Vec2::Zero(), velocity = Vec2::Zero(), carried = Vec2::Zero();  // times mass
        double kinetic = 0.0;                                                               // twice
    };
    std::map<int, Arrival> arrivals;
    for (const CrackFields::Move& move : moves) {
        const double mass = body_.points.mass[move.point] * body_.weights[body_.points.slot[move.point]].value[move.corner];
        Arrival& at = arrivals[move.to];
        at.mass += mass;
        at.displacement += mass * displacement_[move.from];
        at.velocity += mass * velocity_[move.from];
        at.carried += mass * carried_[move.from];
        at.kinetic += mass * velocity_[move.from].squaredNorm();
    }
    for (const auto& [field, come] : arrivals) {
        constexpr double rounding = 1e-9;  // of its mass
        const double rest = mass_[field] - come.mass;
        const bool all_new = rest <= rounding * mass_[field];
        const double stayed = all_new ? 0.0 : rest;
        const double kinetic = stayed * velocity_[field].squaredNorm() + come.kinetic;
        if (all_new) displacement_[field] = come.displacement / come.mass;
        velocity_[field] = (stayed * velocity_[field] + come.velocity) / mass_[field];
        carried_[field] = (stayed * carried_[field] + come.carried) / mass_[field];
        books_.damped += 0.5 * (kinetic - mass_[field] * velocity_[field].squaredNorm());
    }
}

void ExplicitSolver::adopt(const std::vector<CrackFields::NewField>& fields, const Box& changed, double softness) {
    for (const auto& [added, from] : fields) {
        displacement_.push_back(displacement_[from]);
        velocity_.push_back(velocity_[from]);
        carried_.push_back(carried_[from]);
        acceleration_.push_back(acceleration_[from]);
        force_.push_back(Vec2::Zero());
    }
    boundary_.follow(cracks_);
    list_held();
    mass_ = field_masses(body_, cracks_.fields());
    carry_over(cracks_.moves);
    internal_force_.sort_cells();
    if (bridges_) softness *= bridges_->softer_ties(cracks_, softness);
    ties_.take_in(cracks_, mass_, displacement_, false, softness);
    normals_.take_in(body_, cracks_, plan_.rotates);
    normals_.turn(displacement_);
    if (face_facets_) face_facets_->take_in(changed);
    for (SlidingBody& rigid : sliding_) rigid.take_in_faces(changed, mass_);
}

}  // namespace crampfit

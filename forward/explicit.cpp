#include "forward/explicit.hpp"

#include "datasets/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

// A pair of fields at a crack tip comes up just before the tip frees it, so that some tie always holds the tip (CrackFields).
constexpr double least_freed = -0.02;

} // namespace

ExplicitSolver::ExplicitSolver(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body)
    : scene_(scene), plan_(plan), materials_(materials), body_(body), cracks_(scene, body, materials, least_freed),
      boundary_(scene, body, cracks_), internal_force_(body, plan.rotates),
      ties_(body.layout.cell, body.layout.thickness, plan.added_frequency_squared) {
    const std::size_t fields = cracks_.fields();
    displacement_.assign(fields, Vec2::Zero());
    velocity_.assign(fields, Vec2::Zero());
    acceleration_.assign(fields, Vec2::Zero());
    force_.assign(fields, Vec2::Zero());
    reaction_.assign(scene.edges.size() + scene.bodies.size(), Vec2::Zero());
    tips_.resize(2 * cracks_.lines.size());
    mass_ = field_masses(body, cracks_.fields());
    ties_.take_in(cracks_, mass_, displacement_, true);
    for (const Boundary::Held& h : boundary_.held) {
        velocity_[h.field][h.axis] = boundary_.velocity_of(h.driver)[h.axis];
        books_.work += 0.5 * mass_[h.field] * velocity_[h.field][h.axis] * velocity_[h.field][h.axis];
    }
    place_bodies();
}

void ExplicitSolver::step() {
    std::fill(force_.begin(), force_.end(), Vec2::Zero());
    std::fill(reaction_.begin(), reaction_.end(), Vec2::Zero());
    internal_force_.add(displacement_, force_);
    surface_forces();
    ties_.settle(cracks_, mass_, force_);
    ties_.pull(cracks_, displacement_, force_);
    advance_velocities();
    close_crack_faces();
    prescribe_velocities();
    advance_displacements();
    time_ += plan_.time_step;
}

void ExplicitSolver::surface_forces() {
    for (const Boundary::Traction& t : boundary_.tractions) {
        Vec2 velocity = Vec2::Zero();
        for (int k = 0; k < 4; ++k) {
            const int field = body_.points.node[t.facet.point][k];
            force_[field] += t.facet.weight[k] * t.force;
            velocity += t.facet.weight[k] * velocity_[field];
        }
        reaction_[t.driver] += t.force;
        books_.work += plan_.time_step * t.force.dot(velocity);
    }
    for (std::size_t i = 0; i < sliding_.size(); ++i) {
        const int driver = sliding_driver_[i];
        reaction_[driver] = sliding_[i].push(moved(driver), displacement_, force_);
        books_.work += plan_.time_step * reaction_[driver].dot(mean_velocity_of(driver));
    }
}

void ExplicitSolver::advance_velocities() {
    const double dt = plan_.time_step;
    const double drag = 0.5 * dt * scene_.solver.damping;
    for (std::size_t n = 0; n < mass_.size(); ++n) {
        if (mass_[n] == 0.0) continue;
        const Vec2 before = velocity_[n];
        velocity_[n] = ((1.0 - drag) * before + dt / mass_[n] * force_[n]) / (1.0 + drag);
        acceleration_[n] = (velocity_[n] - before) / dt;
        if (drag > 0.0) books_.damped += mass_[n] * drag * 0.5 * (before + velocity_[n]).squaredNorm();
    }
}

void ExplicitSolver::close_crack_faces() {
    const double dt = plan_.time_step;
    for (const FieldPair& pair : cracks_.pairs) {
        const double m_left = mass_[pair.left];
        const double m_right = mass_[pair.right];
        if (m_left == 0.0 || m_right == 0.0) continue;
        const Vec2 gap = displacement_[pair.left] - displacement_[pair.right];
        const Vec2 rate = velocity_[pair.left] - velocity_[pair.right];
        const double open = gap.dot(pair.normal);
        const double slowest = -std::max(open, 0.0) / dt;  // closes just now, no further
        const double too_fast = slowest - rate.dot(pair.normal);
        if (too_fast <= 0.0) continue;
        Vec2 change = too_fast * pair.normal;
        if (scene_.cracks[pair.crack].faces.kind == CrackFaces::Kind::stick) {
            const Vec2 along = left_of(pair.normal);
            change -= rate.dot(along) * along;
        }
        const double total = m_left + m_right;
        velocity_[pair.left] += m_right / total * change;
        velocity_[pair.right] -= m_left / total * change;
        acceleration_[pair.left] += m_right / total * change / dt;
        acceleration_[pair.right] -= m_left / total * change / dt;
    }
}

void ExplicitSolver::prescribe_velocities() {
    const double dt = plan_.time_step;
    const double drag = 0.5 * dt * scene_.solver.damping;
    for (const Boundary::Held& held : boundary_.held) {
        double& v = velocity_[held.field][held.axis];
        const double wanted = mean_velocity_of(held.driver)[held.axis];
        const double before = v - dt * acceleration_[held.field][held.axis];
        const double force = (1.0 + drag) * mass_[held.field] * (wanted - v) / dt;
        books_.work += force * dt * 0.5 * (before + wanted);
        reaction_[held.driver][held.axis] += force;
        acceleration_[held.field][held.axis] += (wanted - v) / dt;
        v = wanted;
    }
}

void ExplicitSolver::advance_displacements() {
    const double dt = plan_.time_step;
    for (std::size_t n = 0; n < mass_.size(); ++n) displacement_[n] += dt * velocity_[n];
}

TipLoad ExplicitSolver::load_at(int crack, bool at_end) const {
    EnergyReleaseOptions options;
    options.rotates = plan_.rotates;
    return tip_load(body_, cracks_, materials_, crack, at_end, {displacement_, velocity_, acceleration_}, options);
}

// As of the last step's forces: with the displacements then and the velocities half a step before and after, v and v',
// W(u) + m v.v' / 2 is what central differences keep to rounding where forces are linear (Belytschko et al. 2014, 6.2).
EnergyBooks ExplicitSolver::energies() const {
    EnergyBooks books = books_;
    const double back = time_ > 0.0 ? plan_.time_step : 0.0;
    std::vector<Vec2> then = displacement_;
    for (std::size_t n = 0; n < mass_.size(); ++n) {
        then[n] -= back * velocity_[n];
        books.kinetic += 0.5 * mass_[n] * velocity_[n].dot(velocity_[n] - back * acceleration_[n]);
    }
    books.strain = internal_force_.energy(then) + ties_.energy(cracks_, then);
    for (const SlidingBody& body : sliding_) books.contact += body.stored_energy();
    return books;
}

bool ExplicitSolver::is_finite() const {
    return std::all_of(displacement_.begin(), displacement_.end(), [](const Vec2& u) { return u.allFinite(); });
}

} // namespace crampfit

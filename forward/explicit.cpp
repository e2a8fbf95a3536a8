#include "forward/explicit.hpp"

#include "forward/growth.hpp"

#include "datasets/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

// Of a pair of fields at a crack tip (CrackFields): a stiffer tie than at this place would shorten the time step for nothing.
constexpr double least_freed = 0.15;

} // namespace

ExplicitSolver::ExplicitSolver(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body)
    : scene_(scene), plan_(plan), materials_(materials), body_(body), cracks_(scene, body, materials, least_freed),
      boundary_(scene, body, cracks_), internal_force_(body, plan.rotates) {
    const std::size_t fields = cracks_.fields();
    displacement_.assign(fields, Vec2::Zero());
    velocity_.assign(fields, Vec2::Zero());
    acceleration_.assign(fields, Vec2::Zero());
    force_.assign(fields, Vec2::Zero());
    reaction_.assign(scene.edges.size() + scene.bodies.size(), Vec2::Zero());
    tip_loads_.resize(2 * cracks_.lines.size());
    last_growth_.assign(2 * cracks_.lines.size(), 0.0);
    mass_ = field_masses(body, cracks_.fields());
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
    tie_forces();
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
        sliding_[i].settle(moved(driver), displacement_);
        books_.work += plan_.time_step * reaction_[driver].dot(mean_velocity_of(driver));
    }
}

double ExplicitSolver::tie_stiffness(const FieldPair& pair) const {
    const double left = mass_[pair.left];
    const double right = mass_[pair.right];
    return std::min(shared_tie(pair, mass_), plan_.added_frequency_squared * left * right / (left + right));
}

void ExplicitSolver::tie_forces() {
    for (const FieldPair& pair : cracks_.pairs) {
        if (pair.tie == 0.0 || mass_[pair.left] == 0.0 || mass_[pair.right] == 0.0) continue;
        const Vec2 pull = tie_stiffness(pair) * (displacement_[pair.left] - displacement_[pair.right]);
        force_[pair.left] -= pull;
        force_[pair.right] += pull;
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
    face_force_.assign(cracks_.pairs.size(), Vec2::Zero());
    for (std::size_t k = 0; k < cracks_.pairs.size(); ++k) {
        const FieldPair& pair = cracks_.pairs[k];
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
        const double total = m_left + m_right;
        const CrackFaces& faces = scene_.cracks[pair.crack].faces;
        const Vec2 along = left_of(pair.normal);
        if (faces.kind == CrackFaces::Kind::stick) change -= rate.dot(along) * along;
        if (faces.coefficient > 0.0) {  // Coulomb's law of impulses
            const double most = faces.coefficient * too_fast;
            change += std::clamp(-rate.dot(along), -most, most) * along;
        }
        const Vec2 rate_before = rate - dt * (acceleration_[pair.left] - acceleration_[pair.right]);
        books_.damped -= m_left * m_right / total * change.dot(0.5 * (rate_before + rate + change));
        face_force_[k] = m_left * m_right / total / dt * change;
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
    return tip_load(body_, cracks_, materials_, crack, at_end, {displacement_, velocity_, acceleration_, face_force_}, options);
}

EnergyBooks ExplicitSolver::energies() const {
    EnergyBooks books = books_;
    books.strain = internal_force_.energy(displacement_);
    for (const FieldPair& pair : cracks_.pairs)
        if (pair.tie > 0.0 && mass_[pair.left] > 0.0 && mass_[pair.right] > 0.0)
            books.strain += 0.5 * tie_stiffness(pair) * (displacement_[pair.left] - displacement_[pair.right]).squaredNorm();
    for (std::size_t n = 0; n < mass_.size(); ++n)
        books.kinetic += 0.5 * mass_[n] * (velocity_[n] + 0.5 * plan_.time_step * acceleration_[n]).squaredNorm();
    for (const SlidingBody& body : sliding_) books.contact += body.stored_energy();
    for (const SlidingBody& body : sliding_) books.damped += body.dissipated();
    return books;
}

bool ExplicitSolver::is_finite() const {
    return std::all_of(displacement_.begin(), displacement_.end(), [](const Vec2& u) { return u.allFinite(); });
}

void ExplicitSolver::grow_cracks() {
    constexpr double increment_in_cells = 0.25;
    const double increment = increment_in_cells * body_.layout.cell.minCoeff();
    for (int k = 0; k < static_cast<int>(cracks_.lines.size()); ++k) {
        for (const bool at_end : {false, true}) {
            const CrackTip tip = cracks_.lines[k].tip(at_end);
            if (!tip.grows || !tip.inside) continue;
            TipLoad& load = tip_loads_[2 * k + at_end];
            load = load_at(k, at_end);
            if (load.G < load.toughness) continue;
            // A crack cannot outrun the Rayleigh wave (Freund 1990).
            const LocalWood wood = materials_.at(tip.position);
            const double rayleigh = rayleigh_speed(in_axes(wood.elasticity.stiffness(), tip.direction), wood.density);
            double& last = last_growth_[2 * k + at_end];
            if (time_ - last < increment / rayleigh) continue;
            last = time_;

            const Vec2 direction = growth_direction(scene_.cracks[k].direction, tip, load, materials_, increment);
            books_.fracture += load.toughness * increment * body_.layout.thickness;
            adopt(cracks_.grow(k, at_end, tip.position + increment * direction));
        }
    }
}

} // namespace crampfit

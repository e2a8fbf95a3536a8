#include "forward/explicit.hpp"

#include "datasets/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

// A pair of fields at a crack tip comes up just before the tip frees it, so that some tie always holds the tip (CrackFields).
constexpr double least_freed = -0.02;

}  // namespace

ExplicitSolver::ExplicitSolver(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body,
                               int threads)
    : scene_(scene), plan_(plan), materials_(materials), body_(body), cracks_(scene, body, materials, least_freed),
      boundary_(scene, body, cracks_),
      history_(plan.remembers ? std::make_unique<History>(materials, body, scene.model.plane) : nullptr),
      internal_force_(body, materials, plan.rotates, history_.get(), true), team_(threads),
      ties_(body.layout.cell, body.layout.thickness, plan.added_frequency_squared), mapping_(scene.solver, body),
      fine_tip_(scene, plan, materials, body, no_numbers_) {
    const std::size_t fields = cracks_.fields();
    displacement_.assign(fields, Vec2::Zero());
    velocity_.assign(fields, Vec2::Zero());
    acceleration_.assign(fields, Vec2::Zero());
    force_.assign(fields, Vec2::Zero());
    reaction_.assign(scene.edges.size() + scene.bodies.size(), Vec2::Zero());
    tips_.resize(2 * cracks_.lines.size());
    mass_ = field_masses(body, cracks_.fields());
    ties_.take_in(cracks_, mass_, displacement_, true);
    normals_.take_in(body, cracks_, plan.rotates);
    if (BridgedFaces::are_in(scene)) bridges_.emplace(scene, body, cracks_, mass_, plan.added_frequency_squared);
    for (const Boundary::Held& h : boundary_.held) {
        velocity_[h.field][h.axis] = boundary_.velocity_of(h.driver)[h.axis];
        books_.work += 0.5 * mass_[h.field] * velocity_[h.field][h.axis] * velocity_[h.field][h.axis];
    }
    list_held();
    start_parts();
    carried_ = velocity_;
    place_bodies();
}

// How far velocities stand behind displacements between steps, in steps. Displacements go on by 1/2 - lag of a step before its
// forces are found, and by the rest after them.
double ExplicitSolver::lag() const {
    switch (scene_.solver.stress_update) {
    case StressUpdate::first:
        return -0.5;
    case StressUpdate::average:
        return 0.0;
    case StressUpdate::last:
        break;
    }
    return 0.5;
}

void ExplicitSolver::step() {
    advance_displacements(0.5 - lag());
    team_.pieces(cracks_.fields(),
                 [&](int first, int last) { std::fill(force_.begin() + first, force_.begin() + last, Vec2::Zero()); });
    std::fill(reaction_.begin(), reaction_.end(), Vec2::Zero());
    inner_forces(time_ + (0.5 - lag()) * plan_.time_step);
    surface_forces();
    normals_.turn(displacement_);
    if (bridges_) bridges_->pull(cracks_, normals_, displacement_, force_);
    ties_.settle(cracks_, normals_, mass_, force_);
    ties_.pull(cracks_, displacement_, force_);
    advance_velocities();
    struck_ = 0.0;
    close_crack_faces(true);
    prescribe_velocities();
    carry_velocities();
    advance_displacements(0.5 + lag());
    time_ += plan_.time_step;
}

// Of the displacements as they are at a time.
void ExplicitSolver::inner_forces(double time) {
    if (history_) history_->go_to(time);
    internal_force_.add(displacement_, force_, team_);
    if (history_) history_->settle();
}

void ExplicitSolver::surface_forces() {
    for (const Boundary::Traction& t : boundary_.tractions) {
        Vec2 velocity = Vec2::Zero();
        for (int k = 0; k < body_.layout.nodes_per_cell(); ++k) {
            const int field = t.field[k];
            force_[field] += t.facet.weight[k] * t.force;
            velocity += t.facet.weight[k] * velocity_[field];
        }
        reaction_[t.driver] += t.force;
        books_.work += plan_.time_step * t.force.dot(velocity);
    }
    half_a_step_ago_ = books_;
    for (std::size_t i = 0; i < sliding_.size(); ++i) {
        const int driver = sliding_driver_[i];
        const Vec2 gone = boundary_.moved(driver, time_ + (0.5 - lag()) * plan_.time_step, displacement_);
        sliding_[i].meet(gone, displacement_);
        reaction_[driver] = sliding_[i].push(force_);
        sliding_[i].settle(gone, displacement_);
        books_.work += plan_.time_step * reaction_[driver].dot(mean_velocity_of(driver, time_, time_ + plan_.time_step));
    }
    if (part_contact_) part_contact_->push(displacement_, force_);
}

void ExplicitSolver::advance_velocities() {
    const double dt = plan_.time_step;
    const double drag = 0.5 * dt * scene_.solver.damping;
    damped_.assign(mass_.size() / Team::piece + 1, 0.0);
    team_.pieces(cracks_.fields(), [&](int first, int last) {
        double damped = 0.0;
        for (int n = first; n < last; ++n) {
            if (mass_[n] == 0.0) continue;
            const Vec2 before = velocity_[n];
            velocity_[n] = ((1.0 - drag) * before + dt / mass_[n] * force_[n]) / (1.0 + drag);
            acceleration_[n] = (velocity_[n] - before) / dt;
            if (drag > 0.0) damped += mass_[n] * drag * 0.5 * (before + velocity_[n]).squaredNorm();
        }
        damped_[first / Team::piece] = damped;
    });
    for (const double damped : damped_) books_.damped += damped;
    if (mapping_.nodes_carry()) books_.damped += mapping_.extrapolate(velocity_, acceleration_, dt, {mass_, held_axes_, team_});
}

void ExplicitSolver::carry_velocities() {
    if (!mapping_.is_used() || mapping_.nodes_carry()) return;
    books_.damped += mapping_.carry(carried_, velocity_, acceleration_, plan_.time_step, {mass_, held_axes_, team_});
    close_crack_faces(false);
}

// Without force: velocities that the points hand back may close faces again, though the points themselves do not.
void ExplicitSolver::close_crack_faces(bool with_force) {
    const double dt = plan_.time_step;
    const double drag = with_force ? 0.5 * dt * scene_.solver.damping : 0.0;
    // Where points carry what the nodes have been given, they tell what the change took; forces' work has been counted without
    // it.
    const bool by_points = with_force && mapping_.nodes_carry() && !cracks_.pairs.empty();
    if (by_points) books_.damped += mapping_.kinetic_energy(velocity_, team_);
    face_force_.assign(cracks_.pairs.size(), Vec2::Zero());
    for (std::size_t k = 0; k < cracks_.pairs.size(); ++k) {
        const FieldPair& pair = cracks_.pairs[k];
        const double m_left = mass_[pair.left];
        const double m_right = mass_[pair.right];
        if (m_left == 0.0 || m_right == 0.0) continue;
        const Vec2& normal = normals_[k];
        const Vec2 gap = displacement_[pair.left] - displacement_[pair.right];
        const Vec2 rate = velocity_[pair.left] - velocity_[pair.right];
        const double open = gap.dot(normal);
        const double slowest = -std::max(open, 0.0) / dt;  // closes just now, no further
        const double too_fast = slowest - rate.dot(normal);
        if (too_fast <= 0.0) continue;
        Vec2 change = too_fast * normal;
        const double total = m_left + m_right;
        const CrackFaces& faces = scene_.cracks[pair.crack].faces;
        const Vec2 along = left_of(normal);
        if (faces.kind == CrackFaces::Kind::stick) change -= rate.dot(along) * along;
        if (faces.coefficient > 0.0) {  // Coulomb's law of impulses
            const double most = faces.coefficient * too_fast;
            change += std::clamp(-rate.dot(along), -most, most) * along;
        }
        const Vec2 gained = dt * (acceleration_[pair.left] - acceleration_[pair.right]);  // by the other forces
        const Vec2 twice_mean = by_points ? -gained : Vec2(2.0 * rate - gained + change);
        const double mass = m_left * m_right / total;
        books_.damped -= 0.5 * mass * change.dot(twice_mean);
        // Against drag it takes more, and drag itself is that of the motion that comes about.
        books_.damped += 0.5 * drag * mass * change.dot(2.0 * rate - gained);
        if (!by_points) struck_ += 0.25 * mass * change.dot(gained + change);
        face_force_[k] = (1.0 + drag) * mass / dt * change;
        velocity_[pair.left] += m_right / total * change;
        velocity_[pair.right] -= m_left / total * change;
        if (!with_force) continue;
        acceleration_[pair.left] += m_right / total * change / dt;
        acceleration_[pair.right] -= m_left / total * change / dt;
    }
    if (by_points) books_.damped -= mapping_.kinetic_energy(velocity_, team_);
}

void ExplicitSolver::prescribe_velocities() {
    const double dt = plan_.time_step;
    const double drag = 0.5 * dt * scene_.solver.damping;
    for (const Boundary::Held& held : boundary_.held) {
        double& v = velocity_[held.field][held.axis];
        const double wanted = velocity_at_end_of_step(held.driver)[held.axis];
        const double before = v - dt * acceleration_[held.field][held.axis];
        const double force = (1.0 + drag) * mass_[held.field] * (wanted - v) / dt;
        books_.work += force * dt * 0.5 * (before + wanted);
        // What damping takes is counted for the motion that comes about.
        books_.damped += mass_[held.field] * drag * 0.5 * ((before + wanted) * (before + wanted) - (before + v) * (before + v));
        reaction_[held.driver][held.axis] += force;
        acceleration_[held.field][held.axis] += (wanted - v) / dt;
        v = wanted;
    }
}

void ExplicitSolver::advance_displacements(double share) {
    if (share == 0.0) return;
    team_.pieces(cracks_.fields(), [&](int first, int last) {
        for (int n = first; n < last; ++n) displacement_[n] += share * plan_.time_step * velocity_[n];
    });
}

TipLoad ExplicitSolver::load_at(int crack, bool at_end) const {
    EnergyReleaseOptions options;
    options.rotates = options.sizes_K_by_J = plan_.rotates;
    std::vector<Vec2> faces = face_force_;
    if (bridges_) bridges_->add_to(faces, normals_);
    TipLoad load = tip_load(body_, cracks_, materials_, crack, at_end,
                            {displacement_, velocity_, acceleration_, ties_.energies(cracks_, displacement_), faces}, options);
    if (history_) history_->forget_unknown(load, cracks_.lines[crack].tip(at_end).position, options);
    return load;
}

EnergyBooks ExplicitSolver::energies() const {
    // As of the last forces: half of the product of velocities before and after them with the strain energy is what a leapfrog
    // keeps (Hairer, Lubich and Wanner 2003), exactly so where forces are linear.
    // Of what that step's forces did from half a step before to half a step behind, one half; of an impact, what it took from the
    // velocity before.
    EnergyBooks books = books_;
    if (time_ > 0.0) {
        books.work = 0.5 * (books_.work + half_a_step_ago_.work);
        books.damped = 0.5 * (books_.damped + half_a_step_ago_.damped) + struck_;
    }
    const double since = time_ > 0.0 ? (0.5 + lag()) * plan_.time_step : 0.0;
    std::vector<Vec2> there = displacement_;
    for (std::size_t n = 0; n < there.size(); ++n) there[n] -= since * velocity_[n];
    books.strain = internal_force_.energy(there) + ties_.energy(cracks_, there);
    books.kinetic = kinetic_energy();
    if (bridges_) {
        const BridgedFaces::Energies faces = bridges_->energies(cracks_, normals_, there);
        books.strain += faces.stored;
        books.fracture += faces.dissipated;
    }
    for (const SlidingBody& body : sliding_) books.contact += body.stored_energy();
    for (const SlidingBody& body : sliding_) books.damped += body.dissipated();
    if (history_) books.damped += history_->dissipated();
    if (part_contact_) books.contact += part_contact_->stored_energy();
    return books;
}

double ExplicitSolver::kinetic_energy() const {
    const double dt = plan_.time_step;
    if (!mapping_.is_used()) {
        double sum = 0.0;
        for (std::size_t n = 0; n < mass_.size(); ++n)
            sum += 0.5 * mass_[n] * velocity_[n].dot(velocity_[n] - dt * acceleration_[n]);
        return sum;
    }
    // v (v - a dt) = (v - a dt / 2)^2 - (a dt / 2)^2
    std::vector<Vec2> middle = mapping_.nodes_carry() ? velocity_ : carried_;
    double half = 0.0;
    for (std::size_t n = 0; n < middle.size(); ++n) {
        middle[n] -= 0.5 * dt * acceleration_[n];
        half += 0.5 * mass_[n] * (0.5 * dt * acceleration_[n]).squaredNorm();
    }
    return mapping_.kinetic_energy(middle, team_) - half;
}

bool ExplicitSolver::is_finite() const {
    return std::all_of(displacement_.begin(), displacement_.end(), [](const Vec2& u) { return u.allFinite(); });
}

}  // namespace crampfit

#include "forward/recorder.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {

Recorder::Recorder(const Scene& scene, const Plan& plan, const Discretisation& body, const ExplicitSolver& solver)
    : scene_(scene), plan_(plan), body_(body), solver_(solver) {
    displacement_.driver = driver_named(scene.measure.displacement);
    displacement_.direction = direction_of(displacement_.driver);
    force_.driver = driver_named(scene.measure.force);
    force_.direction = direction_of(force_.driver);
    if (force_.direction.isZero()) force_.direction = -displacement_.direction;  // a fixed support feels the opposite of the load

    for (std::size_t k = 0; k < scene.cracks.size() && crack_ < 0; ++k)
        if (scene.cracks[k].grows != Growth::none) crack_ = static_cast<int>(k);
    if (crack_ < 0 && !scene.cracks.empty()) crack_ = 0;
    at_end_ = crack_ < 0 || scene.cracks[crack_].grows != Growth::start;
    record_.tracked_crack = std::max(crack_, 0);

    evenly_ = std::isfinite(plan.end_time);
    interval_ = evenly_ ? static_cast<long>(std::ceil(plan.end_time / plan.time_step / scene.output.samples)) : 16;
    interval_ = std::max(interval_, 1L);
    for (const Edge& edge : scene.edges) record_.reactions.push_back({edge.name, {}});
    for (const Body& rigid : scene.bodies) record_.reactions.push_back({rigid.name, {}});
    reaction_sum_.assign(record_.reactions.size(), Vec2::Zero());
    record_.cracks.resize(scene.cracks.size());
    record_.points = body.points.count();
    if (scene.output.frames > 0) {
        record_.point_position = body.points.position;
        record_.point_latewood = body.points.latewood;
    }
}

int Recorder::driver_named(const std::string& name) const {
    for (std::size_t e = 0; e < scene_.edges.size(); ++e)
        if (scene_.edges[e].name == name) return static_cast<int>(e);
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b)
        if (scene_.bodies[b].name == name) return static_cast<int>(scene_.edges.size() + b);
    return 0;
}

Vec2 Recorder::direction_of(int driver) const {
    const int edges = static_cast<int>(scene_.edges.size());
    Vec2 drive = Vec2::Zero();
    if (driver >= edges) {
        if (driver - edges < static_cast<int>(scene_.bodies.size())) drive = scene_.bodies[driver - edges].velocity;
    } else if (scene_.edges[driver].traction) {
        drive = *scene_.edges[driver].traction;
    } else {
        const auto& velocity = scene_.edges[driver].velocity;
        drive = {velocity[0].value_or(0.0), velocity[1].value_or(0.0)};
    }
    return drive.isZero() ? drive : drive.normalized();
}

void Recorder::add_step() {
    ++steps_;
    ++reaction_count_;
    for (std::size_t d = 0; d < reaction_sum_.size(); ++d) reaction_sum_[d] += solver_.reactions()[d];
}

Instant Recorder::now() const {
    Instant now = record_.series.empty() ? Instant{} : record_.series.back();
    now.time = solver_.time();
    if (!reaction_sum_.empty()) now.displacement = solver_.moved(displacement_.driver).dot(displacement_.direction);
    if (crack_ >= 0) {
        now.crack_length = solver_.cracks().lines[crack_].length;
        now.tip = solver_.cracks().lines[crack_].tip(at_end_).position;
    }
    return now;
}

double Recorder::fraction() const {
    const Instant here = now();
    double most = 0.0;
    if (scene_.stop.time) most = std::max(most, here.time / *scene_.stop.time);
    if (scene_.stop.displacement) most = std::max(most, here.displacement / *scene_.stop.displacement);
    if (scene_.stop.crack_length && !record_.series.empty()) {
        const double first = record_.series.front().crack_length;
        if (*scene_.stop.crack_length > first)
            most = std::max(most, (here.crack_length - first) / (*scene_.stop.crack_length - first));
    }
    return std::clamp(most, 0.0, 1.0);
}

void Recorder::look() {
    if (steps_ >= next_row_) {
        next_row_ = steps_ + interval_;
        save_row();
    }
    const int frames = scene_.output.frames;
    if (frames > 0 && frames_saved_ < frames && fraction() * std::max(1, frames - 1) >= frames_saved_) save_frame();
}

void Recorder::save_row() {
    finite_ = solver_.is_finite();
    Instant row = now();
    for (std::size_t d = 0; d < reaction_sum_.size(); ++d) {
        // The mean since the row before, as of a load cell that samples at this interval.
        const Vec2 mean = reaction_count_ > 0 ? Vec2(reaction_sum_[d] / static_cast<double>(reaction_count_)) : Vec2::Zero();
        record_.reactions[d].force.push_back(mean);
        reaction_sum_[d].setZero();
    }
    reaction_count_ = 0;
    if (!record_.reactions.empty()) row.force = record_.reactions[force_.driver].force.back().dot(force_.direction);

    for (int k = 0; k < static_cast<int>(scene_.cracks.size()); ++k) {
        const bool end = k == crack_ ? at_end_ : scene_.cracks[k].grows != Growth::start;
        const CrackLine& line = solver_.cracks().lines[k];
        TipLoad load;
        if (line.tip(end).inside) load = line.tip(end).grows ? solver_.tip_loads()[2 * k + end] : solver_.load_at(k, end);
        if (k == crack_) {
            row.G = load.G;
            row.K_I = load.K_I;
            row.K_II = load.K_II;
        }
        CrackHistory& history = record_.cracks[k];
        history.length.push_back(line.length);
        history.tip.push_back(line.tip(end).position);
        history.G.push_back(load.G);
        history.K_I.push_back(load.K_I);
        history.K_II.push_back(load.K_II);
    }
    const EnergyBooks books = solver_.energies();
    row.strain_energy = books.strain;
    row.kinetic_energy = books.kinetic;
    row.fracture_energy = books.fracture;
    row.external_work = books.work;
    const double kept = books.strain + books.kinetic + books.contact + books.fracture + books.damped;
    largest_energy_ = std::max({largest_energy_, std::abs(books.work), kept});
    largest_imbalance_ = std::max(largest_imbalance_, std::abs(books.work - kept));
    if (largest_energy_ > 0.0) record_.worst_energy_imbalance = largest_imbalance_ / largest_energy_;
    record_.series.push_back(row);
    if (!evenly_ && static_cast<int>(record_.series.size()) > 2 * scene_.output.samples) thin_out();
}

// Every second row goes when the end was not known and the rows become too many.
void Recorder::thin_out() {
    const auto halve = [](auto& rows) {
        for (std::size_t k = 1; 2 * k < rows.size(); ++k) rows[k] = rows[2 * k];
        rows.resize((rows.size() + 1) / 2);
    };
    halve(record_.series);
    for (ReactionHistory& r : record_.reactions) halve(r.force);
    for (CrackHistory& c : record_.cracks) {
        halve(c.length);
        halve(c.tip);
        halve(c.G);
        halve(c.K_I);
        halve(c.K_II);
    }
    interval_ *= 2;
}

void Recorder::save_frame() {
    ++frames_saved_;
    Frame frame;
    frame.time = solver_.time();
    frame.displacement = now().displacement;
    const Points& points = body_.points;
    for (int p = 0; p < points.count(); ++p) {
        const Mat2 gradient = gradient_at(body_, p, solver_.displacements());
        const PointState state = elastic_state(gradient, points.stiffness_of(p), plan_.rotates);
        const double xx = state.stress(0, 0);
        const double yy = state.stress(1, 1);
        const double zz = scene_.model.plane == PlaneCondition::strain ? points.poisson_ratio[p] * (xx + yy) : 0.0;
        frame.moved.push_back(value_at(body_, p, solver_.displacements()).cast<float>());
        frame.stress.push_back(Eigen::Vector4d(xx, yy, 0.5 * (state.stress(0, 1) + state.stress(1, 0)), zz).cast<float>());
    }
    if (crack_ >= 0) frame.crack = solver_.cracks().lines[crack_].points;
    record_.frames.push_back(std::move(frame));
}

void Recorder::finish(RunStatus status, std::string message) {
    record_.status = status;
    record_.message = std::move(message);
    record_.steps = steps_;
    if (record_.series.back().time < solver_.time()) save_row();
    if (scene_.output.frames > 0 && record_.frames.back().time < solver_.time()) {
        if (static_cast<int>(record_.frames.size()) == scene_.output.frames) record_.frames.pop_back();
        save_frame();
    }
    for (const CrackLine& line : solver_.cracks().lines) record_.paths.push_back(line.points);
    if (crack_ >= 0) record_.cracks.erase(record_.cracks.begin() + crack_);  // the series holds it
}

} // namespace crampfit

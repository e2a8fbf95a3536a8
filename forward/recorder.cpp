#include "forward/recorder.hpp"

#include "forward/probes.hpp"
#include "forward/seen_strain.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {

Frame make_frame(const Scene& scene, const Plan& plan, const Discretisation& body, const std::vector<Vec2>& displacement,
                 const History* history) {
    Frame frame;
    const Points& points = body.points;
    const bool plane_strain = scene.model.plane == PlaneCondition::strain;
    frame.moved.resize(points.count());
    frame.stress.resize(points.count());
    const auto set = [&](int p, const Mat2& stress, double zz) {
        frame.moved[p] = value_at(body, p, displacement).cast<float>();
        frame.stress[p] = Eigen::Vector4d(stress(0, 0), stress(1, 1), 0.5 * (stress(0, 1) + stress(1, 0)), zz).cast<float>();
    };
    for (int c = 0; c < body.layout.cells(); ++c) {
        for_groups(points, c, [&](const PointGroup& group) {
            if (history && history->is_in(c)) {
                const SeenStrains seen(body, *history, group, displacement, plan.rotates);
                for (int i = 0; i < group.count; ++i) {
                    const Tensor s = history->stress(group.point[i], seen.strain[i]);
                    const auto stress = [&](const Eigen::Vector3d&) { return Eigen::Vector3d(s[0], s[1], s[3]); };
                    set(group.point[i], state_with(seen.gradient[i], plan.rotates, stress).stress, s[2]);
                }
                return;
            }
            for (const int p : group.points()) {
                const Mat2 stress =
                    elastic_state(seen_gradient_at(body, p, displacement, plan.rotates), points.stiffness_of(p), plan.rotates)
                        .stress;
                const double xx = stress(0, 0), yy = stress(1, 1), xy = 0.5 * (stress(0, 1) + stress(1, 0));
                double zz = 0.0;
                if (plane_strain)
                    zz = points.out_of_plane.empty() ? points.poisson_ratio[p] * (xx + yy)
                                                     : points.out_of_plane[p].dot(Eigen::Vector3d(xx, yy, xy));
                set(p, stress, zz);
            }
        });
    }
    return frame;
}

TrackedTip tracked_tip(const Scene& scene) {
    TrackedTip tracked;
    for (std::size_t k = 0; k < scene.cracks.size() && tracked.crack < 0; ++k)
        if (scene.cracks[k].grows != Growth::none) tracked.crack = static_cast<int>(k);
    if (tracked.crack < 0 && !scene.cracks.empty()) tracked.crack = 0;
    tracked.at_end = tracked.crack < 0 || scene.cracks[tracked.crack].grows != Growth::start;
    return tracked;
}

Recorder::Recorder(const Scene& scene, const Plan& plan, const Discretisation& body, const ExplicitSolver& solver)
    : scene_(scene), plan_(plan), body_(body), solver_(solver), gauges_(scene) {
    const TrackedTip tracked = tracked_tip(scene);
    crack_ = tracked.crack;
    at_end_ = tracked.at_end;
    record_.tracked_crack = std::max(crack_, 0);

    // Evenly where the end is known: a time may stand beside other ends only lest the run go on for ever.
    const bool time_guards = plan.grows && scene.stop.time && plan.end_time == *scene.stop.time;
    evenly_ = std::isfinite(plan.end_time) && !scene.stop.crack_length && !time_guards;
    interval_ = evenly_ ? static_cast<long>(std::ceil(plan.end_time / plan.time_step / scene.output.samples)) : 1;
    interval_ = std::max(interval_, 1L);
    for (const Edge& edge : scene.edges) record_.reactions.push_back({edge.name, {}});
    for (const Body& rigid : scene.bodies) record_.reactions.push_back({rigid.name, {}});
    for (HalfInterval& half : halves_) half.reactions.assign(record_.reactions.size(), Vec2::Zero());
    since_last_row_.assign(record_.reactions.size(), Vec2::Zero());
    record_.cracks.resize(scene.cracks.size());
    record_.points = body.points.count();
    if (scene.output.frames > 0) {
        record_.point_position = body.points.position;
        record_.point_size = body.layout.point_size();
        record_.point_latewood = body.points.latewood;
    }
}

void Recorder::add_step() {
    ++steps_;
    HalfInterval& half = halves_[2 * (steps_ - (next_row_ - interval_)) > interval_];
    ++half.count;
    for (std::size_t d = 0; d < half.reactions.size(); ++d) half.reactions[d] += solver_.reactions()[d];
}

// Forces are means about their rows, as of a load cell that samples at this interval: over the half of it that follows the last
// row, and the half that comes before the next; the very last one over all of the interval before it.
void Recorder::save_forces() {
    const bool is_first = record_.series.empty();
    for (std::size_t d = 0; d < record_.reactions.size(); ++d) {
        auto& [after, before] = halves_;
        std::vector<Vec2>& force = record_.reactions[d].force;
        if (record_.series.size() > 1 && after.count > 0) {
            const double count = static_cast<double>(before_last_row_ + after.count);
            force.back() = (static_cast<double>(before_last_row_) * force.back() + after.reactions[d]) / count;
        }
        const auto steps = static_cast<double>(std::max(1L, before.count + after.count));
        since_last_row_[d] = (before.reactions[d] + after.reactions[d]) / steps;
        const HalfInterval& last = before.count > 0 ? before : after;
        force.push_back(last.count > 0 ? Vec2(last.reactions[d] / static_cast<double>(last.count)) : Vec2::Zero());
    }
    if (!is_first && !record_.reactions.empty()) record_.series.back().force = force_of(record_.series.size() - 1);
    before_last_row_ = halves_[1].count > 0 ? halves_[1].count : halves_[0].count;
    for (HalfInterval& half : halves_) half = {0, std::vector<Vec2>(record_.reactions.size(), Vec2::Zero())};
}

// What the load cell shows in a row [N].
double Recorder::force_of(std::size_t row) const {
    return record_.reactions[gauges_.force].force[row].dot(gauges_.force_direction);
}

Instant Recorder::now() const {
    Instant now = record_.series.empty() ? Instant{} : record_.series.back();
    now.time = solver_.time();
    if (!record_.reactions.empty()) now.displacement = solver_.moved(gauges_.displacement).dot(gauges_.displacement_direction);
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
    read_due_probes();
    if (frames > 0 && frames_saved_ < frames && fraction() * std::max(1, frames - 1) >= frames_saved_) save_frame();
}

void Recorder::save_row() {
    Instant row = now();
    save_forces();
    if (!record_.reactions.empty()) row.force = force_of(record_.series.size());

    for (int k = 0; k < static_cast<int>(scene_.cracks.size()); ++k) {
        const bool end = k == crack_ ? at_end_ : scene_.cracks[k].grows != Growth::start;
        const CrackLine& line = solver_.cracks().lines[k];
        TipLoad load;
        if (line.tip(end).inside) load = solver_.load_at(k, end);
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
    row.strain_energy = books.strain + books.contact;  // what comes back, as at equilibrium
    row.kinetic_energy = books.kinetic;
    row.fracture_energy = books.fracture;
    row.external_work = books.work;
    const double kept = books.strain + books.kinetic + books.contact + books.fracture + books.damped;
    finite_ = solver_.is_finite() && std::isfinite(kept - books.work);
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
    next_row_ += interval_;
    interval_ *= 2;
}

void Recorder::read_due_probes() {
    const Probes& probes = scene_.output.probes;
    if (record_.probes.size() == probes.instants.size()) return;
    const double here = probes.by_displacement ? now().displacement : solver_.time();
    while (record_.probes.size() < probes.instants.size() && here >= probes.instants[record_.probes.size()]) read_probes_now();
}

void Recorder::read_probes_now() {
    record_.probes.push_back(read_probes(scene_.output.probes, body_, solver_.cracks(), solver_.displacements()));
}

void Recorder::save_frame() {
    ++frames_saved_;
    record_.frames.push_back(make_frame(scene_, plan_, body_, solver_.displacements(), solver_.history()));
    Frame& frame = record_.frames.back();
    frame.time = solver_.time();
    frame.displacement = now().displacement;
    if (crack_ >= 0) frame.crack = solver_.cracks().lines[crack_].points;
}

void Recorder::finish(RunStatus status, std::string message) {
    record_.status = status;
    record_.message = std::move(message);
    record_.steps = steps_;
    if (record_.series.back().time < solver_.time()) save_row();
    if (!finite_) {
        record_.status = RunStatus::unstable;
        record_.message = "a displacement or an energy became infinite";
    }
    for (std::size_t d = 0; d < record_.reactions.size(); ++d) record_.reactions[d].force.back() = since_last_row_[d];
    if (!record_.reactions.empty()) record_.series.back().force = force_of(record_.series.size() - 1);
    if (scene_.output.frames > 0 && record_.frames.back().time < solver_.time()) {
        if (static_cast<int>(record_.frames.size()) == scene_.output.frames) record_.frames.pop_back();
        save_frame();
    }
    while (record_.probes.size() < scene_.output.probes.instants.size()) read_probes_now();
    for (const CrackLine& line : solver_.cracks().lines) record_.paths.push_back(line.points);
    if (crack_ >= 0) record_.cracks.erase(record_.cracks.begin() + crack_);  // the series holds it
}

}  // namespace crampfit

#include "forward/march.hpp"

#include "datasets/error.hpp"
#include "forward/equilibrium.hpp"
#include "forward/probes.hpp"
#include "forward/recorder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace crampfit {

namespace {

constexpr double steps_in_run = 100.0;
constexpr double steps_in_relaxation = 20.0;
constexpr double growth_of_steps = 1.25;

// A step that finds no equilibrium is taken in so many parts at most.
constexpr int most_parts = 64;

constexpr double rounding = 1e-9;

double shortest_relaxation(const MaterialMap& materials) {
    double shortest = std::numeric_limits<double>::infinity();
    for (const Material& material : materials.materials())
        if (material.viscoelastic)
            for (const PronyTerm& term : material.viscoelastic->prony) shortest = std::min(shortest, term.tau);
    return shortest;
}

double frame_time(const Scene& scene, double end, int frame) {
    return scene.output.frames == 1 ? end : end * frame / (scene.output.frames - 1.0);
}

// Times at which a step ends, and whether the load goes on otherwise from there.
std::map<double, bool> ends_of_steps(const Scene& scene, double end) {
    std::map<double, bool> ends{{end, false}};
    for (int k = 0; k < scene.output.frames; ++k) ends.emplace(frame_time(scene, end, k), false);
    if (!scene.output.probes.by_displacement)
        for (const double time : scene.output.probes.instants) ends.emplace(time, false);
    for (const Edge& edge : scene.edges)
        if (edge.until) ends[*edge.until] = true;
    for (const Body& body : scene.bodies)
        if (body.until) ends[*body.until] = true;
    ends.erase(ends.begin(), ends.upper_bound(0.0));
    ends.erase(ends.upper_bound(end), ends.end());
    return ends;
}

class March {
  public:
    March(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body, int threads)
        : scene_(scene), plan_(plan), materials_(materials), body_(body), equilibrium_(scene, plan, materials, body, threads),
          gauges_(scene), tracked_(tracked_tip(scene)) {
        for (const Edge& edge : scene.edges) record_.reactions.push_back({edge.name, {}});
        for (const Body& rigid : scene.bodies) record_.reactions.push_back({rigid.name, {}});
        record_.cracks.resize(scene.cracks.size());
        record_.tracked_crack = std::max(tracked_.crack, 0);
        if (scene.output.frames > 0) {
            record_.point_position = body.points.position;
            record_.point_size = body.layout.point_size();
            record_.point_latewood = body.points.latewood;
        }
    }

    Record run(const std::function<bool(double)>& go_on) {
        const std::vector<double> times = march_times(scene_, plan_, materials_);
        const std::size_t skip = std::max<std::size_t>(1, times.size() / (2 * static_cast<std::size_t>(scene_.output.samples)));
        record_.message = "a stop condition was met";
        if (equilibrium_.boundary().has_dead_load() && !go_to(0.0)) return fail(0.0);
        external_work_ = stored() + equilibrium_.dissipated();
        look(true);
        for (std::size_t k = 0; k < times.size(); ++k) {
            if (go_on && !go_on(equilibrium_.time())) {
                record_.status = RunStatus::interrupted;
                record_.message = "stopped by the user";
                break;
            }
            if (!go_to(times[k])) return fail(times[k]);
            const bool last = k + 1 == times.size() || reached_displacement();
            look(last || k % skip == 0);
            if (last) break;
        }
        return finish();
    }

  private:
    // In smaller steps where Newton's method does not find the end of the whole one.
    bool go_to(double time) {
        if (time == 0.0) return take_step(time);
        const double least = (time - equilibrium_.time()) / most_parts;
        while (equilibrium_.time() < time) {
            const double from = equilibrium_.time();
            double step = time - from;
            while (!take_step(step == time - from ? time : from + step)) {
                step *= 0.5;
                if (step < least) return false;
            }
        }
        return true;
    }

    bool take_step(double time) {
        const std::vector<Vec2> displacement = equilibrium_.displacements();
        const std::vector<Vec2> reactions = equilibrium_.reactions();
        const Equilibrium::Contacts contacts = equilibrium_.contacts();
        const double from = equilibrium_.time(), load_work = equilibrium_.traction_work();
        ++record_.steps;
        outcome_ = equilibrium_.solve(time);
        if (outcome_ != Equilibrium::Outcome::solved) {
            equilibrium_.set_displacements(displacement, from, contacts);
            return false;
        }
        const Boundary& boundary = equilibrium_.boundary();
        external_work_ += equilibrium_.traction_work() - load_work;
        for (int d = 0; d < boundary.drivers(); ++d)
            external_work_ +=
                0.5 * (reactions[d] + equilibrium_.reactions()[d]).dot(boundary.travel(d, time) - boundary.travel(d, from));
        return true;
    }

    double stored() const { return equilibrium_.potential() + equilibrium_.traction_work() - equilibrium_.dissipated(); }

    bool reached_displacement() const {
        return scene_.stop.displacement &&
               equilibrium_.measured_displacement(equilibrium_.time()) >= *scene_.stop.displacement * (1.0 - rounding);
    }

    void look(bool row) {
        if (row) save_row();
        save_frames();
        read_due_probes();
    }

    void save_row() {
        Instant row;
        row.time = equilibrium_.time();
        row.displacement = equilibrium_.measured_displacement(row.time);
        row.force = equilibrium_.reactions()[gauges_.force].dot(gauges_.force_direction);
        row.strain_energy = stored();
        row.external_work = external_work_;
        for (int k = 0; k < static_cast<int>(scene_.cracks.size()); ++k) {
            const bool at_end = k == tracked_.crack ? tracked_.at_end : true;
            const CrackLine& line = equilibrium_.cracks().lines[k];
            const TipLoad load = line.tip(at_end).inside ? equilibrium_.load_at(k, at_end) : TipLoad{};
            if (k == tracked_.crack) {
                row.crack_length = line.length;
                row.tip = line.tip(at_end).position;
                row.G = load.G;
                row.K_I = load.K_I;
                row.K_II = load.K_II;
            }
            CrackHistory& crack = record_.cracks[k];
            crack.length.push_back(line.length);
            crack.tip.push_back(line.tip(at_end).position);
            crack.G.push_back(load.G);
            crack.K_I.push_back(load.K_I);
            crack.K_II.push_back(load.K_II);
        }
        for (std::size_t d = 0; d < record_.reactions.size(); ++d)
            record_.reactions[d].force.push_back(equilibrium_.reactions()[d]);
        record_.series.push_back(row);
        const double kept = row.strain_energy + equilibrium_.dissipated();
        largest_energy_ = std::max({largest_energy_, std::abs(external_work_), kept});
        largest_imbalance_ = std::max(largest_imbalance_, std::abs(external_work_ - kept));
    }

    void save_frames() {
        const double time = equilibrium_.time();
        while (static_cast<int>(record_.frames.size()) < scene_.output.frames &&
               time >= frame_time(scene_, plan_.end_time, static_cast<int>(record_.frames.size())) * (1.0 - rounding)) {
            Frame& frame = record_.frames.emplace_back(
                make_frame(scene_, plan_, body_, equilibrium_.displacements(), equilibrium_.history()));
            frame.time = time;
            frame.displacement = equilibrium_.measured_displacement(time);
            if (tracked_.crack >= 0) frame.crack = equilibrium_.cracks().lines[tracked_.crack].points;
        }
    }

    // Between the step before and this one the places go evenly.
    void read_due_probes() {
        const Probes& probes = scene_.output.probes;
        if (record_.probes.size() == probes.instants.size()) return;
        const double here =
            probes.by_displacement ? equilibrium_.measured_displacement(equilibrium_.time()) : equilibrium_.time();
        ProbeReading reading = read_probes(probes, body_, equilibrium_.cracks(), equilibrium_.displacements());
        while (record_.probes.size() < probes.instants.size() &&
               here >= probes.instants[record_.probes.size()] * (1.0 - rounding)) {
            ProbeReading& due = record_.probes.emplace_back(reading);
            if (last_reading_.moved.empty() || here == last_place_) continue;
            const double share =
                std::clamp((probes.instants[record_.probes.size() - 1] - last_place_) / (here - last_place_), 0.0, 1.0);
            for (std::size_t i = 0; i < due.moved.size(); ++i)
                due.moved[i] = last_reading_.moved[i] + share * (reading.moved[i] - last_reading_.moved[i]);
        }
        last_reading_ = std::move(reading);
        last_place_ = here;
    }

    Record fail(double time) {
        const bool plastic = std::any_of(materials_.materials().begin(), materials_.materials().end(),
                                         [](const Material& m) { return m.plastic; });
        if (record_.series.size() <= 1 && outcome_ == Equilibrium::Outcome::mechanism && !plastic && !plan_.friction)
            throw InputError(scene_.file.string(), "edges", "too few",
                             "the specimen, or a piece that cracks cut off it, can move as a whole: nothing holds it");
        record_.status = RunStatus::unstable;
        record_.message = "no equilibrium was found at " + std::to_string(time) + " s" +
                          (plastic ? "; the load may be more than the wood can carry" : "") +
                          (plan_.friction && outcome_ == Equilibrium::Outcome::mechanism ? friction_may_slip : "") +
                          advice_on_holds(scene_);
        if (record_.series.empty()) save_row();
        return finish();
    }

    Record finish() {
        if (record_.series.back().time < equilibrium_.time()) save_row();
        while (record_.probes.size() < scene_.output.probes.instants.size()) record_.probes.push_back(last_reading_);
        for (const CrackLine& line : equilibrium_.cracks().lines) record_.paths.push_back(line.points);
        if (tracked_.crack >= 0) record_.cracks.erase(record_.cracks.begin() + tracked_.crack);  // the series holds it
        if (largest_energy_ > 0.0) record_.worst_energy_imbalance = largest_imbalance_ / largest_energy_;
        record_.points = body_.points.count();
        return std::move(record_);
    }

    const Scene& scene_;
    const Plan& plan_;
    const MaterialMap& materials_;
    Discretisation& body_;
    Equilibrium equilibrium_;
    Gauges gauges_;
    TrackedTip tracked_;
    Record record_;
    Equilibrium::Outcome outcome_ = Equilibrium::Outcome::solved;
    ProbeReading last_reading_;
    double last_place_ = 0.0;         // time or displacement of it
    double external_work_ = 0.0;      // [J]
    double largest_energy_ = 0.0;     // [J]
    double largest_imbalance_ = 0.0;  // [J]
};

}  // namespace

std::vector<double> march_times(const Scene& scene, const Plan& plan, const MaterialMap& materials) {
    const double largest = scene.solver.time_step.value_or(plan.end_time / steps_in_run);
    const double smallest =
        scene.solver.time_step ? largest : std::min(largest, shortest_relaxation(materials) / steps_in_relaxation);
    std::vector<double> times;
    double time = 0.0, step = smallest;
    for (const auto& [end, load_changes] : ends_of_steps(scene, plan.end_time)) {
        while (time < end) {
            const double left = end - time;
            const double steps = std::ceil(left / step - rounding);
            time = steps <= 1.0 ? end : time + (steps == 2.0 ? 0.5 * left : step);
            times.push_back(time);
            step = std::min(largest, growth_of_steps * step);
        }
        if (load_changes) step = smallest;
    }
    return times;
}

Record march(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body, int threads,
             const std::function<bool(double)>& go_on) {
    return March(scene, plan, materials, body, threads).run(go_on);
}

}  // namespace crampfit

#include "forward/trace.hpp"

#include "forward/boundary.hpp"
#include "forward/recorder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

namespace {

constexpr double never = std::numeric_limits<double>::infinity();

// After a jump the same instant follows once more, later by this part of the run: times stay in order.
constexpr double just_after = 1e-9;

// One instant of the way: what a row of the series shows.
struct Moment {
    LoadState load;
    std::vector<double> lengths;            // [cracks] [m]
    std::vector<std::array<Vec2, 2>> tips;  // [cracks] [m]
    double fracture_energy = 0;             // [J]
};

LoadState mixed(const LoadState& a, const LoadState& b, double s) {
    LoadState mix = a;
    const auto blend = [&](auto& to, const auto& from) { to += s * (from - to); };
    blend(mix.time, b.time);
    blend(mix.potential, b.potential);
    blend(mix.power, b.power);
    blend(mix.traction_work, b.traction_work);
    blend(mix.displacement, b.displacement);
    for (std::size_t d = 0; d < mix.reactions.size(); ++d) blend(mix.reactions[d], b.reactions[d]);
    for (std::size_t k = 0; k < mix.tips.size(); ++k) {
        blend(mix.tips[k].G, b.tips[k].G);
        blend(mix.tips[k].K_I, b.tips[k].K_I);
        blend(mix.tips[k].K_II, b.tips[k].K_II);
    }
    return mix;
}

Moment mixed(const Moment& a, const Moment& b, double s) {
    Moment mix = a;
    mix.load = mixed(a.load, b.load, s);
    for (std::size_t k = 0; k < mix.lengths.size(); ++k) {
        mix.lengths[k] = std::lerp(a.lengths[k], b.lengths[k], s);
        for (int end = 0; end < 2; ++end) mix.tips[k][end] = a.tips[k][end] + s * (b.tips[k][end] - a.tips[k][end]);
    }
    mix.fracture_energy = std::lerp(a.fracture_energy, b.fracture_energy, s);
    return mix;
}

// Writes the rows, and knows when to stop.
class Tracer {
  public:
    Tracer(const Scene& scene, const Plan& plan, const CrackDriving& driving, const MaterialMap& materials)
        : scene_(scene), plan_(plan), driving_(driving), gauges_(scene), tracked_(tracked_tip(scene)) {
        double spent = 0.0;
        for (std::size_t i = 0; i < driving.stations.size(); ++i) {
            const Station& station = driving.stations[i];
            if (i > 0) {
                const Station& before = driving.stations[i - 1];
                if (before.crack >= 0) {
                    const Vec2& from = before.tips[before.crack][before.at_end];
                    const Vec2& to = station.tips[before.crack][before.at_end];
                    const double grown = station.lengths[before.crack] - before.lengths[before.crack];
                    spent += mean_toughness(materials, {from, to}) * grown * station.thickness;
                }
            }
            fracture_energy_.push_back(spent);
            toughness_.push_back(station.crack >= 0 ? mean_toughness(materials, station.route) : 0.0);
            critical_.push_back(station.crack >= 0 ? driving.critical_time(station, toughness_.back()) : never);
        }
        sample_ = std::isfinite(plan.end_time) ? plan.end_time / scene.output.samples : last_time() / scene.output.samples;
        for (const Edge& edge : scene.edges) record_.reactions.push_back({edge.name, {}});
        for (const Body& body : scene.bodies) record_.reactions.push_back({body.name, {}});
        record_.cracks.resize(scene.cracks.size());
        record_.tracked_crack = std::max(tracked_.crack, 0);
    }

    Record run() {
        walk();
        record_paths();
        list_driving();
        if (largest_energy_ > 0.0) record_.worst_energy_imbalance = largest_imbalance_ / largest_energy_;
        if (tracked_.crack >= 0) record_.cracks.erase(record_.cracks.begin() + tracked_.crack);
        return std::move(record_);
    }

  private:
    double end_time() const { return plan_.end_time; }

    // The last critical time of the way, for scenes whose end no stop condition on time gives.
    double last_time() const {
        double last = 0.0;
        for (const double time : critical_)
            if (std::isfinite(time)) last = std::max(last, time);
        return last > 0.0 ? last : 1.0;
    }

    Moment moment(std::size_t i, double time) const {
        const Station& station = driving_.stations[i];
        return {driving_.at(station, time), station.lengths, station.tips, fracture_energy_[i]};
    }

    void walk() {
        Moment here = moment(0, 0.0);
        add(here, false);
        double now = 0.0;
        std::size_t i = 0;
        while (true) {
            // The crack stands, or goes on as the load rises, until here.
            if (critical_[i] > end_time() || !std::isfinite(critical_[i])) {
                stand(i, here, std::isfinite(end_time()) ? end_time() : now);
                if (done_) return;
                const bool split = driving_.stations[i].split;
                return end(split ? RunStatus::split : RunStatus::finished,
                           split ? "every growing crack tip has reached a free surface" : "a stop condition was met");
            }
            const Moment there = moment(i, critical_[i]);
            if (i == 0) stand(0, here, critical_[0]);
            else go(here, there);
            if (done_) return;
            here = there;
            now = critical_[i];
            // Over all that needs no more load.
            std::size_t next = i + 1;
            while (next < critical_.size() && critical_[next] <= now && !driving_.stations[next].split) ++next;
            if (next >= critical_.size()) return end(RunStatus::finished, "the walk ended here");
            if (next > i + 1 || driving_.stations[next].split) {
                Moment after = moment(next, now);
                if (!driving_.stations[next].split && std::isfinite(critical_[next]) && critical_[next - 1] < critical_[next]) {
                    const double s = (now - critical_[next - 1]) / (critical_[next] - critical_[next - 1]);
                    after = mixed(moment(next - 1, now), after, std::clamp(s, 0.0, 1.0));
                    after.load.time = now;
                }
                after.load.time += just_after * (std::isfinite(end_time()) ? end_time() : last_time());
                if (beyond_length(after)) {  // stopped on the way
                    const double stop = *scene_.stop.crack_length;
                    std::size_t k = i + 1;
                    while (k < next && length_of(moment(k, now)) < stop) ++k;
                    const double time = after.load.time;
                    after = cut_at_length(moment(k - 1, now), k == next ? after : moment(k, now), stop);
                    after.load.time = time;
                    add(after, true);
                    return end(RunStatus::finished, "a stop condition was met");
                }
                add(after, true);
                here = after;
                if (driving_.stations[next].split) return end(RunStatus::split, "every growing crack tip has reached a free surface");
            }
            i = next;
        }
    }

    double length_of(const Moment& m) const { return tracked_.crack < 0 ? 0.0 : m.lengths[tracked_.crack]; }
    bool beyond_length(const Moment& m) const {
        return scene_.stop.crack_length && length_of(m) >= *scene_.stop.crack_length * (1.0 - 1e-9);
    }
    bool beyond_displacement(const Moment& m) const {
        return scene_.stop.displacement && m.load.displacement >= *scene_.stop.displacement * (1.0 - 1e-9);
    }
    bool beyond_time(const Moment& m) const { return m.load.time >= end_time() * (1.0 - 1e-9); }

    Moment cut_at_length(const Moment& a, const Moment& b, double length) const {
        const double span = length_of(b) - length_of(a);
        return span > 0.0 ? mixed(a, b, std::clamp((length - length_of(a)) / span, 0.0, 1.0)) : b;
    }

    // From one moment to a later one, in a straight line: rows at even times, and one at the end.
    void go(const Moment& from, const Moment& to) {
        double stop = 1.0;
        if (beyond_length(to)) {
            const double span = length_of(to) - length_of(from);
            if (span > 0.0) stop = std::min(stop, (*scene_.stop.crack_length - length_of(from)) / span);
        }
        if (beyond_displacement(to) && to.load.displacement > from.load.displacement)
            stop = std::min(stop, (*scene_.stop.displacement - from.load.displacement) / (to.load.displacement - from.load.displacement));
        if (beyond_time(to) && to.load.time > from.load.time)
            stop = std::min(stop, (end_time() - from.load.time) / (to.load.time - from.load.time));
        stop = std::max(stop, 0.0);
        const double span = to.load.time - from.load.time;
        for (double time = next_sample(from.load.time); time < from.load.time + stop * span; time += sample_)
            add(mixed(from, to, (time - from.load.time) / span), false);
        add(mixed(from, to, stop), false);
        if (stop < 1.0 || beyond_length(to) || beyond_displacement(to) || beyond_time(to))
            end(RunStatus::finished, "a stop condition was met");
    }

    // The crack stands while the load rises.
    void stand(std::size_t i, Moment from, double until) {
        for (double time = next_sample(from.load.time); time < until && !done_; time += sample_) {
            const Moment to = moment(i, time);
            go(from, to);
            from = to;
        }
        if (!done_ && until > from.load.time) go(from, moment(i, until));
    }

    double next_sample(double time) const { return (std::floor(time / sample_ * (1.0 + 1e-12)) + 1.0) * sample_; }

    void add(const Moment& m, bool jumped) {
        if (!record_.series.empty() && m.load.time <= record_.series.back().time) return;
        Instant row;
        row.time = m.load.time;
        row.displacement = m.load.displacement;
        if (!m.load.reactions.empty()) row.force = m.load.reactions[gauges_.force].dot(gauges_.force_direction);
        if (tracked_.crack >= 0) {
            const TipLoad& tip = m.load.tips[2 * tracked_.crack + tracked_.at_end];
            row.crack_length = length_of(m);
            row.tip = m.tips[tracked_.crack][tracked_.at_end];
            row.G = tip.G;
            row.K_I = tip.K_I;
            row.K_II = tip.K_II;
        }
        for (std::size_t k = 0; k < record_.cracks.size(); ++k) {
            const bool at_end = scene_.cracks[k].grows != Growth::start;
            CrackHistory& history = record_.cracks[k];
            const TipLoad& tip = m.load.tips[2 * k + at_end];
            history.length.push_back(m.lengths[k]);
            history.tip.push_back(m.tips[k][at_end]);
            history.G.push_back(tip.G);
            history.K_I.push_back(tip.K_I);
            history.K_II.push_back(tip.K_II);
        }
        for (std::size_t d = 0; d < record_.reactions.size(); ++d) record_.reactions[d].force.push_back(m.load.reactions[d]);
        row.strain_energy = m.load.potential + m.load.traction_work;
        row.fracture_energy = m.fracture_energy;
        if (!record_.series.empty()) {
            const Moment& before = last_;
            const double work = 0.5 * (before.load.power + m.load.power) * (m.load.time - before.load.time) +
                                m.load.traction_work - before.load.traction_work;
            row.external_work = record_.series.back().external_work + work;
            // A jump turns what it releases beyond the toughness into motion, which is not followed.
            if (!jumped)
                imbalance_ += work - (row.strain_energy - before.load.potential - before.load.traction_work) -
                              (m.fracture_energy - before.fracture_energy);
            largest_imbalance_ = std::max(largest_imbalance_, std::abs(imbalance_));
            largest_energy_ = std::max({largest_energy_, std::abs(row.external_work), row.strain_energy});
        } else {
            row.external_work = m.load.traction_work;
        }
        last_ = m;
        record_.series.push_back(row);
    }

    void end(RunStatus status, const char* message) {
        done_ = true;
        record_.status = status;
        record_.message = message;
    }

    void record_paths() {
        const double length = record_.series.back().crack_length;
        for (std::size_t k = 0; k < scene_.cracks.size(); ++k) {
            std::vector<Vec2> path = scene_.cracks[k].points;
            for (const Station& station : driving_.stations) {
                if (tracked_.crack == static_cast<int>(k) && station.lengths[k] > length * (1.0 + 1e-12)) break;
                if (station.tips[k][1] != path.back()) path.push_back(station.tips[k][1]);
                if (station.tips[k][0] != path.front()) path.insert(path.begin(), station.tips[k][0]);
            }
            if (tracked_.crack == static_cast<int>(k)) {
                const Vec2 tip = record_.series.back().tip;
                if (tracked_.at_end && tip != path.back()) path.push_back(tip);
                if (!tracked_.at_end && tip != path.front()) path.insert(path.begin(), tip);
            }
            record_.paths.push_back(path);
        }
    }

    void list_driving() {
        for (std::size_t i = 0; i < driving_.stations.size(); ++i) {
            const Station& station = driving_.stations[i];
            if (station.crack < 0 || !std::isfinite(critical_[i])) continue;
            const LoadState load = driving_.at(station, critical_[i]);
            CriticalLoad row;
            row.crack_length = station.lengths[station.crack];
            row.tip = station.tips[station.crack][station.at_end];
            row.displacement = load.displacement;
            if (!load.reactions.empty()) row.force = load.reactions[gauges_.force].dot(gauges_.force_direction);
            row.G = load.tips[2 * station.crack + station.at_end].G;
            row.toughness = toughness_[i];
            record_.driving.push_back(row);
        }
    }

    const Scene& scene_;
    const Plan& plan_;
    const CrackDriving& driving_;
    Gauges gauges_;
    TrackedTip tracked_;
    std::vector<double> critical_;         // [stations] [s]
    std::vector<double> toughness_;        // [stations] mean over the route [J/m^2]
    std::vector<double> fracture_energy_;  // [stations] [J]
    double sample_ = 0;                    // [s]
    Record record_;
    Moment last_;
    bool done_ = false;
    double imbalance_ = 0;
    double largest_imbalance_ = 0;
    double largest_energy_ = 0;
};

} // namespace

Record trace(const Scene& scene, const Plan& plan, const CrackDriving& driving, const MaterialMap& materials) {
    return Tracer(scene, plan, driving, materials).run();
}

} // namespace crampfit

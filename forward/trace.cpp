#include "forward/trace.hpp"

#include "forward/boundary.hpp"
#include "forward/load_peak.hpp"
#include "forward/loading.hpp"
#include "forward/recorder.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

// After a jump the same instant follows once more, later by this part of the run: times stay in order.
constexpr double just_after = 1e-9;

constexpr double rounding = 1e-6;  // of the time between two rows

constexpr const char* met = "a stop condition was met";

// One instant of the way: what a row of the series shows.
struct Moment {
    LoadState load;
    std::vector<double> lengths;            // [cracks] [m]
    std::vector<std::array<Vec2, 2>> tips;  // [cracks] [m]
    double fracture_energy = 0;             // [J]
};

// On a straight line, as forces and displacements go; energies bend as the work of such forces does.
LoadState mixed(const LoadState& a, const LoadState& b, double s) {
    LoadState mix = a;
    const auto blend = [&](auto& to, const auto& from) { to += s * (from - to); };
    blend(mix.time, b.time);
    blend(mix.potential, b.potential);
    mix.potential -= 0.5 * s * (1.0 - s) * (b.power - a.power) * (b.time - a.time);
    blend(mix.power, b.power);
    blend(mix.traction_work, b.traction_work);
    blend(mix.dissipated, b.dissipated);
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
    Tracer(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk,
           const std::function<bool(double, double)>& go_on)
        : scene_(scene), plan_(plan), materials_(materials), walk_(walk), go_on_(go_on), gauges_(scene),
          tracked_(tracked_tip(scene)) {
        sample_ = plan.end_time / scene.output.samples;
        stops_ = travel_of(scene).stops;
        stops_.push_back(plan.still_from);
        for (const Edge& edge : scene.edges) record_.reactions.push_back({edge.name, {}});
        for (const Body& body : scene.bodies) record_.reactions.push_back({body.name, {}});
        record_.cracks.resize(scene.cracks.size());
        record_.tracked_crack = std::max(tracked_.crack, 0);
    }

    Record run() {
        follow();
        if (record_.message != met && go_on_ && !go_on_(last_.load.time, length_of(last_))) {
            end(RunStatus::interrupted, "stopped by the user");
        } else if (!walk_.failure().empty() && goes_on_left_ && record_.message != met) {  // pieces that hold no longer
            split();
        } else if (!walk_.failure().empty() && record_.message != met && record_.status != RunStatus::split) {
            record_.status = RunStatus::unstable;
            record_.message =
                walk_.failure() + (runs_on_ ? ", as the crack runs on at a constant load" : "") + advice_on_holds(scene_);
        }
        if (goes_on_left_ && record_.status == RunStatus::finished) record_.message.append("; ").append(all_tips_left);
        record_paths();
        if (largest_energy_ > 0.0) record_.worst_energy_imbalance = largest_imbalance_ / largest_energy_;
        if (tracked_.crack >= 0) record_.cracks.erase(record_.cracks.begin() + tracked_.crack);
        return std::move(record_);
    }

  private:
    double end_time() const { return plan_.end_time; }

    // Takes in the next station: when the crack moves on from it, and what has been spent on the way to it.
    bool know_station(std::size_t i, double now) {
        if (i < critical_.size()) return true;
        if (!walk_.failure().empty() || !walk_.reach(i, now)) return false;
        double spent = i > 0 ? fracture_energy_.back() : 0.0;
        if (i > 0) {
            const Station& before = walk_.station(i - 1);
            const Station& here = walk_.station(i);
            for (const auto& [crack, at_end, route] : before.moving) {
                const auto same = [k = crack](const MovingTip& tip) { return tip.crack == k; };
                // Both ends of a crack share what it has grown.
                const auto ends = std::count_if(before.moving.begin(), before.moving.end(), same);
                const double grown = (here.lengths[crack] - before.lengths[crack]) / static_cast<double>(ends);
                spent +=
                    grown * here.thickness * mean_toughness(materials_, {before.tips[crack][at_end], here.tips[crack][at_end]});
            }
        }
        fracture_energy_.push_back(spent);
        const Quasistatic::Critical found = walk_.critical(i, materials_, now);
        critical_.push_back(found.time);
        // Where nothing tells the end, half of the rows come before the crack grows, and as many each time that lasts once more.
        if (!std::isfinite(sample_) && found.time > 0.0) sample_ = 2.0 * found.time / scene_.output.samples;
        toughness_.push_back(found.toughness);
        if (!walk_.failure().empty()) return false;
        list_driving(i, found, now);
        return true;
    }

    Moment moment(std::size_t i, double time) {
        const LoadState load = walk_.at(i, time);
        return {load, walk_.station(i).lengths, walk_.station(i).tips, fracture_energy_[i]};
    }

    void follow() {
        Moment here = moment_at_rest();
        if (!walk_.failure().empty()) here.load.displacement = 0.0;  // where a search for an equilibrium has ended means nothing
        add(here, false);
        if (beyond_displacement(here) || beyond_length(here)) return end(RunStatus::finished, met);
        if (!know_station(0, 0.0)) {
            if (!critical_.empty()) stand(0, here, critical_[0]);
            return;
        }
        double now = 0.0;
        std::size_t i = 0;
        while (true) {
            if (critical_[i] > end_time() || !std::isfinite(critical_[i])) {  // it stands to the end
                const double until = std::isfinite(end_time()) ? end_time() : plan_.still_from;
                if (std::isfinite(until)) {
                    if (!std::isfinite(sample_)) sample_ = until / scene_.output.samples;
                    if (i == 0) stand(0, here, until);
                    else stop_between(i, here, std::max(now, until));
                } else if (i > 0) {
                    jump(i, now, here);
                }
                if (done_ || !walk_.failure().empty()) return;
                if (walk_.station(i).split() && !goes_on_left_) return split();
                return end(RunStatus::finished,
                           std::isfinite(end_time())   ? met
                           : std::isfinite(until)      ? "all that moves stands still, and no stop condition can be met any more"
                           : record_.series.size() > 1 ? "no crack grows on under this load: no stop condition can be met"
                                                       : "no crack grows under this load: no stop condition can be met");
            }
            if (i == 0) stand(0, here, critical_[0]);
            else go(here, moment(i, critical_[i]));
            if (done_) return;
            here = moment(i, std::max(now, critical_[i]));
            now = std::max(now, critical_[i]);
            if (go_on_ && !go_on_(now, length_of(here))) return end(RunStatus::interrupted, "stopped by the user");
            if (const auto top = peak_beyond(i, now)) {
                go(here, *top);
                if (done_) return;
                here = *top;
                now = top->load.time;
            }
            // Over all that needs no more load.
            std::size_t next = i + 1;
            bool known = know_station(next, now);
            while (known && !walk_.station(next).left && critical_[next] <= now && !beyond_length(next) &&
                   !beyond_displacement(next, now)) {
                if (go_on_ && !go_on_(now, walk_.station(next).lengths[std::max(0, tracked_.crack)]))
                    return end(RunStatus::interrupted, "stopped by the user");
                known = know_station(++next, now);
            }
            if (!known) {
                if (next > i + 1) jump(next - 1, now, here);
                if (done_) return;
                runs_on_ = next > i + 1;
                if (runs_on_ && plan_.linear)  // there is one wherever something holds
                    return end(RunStatus::split,
                               "the crack runs on at a constant load until nothing holds the specimen together");
                return end(RunStatus::finished, "the crack's way ends here");
            }
            const bool parted = growing_tips(scene_) > 1 && carries_nothing(next, now);  // a single tip says it itself
            const bool left = walk_.station(next).left || parted;
            if (next > i + 1 || left || critical_[next] <= now) {
                jump(next, now, here);
                if (done_) return;
                if (parted) return end(RunStatus::split, "cracks have parted the specimen: nothing carries load any more");
                if (left && (!std::isfinite(end_time()) || carries_nothing(next, now))) return split();
                goes_on_left_ = left;
            }
            i = next;
        }
    }

    // The way's highest load between a station and the next, where it is higher there than at both.
    std::optional<Moment> peak_beyond(std::size_t i, double now) {
        if (i == 0 || growing_tips(scene_) != 1 || walk_.station(i).route_length() == 0.0) return std::nullopt;
        if (!know_station(i + 1, now) || !std::isfinite(critical_[i + 1])) return std::nullopt;
        if (!know_station(i + 2, std::max(now, critical_[i + 1]))) return std::nullopt;
        const auto find_peak = [&] {
            std::array<NeededLoad, 4> places;
            for (std::size_t k = 0; k < 4; ++k)
                places[k] = {walk_.station(i - 1 + k).lengths[tracked_.crack], critical_[i - 1 + k], toughness_[i - 1 + k]};
            return peak_between(places);
        };
        auto peak = find_peak();
        if (peak && !plan_.linear) {  // what has been due before is known roughly
            for (const std::size_t k : {i + 1, i + 2})
                if (critical_[k] < now) critical_[k] = walk_.critical(k, materials_, now, true).time;
            peak = find_peak();
        }
        if (!peak || peak->time <= now) return std::nullopt;
        const double from = walk_.station(i).lengths[tracked_.crack], to = walk_.station(i + 1).lengths[tracked_.crack];
        const Moment top = mixed(moment(i, peak->time), moment(i + 1, peak->time), (peak->length - from) / (to - from));
        const auto beyond = std::ranges::upper_bound(record_.driving, peak->length, {}, &CriticalLoad::crack_length);
        record_.driving.insert(
            beyond, driving_row(top.load, tracked_, peak->length, top.tips[tracked_.crack][tracked_.at_end], peak->toughness));
        return top;
    }

    void split() { end(RunStatus::split, all_tips_left); }

    // The load has gone, but for rounding and what Newton's method leaves.
    bool carries_nothing(std::size_t i, double now) {
        constexpr double nothing = 1e-6;
        if (most_power_ == 0.0) return false;
        return std::abs(moment(i, now).load.power) <= nothing * most_power_;
    }

    // The unloaded start.
    Moment moment_at_rest() {
        fracture_energy_.push_back(0.0);
        Moment rest = moment(0, 0.0);
        fracture_energy_.clear();
        return rest;
    }

    // A jump at a load ends between the last station that needs no more load and the first that does.
    void jump(std::size_t next, double now, Moment& here) {
        Moment after = moment(next, now);
        const bool arrests = !walk_.station(next).left && critical_[next] > now;
        if (arrests && std::isfinite(critical_[next])) {
            if (!plan_.linear && growing_tips(scene_) == 1)
                critical_[next - 1] = walk_.critical(next - 1, materials_, now, true).time;
            const double s = (now - critical_[next - 1]) / (critical_[next] - critical_[next - 1]);
            after = mixed(moment(next - 1, now), after, std::clamp(s, 0.0, 1.0));
        } else if (beyond_length(after) || beyond_displacement(after)) {
            const Moment before = moment(next - 1, now);
            double share = 1.0;
            const auto end_at = [&](double stop, double from, double to) {
                if (to > from) share = std::min(share, std::clamp((stop - from) / (to - from), 0.0, 1.0));
            };
            if (beyond_length(after)) end_at(*scene_.stop.crack_length, length_of(before), length_of(after));
            if (beyond_displacement(after)) end_at(*scene_.stop.displacement, before.load.displacement, after.load.displacement);
            after = mixed(before, after, share);
        }
        after.load.time = now + just_after * (std::isfinite(end_time()) ? end_time() : now > 0.0 ? now : 1.0);
        add(after, true);
        here = after;
        if (beyond_length(after) || beyond_displacement(after)) end(RunStatus::finished, met);
    }

    bool beyond_length(std::size_t i) const {
        return tracked_.crack >= 0 && scene_.stop.crack_length &&
               walk_.station(i).lengths[tracked_.crack] >= *scene_.stop.crack_length * (1.0 - 1e-9);
    }
    // Under a load that acts from the start; where scenes are not linear that is seen after the jump.
    bool beyond_displacement(std::size_t i, double now) {
        return plan_.linear && scene_.stop.displacement && beyond_displacement(moment(i, now));
    }
    double length_of(const Moment& m) const { return tracked_.crack < 0 ? 0.0 : m.lengths[tracked_.crack]; }
    bool beyond_length(const Moment& m) const {
        return scene_.stop.crack_length && length_of(m) >= *scene_.stop.crack_length * (1.0 - 1e-9);
    }
    bool beyond_displacement(const Moment& m) const {
        return scene_.stop.displacement && m.load.displacement >= *scene_.stop.displacement * (1.0 - 1e-9);
    }
    bool beyond_time(const Moment& m) const { return m.load.time >= end_time() * (1.0 - 1e-9); }

    // From one moment to a later one, in a straight line: rows at even times, and one at the end.
    void go(const Moment& from, const Moment& to) {
        double stop = 1.0;
        if (beyond_length(to)) {
            const double span = length_of(to) - length_of(from);
            if (span > 0.0) stop = std::min(stop, (*scene_.stop.crack_length - length_of(from)) / span);
        }
        if (beyond_displacement(to) && to.load.displacement > from.load.displacement)
            stop = std::min(stop, (*scene_.stop.displacement - from.load.displacement) /
                                      (to.load.displacement - from.load.displacement));
        if (beyond_time(to) && to.load.time > from.load.time)
            stop = std::min(stop, (end_time() - from.load.time) / (to.load.time - from.load.time));
        stop = std::max(stop, 0.0);
        const double span = to.load.time - from.load.time;
        for (double time = next_sample(from.load.time); time < from.load.time + stop * span - rounding * sample_;
             time = next_sample(time))
            add(mixed(from, to, (time - from.load.time) / span), false);
        add(mixed(from, to, stop), false);
        if (stop < 1.0 || beyond_length(to) || beyond_displacement(to) || beyond_time(to)) end(RunStatus::finished, met);
    }

    // The crack stands while the load rises, or until an equilibrium is missing.
    void stand(std::size_t i, Moment from, double until) {
        for (double time = next_look(from.load.time); time < until - rounding * sample_ && !done_; time = next_look(time)) {
            const Moment to = moment(i, time);
            look(from, to);
            from = to;
            if (to.load.time < time) return;
        }
        if (!done_ && until > from.load.time) go(from, moment(i, until));
    }

    // The load ends or is taken back before it is due to go on from a station, to which the crack is on its way.
    void stop_between(std::size_t i, Moment from, double until) {
        const auto grown = [&](const std::vector<double>& lengths) {
            double sum = 0.0;
            for (std::size_t k = 0; k < lengths.size(); ++k) sum += lengths[k] - walk_.station(i - 1).lengths[k];
            return sum;
        };
        const double whole = grown(walk_.station(i).lengths), start = from.load.time;
        const double share_before = whole > 0.0 ? std::clamp(grown(from.lengths) / whole, 0.0, 1.0) : 1.0;
        const auto load = [&](double time) {
            if (std::isfinite(critical_[i])) return time / critical_[i];
            return toughness_[i] > 0.0 ? walk_.station(i).share_of_critical(toughness_[i], time) : 1.0;
        };
        const double load_before = load(start);
        double share = share_before;
        const auto at = [&](double time) {
            if (const double left = 1.0 - load_before; left > 0.0)
                share = std::max(share, std::lerp(share_before, 1.0, std::clamp((load(time) - load_before) / left, 0.0, 1.0)));
            else share = 1.0;
            const Moment whole_way = moment(i, time);
            return share < 1.0 && walk_.can_stand(i - 1, time) ? mixed(moment(i - 1, time), whole_way, share) : whole_way;
        };
        for (double time = next_look(start); time < until - rounding * sample_ && !done_; time = next_look(time)) {
            const Moment to = at(time);
            look(from, to);
            from = to;
            if (to.load.time < time) return;
        }
        if (!done_ && until > from.load.time) go(from, at(until));
    }

    // Where forces are not straight lines, their work is that of all equilibria, however few rows there are.
    double next_look(double time) {
        const double sample = next_sample(time);
        if (plan_.linear) return sample;
        const double known = walk_.next_time(time + rounding * sample_);
        return known < sample - rounding * sample_ ? known : sample;
    }

    // From one moment to a later one; a row only where it is due.
    void look(const Moment& from, const Moment& to) {
        const bool ends = beyond_length(to) || beyond_displacement(to) || beyond_time(to);
        if (!ends && to.load.time < next_sample(from.load.time) - rounding * sample_) pass(to, false);
        else go(from, to);
    }

    // There is one where some or all motion ends: the load's power goes in a step there.
    double next_sample(double time) {
        while (!std::isfinite(end_time()) && time >= sample_ * scene_.output.samples) sample_ *= 2.0;
        const double next = (std::floor(time / sample_ + rounding) + 1.0) * sample_;
        for (const double stop : stops_)
            if (time < stop - rounding * sample_) return std::min(next, stop);
        return next;
    }

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
        pass(m, jumped);
        row.strain_energy = m.load.potential + m.load.traction_work - m.load.dissipated;
        row.fracture_energy = m.fracture_energy;
        row.external_work = work_;
        record_.series.push_back(row);
    }

    // Work done on the way there, and the books.
    void pass(const Moment& m, bool jumped) {
        const double stored = m.load.potential + m.load.traction_work;  // and dissipated
        if (!record_.series.empty()) {
            const Moment& before = last_;
            double work = m.load.traction_work - before.load.traction_work;
            for (int d = 0; d < static_cast<int>(m.load.reactions.size()); ++d)
                work += 0.5 * (before.load.reactions[d] + m.load.reactions[d])
                                  .dot(walk_.boundary().travel(d, m.load.time) - walk_.boundary().travel(d, before.load.time));
            work_ += work;
            // A jump turns what it releases beyond the toughness into motion, which is not followed.
            if (!jumped)
                imbalance_ += work - (stored - before.load.potential - before.load.traction_work) -
                              (m.fracture_energy - before.fracture_energy);
            largest_imbalance_ = std::max(largest_imbalance_, std::abs(imbalance_));
            largest_energy_ = std::max({largest_energy_, std::abs(work_), stored});
        } else {
            work_ = stored;  // what stays was laid on slowly
        }
        last_ = m;
        most_power_ = std::max(most_power_, std::abs(m.load.power));
    }

    void end(RunStatus status, const char* message) {
        done_ = true;
        record_.status = status;
        record_.message = message;
    }

    void record_paths() {
        for (std::size_t k = 0; k < scene_.cracks.size(); ++k) {
            std::vector<Vec2> path = scene_.cracks[k].points;
            const double hair = 1e-12 * last_.lengths[k];
            const auto add = [&](const std::array<Vec2, 2>& tips) {
                if ((tips[1] - path.back()).norm() > hair) path.push_back(tips[1]);
                if ((tips[0] - path.front()).norm() > hair) path.insert(path.begin(), tips[0]);
            };
            for (std::size_t i = 0; i < critical_.size() && walk_.station(i).lengths[k] <= last_.lengths[k] + hair; ++i)
                add(walk_.station(i).tips[k]);
            add(last_.tips[k]);
            record_.paths.push_back(path);
        }
    }

    // A place that the crack jumped over has a row where its critical load lies between equilibria that are known.
    void list_driving(std::size_t i, const Quasistatic::Critical& found, double now) {
        const Station& station = walk_.station(i);
        if (station.moving.empty() || !std::isfinite(found.time)) return;
        if (!station.linear && found.time < now && found.time < station.states.begin()->second.time) return;
        const auto& [crack, at_end, route] = station.moving.front();
        const LoadState load = station.at(found.time);
        record_.driving.push_back(
            driving_row(load, {crack, at_end}, station.lengths[crack], station.tips[crack][at_end], found.toughness));
    }

    CriticalLoad driving_row(const LoadState& load, const TrackedTip& at, double length, const Vec2& tip,
                             double toughness) const {
        CriticalLoad row;
        row.crack_length = length;
        row.tip = tip;
        row.displacement = load.displacement;
        if (!load.reactions.empty()) row.force = load.reactions[gauges_.force].dot(gauges_.force_direction);
        row.G = load.tips[2 * at.crack + at.at_end].G;
        row.toughness = toughness;
        return row;
    }

    const Scene& scene_;
    const Plan& plan_;
    const MaterialMap& materials_;
    Quasistatic& walk_;
    const std::function<bool(double, double)>& go_on_;
    Gauges gauges_;
    TrackedTip tracked_;
    std::vector<double> critical_;         // [stations] [s]
    std::vector<double> toughness_;        // [stations] overcome then [J/m^2]
    std::vector<double> fracture_energy_;  // [stations] [J]
    double sample_ = 0;                    // [s]
    std::vector<double> stops_;            // of what moves [s]
    Record record_;
    Moment last_;
    bool done_ = false;
    bool runs_on_ = false;       // to where an equilibrium is missing
    bool goes_on_left_ = false;  // no tip can grow any more, but the specimen carries on
    double work_ = 0;            // external [J]
    double imbalance_ = 0;
    double largest_imbalance_ = 0;
    double largest_energy_ = 0;
    double most_power_ = 0;  // [W]
};

}  // namespace

Record trace(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk,
             const std::function<bool(double, double)>& go_on) {
    return Tracer(scene, plan, materials, walk, go_on).run();
}

}  // namespace crampfit

#include "forward/simulate.hpp"

#include "forward/contact_limits.hpp"
#include "forward/deformation.hpp"
#include "forward/explicit.hpp"
#include "forward/grid_choice.hpp"
#include "forward/march.hpp"
#include "forward/probes.hpp"
#include "forward/quasistatic.hpp"
#include "forward/recorder.hpp"
#include "forward/trace.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace crampfit {

namespace {

constexpr int steps_between_reports = 64;

// Fewer points than this, a step of about 30 microseconds, do not pay for another thread.
constexpr int points_a_thread = 2000;

bool reached(const Stop& stop, const Instant& now) {
    return (stop.displacement && now.displacement >= *stop.displacement * (1.0 - 1e-9)) ||
           (stop.crack_length && now.crack_length >= *stop.crack_length * (1.0 - 1e-9)) ||
           (stop.time && now.time >= *stop.time * (1.0 - 1e-9));
}

bool all_growing_tips_left(const Scene& scene, const ExplicitSolver& solver) {
    bool any = false;
    for (int k = 0; k < static_cast<int>(scene.cracks.size()); ++k)
        for (const bool at_end : {false, true})
            if (solver.cracks().lines[k].tip(at_end).grows) {
                any = true;
                if (!solver.has_left(k, at_end)) return false;
            }
    return any;
}

// The instant of the series that a frame of so many is due at.
const Instant& instant_of_frame(const Record& record, int frame, int frames) {
    const double first = record.series.front().time;
    const double last = record.series.back().time;
    const double due = frames == 1 ? last : std::lerp(first, last, frame / (frames - 1.0));
    const auto found = std::find_if(record.series.begin(), record.series.end(),
                                    [&](const Instant& row) { return row.time >= due * (1.0 - 1e-12); });
    return found == record.series.end() ? record.series.back() : *found;
}

bool is_stopped(const SimulateOptions& options) {
    return options.stop_requested && options.stop_requested->load(std::memory_order_relaxed);
}

// Frames at even times.
void draw_frames(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                 Quasistatic& walk, const SimulateOptions& options, Record& record) {
    Revisit revisit(scene, plan, materials, body, walk);
    record.point_position = revisit.body().points.position;
    record.point_size = revisit.body().layout.point_size();
    record.point_latewood = revisit.body().points.latewood;
    const TrackedTip tracked = tracked_tip(scene);
    for (int k = 0; k < scene.output.frames; ++k) {
        if (is_stopped(options)) {
            if (record.status != RunStatus::interrupted) record.message += "; stopped by the user before all frames were drawn";
            record.status = RunStatus::interrupted;
            return;
        }
        const Instant& instant = instant_of_frame(record, k, scene.output.frames);
        if (!revisit.to(record, {static_cast<std::size_t>(&instant - record.series.data()), 0.0})) {
            record.message += fmt::format("; frames end before {:.4g} s, where no equilibrium was found again", instant.time);
            return;
        }
        record.frames.push_back(make_frame(scene, plan, revisit.body(), revisit.equilibrium().displacements()));
        Frame& frame = record.frames.back();
        frame.time = instant.time;
        frame.displacement = instant.displacement;
        if (tracked.crack >= 0) frame.crack = revisit.equilibrium().cracks().lines[tracked.crack].points;
    }
}

// Says so where wood that was modelled by small strain has turned: under tractions and forces no plan knows how far it will go.
void judge_turns(const Plan& plan, const Discretisation& body, const std::vector<Vec2>& displacement, Record& record) {
    constexpr double much = 0.9, counts = 0.1;  // of the points; more than so much [rad]: its false strain is half the square
    std::vector<double> turns;
    for (int p = 0; p < body.points.count() && !plan.rotates; ++p) {
        const Mat2 gradient = gradient_at(body, p, displacement);
        turns.push_back(0.5 * std::abs(gradient(1, 0) - gradient(0, 1)));
    }
    if (turns.empty()) return;
    const auto at = turns.begin() + static_cast<std::ptrdiff_t>(much * static_cast<double>(turns.size() - 1));
    std::ranges::nth_element(turns, at);
    if (*at > counts)
        record.message +=
            fmt::format("; small strain: a tenth of the wood has turned by more than {:.2g} rad, see solver.strain = "
                        "\"finite rotation\"",
                        *at);
}

// Says where small strain may not be enough, at the farthest that the load goes while the specimen carries it. Of a crack that
// grows as edges move: by how much turns of the wood would change the force. Not with friction, which hangs on the way to a
// state: that is not gone again here.
void judge_small_strain(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                        Quasistatic& walk, Record& record) {
    constexpr double carries = 0.1;  // of the largest strain energy
    constexpr double counts = 0.02;
    constexpr double nothing = 1e-10;  // of what the whole specimen would hold, strained as far
    const bool ended = record.status == RunStatus::finished || record.status == RunStatus::split;
    if (!ended || !plan.may_turn || plan.friction) return;
    const auto lower = [](const Instant& a, const Instant& b) { return a.strain_energy < b.strain_energy; };
    const double most = std::max_element(record.series.begin(), record.series.end(), lower)->strain_energy;
    const auto last = std::find_if(record.series.rbegin(), record.series.rend(),
                                   [&](const Instant& row) { return row.strain_energy >= carries * most; });
    double stiffest = 0.0;
    for (int p = 0; p < body.points.count(); ++p) stiffest = std::max(stiffest, body.points.stiffest(p));
    const double strain = last->displacement / scene.specimen.size.maxCoeff();
    if (most <= nothing * stiffest * strain * strain * scene.specimen.size.prod() * scene.model.thickness) return;
    const SeriesPlace place{static_cast<std::size_t>(record.series.rend() - last - 1), 0.0};
    Revisit small(scene, plan, materials, body, walk);
    if (!small.to(record, place)) return;
    const double without = small.equilibrium().power();
    if (!plan.grows || without == 0.0) {
        judge_turns(plan, small.body(), small.equilibrium().displacements(), record);
        return;
    }
    Plan turned = plan;
    turned.rotates = true;
    turned.linear = false;
    Revisit large(scene, turned, materials, body, walk);
    const double with = large.to(record, place) ? large.equilibrium().power() : 0.0;
    if (with == 0.0 || std::abs(with / without - 1.0) <= counts) return;
    record.message +=
        fmt::format("; small strain: turns of the wood would change the force by {:+.1f} % at {:.3g} mm, see solver.strain = "
                    "\"finite rotation\"",
                    100.0 * (with / without - 1.0), 1e3 * last->displacement);
}

// Says so where contact at the end is more than its models hold for.
void judge_contact(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                   Quasistatic& walk, Record& record) {
    const auto judge = [&](const Discretisation& there, const Equilibrium& equilibrium) {
        const Boundary& boundary = equilibrium.boundary();
        std::vector<Vec2> moved;
        for (int driver = boundary.first_body(); driver < boundary.drivers(); ++driver)
            moved.push_back(boundary.travel(driver, equilibrium.time()) + equilibrium.contacts().moved[driver]);
        record.message += beyond_contact(scene, there, equilibrium.cracks(), equilibrium.displacements(), moved);
    };
    if (!plan.linear) {
        if (const Equilibrium* equilibrium = walk.stand_at_last()) judge(walk.body(), *equilibrium);
    } else if (!scene.bodies.empty()) {
        Revisit revisit(scene, plan, materials, body, walk);
        if (revisit.to(record, {record.series.size() - 1, 0.0})) judge(revisit.body(), revisit.equilibrium());
    }
}

// How much wood there is straight ahead of a point [m].
double wood_ahead(const Discretisation& body, const Vec2& x, const Vec2& direction) {
    const double step = 0.5 * body.layout.point_size().minCoeff();
    double ahead = step;  // a tip may lie at the root of a notch
    while (body.point_at(x + ahead * direction) >= 0) ahead += step;
    return ahead - step;
}

// Says so where an advance takes in most of the wood that there is, which is hardly meant.
void judge_long_advance(const Scene& scene, const Discretisation& body, Record& record) {
    for (std::size_t k = 0; k < scene.cracks.size(); ++k) {
        const Crack& crack = scene.cracks[k];
        for (const bool at_end : {false, true}) {
            if (crack.grows != Growth::both && crack.grows != (at_end ? Growth::end : Growth::start)) continue;
            const auto& points = crack.points;
            const Vec2 tip = at_end ? points.back() : points.front();
            const Vec2 before = at_end ? points[points.size() - 2] : points[1];
            const double ahead = wood_ahead(body, tip, (tip - before).normalized());
            if (ahead == 0.0 || crack.advance <= 0.5 * ahead) continue;
            record.message +=
                fmt::format("; cracks.{}.advance = {:.3g} mm takes in more than half of the {:.3g} mm of wood ahead: "
                            "energy is balanced over it as a whole",
                            k, 1e3 * crack.advance, 1e3 * ahead);
        }
    }
}

// Says so where an advance is so short that what it releases is the grid's say: it may pin a crack for good.
void judge_advance(const Scene& scene, const Discretisation& body, Record& record) {
    constexpr double short_in_cells = 0.2;  // peak force at a tenth of a cell 0.3 % above that of G at the tip, at a 25th 32 %
    for (const Crack& crack : scene.cracks)
        if (crack.grows != Growth::none && crack.advance > 0.0 && crack.advance < short_in_cells * body.layout.cell.minCoeff()) {
            record.message +=
                fmt::format("; advance = {:.3g} mm is short for cells of {:.3g} mm: the grid may hold the crack up, see "
                            "crampfit explain",
                            1e3 * crack.advance, 1e3 * body.layout.cell.minCoeff());
            return;
        }
}

// A crack that goes out through a side is shown to end there, or to begin: solvers let its tip go on a little, and a scene may
// draw it from outside.
void end_at_sides(const Scene& scene, Record& record) {
    const Box box{Vec2::Zero(), scene.specimen.size};
    const auto outside = [&](const Vec2& x) { return (box.low - x).maxCoeff() > 0.0 || (x - box.high).maxCoeff() > 0.0; };
    const auto end_at = [&](std::vector<Vec2> way, const auto& replace) {  // from the tip back
        while (way.size() > 2 && outside(way[1])) way.erase(way.begin());
        if (way.size() < 2 || !outside(way[0]) || outside(way[1])) return;
        const Vec2 direction = (way[0] - way[1]).normalized();
        if (const auto leave = exit_distance(way[1], direction, box)) way[0] = way[1] + *leave * direction;
        replace(way);
    };
    for (int k = 0; k < static_cast<int>(scene.cracks.size()); ++k)
        for (const bool at_end : {false, true}) {
            const bool grows =
                scene.cracks[k].grows == Growth::both || scene.cracks[k].grows == (at_end ? Growth::end : Growth::start);
            std::vector<Vec2>& path = record.paths[k];
            std::vector<Vec2> back = path;
            if (at_end) std::ranges::reverse(back);
            end_at(back, [&](std::vector<Vec2> way) {
                const Vec2 tip = way[0];
                if (at_end) std::ranges::reverse(way);
                path = way;
                if (!grows || at_end != (scene.cracks[k].grows != Growth::start)) return;  // not the end that the tables show
                if (k == record.tracked_crack) {
                    for (Instant& row : record.series)
                        if (outside(row.tip)) row.tip = tip;
                } else {
                    for (Vec2& x : record.cracks[k - (k > record.tracked_crack)].tip)
                        if (outside(x)) x = tip;
                }
            });
        }
}

// Whether a piece of a crack is one that the scene drew.
bool is_drawn(const Crack& crack, const Vec2& from, const Vec2& to) {
    const Vec2 middle = 0.5 * (from + to);
    for (std::size_t k = 0; k + 1 < crack.points.size(); ++k) {
        const Vec2 along = crack.points[k + 1] - crack.points[k];
        const Vec2 nearest = crack.points[k] + nearest_on_segment(crack.points[k], crack.points[k + 1], middle) * along;
        if ((nearest - middle).norm() < 1e-6 * along.norm()) return true;
    }
    return false;
}

// Says so where a crack has grown alongside a held side within a cell of it: there it would have to cut wood off what holds it,
// and the grid cannot tell what load that takes.
void judge_held_sides(const Scene& scene, Record& record) {
    constexpr double counts = 1.2;  // cells of way; what comes straight to the side has one
    for (int k = 0; k < static_cast<int>(scene.cracks.size()); ++k) {
        if (scene.cracks[k].grows == Growth::none) continue;
        for (const Edge& edge : scene.edges) {
            const int across = edge.side == Side::top || edge.side == Side::bottom ? 1 : 0;
            if (!edge.velocity[across]) continue;
            const bool high = edge.side == Side::top || edge.side == Side::right;
            const double side = high ? scene.specimen.size[across] : 0.0;
            const auto is_close = [&](const Vec2& x) {
                const double along = x[1 - across];
                const bool beside = !edge.range || (along >= edge.range->first && along <= edge.range->second);
                return beside && std::abs(x[across] - side) < scene.model.cell;
            };
            const std::vector<Vec2>& path = record.paths[k];
            double way = 0.0;
            std::optional<Vec2> first;
            for (std::size_t j = 0; j + 1 < path.size(); ++j) {
                if (!is_close(path[j]) || !is_close(path[j + 1]) || is_drawn(scene.cracks[k], path[j], path[j + 1])) continue;
                if (!first) first = path[j];
                way += (path[j + 1] - path[j]).norm();
            }
            if (way > counts * scene.model.cell)
                record.message +=
                    fmt::format("; cracks.{} has grown {:.3g} mm within a cell of edge \"{}\", which holds the wood, "
                                "about x = {:.4g}, y = {:.4g} mm: the load there is the grid's",
                                k, 1e3 * way, edge.name, 1e3 * first->x(), 1e3 * first->y());
        }
    }
}

// Says so where a crack was drawn longer than it shall grow.
void judge_stop(const Scene& scene, Record& record) {
    const Instant& start = record.series.front();
    if (scene.stop.crack_length && start.crack_length >= *scene.stop.crack_length)
        record.message += fmt::format("; stop.crack_length = {:.4g} mm: the crack has {:.4g} mm from the start",
                                      1e3 * *scene.stop.crack_length, 1e3 * start.crack_length);
}

// Says so where nothing resists, as where an edge has been forgotten: there is no force to compare with anything.
void judge_support(const Discretisation& body, Record& record) {
    constexpr double none = 1e-10;  // of the energy of wood that is strained by all of the displacement over its size
    const Instant& last = record.series.back();
    double softest = std::numeric_limits<double>::infinity();
    for (int p = 0; p < body.points.count(); ++p) softest = std::min(softest, body.points.stiffest(p));
    const Vec2 size = body.layout.size();
    const double nominal = softest * size.prod() * body.layout.thickness * std::pow(last.displacement / size.maxCoeff(), 2);
    double largest = 0.0;
    for (const Instant& row : record.series) largest = std::max(largest, std::abs(row.strain_energy));
    if (nominal > 0.0 && largest < none * nominal)
        record.message += "; nothing resists the load: the specimen moves as a whole, or nothing touches it (edges, bodies)";
}

// Says so where the energy books do not close, as they do to a hundredth on any scene that the grid resolves.
void judge_books(Record& record) {
    constexpr double counts = 0.05;
    if (record.worst_energy_imbalance > counts)
        record.message += fmt::format("; energy books open by up to {:.2g} % of the largest energy: do not trust this run",
                                      100.0 * record.worst_energy_imbalance);
}

Record run_in_time(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body,
                   const SimulateOptions& options) {
    long step = 0;
    double crack_length = 0.0;  // it stands
    if (const int crack = tracked_tip(scene).crack; crack >= 0)
        for (std::size_t k = 0; k + 1 < scene.cracks[crack].points.size(); ++k)
            crack_length += (scene.cracks[crack].points[k + 1] - scene.cracks[crack].points[k]).norm();
    return march(scene, plan, materials, body, options.threads, [&](double time) {
        if (options.progress) options.progress({std::clamp(time / plan.end_time, 0.0, 1.0), time, crack_length, step++});
        return !is_stopped(options);
    });
}

Record run_quasistatic(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                       const SimulateOptions& options) {
    Quasistatic walk(scene, plan, materials, body, {}, options.threads);
    walk.end_where([&options] { return is_stopped(options); });
    const auto go_on = [&](double time, double crack_length) {
        if (options.progress) {
            const double by_time = time / plan.end_time;
            const double by_length = scene.stop.crack_length ? crack_length / *scene.stop.crack_length : 0.0;
            options.progress({std::clamp(std::max(by_time, by_length), 0.0, 1.0), time, crack_length, walk.equilibria()});
        }
        return !is_stopped(options);
    };
    Record record = trace(scene, plan, materials, walk, go_on);
    record.steps = walk.equilibria();
    record.points = walk.points();
    if (scene.output.frames > 0) draw_frames(scene, plan, materials, body, walk, options, record);
    read_probes(scene, walk, record);
    judge_small_strain(scene, plan, materials, body, walk, record);
    judge_contact(scene, plan, materials, body, walk, record);
    judge_advance(scene, body, record);
    return record;
}

// Under loads that do not change any more: whether a specimen has swung for so long since something last went farther than before
// that no stop condition will be met.
class Standstill {
  public:
    Standstill(const Scene& scene, const Plan& plan) {
        const bool ends_anyway = std::isfinite(plan.end_time) || plan.remembers;  // or creeps on
        since_ = last_ = ends_anyway ? std::numeric_limits<double>::infinity() : plan.driven ? plan.still_from : 0.0;
        least_ = steps_across * plan.time_step * scene.specimen.size.maxCoeff() / scene.model.cell;
    }

    bool goes_on_after(const Instant& now) {
        if (now.time <= since_) return true;
        if (std::abs(now.displacement) > (1.0 + counts) * farthest_ || now.crack_length > longest_) {
            farthest_ = std::max(farthest_, std::abs(now.displacement));
            longest_ = std::max(longest_, now.crack_length);
            last_ = now.time;
        }
        return now.time - since_ <= times_as_long * (last_ - since_) + least_;
    }

  private:
    static constexpr double counts = 1e-3, times_as_long = 10.0, steps_across = 40.0;
    double since_, last_, least_;            // [s]
    double farthest_ = 0.0, longest_ = 0.0;  // [m]
};

Record run_explicit(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body,
                    const SimulateOptions& options) {
    ExplicitSolver solver(scene, plan, materials, body, std::min(options.threads, 1 + body.points.count() / points_a_thread));
    Recorder recorder(scene, plan, body, solver);
    Standstill standstill(scene, plan);
    const bool goes_on_left = scene.stop.time || scene.stop.displacement;
    std::optional<long> left;  // the step by which every growing tip has
    for (long step = 0;; ++step) {
        recorder.look();
        if (!recorder.is_finite()) {
            recorder.finish(RunStatus::unstable, {});
            break;
        }
        const Instant now = recorder.now();
        if (reached(scene.stop, now)) {
            recorder.finish(RunStatus::finished, "a stop condition was met");
            break;
        }
        if (!standstill.goes_on_after(now)) {
            recorder.finish(RunStatus::finished, "under a constant load nothing goes on: no stop condition can be met");
            break;
        }
        if (plan.grows && !left && all_growing_tips_left(scene, solver)) left = step;
        if (left && (step - *left) % steps_between_reports == 0 && !(goes_on_left && solver.carries_load())) {
            recorder.finish(RunStatus::split, all_tips_left);
            break;
        }
        if (is_stopped(options)) {
            recorder.finish(RunStatus::interrupted, "stopped by the user");
            break;
        }
        if (options.progress && step % steps_between_reports == 0)
            options.progress({recorder.fraction(), solver.time(), recorder.now().crack_length, step});
        if (plan.grows) solver.grow_cracks();
        solver.step();
        recorder.add_step();
    }
    Record record = recorder.take();
    if (left && record.status == RunStatus::finished) record.message.append("; ").append(all_tips_left);
    judge_turns(plan, body, solver.displacements(), record);
    judge_books(record);
    std::vector<Vec2> moved;
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) moved.push_back(solver.moved(static_cast<int>(scene.edges.size() + b)));
    record.message += beyond_contact(scene, body, solver.cracks(), solver.displacements(), moved);
    if (solver.fastest_crack() > 0.0) record.message += fmt::format("; crack at up to {:.3g} m/s", solver.fastest_crack());
    return record;
}

Scene with_cell(Scene scene, double cell) {
    scene.model.cell = cell;
    return scene;
}

}  // namespace

Record simulate(const Scene& scene, const SimulateOptions& options) {
    if (scene.model.cell == 0.0) {
        const GridChoice choice = choose_grid(scene, scene.model.error);
        Record record = simulate(with_cell(scene, choice.cell), options);
        record.explanation += choice.text;
        record.seconds += choice.seconds_spent;
        return record;
    }
    const auto start = std::chrono::steady_clock::now();
    const MaterialMap materials(scene);
    Discretisation body(scene, materials);
    const Plan plan = make_plan(scene, materials, body);
    Record record = !plan.quasistatic ? run_explicit(scene, plan, materials, body, options)
                    : plan.remembers  ? run_in_time(scene, plan, materials, body, options)
                                      : run_quasistatic(scene, plan, materials, body, options);
    for (const Plan::Choice& choice : plan.choices)
        if (choice.warns) record.message += fmt::format("; {}: {}", choice.part, choice.choice);
    judge_stop(scene, record);
    judge_long_advance(scene, body, record);
    if (plan.quasistatic) judge_support(body, record);
    end_at_sides(scene, record);
    judge_held_sides(scene, record);
    record.scene_text = scene.text;
    record.explanation = describe(scene, plan, body);
    if (!plan.quasistatic)
        record.explanation +=
            fmt::format("{:<15} kinetic energy up to {:.2g} times the strain energy\n", "motion", kinetic_share(record));
    record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return record;
}

double kinetic_share(const Record& record) {
    constexpr double counts = 0.1;  // of the largest strain energy
    double most_strain = 0.0, share = 0.0;
    for (const Instant& row : record.series) most_strain = std::max(most_strain, row.strain_energy);
    for (const Instant& row : record.series)
        if (row.strain_energy > 0.0 && row.strain_energy >= counts * most_strain)
            share = std::max(share, row.kinetic_energy / row.strain_energy);
    return share;
}

std::string explain(const Scene& scene) {
    if (scene.model.cell == 0.0) {
        const GridChoice choice = choose_grid(scene, scene.model.error);
        return explain(with_cell(scene, choice.cell)) + choice.text;
    }
    const MaterialMap materials(scene);
    const Discretisation body(scene, materials);
    return describe(scene, make_plan(scene, materials, body), body);
}

}  // namespace crampfit

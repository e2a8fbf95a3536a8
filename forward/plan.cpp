#include "forward/plan.hpp"

#include "datasets/error.hpp"
#include "forward/boundary.hpp"
#include "forward/bridging.hpp"
#include "forward/bridging_check.hpp"
#include "forward/contact.hpp"
#include "forward/history.hpp"
#include "forward/loading.hpp"
#include "forward/march.hpp"
#include "forward/memory_check.hpp"
#include "forward/thin_voids.hpp"

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

namespace crampfit {

namespace {

// Motion over the specimen's smaller side above which rotations count. Parts turn by about half of it; a small-strain model then
// sees a false strain of half the turn's square, 1e-4, against the 0.02 at which earlywood cracks.
constexpr double most_rotation = 0.03;

// The same where the motion is that at which a crack is expected to run through. It is little more than a guess and hangs on the
// toughness, so that runs of a fit could fall to both sides: small strain goes further, and the record says by how much the force
// would change.
constexpr double most_expected_rotation = 0.06;

// Loading that takes this many transits of a wave is taken for equilibrium: inertia then adds its inverse square to the energy.
constexpr double slow_loading = 100.0;

// A grid with fewer cells on its shorter side says nothing about a finer one's error.
constexpr int least_coarse_cells = 16;

// Where no stop condition says how far the load goes: about the strain at which earlywood cracks.
constexpr double cracking_strain = 0.02;

// Part of the stable time step that is used. Contact and ties may add `added_stiffness` to the squared highest frequency.
constexpr double courant = 0.95;
constexpr double added_stiffness = 0.3;

// Seconds for one assembly and factorisation over nodes^1.5 (nested dissection; George 1973); the tests' output shows it. Of a
// crack's way each half cell takes a part of one, and what does not go with the grid; where Newton's method follows contact or
// rotation a run takes between so many of them. Measured on the packaged scenes with cells of 0.2, 0.1 and 0.05 mm, to a factor
// of about two.
constexpr double seconds_per_node = 7e-8;
constexpr double share_per_place = 0.2;
constexpr double seconds_per_place = 0.02;
constexpr std::array<double, 2> newton_runs{100.0, 500.0};

// Point steps a second on one core, for the estimate of seconds only; `benchmark_forward` measures it.
constexpr double expected_speed = 4e7;

// Of wood that is much stiffer than other so much has to fill whole cells of a grid twice as coarse, as it does in layers of two
// of these: of thinner ones the coarse grid's error does not go with the square of its cell, and may have the other sign.
constexpr double least_resolved = 0.7;
constexpr double much_stiffer = 4.0;

bool resolves_woods(const Discretisation& body) {
    const Layout& layout = body.layout;
    double stiffest = 0.0, softest = std::numeric_limits<double>::infinity();
    const auto stiffness = [&](int c) {
        if (body.points.first_of_cell[c] == body.points.first_of_cell[c + 1]) return 0.0;
        return std::max(body.points.stiffness[c][0], body.points.stiffness[c][2]);
    };
    for (int c = 0; c < layout.cells(); ++c) {
        if (stiffness(c) == 0.0) continue;
        stiffest = std::max(stiffest, stiffness(c));
        softest = std::min(softest, stiffness(c));
    }
    if (stiffest < much_stiffer * softest) return true;
    int all = 0, whole = 0;
    for (int j = 0; j < layout.cells_y; j += 2)
        for (int i = 0; i < layout.cells_x; i += 2) {
            int stiff = 0, wood = 0;
            for (int y = j; y < std::min(j + 2, layout.cells_y); ++y)
                for (int x = i; x < std::min(i + 2, layout.cells_x); ++x) {
                    const double here = stiffness(layout.cell_index(x, y));
                    stiff += here >= 0.5 * stiffest;
                    wood += here > 0.0;
                }
            all += stiff;
            if (stiff == wood) whole += stiff;
        }
    return whole >= least_resolved * all;
}

void refuse(const Scene& scene, const std::string& key, const std::string& value, const std::string& rule) {
    throw InputError(scene.file.string(), key, value, rule);
}

bool starts_in_motion(const Scene& scene) {
    const auto& parts = scene.specimen.parts;
    return std::any_of(parts.begin(), parts.end(), [](const Part& part) { return !part.velocity.isZero(0.0); });
}

const char* name_of(VelocityUpdate update) {
    switch (update) {
    case VelocityUpdate::automatic:
        break;
    case VelocityUpdate::flip:
        return "flip";
    case VelocityUpdate::pic:
        return "pic";
    case VelocityUpdate::xpic:
        return "xpic";
    case VelocityUpdate::fmpm:
        return "fmpm";
    }
    return "auto";
}

void check_solver(const Scene& scene, bool quasistatic, bool orthotropic) {
    const std::string other = quasistatic ? "quasistatic" : "explicit";
    if (quasistatic && scene.solver.shape_function == ShapeFunction::bspline2)
        refuse(scene, "solver.shape_function", "bspline2",
               "not available at equilibrium; use \"auto\", \"gimp\", \"cpdi\" or \"linear\", or solver.kind = \"explicit\"");
    if (quasistatic && scene.solver.velocity_update != VelocityUpdate::automatic)
        refuse(scene, "solver.velocity_update", name_of(scene.solver.velocity_update),
               "equilibrium has no velocities to update; leave it out");
    if (quasistatic && scene.solver.stress_update != StressUpdate::last)
        refuse(scene, "solver.stress_update", scene.solver.stress_update == StressUpdate::first ? "first" : "average",
               "equilibrium has no time step; leave it out");
    if (quasistatic && (starts_in_motion(scene) || scene.specimen.parts.size() > 1))
        refuse(
            scene, "specimen.parts", fmt::format("{} parts", scene.specimen.parts.size()),
            "parts that start with a velocity or push on one another are for explicit dynamics; give solver.kind = \"explicit\"");
    if (quasistatic && scene.solver.damping > 0.0)
        refuse(scene, "solver.damping", fmt::format("{} 1/s", scene.solver.damping),
               "equilibrium has no motion to damp; leave it out");
    for (std::size_t k = 0; k < scene.cracks.size(); ++k) {
        const Crack& crack = scene.cracks[k];
        const std::string key = "cracks." + std::to_string(k);
        if (crack.direction == GrowthDirection::energy_release_rate && crack.grows != Growth::none && orthotropic)
            refuse(scene, key + ".direction", "energy release rate",
                   "not available in orthotropic wood, for whose branches no solution is built in; use \"hoop stress\", \"normal "
                   "to opening\" or \"straight\"");
    }
    for (const Body& body : scene.bodies)
        if (!quasistatic && (body.free[0] || body.free[1]))
            refuse(scene, "bodies." + body.name + ".velocity", "free",
                   "a body that follows a force has no mass to move with in explicit dynamics; use solver.kind = "
                   "\"quasistatic\", or give its velocity");
}

// Which sides of a crack, right and left, have points within a cell of it.
std::array<bool, 2> sides_with_points(const Discretisation& body, const Crack& crack) {
    const double cell = body.layout.cell.maxCoeff();
    std::array<bool, 2> found{false, false};
    for (std::size_t k = 0; k + 1 < crack.points.size(); ++k) {
        const Vec2 from = crack.points[k], to = crack.points[k + 1];
        body.for_cells_in({from.cwiseMin(to).array() - cell, from.cwiseMax(to).array() + cell}, [&](int c) {
            for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p) {
                const Vec2& x = body.points.position[p];
                const double along = nearest_on_segment(from, to, x);
                const Vec2 away = x - (from + along * (to - from));
                if (along > 0.0 && along < 1.0 && away.norm() < cell) found[cross(to - from, away) > 0.0] = true;
            }
        });
    }
    return found;
}

// Asked of those alone that are as close to the outline on all of their way.
bool wide_cells_see_cracks(const Scene& scene, const MaterialMap& materials, const Discretisation& body) {
    const double cell = 2.0 * body.layout.cell.maxCoeff();
    const Vec2 size = body.layout.size();
    const auto is_far_in = [&](const Vec2& x) { return x.minCoeff() > cell && (size - x).minCoeff() > cell; };
    std::optional<Discretisation> wide;
    return std::all_of(scene.cracks.begin(), scene.cracks.end(), [&](const Crack& crack) {
        if (std::any_of(crack.points.begin(), crack.points.end(), is_far_in)) return true;
        if (!wide) wide.emplace(scene, materials, Layout::of(scene, 2.0 * body.layout.cell));
        const auto [right, left] = sides_with_points(*wide, crack);
        return right && left;
    });
}

// Or they would join what a void parts.
bool wide_cells_see_voids(const Scene& scene, const MaterialMap& materials, const Discretisation& body) {
    for (int c = 0; c < body.layout.cells(); ++c)
        if (!body.cell_is_full(c))
            return !thin_voids(scene, Discretisation(scene, materials, Layout::of(scene, 2.0 * body.layout.cell)));
    return true;
}

// Two sides that are pressed together must not meet.
void check_edges(const Scene& scene, double end) {
    if (!std::isfinite(end)) return;
    const auto meet = [](const Edge& a, const Edge& b) {
        return !a.range || !b.range || (a.range->first < b.range->second && b.range->first < a.range->second);
    };
    for (const auto& [low, high, axis] : {std::tuple(Side::left, Side::right, 0), std::tuple(Side::bottom, Side::top, 1)})
        for (const Edge& a : scene.edges)
            for (const Edge& b : scene.edges) {
                if (a.side != low || b.side != high || !a.velocity[axis] || !b.velocity[axis] || !meet(a, b)) continue;
                const auto way = [&](const Edge& edge) { return *edge.velocity[axis] * std::min(end, edge.until.value_or(end)); };
                const double closer = way(a) - way(b);
                if (closer < scene.specimen.size[axis]) continue;
                const Edge& moves = std::abs(way(b)) >= std::abs(way(a)) ? b : a;
                refuse(scene, "edges." + moves.name + ".velocity", fmt::format("{:g} m/s", *moves.velocity[axis]),
                       fmt::format("in the end it would have come {:.3g} mm closer to the side across, which is {:.3g} mm away",
                                   1e3 * closer, 1e3 * scene.specimen.size[axis]));
            }
}

void check_cracks(const Scene& scene, const Discretisation& body) {
    const Vec2 size = body.layout.size(), hair = 1e-9 * size;
    for (std::size_t k = 0; k < scene.cracks.size(); ++k) {
        const Crack& crack = scene.cracks[k];
        const std::string key = fmt::format("cracks.{}", k);
        const auto is_within = [&](const Vec2& x) {
            return (x.array() > hair.array()).all() && (x.array() < (size - hair).array()).all();
        };
        const bool start = crack.grows == Growth::start || crack.grows == Growth::both;
        const bool end = crack.grows == Growth::end || crack.grows == Growth::both;
        // Its stations would have no end, and say what the grid does within a cell.
        constexpr double least_advance = 1e-3;  // of a cell
        if ((start || end) && crack.advance > 0.0 && crack.advance < least_advance * body.layout.cell.minCoeff())
            refuse(scene, key + ".advance", fmt::format("{:.3g} mm", 1e3 * crack.advance),
                   fmt::format("must be 0, for G at the tip, or more than a thousandth of a cell of {:.3g} mm",
                               1e3 * body.layout.cell.minCoeff()));
        if ((start || end) && !(start && is_within(crack.points.front())) && !(end && is_within(crack.points.back())))
            refuse(scene, key + ".grows",
                   start && end ? "both"
                   : start      ? "start"
                                : "end",
                   "no such end of the crack lies inside the specimen: there is no wood to grow into");
        const auto [right, left] = sides_with_points(body, crack);
        if (right != left)
            refuse(scene, key + ".points", fmt::format("on cells of {:.3g} mm", 1e3 * body.layout.cell.maxCoeff()),
                   fmt::format("the grid has no wood {} of the crack: it must lie farther in, or the cells be smaller",
                               right ? "left" : "right"));
    }
}

// What slides must not lie in the wood at the start; what it touches may be off by what the points of cut cells are.
void check_bodies(const Scene& scene, const Discretisation& body) {
    const double hair = 0.05 * body.layout.cell.minCoeff();
    for (const Body& rigid : scene.bodies) {
        if (rigid.contact.kind == Contact::Kind::bonded) continue;
        double depth = 0.0;
        for (const Vec2& x : body.points.position)
            if (inside(rigid.shape, x)) depth = std::max(depth, nearest_on_outline(rigid.shape, x).distance);
        if (depth > hair)
            refuse(scene, "bodies." + rigid.name, fmt::format("overlap of {:.3g} mm", 1e3 * depth),
                   "a sliding body must not overlap the specimen at the start");
    }
}

// Highest squared frequency that any point can take part in: with the point as an element of its own, its stiffness over its
// share of the nodes' mass. No way of joining the points, so no crack, exceeds it (Irons and Treharne 1971).
double highest_frequency_squared(const Discretisation& body) {
    const auto largest = [](const Eigen::Matrix3d& m) {
        return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m, Eigen::EigenvaluesOnly).eigenvalues()[2];
    };
    std::vector<Eigen::Matrix3d> spread;  // by slot
    std::vector<double> widest;
    for (const CellWeights& w : body.weights) {
        spread.emplace_back(Eigen::Matrix3d::Zero());
        for (int k = 0; k < body.layout.nodes_per_cell(); ++k) {
            Eigen::Matrix<double, 3, 2> B;
            B << w.slope_x[k], 0, 0, w.slope_y[k], w.slope_y[k], w.slope_x[k];
            spread.back() += B * B.transpose() / w.value[k];
        }
        widest.push_back(largest(spread.back()));
    }
    double highest = 0.0;
    int last = -1;  // a point of the cell that was looked at last
    for (int c = 0; c < body.layout.cells(); ++c) {
        const int p = body.points.first_of_cell[c];
        if (p == body.points.first_of_cell[c + 1]) continue;
        const double density = body.points.density(p);
        const int first_slot = body.points.slot[p] - body.place_of(p);
        const auto alike = [&](int q) {
            return body.points.stiffness[body.points.cell[q]] == body.points.stiffness[c] && body.points.density(q) == density &&
                   body.points.slot[q] - body.place_of(q) == first_slot;
        };
        if (last >= 0 && alike(last)) continue;
        last = p;
        const Eigen::Matrix3d C = body.points.stiffness_of(p);
        for (int slot = first_slot; slot < first_slot + body.layout.points_per_cell(); ++slot) {
            if (C.trace() * widest[slot] / density <= highest) continue;  // a bound: spares most cells the eigenvalues
            const Eigen::Matrix3d root = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(C).operatorSqrt();
            highest = std::max(highest, largest(root * spread[slot] * root) / density);
        }
    }
    return highest;
}

std::string name_of(ShapeFunction kind) {
    return kind == ShapeFunction::linear ? "linear" : kind == ShapeFunction::cpdi ? "CPDI" : "GIMP";
}

// FMPM takes w to mu w + (mu / A) a dt with mu = 1 - (1 - A)^m: with squared frequency f it is stable up to dt^2 f = 2 (1 + mu) A
// / mu, against 4 of a leapfrog: less by 2 m as A, between 0 and 1, comes near 0.
void choose_updates(const Scene& scene, Plan& plan) {
    const SolverChoice& solver = scene.solver;
    std::string how = "kept by the grid";
    std::string why = "points stay in their cells: mapping to points and back would only lose";
    if (solver.velocity_update != VelocityUpdate::automatic) why = "asked for in solver.velocity_update";
    switch (solver.velocity_update) {
    case VelocityUpdate::automatic:
        break;
    case VelocityUpdate::flip:
        how = fmt::format("FLIP, {:g} of it PIC", solver.pic_share);
        break;
    case VelocityUpdate::pic:
        how = "PIC, time step shorter by the root of 2";
        plan.time_step /= std::sqrt(2.0);
        break;
    case VelocityUpdate::xpic:
        how = fmt::format("XPIC({})", solver.order);
        break;
    case VelocityUpdate::fmpm:
        how = fmt::format("FMPM({}), time step shorter by the root of twice its order", solver.order);
        plan.time_step /= std::sqrt(2.0 * solver.order);
        break;
    }
    plan.choices.push_back({"velocities", how, why});
    if (solver.stress_update != StressUpdate::last)
        plan.choices.push_back(
            {"stresses",
             solver.stress_update == StressUpdate::first ? "updated first" : "updated first and last by half a step each",
             "asked for in solver.stress_update"});
}

void choose_history(const Scene& scene, Plan& plan, const MaterialMap& materials, const Discretisation& body) {
    if (!plan.remembers) {
        plan.choices.push_back({"history", "none", "all wood is elastic"});
        return;
    }
    std::string kinds;
    for (const auto& [name, material] : scene.materials)
        if (material.remembers())
            kinds += fmt::format("{}{} is {}", kinds.empty() ? "" : ", ", name, material.plastic ? "plastic" : "viscoelastic");
    const History history(materials, body, scene.model.plane);
    plan.choices.push_back({"history",
                            fmt::format("in {} of {} cells, {:.3g} MB", history.cells(), body.layout.cells(),
                                        static_cast<double>(history.bytes()) * 1e-6),
                            kinds + "; woods that share a cell act as layers, each with a memory of its own"});
    plan.choices.push_back({"dissipation", "beside the strain energy, which is what comes back",
                            "external work = strain + kinetic + fracture energy + what wood, damping and friction dissipate"});
}

// A picture that does not reach over the whole specimen.
void choose_wood_unseen(const Scene& scene, Plan& plan, const MaterialMap& materials, const Discretisation& body) {
    const auto& at = body.points.position;
    const auto seen = static_cast<int>(std::count_if(at.begin(), at.end(), [&](const Vec2& x) { return materials.is_seen(x); }));
    if (seen == body.points.count()) return;
    if (seen == 0)
        refuse(scene, scene.specimen.picture ? "specimen.image" : "specimen.file",
               (scene.specimen.picture ? scene.specimen.picture->file : scene.specimen.file).string(),
               "lies wholly beside the specimen: see pixel, offset and rotation");
    plan.choices.push_back({"wood not seen", fmt::format("{:.2g} % of the specimen", 100.0 - 100.0 * seen / body.points.count()),
                            "the picture does not reach there: taken for the wood of its nearest pixel", true});
}

// A map of density that goes far beyond that of both materials.
void choose_density_beyond(const Scene& scene, Plan& plan) {
    constexpr double least_part = 0.05, clearly = 0.05;  // of the wood; of the way from EW to LW
    if (!scene.specimen.map || scene.specimen.map->density.empty()) return;
    const Specimen& map = *scene.specimen.map;
    const double early = scene.materials.at("EW").density, late = scene.materials.at("LW").density;
    std::size_t wood = 0, beyond = 0;
    for (std::size_t i = 0; i < map.density.size(); ++i) {
        if (map.label[i] == Specimen::void_label) continue;
        const double way = (map.density[i] - early) / (late - early);
        ++wood;
        beyond += way < -clearly || way > 1.0 + clearly;
    }
    const double part = wood > 0 ? static_cast<double>(beyond) / static_cast<double>(wood) : 0.0;
    if (part < least_part) return;
    plan.choices.push_back({"wood beyond EW and LW", fmt::format("{:.2g} % of the picture's", 100.0 * part),
                            "less dense than EW or denser than LW is: taken for these; see the materials' densities", true});
}

}  // namespace

Plan make_plan(const Scene& scene, const MaterialMap& materials, const Discretisation& body) {
    Plan plan;
    const auto choose = [&](std::string part, std::string choice, std::string reason) {
        plan.choices.push_back({std::move(part), std::move(choice), std::move(reason)});
    };
    plan.end_time = end_time(scene);
    double slowest = std::numeric_limits<double>::infinity();
    for (int p = 0; p < body.points.count(); ++p)
        slowest = std::min(slowest, std::sqrt(body.points.stiffest(p) / body.points.density(p)));
    const Travel travel = travel_of(scene);
    const double loading = std::isfinite(plan.end_time) ? std::min(plan.end_time, travel.until)
                           : travel.fastest > 0.0       ? cracking_strain * scene.specimen.size.minCoeff() / travel.fastest
                                                        : 0.0;
    plan.slowness = loading * slowest / scene.specimen.size.maxCoeff();
    plan.driven = travel.fastest > 0.0;
    plan.still_from = travel.until;
    for (const Crack& crack : scene.cracks) plan.grows |= crack.grows != Growth::none;
    for (const Crack& crack : scene.cracks) plan.friction |= crack.faces.coefficient > 0.0;
    const bool bridged = BridgedFaces::are_in(scene);
    for (const Body& rigid : scene.bodies) {
        plan.friction |= rigid.contact.coefficient > 0.0;
        plan.free_bodies |= rigid.free[0] || rigid.free[1];
    }
    plan.quasistatic = scene.solver.kind == SolverKind::quasistatic ||
                       (scene.solver.kind == SolverKind::automatic && scene.solver.damping == 0.0 && !starts_in_motion(scene) &&
                        !bridged && (plan.slowness > slow_loading || plan.free_bodies));
    check_solver(scene, plan.quasistatic, materials.orthotropic());
    check_bodies(scene, body);
    check_edges(scene, plan.end_time);
    check_cracks(scene, body);
    for (const Edge& edge : scene.edges)
        if (edge.name == scene.measure.displacement && edge.traction && edge.traction->isZero(0.0))
            refuse(
                scene, "edges." + edge.name + ".traction", "0 MPa, 0 MPa",
                "measure.displacement goes along the traction of this edge, which says no direction: a small one does, as 1 Pa");
    if (!may_end(scene))
        refuse(scene, scene.stop.displacement ? "stop.displacement" : "stop.crack_length",
               fmt::format("{:g} mm", 1e3 * scene.stop.displacement.value_or(scene.stop.crack_length.value_or(0.0))),
               "the run would never end: what is measured does not get there, and no time ends it");
    plan.remembers = materials.remembers();
    // The way of a crack that turns hangs on the material, and what it cuts off would too: derivatives hold the way.
    const auto goes_straight = [](const Crack& crack) {
        return crack.grows == Growth::none || crack.direction == GrowthDirection::straight;
    };
    plan.cuts_domains =
        plan.quasistatic && !scene.cracks.empty() && std::ranges::all_of(scene.cracks, goes_straight) && !plan.remembers;
    check_memory(scene, plan.quasistatic, materials, body);
    check_bridging(scene, plan.quasistatic, materials, body);

    const double smallest = scene.specimen.size.minCoeff();
    const double motion = farthest_motion(scene, plan.end_time);
    plan.contact = std::any_of(scene.bodies.begin(), scene.bodies.end(),
                               [](const Body& b) { return b.contact.kind != Contact::Kind::bonded; });
    plan.finer_at_wheels = !plan.friction && !plan.remembers && !plan.free_bodies &&
                           std::isfinite(std::min(plan.end_time, plan.still_from)) &&
                           std::any_of(scene.bodies.begin(), scene.bodies.end(), [&](const Body& b) {
                               return b.contact.kind != Contact::Kind::bonded && is_small_circle(b.shape, body.layout);
                           });
    // A crack under edges that are drawn apart crosses before they go much farther than it takes to split a plain strip.
    const double needed = plan.quasistatic && plan.grows && scene.bodies.empty() ? splitting_motion(scene, body) : motion;
    const double expected = std::min(motion, needed);
    const double bound = needed < motion ? most_expected_rotation : most_rotation;
    const bool chosen = scene.solver.strain != StrainMeasure::automatic;
    plan.rotates = chosen ? scene.solver.strain == StrainMeasure::finite_rotation : expected > bound * smallest;
    plan.may_turn = !plan.rotates && (plan.grows || has_dead_load(scene) || expected > bound * smallest);
    // Under a load that goes and another that stays faces of cracks may come together or part.
    const bool faces_may_change = !scene.cracks.empty() && plan.driven && has_dead_load(scene);
    plan.linear = plan.quasistatic && !plan.rotates && !plan.contact && !plan.friction && !plan.remembers &&
                  travel.stops.empty() && !faces_may_change;
    if (plan.quasistatic && !plan.linear && (plan.driven || plan.remembers) && !std::isfinite(plan.end_time))
        refuse(scene, "stop", "crack_length alone",
               "equilibrium that is not linear needs a time, or a displacement that is driven, to know how far "
               "the load may go");
    const std::string why =
        scene.solver.kind != SolverKind::automatic ? "asked for in solver.kind"
        : plan.free_bodies                         ? "a body that follows a force is in equilibrium with the specimen"
        : bridged                 ? "crack faces that a traction pulls together: their law hangs on the way to an opening"
        : starts_in_motion(scene) ? "a part starts in motion"
        : scene.solver.damping > 0.0
            ? "solver.damping is given, and equilibrium has no motion to damp"
            : fmt::format("the load takes {:.3g} transits of a wave through the specimen; equilibrium from {} on", plan.slowness,
                          slow_loading);
    if (plan.quasistatic)
        choose("solver",
               plan.linear      ? "equilibrium, linear"
               : plan.remembers ? "equilibrium in steps of time, Newton's method"
                                : "equilibrium, Newton's method",
               why);
    else choose("solver", "explicit dynamics", why);
    double least_advance = std::numeric_limits<double>::infinity(), most_advance = 0.0;
    for (const Crack& crack : scene.cracks) {
        if (crack.grows == Growth::none) continue;
        least_advance = std::min(least_advance, crack.advance);
        most_advance = std::max(most_advance, crack.advance);
    }
    const bool fine_enough = std::min(body.layout.cells_x, body.layout.cells_y) >= 2 * least_coarse_cells &&
                             least_advance >= 2.0 * body.layout.cell.maxCoeff() * (1.0 - 1e-6);
    const bool may_meet = plan.grows && scene.cracks.size() > 1;
    const bool may_extrapolate = plan.quasistatic && scene.solver.extrapolate && fine_enough && !may_meet && !plan.remembers;
    const bool resolved = may_extrapolate && resolves_woods(body);
    const bool held = resolved && meets_nodes(scene, Layout::of(scene, 2.0 * body.layout.cell));
    const bool sees_cracks = held && wide_cells_see_cracks(scene, materials, body);
    plan.extrapolates = sees_cracks && wide_cells_see_voids(scene, materials, body);
    if (plan.quasistatic)
        choose("grids", plan.extrapolates ? "two, one twice as coarse" : "one",
               plan.extrapolates ? "a third of their difference takes off most of the grid's error (Richardson 1911)"
               : plan.remembers  ? "wood that remembers: errors of time and of the grid do not go together"
               : may_meet
                   ? "several cracks: where they come near each other a second, twice as coarse, would not see the wood between"
               : sees_cracks     ? "a second, twice as coarse, would join the wood on both sides of a void"
               : held            ? "a second, twice as coarse, would have no wood beside a crack"
               : resolved        ? "a second, twice as coarse, would have hardly a node where an edge or a bonded body holds"
               : may_extrapolate ? "layers of the stiffest wood are less than two cells of a second, twice as coarse, wide: its "
                                   "error would not tell"
               : scene.solver.extrapolate
                   ? fmt::format("a second, twice as coarse, would have less than {} cells a side or a cell wider than `advance`",
                                 least_coarse_cells)
                   : "solver.extrapolate is false");
    if (plan.quasistatic && plan.grows && least_advance > 0.0 && least_advance < body.layout.cell.minCoeff() * (1.0 - 1e-6))
        choose(
            "advance", "shorter than a cell",
            "what is released over less than a cell goes in steps with the grid: the load comes out too high; 0 takes G at the "
            "tip instead, or take finer cells");
    const bool patches_see = body.layout.degree == 1 && !BridgedFaces::are_in(scene);
    const bool asks_ahead = plan.quasistatic ? least_advance > 0.0 : patches_see && most_advance > body.layout.cell.maxCoeff();
    if (plan.grows && asks_ahead && !materials.homogeneous() && !plan.remembers)
        choose("tips near sharp boundaries", "boxes with finer cells around them",
               "a tip that passes into wood many times as stiff releases hardly any energy within a cell: the grid alone takes "
               "it for much");
    choose("reference", "undeformed specimen (total Lagrangian)",
           "points stay in their cells: no cell crossing, and grid velocities need no mapping to points and back");
    if (scene.solver.shape_function == ShapeFunction::bspline2)
        choose("shape function", "quadratic B-splines, knots threefold at the specimen's sides", "asked for");
    else
        choose("shape function", name_of(scene.solver.shape_function),
               "in the undeformed specimen a point's domain lies in one cell, where linear, GIMP and CPDI weights are the same");
    if (plan.grows && scene.solver.shape_function == ShapeFunction::bspline2)
        plan.choices.push_back({"running cracks", "with B-splines they go up to a third less far than with GIMP, on any grid",
                                "measured, and not understood", true});
    choose("strain", plan.rotates ? "Biot strain, finite rotation" : "small strain",
           chosen ? "asked for in solver.strain"
                  : fmt::format("edges and bodies are expected to move by up to {:.3g} of the specimen's smaller side{}; small "
                                "strain up to {}",
                                expected / smallest,
                                has_dead_load(scene) ? ", as far as is known: tractions and forces move them too" : "", bound));
    const std::string kind = materials.orthotropic() ? "orthotropic" : "isotropic";
    choose("material",
           materials.homogeneous() ? "one " + kind + " material"
                                   : kind + " wood by place; points that a boundary crosses act as layers",
           !materials.homogeneous()  ? "band widths do not round to points; J carries the material-gradient term"
           : materials.orthotropic() ? "one radial direction"
                                     : "no orientation");
    const SpecimenPlan& specimen = scene.specimen;
    if (!materials.orthotropic() &&
        (specimen.radial || specimen.pith || (specimen.picture && !specimen.picture->orientation.empty())))
        choose("radial direction", "not used", "all wood is isotropic");
    choose_wood_unseen(scene, plan, materials, body);
    choose_density_beyond(scene, plan);
    if (const auto voids = thin_voids(scene, body)) plan.choices.push_back(*voids);
    choose_history(scene, plan, materials, body);

    if (scene.cracks.empty()) choose("crack fields", "none", "no crack");
    else
        choose("crack fields", fmt::format("{} crack{}", scene.cracks.size(), scene.cracks.size() == 1 ? "" : "s"),
               std::string("two fields at nodes whose support a crack cuts, ") +
                   (scene.cracks.size() > 1 ? "up to four where two cracks do, " : "") + "one elsewhere; " +
                   (plan.cuts_domains ? "what it cuts off a point's domain moves with the wood on that side"
                                      : "points lie on one side or the other"));
    if (!scene.cracks.empty())
        choose("J, K",
               plan.remembers ? "at saved instants; not a number where wood within 5.5 cells of the tip remembers"
               : !plan.grows  ? "at saved instants"
               : plan.quasistatic
                   ? "at each place of the tip"
                   : "at saved instants and where a crack turns; it grows by the energy that the ties at its tip give up",
               "domain form, 4 cells around the tip");
    const int tips = growing_tips(scene);
    if (plan.quasistatic && tips > 1)
        choose("growth", fmt::format("{} tips compete", tips),
               "the tip moves whose next advance pays for itself at the least load, tips that nothing tells apart together; "
               "which one "
               "depends on the toughness, so that each other toughness needs a run of its own");
    const bool parts_touch = scene.specimen.parts.size() > 1;
    if (parts_touch)
        choose("parts", fmt::format("{}, which push on one another without friction", scene.specimen.parts.size()),
               "given in specimen.parts");
    choose("contact",
           !plan.contact          ? "none between bodies and specimen"
           : scene.cracks.empty() ? "bodies push on the specimen's outline"
                                  : "bodies push on the specimen's outline and on faces of cracks",
           plan.contact ? "penalty of up to ten cells' stiffness, never pulls" : "no body that slides");
    if (plan.quasistatic && plan.finer_at_wheels)
        choose("wood under wheels", "boxes with finer cells along their ways",
               "a wheel touches a few cells, which yield less than the wood does");
    if (plan.friction)
        choose("friction", "Coulomb, of bodies or crack faces that press",
               plan.quasistatic ? "slip counts from one equilibrium to the next; Newton's method takes its unsymmetric tangent "
                                  "by iteration on the symmetric part, and crack faces are sorted into those that grip and slide "
                                  "where it goes round in circles"
                                : "asked for");
    if (plan.free_bodies) choose("free bodies", "follow their force", "one more unknown for each free component");
    if (plan.quasistatic) return plan;

    for (const Plan::Choice& choice : bridging_choices(scene, materials, body)) plan.choices.push_back(choice);
    const double highest = highest_frequency_squared(body);
    plan.added_frequency_squared = plan.contact || parts_touch || !scene.cracks.empty() ? added_stiffness * highest : 0.0;
    plan.time_step = courant * 2.0 / std::sqrt(highest + plan.added_frequency_squared);
    choose_updates(scene, plan);
    return plan;
}

int growing_tips(const Scene& scene) {
    int tips = 0;
    for (const Crack& crack : scene.cracks) tips += crack.grows == Growth::both ? 2 : crack.grows != Growth::none;
    return tips;
}

namespace {

// What a run at equilibrium takes beyond one equilibrium.
std::string cost_of_run(const Scene& scene, const Plan& plan, const Discretisation& body, double equilibrium) {
    if (plan.remembers)
        return fmt::format(", of which there are {} or more in time", march_times(scene, plan, MaterialMap(scene)).size());
    if (!plan.linear)
        return fmt::format("; with its steps of load, some {:.2g} to {:.2g} s for the run", newton_runs[0] * equilibrium,
                           newton_runs[1] * equilibrium);
    if (!plan.grows) return "";
    const double side = scene.specimen.size.maxCoeff();
    double places = 0.0;
    for (const Crack& crack : scene.cracks) {
        if (crack.grows == Growth::none) continue;
        const double length = (crack.points.back() - crack.points.front()).norm();
        const double farthest = std::min(scene.stop.crack_length.value_or(side), side);
        places += 2.0 * std::max(farthest - length, 0.0) / body.layout.cell.minCoeff();
    }
    return fmt::format(", {:.2g} s for the run if its cracks go all their way",
                       equilibrium + places * (seconds_per_place + share_per_place * equilibrium));
}

}  // namespace

std::string describe(const Scene& scene, const Plan& plan, const Discretisation& body) {
    std::string text;
    if (!scene.title.empty()) text += scene.title + "\n";
    for (const auto& [part, choice, reason, warns] : plan.choices)
        text += fmt::format("{:<15} {}\n{:<15}   because: {}\n", part, choice, "", reason);
    text += fmt::format("{:<15} {} x {} cells of {:.4g} x {:.4g} mm, {} points, {} nodes\n", "grid", body.layout.cells_x,
                        body.layout.cells_y, body.layout.cell.x() * 1e3, body.layout.cell.y() * 1e3, body.points.count(),
                        body.layout.nodes());
    if (plan.quasistatic) {
        const double seconds = body.layout.nodes() * seconds_per_node * std::sqrt(static_cast<double>(body.layout.nodes()));
        text += fmt::format("{:<15} about {:.2g} s on one core for an equilibrium{}\n", "cost", seconds,
                            cost_of_run(scene, plan, body, seconds));
        return text;
    }
    text += fmt::format("{:<15} {:.4g} us\n", "time step", plan.time_step * 1e6);
    if (std::isfinite(plan.end_time)) {
        const double steps = std::ceil(plan.end_time / plan.time_step);
        text += fmt::format("{:<15} {:.4g} steps to {:.4g} ms, about {:.2g} s on one core at most\n", "cost", steps,
                            plan.end_time * 1e3, steps * body.points.count() / expected_speed);
        text += fmt::format("{:<15} the load takes {:.3g} wave transits of the specimen; vibration is felt below about 50\n",
                            "loading", plan.slowness);
    } else {
        text += fmt::format(
            "{:<15} not known before the run: no stop condition on time, nor on a displacement that is prescribed\n", "cost");
    }
    return text;
}

}  // namespace crampfit

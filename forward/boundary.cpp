#include "forward/boundary.hpp"

#include "datasets/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

namespace crampfit {

namespace {

// The ends of a stretch that is shorter are not seen on their own.
constexpr double least_cells_between_ends = 1.0;

bool on_side(const Layout& layout, Side side, const Vec2& x) {
    const Vec2 near = 1e-6 * layout.cell;
    switch (side) {
    case Side::left:
        return x.x() < near.x();
    case Side::right:
        return x.x() > layout.size().x() - near.x();
    case Side::bottom:
        return x.y() < near.y();
    case Side::top:
        return x.y() > layout.size().y() - near.y();
    }
    return false;
}

int along_side(Side side) { return side == Side::top || side == Side::bottom ? 0 : 1; }

bool in_range(const Layout& layout, const Edge& edge, const Vec2& x) {
    if (!edge.range) return true;
    const int axis = along_side(edge.side);
    const double rounding = 1e-6 * layout.cell[axis];
    return x[axis] >= edge.range->first - rounding && x[axis] <= edge.range->second + rounding;
}

// Whether a bonded body holds a node: one in it, and one that its outline passes by less than half a cell, through wood. So what
// it holds ends as often before its outline as behind it.
bool holds_node(const Shape& shape, const SpecimenPlan& specimen, const Vec2& x, double cell) {
    const double hair = 1e-6 * cell;
    if (inside(shape, x)) return true;
    const OutlinePoint on = nearest_on_outline(shape, x);
    if (on.distance <= hair) return true;
    if (on.distance >= 0.5 * cell - hair) return false;
    const Vec2 beside = on.position + hair / on.distance * (x - on.position);
    return beside.minCoeff() >= -hair && (specimen.size - beside).minCoeff() >= -hair && has_wood(specimen, beside);
}

}  // namespace

bool meets_nodes(const Scene& scene, const Layout& layout) {
    const auto nodes = [&](const auto& is_held) {
        int count = 0;
        for (int n = 0; n < layout.nodes(); ++n) count += is_held(layout.node_position(n));
        return count;
    };
    const auto meets = [&](const Edge& edge) {
        return nodes([&](const Vec2& x) { return on_side(layout, edge.side, x) && in_range(layout, edge, x); }) >= 2;
    };
    const auto holds = [&](const Body& grip) {
        const double cell = layout.cell.minCoeff();
        return nodes([&](const Vec2& x) { return holds_node(grip.shape, scene.specimen, x, cell); }) > 0;
    };
    return std::ranges::all_of(scene.edges, [&](const Edge& e) { return e.traction || !e.range || meets(e); }) &&
           std::ranges::all_of(scene.bodies, [&](const Body& b) { return b.contact.kind != Contact::Kind::bonded || holds(b); });
}

Gauges::Gauges(const Scene& scene) {
    const int edges = static_cast<int>(scene.edges.size());
    const auto driver_named = [&](const std::string& name) {
        for (int e = 0; e < edges; ++e)
            if (scene.edges[e].name == name) return e;
        for (std::size_t b = 0; b < scene.bodies.size(); ++b)
            if (scene.bodies[b].name == name) return edges + static_cast<int>(b);
        return 0;
    };
    const auto direction_of = [&](int driver) {
        Vec2 drive = Vec2::Zero();
        if (driver >= edges) {
            if (driver - edges < static_cast<int>(scene.bodies.size())) {
                const Body& body = scene.bodies[driver - edges];
                drive = body.velocity.isZero(0.0) ? body.force : body.velocity;
            }
        } else if (scene.edges[driver].traction) {
            drive = *scene.edges[driver].traction;
        } else {
            drive = {scene.edges[driver].velocity[0].value_or(0.0), scene.edges[driver].velocity[1].value_or(0.0)};
        }
        return drive.isZero(0.0) ? drive : Vec2(drive.normalized());
    };
    displacement = driver_named(scene.measure.displacement);
    displacement_direction = direction_of(displacement);
    force = driver_named(scene.measure.force);
    force_direction = direction_of(force);
    if (force_direction.isZero(0.0)) force_direction = -displacement_direction;  // a fixed support feels the opposite of the load
    if (force < edges && !scene.edges[force].traction) {
        const Edge& edge = scene.edges[force];
        const auto held = [&](int axis) { return edge.velocity[axis].has_value(); };
        const bool feels = (held(0) && force_direction.x() != 0.0) || (held(1) && force_direction.y() != 0.0);
        if (const int along = along_side(edge.side), across = 1 - along; !feels && (held(along) || held(across))) {
            const bool low = edge.side == Side::left || edge.side == Side::bottom;
            force_direction = held(across) ? Vec2(Vec2::Unit(across) * (low ? -1.0 : 1.0)) : Vec2(Vec2::Unit(along));
        }
    }
}

std::vector<double> field_masses(const Discretisation& body, int fields) {
    std::vector<double> mass(fields, 0.0);
    const Points& points = body.points;
    for (int p = 0; p < points.count(); ++p)
        for (int k = 0; k < body.layout.nodes_per_cell(); ++k)
            mass[points.node[p][k]] += points.mass[p] * body.weights[points.slot[p]].value[k];
    for (const Sliver& sliver : body.slivers) {
        const int p = sliver.point;
        const auto own = body.values_at(points.cell[p], sliver.position);
        const auto rest = body.values_at(points.cell[p], sliver.middle_of_rest(points.position[p]));
        for (int k = 0; k < 4; ++k) {
            mass[points.node[p][k]] += points.mass[p] * ((1.0 - sliver.share) * rest[k] - body.weights[points.slot[p]].value[k]);
            mass[sliver.node[k]] += points.mass[p] * sliver.share * own[k];
        }
    }
    return mass;
}

Boundary::Boundary(const Scene& scene, const Discretisation& body, const CrackFields& cracks, const MaterialMap* materials)
    : scene_(scene), body_(body), edges_(static_cast<int>(scene.edges.size())) {
    hold_nodes(cracks, materials);
    place_tractions(cracks);
    follow(cracks);
}

// As tips that would run on into what is held: where a stretch of a side ends in whole wood that no other edge holds along an
// axis.
std::vector<CrackTip> Boundary::ends_within(const Edge& edge, int axis, const CrackFields& cracks,
                                            const std::vector<double>& mass) const {
    const Layout& layout = body_.layout;
    const int along = along_side(edge.side);
    const double cell = layout.cell[along];
    std::vector<CrackTip> ends;
    if (!edge.range || edge.range->second - edge.range->first < least_cells_between_ends * cell) return ends;
    for (const auto& [end, inward] : {std::pair{edge.range->first, 1.0}, {edge.range->second, -1.0}}) {
        const auto beyond = [&](const Vec2& x) { return inward * (end - x[along]); };
        bool goes_on = false;
        for (int n = 0; n < layout.nodes(); ++n) {
            const Vec2 x = layout.node_position(n);
            goes_on |= mass[n] > 0.0 && on_side(layout, edge.side, x) && beyond(x) >= cell && beyond(x) < 2.5 * cell;
        }
        const auto takes_over = [&](const Edge& other) {
            if (&other == &edge || other.side != edge.side || !other.velocity[axis] || other.traction) return false;
            Vec2 just_beyond = Vec2::Zero();
            just_beyond[along] = end - 0.5 * inward * cell;
            return in_range(layout, other, just_beyond);
        };
        CrackTip tip;
        tip.position[along] = end;
        tip.position[1 - along] = edge.side == Side::right || edge.side == Side::top ? layout.size()[1 - along] : 0.0;
        tip.direction = Vec2::Zero();
        tip.direction[along] = inward;
        const Box about{tip.position - 1.5 * layout.cell, tip.position + 1.5 * layout.cell};
        const auto cuts = [&](const CrackLine& line) { return line.comes_to(about); };
        if (goes_on && std::ranges::none_of(scene_.edges, takes_over) && std::ranges::none_of(cracks.lines, cuts))
            ends.push_back(tip);
    }
    return ends;
}

void Boundary::hold_nodes(const CrackFields& cracks, const MaterialMap* materials) {
    const Layout& layout = body_.layout;
    const std::vector<double> mass = field_masses(body_, cracks.fields());
    std::vector<std::array<bool, 2>> taken(layout.nodes(), {false, false});
    const auto hold = [&](int node, int axis, int driver) {  // where two meet, the first in the list holds
        if (taken[node][axis]) {
            others_.push_back({node, axis, driver});
            return false;
        }
        taken[node][axis] = true;
        held.push_back({node, axis, driver});
        return true;
    };
    for (int e = 0; e < edges_; ++e) {
        const Edge& edge = scene_.edges[e];
        if (edge.traction) continue;
        int found = 0, holds = 0;
        std::array<std::vector<CrackTip>, 2> ends;
        for (const int axis : {0, 1})
            if (materials && edge.velocity[axis]) ends[axis] = ends_within(edge, axis, cracks, mass);
        for (int n = 0; n < layout.nodes(); ++n) {
            const Vec2 x = layout.node_position(n);
            if (mass[n] == 0.0 || !on_side(layout, edge.side, x)) continue;
            found += in_range(layout, edge, x);
            for (const int axis : {0, 1}) {
                if (!edge.velocity[axis]) continue;
                const CrackTip* near = nullptr;
                double freed = 0.0;
                for (const CrackTip& end : ends[axis]) {
                    const double here = share_freed(x, end, layout);
                    if (here >= least_freed_at_rest && here < 1.0) {
                        near = &end;
                        freed = here;
                    }
                }
                if (near) {
                    ++holds;
                    const double modulus = opening_modulus(*materials, x, 0.5 * layout.cell, near->direction);
                    // Half a pair gives half as much.
                    tied.push_back(
                        {n, axis, e, 2.0 * tie_stiffness(freed, modulus * layout.thickness), modulus, x, near->direction});
                } else if (in_range(layout, edge, x)) {
                    holds += hold(n, axis, e);
                }
            }
        }
        const auto refuse_range = [&](const char* rule) {
            const auto [from, to] = edge.range.value_or(std::pair(0.0, 0.0));
            throw InputError(scene_.file.string(), "edges." + edge.name + ".range",
                             edge.range ? fmt::format("{:g} mm, {:g} mm", 1e3 * from, 1e3 * to) : "(missing)", rule);
        };
        const bool prescribes = edge.velocity[0] || edge.velocity[1];
        if (found > 0 && holds == 0 && prescribes)
            refuse_range("edges before it hold all that it would hold: give each its own range");
        if (found == 0) refuse_range("no node of the grid lies on this stretch of the side");
    }
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
        const Body& grip = scene_.bodies[b];
        if (grip.contact.kind != Contact::Kind::bonded) continue;
        int found = 0;
        for (int n = 0; n < layout.nodes(); ++n) {
            if (mass[n] == 0.0 || !holds_node(grip.shape, scene_.specimen, layout.node_position(n), layout.cell.minCoeff()))
                continue;
            ++found;
            for (int axis = 0; axis < 2; ++axis) hold(n, axis, edges_ + static_cast<int>(b));
        }
        if (found == 0)
            throw InputError(scene_.file.string(), "bodies." + grip.name, "bonded",
                             "the body holds no node of the grid: it must overlap the specimen by a cell or so");
    }
}

// Whether a driver reaches wood of a field about its node.
bool Boundary::reaches(const Reach& is_reached, int field, int node) const {
    bool found = false;
    body_.for_cells_near(body_.layout.node_position(node), 0.5 * body_.layout.cell.minCoeff(), [&](int c) {
        for (int p = body_.points.first_of_cell[c]; p < body_.points.first_of_cell[c + 1]; ++p) {
            const auto fields = body_.points.node[p];
            if (std::find(fields.begin(), fields.end(), field) != fields.end())
                found |= is_reached(body_.points.position[p], body_.domain(p));
        }
        for (const Sliver& sliver : body_.slivers_of(c, c + 1))
            if (std::ranges::find(sliver.node, field) != sliver.node.end())
                found |= is_reached(sliver.position, {sliver.low, sliver.high});
    });
    return found;
}

// What lies at the edge's stretch of its side.
Boundary::Reach Boundary::reach_of(const Edge& edge) const {
    return [this, &edge](const Vec2& middle, const Box& wood) {
        return (on_side(body_.layout, edge.side, wood.low) || on_side(body_.layout, edge.side, wood.high)) &&
               in_range(body_.layout, edge, middle);
    };
}

// What the body overlaps, or touches with a side of its outline, no crack in between.
Boundary::Reach Boundary::reach_of(const Body& grip, const CrackFields& cracks) const {
    return [this, &grip, &cracks](const Vec2& middle, const Box& wood) {
        if (inside(grip.shape, middle)) return true;
        const double hair = 1e-6 * body_.layout.cell.minCoeff();
        const Vec2 place = nearest_on_outline(grip.shape, middle).position;
        if ((wood.low - place).maxCoeff() > hair || (place - wood.high).maxCoeff() > hair) return false;
        const auto* polygon = std::get_if<Polygon>(&grip.shape);
        const auto is_there = [&](const Vec2& corner) { return (corner - place).norm() < hair; };
        if (polygon && std::ranges::any_of(polygon->points, is_there)) return false;
        for (int k = 0; k < static_cast<int>(cracks.lines.size()); ++k)
            if (distance_to(cracks.lines[k].points, place) < hair || cracks.is_left(k, middle) != cracks.is_left(k, place))
                return false;
        return true;
    };
}

void Boundary::hold_further_fields(const CrackFields& cracks) {
    const int nodes = body_.layout.nodes();
    std::vector<std::vector<int>> further(nodes);  // fields
    for (int f = nodes; f < cracks.fields(); ++f) further[cracks.node_of_field[f]].push_back(f);

    // All that would hold a node, first in the list first: a crack may cut a corner off, or part two stretches, so that its two
    // sides are held by one each, or one of them by none.
    std::vector<Held> would_hold;
    std::map<std::pair<int, int>, std::vector<int>> drivers_at;  // by node and axis
    for (const auto* holds : {&held, &others_}) {
        for (const Held& h : *holds) {
            if (h.field >= nodes) continue;
            std::vector<int>& drivers = drivers_at[{h.field, h.axis}];
            if (drivers.empty()) would_hold.push_back(h);
            drivers.insert(std::ranges::upper_bound(drivers, h.driver), h.driver);
        }
    }
    held.clear();
    others_.clear();
    std::vector<Held> held_beyond;
    for (const Held& h : would_hold) {
        const std::vector<int>& drivers = drivers_at.at({h.field, h.axis});
        const int node = h.field;
        int on_node = -1;
        bool is_held = false;
        if (further[node].empty()) {
            on_node = drivers.front();
        } else {
            const auto first_for = [&](int field) {
                const auto keeps = [&](int d) {
                    return reaches(d < edges_ ? reach_of(scene_.edges[d]) : reach_of(scene_.bodies[d - edges_], cracks), field,
                                   node);
                };
                const auto driver = std::ranges::find_if(drivers, keeps);
                return driver == drivers.end() ? -1 : *driver;
            };
            on_node = first_for(node);
            for (const int field : further[node]) {
                const int driver = first_for(field);
                if (driver < 0) continue;
                held_beyond.push_back({field, h.axis, driver});
                is_held = true;
            }
            if (on_node < 0 && !is_held) on_node = drivers.front();
        }
        if (on_node >= 0) held.push_back({node, h.axis, on_node});
        for (const int driver : drivers)
            if (driver != on_node) others_.push_back({node, h.axis, driver});
    }
    std::ranges::stable_sort(held_beyond, {}, &Held::field);
    held.insert(held.end(), held_beyond.begin(), held_beyond.end());

    std::erase_if(tied, [&](const Tied& t) { return t.field >= nodes; });
    const std::size_t on_nodes = tied.size();
    for (std::size_t i = 0; i < on_nodes; ++i) {
        for (const int field : further[tied[i].field]) {
            Tied beyond = tied[i];
            Edge side = scene_.edges[beyond.driver];  // the tie is there for what is free beyond its stretch
            side.range.reset();
            if (!reaches(reach_of(side), field, beyond.field)) continue;
            beyond.field = field;
            tied.push_back(beyond);
        }
    }
}

void Boundary::place_tractions(const CrackFields& cracks) {
    for (int e = 0; e < edges_; ++e) {
        const Edge& edge = scene_.edges[e];
        if (!edge.traction) continue;
        const int axis = along_side(edge.side);
        std::vector<double> ends;  // of the stretch, and cracks' mouths
        if (edge.range) ends = {edge.range->first, edge.range->second};
        for (const CrackLine& line : cracks.lines)
            for (const Vec2& end : {line.points.front(), line.points.back()})
                if (on_side(body_.layout, edge.side, end)) ends.push_back(end[axis]);
        std::ranges::sort(ends);
        const std::size_t before = tractions.size();
        for (const Facet& facet : body_.facets) {
            if (!on_side(body_.layout, edge.side, facet.position)) continue;
            double low = facet.position[axis] - 0.5 * facet.length;
            const double high = facet.position[axis] + 0.5 * facet.length;
            const double least = 1e-6 * facet.length;
            for (const double end : ends) {
                if (end <= low + least || end >= high - least) continue;
                place_traction(piece_of(facet, axis, low, end), e);
                low = end;
            }
            place_traction(low == facet.position[axis] - 0.5 * facet.length ? facet : piece_of(facet, axis, low, high), e);
        }
        if (tractions.size() == before)
            throw InputError(scene_.file.string(), "edges." + edge.name, "range", "no material lies on this stretch of the side");
    }
}

// Of a facet a piece.
Facet Boundary::piece_of(Facet facet, int axis, double low, double high) const {
    facet.position[axis] = 0.5 * (low + high);
    facet.length = high - low;
    facet.weight = body_.values_at(body_.points.cell[facet.point], facet.position);
    return facet;
}

void Boundary::place_traction(const Facet& facet, int driver) {
    const Edge& edge = scene_.edges[driver];
    if (!in_range(body_.layout, edge, facet.position)) return;
    tractions.push_back({facet, *edge.traction * facet.length * body_.layout.thickness, driver, {}});
    if (body_.layout.degree == 1) return;
    // B-splines are integrated along the side by the points' own places, as the stress that holds against it is.
    const Box domain = body_.domain(facet.point);
    const int axis = along_side(edge.side);
    Vec2 place = facet.position;
    place[axis] = 0.5 * (domain.low[axis] + domain.high[axis]);
    tractions.back().facet.weight = body_.values_at(body_.points.cell[facet.point], place);
}

// A crack between a facet and its point, whose middle lies on one side of it: the facet goes with the other.
void Boundary::load_own_sides(const CrackFields& cracks) {
    if (tractions.empty()) return;
    std::vector<bool> is_parted(body_.layout.nodes(), false);
    for (const FieldPair& pair : cracks.pairs) is_parted[pair.node] = true;
    for (Traction& t : tractions) {
        const int p = t.facet.point;
        const auto own = std::as_const(body_.points).node[p];
        std::ranges::copy(own, t.field.begin());
        const auto nodes = body_.layout.cell_nodes(body_.points.cell[p]);
        const auto seen = nodes.begin() + body_.layout.nodes_per_cell();
        if (std::none_of(nodes.begin(), seen, [&](int node) { return is_parted[node]; })) continue;
        for (int k = 0; k < static_cast<int>(cracks.lines.size()); ++k) {
            if (cracks.is_left(k, t.facet.position) == cracks.is_left(k, body_.points.position[p])) continue;
            t.field = cracks.fields_at(body_.points.cell[p], t.facet.position);
            break;
        }
    }
}

void Boundary::follow(const CrackFields& cracks) {
    hold_further_fields(cracks);
    load_own_sides(cracks);
}

void Boundary::go_back(const Holds& holds, const CrackFields& cracks) {
    held = holds.held;
    others_ = holds.others;
    tied = holds.tied;
    load_own_sides(cracks);
}

double Boundary::travel_time(int driver) const {
    const auto& until = driver < edges_ ? scene_.edges[driver].until : scene_.bodies[driver - edges_].until;
    return until.value_or(std::numeric_limits<double>::infinity());
}

Vec2 Boundary::velocity_of(int driver) const {
    if (driver >= edges_) return scene_.bodies[driver - edges_].velocity;
    const Edge& edge = scene_.edges[driver];
    return {edge.velocity[0].value_or(0.0), edge.velocity[1].value_or(0.0)};
}

Vec2 Boundary::travel(int driver, double time) const { return velocity_of(driver) * std::min(time, travel_time(driver)); }

std::vector<Vec2> Boundary::load_to_move(int driver, const Vec2& direction, std::size_t fields) const {
    if (driver >= edges_ || !scene_.edges[driver].traction) return {};
    std::vector<Vec2> load(fields, Vec2::Zero());
    double length = 0.0;
    for (const Traction& t : tractions)
        if (t.driver == driver) length += t.facet.length;
    for (const Traction& t : tractions)
        for (int k = 0; k < body_.layout.nodes_per_cell() && t.driver == driver; ++k)
            load[t.field[k]] += t.facet.length / length * t.facet.weight[k] * direction;
    return load;
}

Vec2 Boundary::moved(int driver, double time, const std::vector<Vec2>& displacement) const {
    if (driver >= edges_ || !scene_.edges[driver].traction) return travel(driver, time);
    Vec2 sum = Vec2::Zero();
    double length = 0.0;
    for (const Traction& t : tractions) {
        if (t.driver != driver) continue;
        length += t.facet.length;
        for (int k = 0; k < body_.layout.nodes_per_cell(); ++k)
            sum += t.facet.length * t.facet.weight[k] * displacement[t.field[k]];
    }
    return sum / length;
}

}  // namespace crampfit

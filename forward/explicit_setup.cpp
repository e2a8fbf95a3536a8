#include "datasets/error.hpp"
#include "forward/explicit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

namespace {

bool on_side(const Layout& layout, Side side, const Vec2& x) {
    const Vec2 near = 1e-6 * layout.cell;
    switch (side) {
        case Side::left: return x.x() < near.x();
        case Side::right: return x.x() > layout.size().x() - near.x();
        case Side::bottom: return x.y() < near.y();
        case Side::top: return x.y() > layout.size().y() - near.y();
    }
    return false;
}

bool in_range(const Layout& layout, const Edge& edge, const Vec2& x) {
    if (!edge.range) return true;
    const int axis = edge.side == Side::top || edge.side == Side::bottom ? 0 : 1;
    const double rounding = 1e-6 * layout.cell[axis];
    return x[axis] >= edge.range->first - rounding && x[axis] <= edge.range->second + rounding;
}

Shape widened(const Shape& shape, double by) {
    Shape wide = shape;
    if (auto* circle = std::get_if<Circle>(&wide)) circle->radius += by;
    return wide;
}

} // namespace

void ExplicitSolver::weigh_nodes() {
    mass_.assign(cracks_.fields(), 0.0);
    const Points& points = body_.points;
    for (int p = 0; p < points.count(); ++p)
        for (int k = 0; k < 4; ++k) mass_[points.node[p][k]] += points.mass[p] * body_.weights[points.slot[p]].value[k];
}

void ExplicitSolver::hold_nodes() {
    const Layout& layout = body_.layout;
    const auto already = [&](int node, int axis) {
        return std::any_of(held_.begin(), held_.end(), [&](const Held& h) { return h.field == node && h.axis == axis; });
    };
    for (std::size_t e = 0; e < scene_.edges.size(); ++e) {
        const Edge& edge = scene_.edges[e];
        if (edge.traction) continue;
        int found = 0;
        for (int n = 0; n < layout.nodes(); ++n) {
            const Vec2 x = layout.node_position(n);
            if (mass_[n] == 0.0 || !on_side(layout, edge.side, x) || !in_range(layout, edge, x)) continue;
            ++found;
            for (int axis = 0; axis < 2; ++axis)  // where two edges meet, the first in the list holds
                if (edge.velocity[axis] && !already(n, axis)) held_.push_back({n, axis, static_cast<int>(e)});
        }
        if (found == 0)
            throw InputError(scene_.file.string(), "edges." + edge.name, "range", "no node of the grid lies on this stretch of the side");
    }
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
        const Body& grip = scene_.bodies[b];
        if (grip.contact.kind != Contact::Kind::bonded) continue;
        const Shape shape = widened(grip.shape, 1e-6 * layout.cell.minCoeff());
        int found = 0;
        for (int n = 0; n < layout.nodes(); ++n) {
            if (mass_[n] == 0.0 || !inside(shape, layout.node_position(n))) continue;
            ++found;
            for (int axis = 0; axis < 2; ++axis)
                if (!already(n, axis)) held_.push_back({n, axis, static_cast<int>(scene_.edges.size() + b)});
        }
        if (found == 0)
            throw InputError(scene_.file.string(), "bodies." + grip.name, "bonded",
                             "the body holds no node of the grid: it must overlap the specimen by a cell or so");
    }
    // A crack that starts on a held edge has fields there already.
    const std::size_t on_nodes = held_.size();
    for (int f = layout.nodes(); f < cracks_.fields(); ++f)
        for (std::size_t i = 0; i < on_nodes; ++i)
            if (held_[i].field == cracks_.node_of_field[f]) held_.push_back({f, held_[i].axis, held_[i].driver});
    for (const Held& h : held_) {
        velocity_[h.field][h.axis] = velocity_of(h.driver)[h.axis];
        books_.work += 0.5 * mass_[h.field] * velocity_[h.field][h.axis] * velocity_[h.field][h.axis];
    }
}

void ExplicitSolver::place_tractions() {
    for (std::size_t e = 0; e < scene_.edges.size(); ++e) {
        const Edge& edge = scene_.edges[e];
        if (!edge.traction) continue;
        int found = 0;
        for (const Facet& facet : body_.facets) {
            if (!on_side(body_.layout, edge.side, facet.position) || !in_range(body_.layout, edge, facet.position)) continue;
            ++found;
            tractions_.push_back({facet, *edge.traction * facet.length * body_.layout.thickness, static_cast<int>(e)});
        }
        if (found == 0)
            throw InputError(scene_.file.string(), "edges." + edge.name, "range", "no material lies on this stretch of the side");
    }
}

void ExplicitSolver::place_bodies() {
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
        const Body& rigid = scene_.bodies[b];
        if (rigid.contact.kind != Contact::Kind::frictionless) continue;
        SlidingBody sliding(rigid.shape, body_, mass_, plan_.added_frequency_squared);
        const double depth = std::max(sliding.deepest(displacement_), 0.0);
        const bool swallows = std::any_of(body_.points.position.begin(), body_.points.position.end(),
                                          [&](const Vec2& x) { return inside(rigid.shape, x) &&
                                              nearest_on_outline(rigid.shape, x).distance > body_.layout.cell.maxCoeff(); });
        if (swallows || depth > body_.layout.cell.maxCoeff())
            throw InputError(scene_.file.string(), "bodies." + rigid.name, fmt::format("overlap of {:.3g} mm", depth * 1e3),
                             "a sliding body must not overlap the specimen at the start");
        sliding_.push_back(std::move(sliding));
        sliding_driver_.push_back(static_cast<int>(scene_.edges.size() + b));
    }
}

double ExplicitSolver::travel_time(int driver) const {
    const int edges = static_cast<int>(scene_.edges.size());
    const auto& until = driver < edges ? scene_.edges[driver].until : scene_.bodies[driver - edges].until;
    return until.value_or(std::numeric_limits<double>::infinity());
}

Vec2 ExplicitSolver::velocity_of(int driver) const {
    const int edges = static_cast<int>(scene_.edges.size());
    if (driver >= edges) return scene_.bodies[driver - edges].velocity;
    const Edge& edge = scene_.edges[driver];
    return {edge.velocity[0].value_or(0.0), edge.velocity[1].value_or(0.0)};
}

// Over the step that begins now: in the step in which it stops a driver goes just as far as it should.
Vec2 ExplicitSolver::mean_velocity_of(int driver) const {
    return velocity_of(driver) * std::clamp((travel_time(driver) - time_) / plan_.time_step, 0.0, 1.0);
}

Vec2 ExplicitSolver::moved(int driver) const {
    const int edges = static_cast<int>(scene_.edges.size());
    if (driver < edges && scene_.edges[driver].traction) {  // the mean motion of its facets
        Vec2 sum = Vec2::Zero();
        double length = 0.0;
        for (const Traction& t : tractions_) {
            if (t.driver != driver) continue;
            length += t.facet.length;
            for (int k = 0; k < 4; ++k)
                sum += t.facet.length * t.facet.weight[k] * displacement_[body_.points.node[t.facet.point][k]];
        }
        return sum / length;
    }
    return velocity_of(driver) * std::min(time_, travel_time(driver));
}

void ExplicitSolver::adopt(const std::vector<CrackFields::NewField>& fields) {
    for (const auto& [added, from] : fields) {
        displacement_.push_back(displacement_[from]);
        velocity_.push_back(velocity_[from]);
        acceleration_.push_back(acceleration_[from]);
        force_.push_back(Vec2::Zero());
        const std::size_t count = held_.size();
        for (std::size_t i = 0; i < count; ++i)
            if (held_[i].field == from) held_.push_back({added, held_[i].axis, held_[i].driver});
    }
    weigh_nodes();
    internal_force_.sort_cells();
}

} // namespace crampfit

#include "forward/part_contact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

namespace {

constexpr int most_steps_between_searches = 10;
constexpr double search_margin = 1.0;     // in cells
constexpr double part_of_margin = 0.25;   // that anything may go between two searches
constexpr int neighbours_looked_at = 12;  // each way along the outline from the facet that was nearest a step ago

// Stiffness of a facet over that of one cell of its wood, where the time step allows it.
constexpr double stiffness_in_cells = 10.0;

}  // namespace

PartContact::PartContact(const Discretisation& body, const std::vector<double>& mass, double most_frequency_squared)
    : body_(body), search_(most_steps_between_searches) {
    const double h = body.layout.cell.minCoeff();
    for (const Facet& f : body.facets) {
        Segment segment;
        const Vec2 half = 0.5 * f.length * left_of(f.normal);
        const int c = body.points.cell[f.point];
        segment.weight = {body.values_at(c, f.position - half), body.values_at(c, f.position + half)};
        segment.stiffness = 0.5 * stiffness_in_cells * body.points.stiffest(f.point) / h * f.length * body.layout.thickness;
        segment.part = body.points.part[f.point];
        segment.at_search = f.position - half;
        segments_.push_back(segment);
    }
    find_neighbours();
    box_.resize(1 + *std::max_element(body.points.part.begin(), body.points.part.end()));
    soften(mass, most_frequency_squared);
}

// The outline's facets lie one after the other but where it closes.
void PartContact::find_neighbours() {
    constexpr double touching = 1e-3;  // of a facet's length
    const int count = static_cast<int>(segments_.size());
    const auto end_of = [&](int i, int e) -> Vec2 {
        const Facet& f = body_.facets[i];
        return f.position + (e - 0.5) * f.length * left_of(f.normal);
    };
    const auto join = [&](int i, int e, int j) {
        const double near = touching * std::min(body_.facets[i].length, body_.facets[j].length);
        const bool joins = segments_[i].part == segments_[j].part && (end_of(i, e) - end_of(j, 1 - e)).norm() < near;
        if (joins) segments_[i].next[e] = j;
        return joins;
    };
    for (int i = 0; i < count; ++i)
        for (const int e : {0, 1}) {
            if ((i > 0 && join(i, e, i - 1)) || (i + 1 < count && join(i, e, i + 1))) continue;
            for (int j = 0; j < count && segments_[i].next[e] < 0; ++j)
                if (j != i) join(i, e, j);
        }
}

// What the facets of a node add to its stiffness is bounded by the sum of their springs' shares. A spring joins two nodes, and
// each of them has springs of both parts' facets: a quarter of what is allowed is each facet's own.
void PartContact::soften(const std::vector<double>& mass, double most_frequency_squared) {
    const int nodes = body_.layout.nodes_per_cell();
    std::vector<double> added(mass.size(), 0.0);
    for (std::size_t i = 0; i < segments_.size(); ++i)
        for (int k = 0; k < nodes; ++k)
            added[body_.points.node[body_.facets[i].point][k]] += segments_[i].stiffness * std::abs(body_.facets[i].weight[k]);
    for (std::size_t i = 0; i < segments_.size(); ++i) {
        double least = 1.0;
        for (int k = 0; k < nodes; ++k) {
            const int n = body_.points.node[body_.facets[i].point][k];
            const double allowed = 0.25 * most_frequency_squared * mass[n];
            if (body_.facets[i].weight[k] != 0.0 && added[n] > allowed) least = std::min(least, allowed / added[n]);
        }
        segments_[i].stiffness *= least;
    }
}

void PartContact::move(int facet, const std::vector<Vec2>& displacement) {
    const Facet& f = body_.facets[facet];
    const auto node = body_.points.node[f.point];
    const Vec2 half = 0.5 * f.length * left_of(f.normal);
    Segment& segment = segments_[facet];
    segment.end = {f.position - half, f.position + half};
    for (std::size_t k = 0; k < node.size(); ++k)
        for (const int e : {0, 1}) segment.end[e] += segment.weight[e][k] * displacement[node[k]];
}

// Out of the wood at a place of a facet: its normal; at one of its ends the sum of both facets' normals there, which tells inside
// from outside at corners too (Baerentzen and Aanaes 2005).
Vec2 PartContact::outward(int facet, double along) const {
    const auto normal = [&](int j) -> Vec2 { return -left_of((segments_[j].end[1] - segments_[j].end[0]).normalized()); };
    Vec2 out = normal(facet);
    for (const int e : {0, 1})
        if (along == e && segments_[facet].next[e] >= 0) out += normal(segments_[facet].next[e]);
    return out;
}

// Square of the distance from x to a facet [m^2], and where on it the nearest place is: 0 at its first end, 1 at its second.
double PartContact::distance_squared(int facet, const Vec2& x, double& along) const {
    const auto& [a, b] = segments_[facet].end;
    along = nearest_on_segment(a, b, x);
    return (x - a - along * (b - a)).squaredNorm();
}

// Facets that lie in the box of another part, or will soon.
void PartContact::find_candidates() {
    const double infinity = std::numeric_limits<double>::infinity();
    const Vec2 margin = search_margin * body_.layout.cell;
    std::fill(box_.begin(), box_.end(), Box{Vec2::Constant(infinity), Vec2::Constant(-infinity)});
    for (const Segment& s : segments_) {
        box_[s.part].low = box_[s.part].low.cwiseMin(s.end[0] - margin);
        box_[s.part].high = box_[s.part].high.cwiseMax(s.end[0] + margin);
    }
    near_.clear();
    for (int i = 0; i < static_cast<int>(segments_.size()); ++i) {
        const auto holds_it = [&](const Box& box) {
            return &box != &box_[segments_[i].part] && box.contains(segments_[i].end[0]);
        };
        if (std::any_of(box_.begin(), box_.end(), holds_it)) near_.push_back(i);
    }
    candidates_.clear();
    for (const int i : near_) {
        const Vec2 x = 0.5 * (segments_[i].end[0] + segments_[i].end[1]);
        Candidate candidate{i, -1};
        double nearest = infinity, along = 0.0;
        for (const int j : near_) {
            if (segments_[j].part == segments_[i].part) continue;
            const double distance = distance_squared(j, x, along);
            if (distance < nearest) {
                nearest = distance;
                candidate.nearest = j;
            }
        }
        if (candidate.nearest >= 0) candidates_.push_back(candidate);
    }
}

void PartContact::touch(Candidate& candidate, std::vector<Vec2>& force) {
    const Segment& own = segments_[candidate.facet];
    const Vec2 x = 0.5 * (own.end[0] + own.end[1]);
    const int count = static_cast<int>(segments_.size());
    double nearest = std::numeric_limits<double>::infinity(), along = 0.0;
    for (int j = std::max(0, candidate.nearest - neighbours_looked_at),
             last = std::min(count - 1, candidate.nearest + neighbours_looked_at);
         j <= last; ++j) {
        double place = 0.0;
        const double distance = segments_[j].part == own.part ? nearest : distance_squared(j, x, place);
        if (distance < nearest) {
            nearest = distance;
            candidate.nearest = j;
            along = place;
        }
    }
    const Segment& other = segments_[candidate.nearest];
    const auto& [a, b] = other.end;
    const Vec2 out = a + along * (b - a) - x;
    const double depth = out.norm();
    if (depth == 0.0 || out.dot(outward(candidate.nearest, along)) <= 0.0) return;
    const Vec2 push = own.stiffness * out;
    const Facet& facet = body_.facets[candidate.facet];
    const auto own_node = body_.points.node[facet.point];
    const auto other_node = body_.points.node[body_.facets[candidate.nearest].point];
    for (std::size_t k = 0; k < own_node.size(); ++k) {
        force[own_node[k]] += 0.5 * (own.weight[0][k] + own.weight[1][k]) * push;
        force[other_node[k]] -= ((1.0 - along) * other.weight[0][k] + along * other.weight[1][k]) * push;
    }
    stored_energy_ += 0.5 * own.stiffness * depth * depth;
}

void PartContact::push(const std::vector<Vec2>& displacement, std::vector<Vec2>& force) {
    stored_energy_ = 0.0;
    if (search_.is_due()) {
        double way = 0.0;  // that any facet has gone since the last search [m]
        for (int i = 0; i < static_cast<int>(segments_.size()); ++i) {
            move(i, displacement);
            way = std::max(way, (segments_[i].end[0] - segments_[i].at_search).norm());
            segments_[i].at_search = segments_[i].end[0];
        }
        search_.has_searched(way, part_of_margin * search_margin * body_.layout.cell.minCoeff());
        find_candidates();
    } else {
        for (const int i : near_) move(i, displacement);
    }
    for (Candidate& candidate : candidates_) touch(candidate, force);
}

}  // namespace crampfit

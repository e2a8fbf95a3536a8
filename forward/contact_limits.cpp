#include "forward/contact_limits.hpp"

#include "forward/boundary.hpp"
#include "forward/deformation.hpp"
#include "forward/geometry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

constexpr double counts_as_overlap = 0.5;  // depth of a face in a body [cells]
constexpr double beside = 0.25;            // of a crack there is wood on both sides [cells]
constexpr double deep_in_bonded = 0.25;    // [cells]

// A place on a crack with wood on both sides, as they lie now.
struct Face {
    Vec2 at_rest, left, right;  // [m]
    Vec2 normal;                // unit, from right to left
};

// Those of pairs that the crack has freed.
std::vector<std::pair<int, Face>> faces_of(const Discretisation& body, const CrackFields& cracks,
                                           const std::vector<Vec2>& displacement) {
    const std::vector<double> mass = field_masses(body, cracks.fields());
    const double step = beside * body.layout.cell.minCoeff();
    std::vector<std::pair<int, Face>> found;
    for (const FieldPair& pair : cracks.pairs) {
        if (pair.freed < 1.0 || mass[pair.left] == 0.0 || mass[pair.right] == 0.0) continue;
        const Vec2 node = body.layout.node_position(pair.node);
        const std::vector<Vec2>& line = cracks.lines[pair.crack].points;
        Vec2 foot = line[0];
        for (std::size_t k = 0; k + 1 < line.size(); ++k) {
            const Vec2 there = line[k] + nearest_on_segment(line[k], line[k + 1], node) * (line[k + 1] - line[k]);
            if ((there - node).norm() < (foot - node).norm()) foot = there;
        }
        const int left = body.point_at(foot + step * pair.normal), right = body.point_at(foot - step * pair.normal);
        if (left < 0 || right < 0) continue;
        const Mat2 turn = Polar(gradient_at(body, right, displacement)).turn;
        found.push_back(
            {pair.crack, {foot, foot + displacement[pair.left], foot + displacement[pair.right], turn * pair.normal}});
    }
    return found;
}

std::string in_mm(const Vec2& x) { return fmt::format("x = {:.4g}, y = {:.4g} mm", 1e3 * x.x(), 1e3 * x.y()); }

Vec2 place_of(const Facet& facet, const Discretisation& body, const std::vector<Vec2>& displacement) {
    Vec2 x = facet.position;
    const auto nodes = body.points.node[facet.point];
    for (int i = 0; i < body.layout.nodes_per_cell(); ++i) x += facet.weight[i] * displacement[nodes[i]];
    return x;
}

}  // namespace

std::string beyond_contact(const Scene& scene, const Discretisation& body, const CrackFields& cracks,
                           const std::vector<Vec2>& displacement, const std::vector<Vec2>& moved) {
    const double cell = body.layout.cell.minCoeff();
    const auto faces = faces_of(body, cracks, displacement);
    std::string text;
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        const Body& rigid = scene.bodies[b];
        if (rigid.contact.kind == Contact::Kind::bonded) {
            const bool is_over_wood = std::ranges::any_of(body.facets, [&](const Facet& facet) {
                const Vec2 x = place_of(facet, body, displacement) - moved[b];
                return !inside(rigid.shape, facet.position) && inside(rigid.shape, x) &&
                       nearest_on_outline(rigid.shape, x).distance > deep_in_bonded * cell;
            });
            if (is_over_wood)
                text +=
                    fmt::format("; bodies.{} lies over wood that it did not hold at the start: bonded bodies press on nothing "
                                "else",
                                rigid.name);
            continue;
        }
        for (const auto& [crack, face] : faces) {
            const auto depth = [&](const Vec2& x) {
                const Vec2 there = x - moved[b];
                return inside(rigid.shape, there) ? nearest_on_outline(rigid.shape, there).distance : 0.0;
            };
            if (std::max(depth(face.left), depth(face.right)) < counts_as_overlap * cell) continue;
            text += fmt::format("; bodies.{} lies over faces of cracks.{} by more than half a cell, about {}, which it has not "
                                "opened: do not trust its force",
                                rigid.name, crack, in_mm(face.at_rest));
            break;
        }
    }
    for (int crack = 0; crack < static_cast<int>(scene.cracks.size()); ++crack) {
        double most = 0.0;
        for (const auto& [of, face] : faces) {
            const Vec2 jump = face.left - face.right;
            if (of == crack && jump.dot(face.normal) < 0.0) most = std::max(most, std::abs(jump.dot(left_of(face.normal))));
        }
        if (most > cell)
            text += fmt::format("; faces of cracks.{} that press have slid along each other by up to {:.3g} mm: what faced each "
                                "other at first is taken to press, which with more than a cell of {:.3g} mm is off by tens of "
                                "percent",
                                crack, 1e3 * most, 1e3 * cell);
    }
    return text;
}

}  // namespace crampfit

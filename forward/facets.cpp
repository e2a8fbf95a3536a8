#include "forward/discretisation.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace crampfit {

namespace {

// Wood is looked for this far from an outline, in cells.
constexpr double just_beside = 1e-6;

// A smooth piece of an outline, straight or a whole circle; s is the way along it.
struct Curve {
    Vec2 from, to;  // [m]
    Circle circle;
    bool straight;
    double length;  // [m]
    double inward;  // 1: the specimen lies left of the straight way, or around the circle; -1: right, or in it

    Vec2 position(double s) const {
        if (straight) return from + s / length * (to - from);
        const double angle = s / circle.radius;
        return circle.centre + circle.radius * Vec2(std::cos(angle), std::sin(angle));
    }
    Vec2 normal(double s) const {  // unit, out of the specimen
        if (straight) return -inward * left_of((to - from) / length);
        return inward * (circle.centre - position(s)) / circle.radius;
    }
};

// Smooth pieces of a polygon's outline; the specimen lies in it or around it.
std::vector<Curve> sides_of(const std::vector<Vec2>& points, bool specimen_is_inside) {
    const double inward = (signed_area(points) > 0.0) == specimen_is_inside ? 1.0 : -1.0;
    std::vector<Curve> curves;
    for (std::size_t k = 0; k < points.size(); ++k) {
        const Vec2& a = points[k];
        const Vec2& b = points[(k + 1) % points.size()];
        if (a != b) curves.push_back({a, b, {}, true, (b - a).norm(), inward});
    }
    return curves;
}

std::vector<Curve> outline_of(const Shape& shape, bool specimen_is_inside) {
    if (const auto* circle = std::get_if<Circle>(&shape))
        return {{Vec2::Zero(), Vec2::Zero(), *circle, false, 2.0 * std::numbers::pi * circle->radius,
                 specimen_is_inside ? -1.0 : 1.0}};
    return sides_of(std::get<Polygon>(shape).points, specimen_is_inside);
}

struct Stretch {
    double begin, end;  // along a curve [m]
};

// The stretches of a curve that are surface. None shorter than `step` is sure to be seen; their ends are found by bisection.
template <class IsSurface>
std::vector<Stretch> stretches(double length, double step, IsSurface is_surface) {
    constexpr int bisections = 40;
    const int steps = std::max(1, static_cast<int>(std::ceil(length / step)));
    std::vector<Stretch> found;
    double before = 0.0;
    bool was_surface = false;
    for (int k = 0; k <= steps; ++k) {
        // The ends themselves may lie in a corner, which belongs to nobody.
        const double s = std::clamp(static_cast<double>(k) / steps, 1e-6 / steps, 1.0 - 1e-6 / steps) * length;
        const bool here = is_surface(s);
        if (here != was_surface) {
            double low = before, high = s;
            for (int i = 0; i < bisections; ++i) (is_surface(0.5 * (low + high)) == here ? high : low) = 0.5 * (low + high);
            if (here) found.push_back({k == 0 ? 0.0 : high, length});
            else found.back().end = low;
        }
        before = s;
        was_surface = here;
    }
    return found;
}

}  // namespace

// The point whose domain holds x. Where none is, the nearest one of the same cell or, if that has none, of the neighbourhood; or
// -1.
int Discretisation::point_beside(const Vec2& x) const {
    if (const int own = point_at(x); own >= 0) return own;
    int nearest = -1;
    const auto consider = [&](int p) {
        const auto distance = [&](int q) { return (points.position[q] - x).squaredNorm(); };
        if (p >= 0 && (nearest < 0 || distance(p) < distance(nearest))) nearest = p;
    };
    const int c = layout.cell_at(x);
    for (int p = points.first_of_cell[c]; p < points.first_of_cell[c + 1]; ++p) consider(p);
    if (nearest >= 0) return nearest;
    for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) consider(point_at(x + layout.point_size().cwiseProduct(Vec2(i, j))));
    return nearest;
}

void Discretisation::add_facet(int p, const Vec2& position, double length, const Vec2& normal) {
    // Next to a cell that has no point it goes on as the cell of its point does.
    facets.push_back({p, position, length, normal, values_at(points.cell[p], position)});
}

void Discretisation::find_facets(const Scene& scene) {
    const auto& cutouts = scene.specimen.cutouts;
    const Vec2 size = layout.size();
    const Box rectangle{Vec2::Zero(), size};
    const double beside = just_beside * layout.cell.minCoeff();
    // A facet may be longer by a hair: where last digits of the specimen's size make cells a little narrower one way, those along
    // their other side are still as many.
    constexpr double hair = 1e-6;  // of its length
    const double step = facet_in_points * layout.point_size().minCoeff();
    const auto cut_by_first = [&](std::size_t count, const Vec2& x) {
        const auto end = cutouts.begin() + static_cast<std::ptrdiff_t>(count);
        return std::any_of(cutouts.begin(), end, [&](const Shape& s) { return inside(s, x); });
    };
    // Where the outlines of two cutouts fall together, the earlier one has the facets; where a part's falls on the rectangle's
    // side or on a cutout, that has them.
    const auto add_curve = [&](const Curve& curve, std::size_t earlier, bool of_part) {
        const auto is_surface = [&](double s) {
            const Vec2 in = curve.position(s) - beside * curve.normal(s);
            const Vec2 out = curve.position(s) + beside * curve.normal(s);
            if (of_part && (!rectangle.contains(out) || has_wood(scene.specimen, out))) return false;
            return rectangle.contains(in) && has_wood(scene.specimen, in) && !cut_by_first(earlier, out);
        };
        for (const auto& [begin, end] : stretches(curve.length, step, is_surface)) {
            const int count = std::max(1, static_cast<int>(std::ceil((1.0 - hair) * (end - begin) / step)));
            for (int k = 0; k < count; ++k) {
                const double s = begin + (k + 0.5) / count * (end - begin);
                const int p = point_beside(curve.position(s) - beside * curve.normal(s));
                if (p >= 0) add_facet(p, curve.position(s), (end - begin) / count, curve.normal(s));
            }
        }
    };
    for (const Curve& side : sides_of({Vec2::Zero(), Vec2(size.x(), 0.0), size, Vec2(0.0, size.y())}, true))
        add_curve(side, 0, false);
    for (std::size_t k = 0; k < cutouts.size(); ++k)
        for (const Curve& curve : outline_of(cutouts[k], false)) add_curve(curve, k, false);
    for (const Part& part : scene.specimen.parts)
        for (const Curve& curve : outline_of(part.shape, true)) add_curve(curve, cutouts.size(), true);
    add_void_facets(scene.specimen);
}

// The voids of a picture have no smooth outline: there the points' own faces are the surface.
void Discretisation::add_void_facets(const SpecimenPlan& specimen) {
    if (points.lattice.size() == static_cast<std::size_t>(points.count())) return;  // there are none
    const Box rectangle{Vec2::Zero(), layout.size()};
    const Vec2 size = layout.point_size();
    for (int p = 0; p < points.count(); ++p) {
        for (const auto& [step_x, step_y] : {std::pair{0, -1}, {1, 0}, {0, 1}, {-1, 0}}) {
            const Vec2 normal(step_x, step_y);
            const Vec2 centre = domain(p).low + 0.5 * size;
            const Vec2 next = centre + size.cwiseProduct(normal);
            if (neighbour(p, step_x, step_y) >= 0 || !rectangle.contains(next)) continue;
            if (!has_wood(specimen, next)) continue;
            add_facet(p, 0.5 * (centre + next), step_x != 0 ? size.y() : size.x(), normal);
        }
    }
}

}  // namespace crampfit

#include "forward/discretisation.hpp"

#include "datasets/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace crampfit {

namespace {

// A point that cutouts leave less of than this is left out: next to nothing would hold what pushes on it.
constexpr double least_share = 0.02;

// What cutouts and parts leave of an upright rectangle.
struct Remainder {
    double share;  // of its area
    Vec2 middle;   // [m]
};

class Extent {
  public:
    explicit Extent(const SpecimenPlan& specimen) : specimen_(specimen), outlines_(specimen.cutouts) {
        for (const Part& part : specimen.parts) outlines_.push_back(part.shape);
        for (const Shape& shape : outlines_) boxes_.push_back(bounds(shape));
    }

    Remainder leave_of(const Box& box) const {
        std::vector<const Shape*> near;
        const Vec2 centre = 0.5 * (box.low + box.high);
        const Vec2 size = box.high - box.low;
        for (std::size_t k = 0; k < outlines_.size(); ++k)
            if (boxes_[k].touches(box)) near.push_back(&outlines_[k]);
        const auto takes = [&](const Vec2& x) { return !has_wood(specimen_, x); };
        if (near.empty()) return {specimen_.parts.empty() ? 1.0 : 0.0, centre};
        const bool crossed = std::any_of(near.begin(), near.end(), [&](const Shape* s) {
            return nearest_on_outline(*s, centre).distance < 0.5 * size.norm();
        });
        if (!crossed) return {takes(centre) ? 0.0 : 1.0, centre};
        constexpr int samples = 16;  // a side
        int left = 0;
        Vec2 sum = Vec2::Zero();
        for (int j = 0; j < samples; ++j) {
            for (int i = 0; i < samples; ++i) {
                const Vec2 x = box.low + size.cwiseProduct(Vec2(i + 0.5, j + 0.5)) / samples;
                if (takes(x)) continue;
                ++left;
                sum += x;
            }
        }
        return {static_cast<double>(left) / (samples * samples), left > 0 ? Vec2(sum / left) : centre};
    }

  private:
    const SpecimenPlan& specimen_;
    std::vector<Shape> outlines_;  // of cutouts and parts
    std::vector<Box> boxes_;
};

int part_at(const std::vector<Part>& parts, const Vec2& x) {
    const auto distance = [&](const Part& part) {
        return inside(part.shape, x) ? 0.0 : nearest_on_outline(part.shape, x).distance;
    };
    return static_cast<int>(
        std::min_element(parts.begin(), parts.end(), [&](const Part& a, const Part& b) { return distance(a) < distance(b); }) -
        parts.begin());
}

// Stress zz per stress xx, yy, xy in plane strain.
Eigen::Vector3d stress_out_of_plane(const LocalWood& wood) {
    const Vec2& n = wood.elasticity.normal;
    const double across = wood.poisson_ratios[0], along = wood.poisson_ratios[1];
    return {across * n.x() * n.x() + along * n.y() * n.y(), across * n.y() * n.y() + along * n.x() * n.x(),
            2.0 * (across - along) * n.x() * n.y()};
}

}  // namespace

// With four points a cell that takes more memory than a machine has: a cell in the wrong unit.
constexpr double most_cells = 1e9;

Layout Layout::of(const Scene& scene) {
    if (!(scene.model.cell > 0.0))
        throw InputError(scene.file.string(), "model.error", std::to_string(scene.model.error),
                         "the cell is chosen for a single simulation only; runs that are compared share a grid: give model.cell");
    return of(scene, Vec2::Constant(scene.model.cell));
}

Layout Layout::of(const Scene& scene, const Vec2& cell) {
    Layout layout;
    if (const double cells = scene.specimen.size.cwiseQuotient(cell).prod(); !(cells <= most_cells))
        throw InputError(scene.file.string(), "model.cell", fmt::format("{:g} mm", 1e3 * cell.minCoeff()),
                         fmt::format("makes {:.3g} cells of this specimen: must make {:g} at most", cells, most_cells));
    const auto count = [&](int axis) {
        return std::max(1, static_cast<int>(std::lround(scene.specimen.size[axis] / cell[axis])));
    };
    layout.cells_x = count(0);
    layout.cells_y = count(1);
    layout.cell = {scene.specimen.size.x() / layout.cells_x, scene.specimen.size.y() / layout.cells_y};
    layout.degree = scene.solver.shape_function == ShapeFunction::bspline2 ? 2 : 1;
    layout.per_side = static_cast<int>(std::lround(std::sqrt(scene.model.points_per_cell)));
    layout.thickness = scene.model.thickness;
    return layout;
}

int Layout::cell_at(const Vec2& x) const {
    const int i = std::clamp(static_cast<int>(std::floor(x.x() / cell.x())), 0, cells_x - 1);
    const int j = std::clamp(static_cast<int>(std::floor(x.y() / cell.y())), 0, cells_y - 1);
    return cell_index(i, j);
}

Box Layout::support(int node) const {
    // The nodes that a cell sees begin with those of its own number along each axis.
    const Vec2 last = cell.cwiseProduct(Vec2(node % nodes_x() + 1, node / nodes_x() + 1));
    return {last - (degree + 1) * cell, last};
}

namespace {

// Kinds of cells along an axis that see different B-splines: those before whose first or beyond whose last knot the grid ends.
constexpr int kinds_of_cells = 4;
int kind_of_cell(int i, int cells) { return (i == 0 ? 1 : 0) + (i == cells - 1 ? 2 : 0); }
CellEnds ends_of_kind(int kind) { return {(kind & 1) != 0, (kind & 2) != 0}; }

}  // namespace

Discretisation::Discretisation(const Scene& scene, const MaterialMap& materials, const Layout& grid) : layout(grid) {
    const ShapeFunction kind = scene.solver.shape_function;
    find_weights(kind == ShapeFunction::automatic ? ShapeFunction::gimp : kind);
    place_points(scene, materials);
    if (points.count() == 0)
        throw InputError(scene.file.string(), scene.specimen.cutouts.empty() ? "specimen" : "specimen.cutouts", "(all of it)",
                         "no material is left: cutouts or void cover it all");
    if (!points.part.empty()) check_parts(scene);
    find_facets(scene);
    if (!materials.homogeneous()) mark_changes();
}

void Discretisation::find_weights(ShapeFunction kind) {
    const Vec2 size = layout.point_size();
    for (int cells = 0; cells < (layout.degree == 1 ? 1 : kinds_of_cells * kinds_of_cells); ++cells) {
        for (int place = 0; place < layout.points_per_cell(); ++place) {
            const Vec2 x = size.cwiseProduct(Vec2(place % layout.per_side + 0.5, place / layout.per_side + 0.5));
            weights.push_back(cell_weights(kind, x, layout.cell, 0.5 * size,
                                           {ends_of_kind(cells % kinds_of_cells), ends_of_kind(cells / kinds_of_cells)}));
            if (cells == 0) corner_weights.push_back(cell_weights(ShapeFunction::linear, x, layout.cell, 0.5 * size));
        }
    }
}

std::array<double, most_nodes> Discretisation::values_at(int c, const Vec2& x) const {
    const Vec2 place = x - layout.cell_corner(c);
    if (layout.degree == 1) {
        const Vec2 r = place.cwiseQuotient(layout.cell);
        const Vec2 l = Vec2::Ones() - r;
        return {l.x() * l.y(), r.x() * l.y(), l.x() * r.y(), r.x() * r.y()};
    }
    const std::array<CellEnds, 2> ends{ends_of_kind(kind_of_cell(c % layout.cells_x, layout.cells_x)),
                                       ends_of_kind(kind_of_cell(c / layout.cells_x, layout.cells_y))};
    return cell_weights(ShapeFunction::bspline2, place, layout.cell, {}, ends).value;
}

std::array<Vec2, 4> Discretisation::slopes_at(int c, const Vec2& x) const {
    const Vec2& cell = layout.cell;
    const Vec2 r = (x - layout.cell_corner(c)).cwiseQuotient(cell);
    return {Vec2((r.y() - 1.0) / cell.x(), (r.x() - 1.0) / cell.y()), Vec2((1.0 - r.y()) / cell.x(), -r.x() / cell.y()),
            Vec2(-r.y() / cell.x(), (1.0 - r.x()) / cell.y()), Vec2(r.y() / cell.x(), r.x() / cell.y())};
}

std::span<const Sliver> Discretisation::slivers_of(int first, int last) const {
    const auto from = std::ranges::lower_bound(slivers, points.first_of_cell[first], {}, &Sliver::point);
    const auto to = std::ranges::lower_bound(from, slivers.end(), points.first_of_cell[last], {}, &Sliver::point);
    return {from, to};
}

std::optional<Discretisation::Rest> Discretisation::rest_of_cell(int c) const {
    if (slivers.empty() || !cell_is_full_[c]) return std::nullopt;
    const std::span<const Sliver> here = slivers_of(c, c + 1);
    if (here.empty() || !points_are_together(c)) return std::nullopt;
    Rest rest{1.0, Vec2::Constant(0.5)};
    for (const Sliver& sliver : here) {
        const double share = sliver.share / layout.points_per_cell();
        rest.share -= share;
        rest.middle -= share * (sliver.position - layout.cell_corner(c)).cwiseQuotient(layout.cell);
    }
    rest.middle /= rest.share;
    return rest;
}

void Discretisation::mark_changes() {
    points.changes.assign(points.count(), Change::none);
    for (int p = 0; p < points.count(); ++p) {
        for (const auto& [step_x, step_y] : {std::pair{0, -1}, {1, 0}, {0, 1}, {-1, 0}}) {
            const int other = neighbour(p, step_x, step_y);
            if (other >= 0) points.changes[p] = std::max(points.changes[p], change_between(p, other));
        }
    }
}

Change Discretisation::change_between(int p, int other) const {
    constexpr double rounding = 1e-9;
    if (!points.layers.empty()) {
        const Eigen::Vector4d change = points.layers[other] - points.layers[p];
        return change.cwiseQuotient(points.layers[p]).cwiseAbs().maxCoeff() > rounding ? Change::wood : Change::none;
    }
    // The two linear invariants of a plane stiffness do not feel the grain's direction. Averaged over a cell, grain that turns
    // changes them by the square of its turn within the cell, which is no other wood.
    constexpr double no_other_wood = 0.01;
    const Eigen::Matrix3d here = points.stiffness_of(p), there = points.stiffness_of(other);
    const double bulk = here(0, 0) + here(1, 1) + 2.0 * here(0, 1),
                 shear = here(0, 0) + here(1, 1) - 2.0 * here(0, 1) + 4.0 * here(2, 2);
    const double other_bulk = there(0, 0) + there(1, 1) + 2.0 * there(0, 1);
    const double other_shear = there(0, 0) + there(1, 1) - 2.0 * there(0, 1) + 4.0 * there(2, 2);
    if (std::abs(other_bulk - bulk) > no_other_wood * bulk || std::abs(other_shear - shear) > no_other_wood * shear)
        return Change::wood;
    return (there - here).norm() > rounding * here.norm() ? Change::grain : Change::none;
}

// Wood is averaged over the cell and not over each point: within a cell the strain can hardly jump from point to point, and
// layers that share it would act too stiff across. Where in the cell each wood lies is told apart (`uneven_cells`).
LocalWood Discretisation::wood_of_cell(const MaterialMap& materials, int c) const {
    WoodArea area = area_of_cell(c);
    return materials.average(area);
}

namespace {

// Of places in so many points a side, for the same second moment.
Vec2 spread_of(const Vec2& points) { return (1.0 - points.array().square().inverse()).sqrt(); }

}  // namespace

Unevenness Discretisation::unevenness_of(const MaterialMap& materials, WoodArea& cell, const LocalWood& average) const {
    return materials.unevenness(cell, average, Vec2::Ones());
}

Unevenness Discretisation::unevenness_of(const MaterialMap& materials, int c, const PointBox& box,
                                         const LocalWood& average) const {
    const Vec2 wide(box.to_x - box.from_x, box.to_y - box.from_y);
    const Vec2 half = 0.5 * wide.cwiseProduct(layout.point_size());
    WoodArea area{layout.cell_corner(c) + layout.point_size().cwiseProduct(Vec2(box.from_x, box.from_y)) + half, half};
    return materials.unevenness(area, average, spread_of(wide));
}

void Discretisation::place_points(const Scene& scene, const MaterialMap& materials) {
    const Vec2 size = layout.point_size();
    const int columns = layout.cells_x * layout.per_side;
    points.lattice.assign(static_cast<std::size_t>(columns) * layout.cells_y * layout.per_side, -1);
    points.first_of_cell.reserve(layout.cells() + 1);
    points.node = PointTable<int>(layout.nodes_per_cell());
    const double whole = layout.cell.prod() * layout.thickness;
    cell_is_full_.assign(layout.cells(), false);
    const Extent extent(scene.specimen);
    for (int c = 0; c < layout.cells(); ++c) {
        points.first_of_cell.push_back(points.count());
        WoodArea area = area_of_cell(c);
        const LocalWood wood = materials.average(area);
        const Eigen::Matrix3d C = wood.elasticity.stiffness();
        points.stiffness.push_back({C(0, 0), C(0, 1), C(1, 1), C(2, 2), C(0, 2), C(1, 2)});
        points.moduli.push_back(wood.filled > 0.0 ? uniaxial_moduli(C) : Vec2::Zero());
        const auto nodes = layout.cell_nodes(c);
        const int kind =
            kind_of_cell(c % layout.cells_x, layout.cells_x) + kinds_of_cells * kind_of_cell(c / layout.cells_x, layout.cells_y);
        const int first_slot = layout.degree == 1 ? 0 : kind * layout.points_per_cell();
        double filled = 0.0;
        for (int slot = 0; slot < layout.points_per_cell(); ++slot) {
            const int column = c % layout.cells_x * layout.per_side + slot % layout.per_side;
            const int row = c / layout.cells_x * layout.per_side + slot / layout.per_side;
            const Vec2 corner = size.cwiseProduct(Vec2(column, row));
            const auto [share, x] = extent.leave_of({corner, corner + size});
            if (share < least_share) continue;
            if (!materials.has_wood_at(x)) continue;
            points.lattice[static_cast<std::size_t>(row) * columns + column] = points.count();
            points.position.push_back(x);
            points.cell.push_back(c);
            points.slot.push_back(static_cast<std::uint16_t>(first_slot + slot));
            points.node.add({nodes.data(), static_cast<std::size_t>(layout.nodes_per_cell())});
            if (!materials.homogeneous() && !materials.orthotropic())
                points.layers.push_back(wood.elasticity.coefficients.head<4>());
            points.volume.push_back(share * size.prod() * layout.thickness);
            points.mass.push_back(wood.density * points.volume.back());
            if (materials.orthotropic()) points.out_of_plane.push_back(stress_out_of_plane(wood));
            else points.poisson_ratio.push_back(wood.poisson_ratios[0]);
            points.latewood.push_back(static_cast<float>(wood.latewood));
            if (!scene.specimen.parts.empty()) points.part.push_back(part_at(scene.specimen.parts, x));
            filled += points.volume.back();
        }
        cell_is_full_[c] = filled > (1.0 - 1e-9) * whole;
        if (!cell_is_full_[c] || !wood.mixed || layout.degree > 1) continue;
        const Unevenness uneven = unevenness_of(materials, area, wood);
        if (!uneven.isZero()) uneven_cells.push_back({c, uneven});
    }
    points.first_of_cell.push_back(points.count());
}

// Parts that share a node would move together there.
void Discretisation::check_parts(const Scene& scene) const {
    std::vector<int> part(layout.nodes(), -1);
    for (int p = 0; p < points.count(); ++p) {
        for (const int node : points.node[p]) {
            int& known = part[node];
            if (known >= 0 && known != points.part[p])
                throw InputError(scene.file.string(), "specimen.parts",
                                 std::to_string(known) + " and " + std::to_string(points.part[p]),
                                 "two parts must lie " + std::to_string(layout.degree + 1) +
                                     " cells apart at the least, or make up one shape");
            known = points.part[p];
        }
    }
}

bool Discretisation::points_are_together(int c) const {
    const int first = points.first_of_cell[c];
    for (int p = first + 1; p < points.first_of_cell[c + 1]; ++p)
        if (!points.node.same(p, first)) return false;
    return true;
}

bool Discretisation::cell_is_whole(int c) const {
    return cell_is_full_[c] && points_are_together(c) && (slivers.empty() || slivers_of(c, c + 1).empty());
}

const Unevenness* Discretisation::unevenness_of_whole(int c) const {
    const auto found = std::ranges::lower_bound(uneven_cells, c, {}, &UnevenCell::cell);
    return found != uneven_cells.end() && found->cell == c && cell_is_whole(c) ? &found->wood : nullptr;
}

int Discretisation::point_at(const Vec2& x) const {
    const Vec2 place = x.cwiseQuotient(layout.point_size());
    const int columns = layout.cells_x * layout.per_side;
    const int rows = layout.cells_y * layout.per_side;
    const int column = static_cast<int>(std::floor(place.x()));
    const int row = static_cast<int>(std::floor(place.y()));
    if (column < 0 || row < 0 || column >= columns || row >= rows) return -1;
    return points.lattice[static_cast<std::size_t>(row) * columns + column];
}

int Discretisation::neighbour(int p, int step_x, int step_y) const {
    return point_at(points.position[p] + layout.point_size().cwiseProduct(Vec2(step_x, step_y)));
}

}  // namespace crampfit

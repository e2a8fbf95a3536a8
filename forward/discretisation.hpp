#pragma once

#include "forward/geometry.hpp"
#include "forward/material_map.hpp"
#include "forward/shape_functions.hpp"

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace crampfit {

/// How grid and points lie in the specimen. The grid fits the specimen exactly: the asked spacing is rounded, each way on its
/// own, so that sides lie on grid lines. Cells and nodes are counted row by row from the lower left corner. Nodes are the cells'
/// corners, or, for quadratic B-splines, the places where a line's coefficients are its values (Greville): the middles of cells,
/// and the grid's ends.
struct Layout {
    int cells_x = 0;
    int cells_y = 0;
    int degree = 1;        // of the shape functions along an axis; 2: B-splines
    int per_side = 0;      // points along one side of a cell
    Vec2 cell;             // grid spacing in x and y [m]
    double thickness = 0;  // [m]

    /// With cells about as wide as these, or as the scene says [m]: a whole number of them fits the specimen.
    static Layout of(const Scene& scene, const Vec2& cell);
    static Layout of(const Scene& scene);

    int cells() const { return cells_x * cells_y; }
    int nodes_x() const { return cells_x + degree; }
    int nodes_y() const { return cells_y + degree; }
    int nodes() const { return nodes_x() * nodes_y(); }
    int nodes_per_cell() const { return (degree + 1) * (degree + 1); }
    int points_per_cell() const { return per_side * per_side; }
    Vec2 point_size() const { return cell / per_side; }
    Vec2 size() const { return {cells_x * cell.x(), cells_y * cell.y()}; }
    int cell_index(int i, int j) const { return j * cells_x + i; }
    int node_index(int i, int j) const { return j * nodes_x() + i; }
    Vec2 node_position(int node) const {
        return {place_of_node(node % nodes_x(), cells_x) * cell.x(), place_of_node(node / nodes_x(), cells_y) * cell.y()};
    }
    /// Where the shape function of a node is not zero; may reach beyond the specimen.
    Box support(int node) const;
    Vec2 cell_corner(int c) const { return {(c % cells_x) * cell.x(), (c / cells_x) * cell.y()}; }
    /// The nodes that a cell sees, row by row: the first `nodes_per_cell()` of these.
    std::array<int, most_nodes> cell_nodes(int c) const {
        std::array<int, most_nodes> nodes{};
        const int corner = node_index(c % cells_x, c / cells_x);
        for (int k = 0; k < nodes_per_cell(); ++k) nodes[k] = corner + k / (degree + 1) * nodes_x() + k % (degree + 1);
        return nodes;
    }
    /// The cell that holds x; the nearest one for a place outside.
    int cell_at(const Vec2& x) const;

  private:
    // In cells, of node i along an axis of so many cells.
    double place_of_node(int i, int cells) const {
        return degree == 1 ? i : std::clamp(i - 0.5, 0.0, static_cast<double>(cells));
    }
};

/// So many values a point, one row each.
template <class Value>
class PointTable {
  public:
    explicit PointTable(int width = 0) : width_(width) {}

    std::span<Value> operator[](int p) { return {values_.data() + static_cast<std::size_t>(p) * width_, width_}; }
    std::span<const Value> operator[](int p) const { return {values_.data() + static_cast<std::size_t>(p) * width_, width_}; }
    bool same(int p, int q) const {
        const Value *a = &values_[p * width_], *b = &values_[q * width_];
        std::size_t k = 0;
        while (k < width_ && a[k] == b[k]) ++k;
        return k == width_;
    }
    void resize(int points) { values_.resize(static_cast<std::size_t>(points) * width_); }
    void add(std::span<const Value> row) { values_.insert(values_.end(), row.begin(), row.end()); }

  private:
    std::size_t width_;
    std::vector<Value> values_;
};

/// How the wood differs between neighbouring points: not at all, by the direction of its grain alone, or in its constants.
enum class Change : std::uint8_t { none, grain, wood };

/// Points of a cell, counted along x and y from its lower left corner: from .. to - 1.
struct PointBox {
    int from_x, from_y, to_x, to_y;
    auto operator<=>(const PointBox&) const = default;
};

/// Material points in the undeformed specimen, in cell order: those of cell c are first_of_cell[c] .. first_of_cell[c + 1]. What
/// a cutout takes of a point's domain is taken off its volume.
struct Points {
    std::vector<Vec2> position;  // middle of what is left of its domain [m]
    std::vector<int> cell;
    std::vector<std::uint16_t> slot;               // which of the discretisation's `weights` are its own
    PointTable<int> node;                          // the velocity fields it belongs to at the nodes that its cell sees
    std::vector<std::array<double, 6>> stiffness;  // [cells] stress from strain: xx,xx; xx,yy; yy,yy; xy,xy; xx,xy; yy,xy [Pa]
    std::vector<Vec2> moduli;                      // [cells] of it, `uniaxial_moduli` [Pa]
    std::vector<Eigen::Vector4d>
        layers;                         // coefficients of LayeredElasticity; empty where all wood is the same or some orthotropic
    std::vector<double> volume;         // [m^3]
    std::vector<double> mass;           // [kg]
    std::vector<double> poisson_ratio;  // for the stress out of the plane; empty where some wood is orthotropic
    std::vector<Eigen::Vector3d> out_of_plane;  // there: stress zz per stress xx, yy, xy in plane strain
    std::vector<float> latewood;                // 0..1, for pictures
    std::vector<int> part;                      // of the specimen's parts; empty where it has none
    std::vector<Change> changes;                // from a neighbouring point to this one; empty: nowhere
    std::vector<int> first_of_cell;             // [cells + 1]
    std::vector<int> lattice;                   // [rows x columns of point places] point there, or -1

    int count() const { return static_cast<int>(position.size()); }
    Eigen::Matrix3d stiffness_of(int p) const {
        const auto& c = stiffness[cell[p]];
        Eigen::Matrix3d C;
        C << c[0], c[1], c[4], c[1], c[2], c[5], c[4], c[5], c[3];
        return C;
    }
    double density(int p) const { return mass[p] / volume[p]; }
    double stiffest(int p) const { return std::max(stiffness[cell[p]][0], stiffness[cell[p]][2]); }  // of both axes [Pa]
};

/// What a crack cuts off the domain of a point that lies on its other side. It moves with fields of its own, at a place of its
/// own. The point counts for so much less, and at the middle of what is left.
struct Sliver {
    int point;
    double share;             // of the point's volume
    Vec2 position;            // its middle, undeformed [m]
    Vec2 moments;             // second ones about its middle, of x and y, over its area [m^2]
    Vec2 low, high;           // its bounds [m]
    std::array<int, 4> node;  // the velocity fields it belongs to at the nodes that the point's cell sees

    /// Of what is left of the point.
    Vec2 middle_of_rest(const Vec2& middle) const { return (middle - share * position) / (1.0 - share); }

    bool operator==(const Sliver&) const = default;
};

/// A short piece of the specimen's surface: of its sides, or of a cutout's true outline and not of the staircase of the points.
/// Together they are as long as the surface. It moves with the cell that it lies in, so that the surface stays in one piece.
struct Facet {
    int point;                              // of its cell, near it: knows the fields
    Vec2 position;                          // its middle, undeformed [m]
    double length;                          // [m]
    Vec2 normal;                            // unit, out of the specimen
    std::array<double, most_nodes> weight;  // of the nodes that the point's cell sees
};

/// Facets are this part of a point's size at most: a body that rolls from one to the next then feels no step. With wheels
/// five to twenty cells across on flanks of slope 2 (the wedge sample, 0.2 to 0.05 mm cells) the force scatters by 6 % with half a
/// point, by 1.3 % with a quarter and by 0.7 % with an eighth.
inline constexpr double facet_in_points = 0.125;

/// Points, grid layout and shape functions: what both solvers share. In the undeformed specimen a point stays in its cell for
/// good (total Lagrangian form; de Vaucorbeil, Nguyen and Hutchinson 2020), so the weights are those of a few places in a cell.
class Discretisation {
  public:
    /// Throws InputError when no point is left.
    Discretisation(const Scene& scene, const MaterialMap& materials) : Discretisation(scene, materials, Layout::of(scene)) {}
    Discretisation(const Scene& scene, const MaterialMap& materials, const Layout& grid);

    Layout layout;
    Points points;
    std::vector<CellWeights>
        weights;  // by slot: places in a cell row by row and, for B-splines, for each kind of cell (`cell_ends`)
    std::vector<CellWeights> corner_weights;  // linear, by place in a cell: of what is given at the cells' corners
    std::vector<Facet> facets;
    struct UnevenCell {
        int cell;
        Unevenness wood;
    };
    std::vector<Sliver> slivers;           // by point; at equilibrium only
    std::vector<UnevenCell> uneven_cells;  // full cells of more than one wood, in order; none with B-splines

    Box domain(int p) const {  // of a point, whatever cutouts take of it
        const int place = place_of(p);
        const Vec2 corner = layout.point_size().cwiseProduct(Vec2(place % layout.per_side, place / layout.per_side));
        const Vec2 low = layout.cell_corner(points.cell[p]) + corner;
        return {low, low + layout.point_size()};
    }
    int place_of(int p) const { return points.slot[p] % layout.points_per_cell(); }  // in its cell, row by row
    /// Shape functions of the nodes that a cell sees at x, which may lie outside the cell: they go on as they do in it.
    std::array<double, most_nodes> values_at(int c, const Vec2& x) const;
    /// Slopes of the corners' bilinear functions at x [1/m].
    std::array<Vec2, 4> slopes_at(int c, const Vec2& x) const;
    /// The slivers of the points of cells `first` .. `last` - 1.
    std::span<const Sliver> slivers_of(int first, int last) const;
    struct Rest {      // that slivers leave of a cell
        double share;  // of the cell
        Vec2 middle;   // in cells from the cell's lower left corner
    };
    /// Of a full cell with slivers whose points all have the same fields; nothing for other cells.
    std::optional<Rest> rest_of_cell(int c) const;
    bool cell_is_full(int c) const { return cell_is_full_[c]; }  // nothing of it is cut out or void
    bool cell_is_whole(int c) const;                             // full, and no crack between its points
    const Unevenness* unevenness_of_whole(int c) const;          // null where a cell is cut, or of one wood
    int point_at(const Vec2& x) const;                           // the point whose domain holds x, or -1
    WoodArea area_of_cell(int c) const { return {layout.cell_corner(c) + 0.5 * layout.cell, 0.5 * layout.cell}; }
    LocalWood wood_of_cell(const MaterialMap& materials, int c) const;                                       // on average
    Unevenness unevenness_of(const MaterialMap& materials, WoodArea& cell, const LocalWood& average) const;  // of a full one
    Unevenness unevenness_of(const MaterialMap& materials, int c, const PointBox& box,
                             const LocalWood& average) const;  // a piece of a full cell
    int neighbour(int p, int step_x, int step_y) const;        // the point that many places away, or -1

    /// Calls `visit(c)` for every cell that a square of half width `reach` about x touches.
    template <class Visit>
    void for_cells_near(const Vec2& x, double reach, Visit visit) const {
        for_cells_in({x.array() - reach, x.array() + reach}, visit);
    }

    /// The same for a box.
    template <class Visit>
    void for_cells_in(const Box& box, Visit visit) const {
        const int low = layout.cell_at(box.low);
        const int high = layout.cell_at(box.high);
        for (int j = low / layout.cells_x; j <= high / layout.cells_x; ++j)
            for (int i = low % layout.cells_x; i <= high % layout.cells_x; ++i) visit(layout.cell_index(i, j));
    }

    /// Calls `visit(p)` for every point of the cells of which a box holds half or more.
    template <class Visit>
    void for_points_in(const Box& box, Visit visit) const {
        for_cells_in({box.low + 0.5 * layout.cell, box.high - 0.5 * layout.cell}, [&](int c) {
            for (int p = points.first_of_cell[c]; p < points.first_of_cell[c + 1]; ++p) visit(p);
        });
    }

  private:
    bool points_are_together(int c) const;  // on the same fields
    void find_weights(ShapeFunction kind);
    void check_parts(const Scene& scene) const;
    void mark_changes();
    Change change_between(int p, int other) const;
    void place_points(const Scene& scene, const MaterialMap& materials);
    int point_beside(const Vec2& x) const;
    void add_facet(int p, const Vec2& position, double length, const Vec2& normal);
    void add_void_facets(const SpecimenPlan& specimen);
    void find_facets(const Scene& scene);

    std::vector<bool> cell_is_full_;
};

}  // namespace crampfit

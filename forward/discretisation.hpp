#pragma once

#include "forward/geometry.hpp"
#include "forward/material_map.hpp"
#include "forward/shape_functions.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace crampfit {

/// How grid and points lie in the specimen. The grid fits the specimen exactly: the asked spacing is rounded, each way on its
/// own, so that sides lie on grid lines. Cells and nodes are counted row by row from the lower left corner.
struct Layout {
    int cells_x = 0;
    int cells_y = 0;
    int per_side = 0;  // points along one side of a cell
    Vec2 cell;         // grid spacing in x and y [m]
    double thickness = 0;  // [m]

    static Layout of(const Scene& scene);

    int cells() const { return cells_x * cells_y; }
    int nodes() const { return (cells_x + 1) * (cells_y + 1); }
    int points_per_cell() const { return per_side * per_side; }
    Vec2 point_size() const { return cell / per_side; }
    Vec2 size() const { return {cells_x * cell.x(), cells_y * cell.y()}; }
    int cell_index(int i, int j) const { return j * cells_x + i; }
    int node_index(int i, int j) const { return j * (cells_x + 1) + i; }
    Vec2 node_position(int node) const {
        return {(node % (cells_x + 1)) * cell.x(), (node / (cells_x + 1)) * cell.y()};
    }
    Vec2 cell_corner(int c) const { return {(c % cells_x) * cell.x(), (c / cells_x) * cell.y()}; }
    std::array<int, 4> cell_nodes(int c) const {
        const int corner = node_index(c % cells_x, c / cells_x);
        return {corner, corner + 1, corner + cells_x + 1, corner + cells_x + 2};
    }
    /// The cell that holds x; the nearest one for a place outside.
    int cell_at(const Vec2& x) const;
};

/// How the wood differs between neighbouring points: not at all, by the direction of its grain alone, or in its constants.
enum class Change : std::uint8_t { none, grain, wood };

/// Material points in the undeformed specimen, in cell order: those of cell c are first_of_cell[c] .. first_of_cell[c + 1]. What
/// a cutout takes of a point's domain is taken off its volume.
struct Points {
    std::vector<Vec2> position;              // middle of what is left of its domain [m]
    std::vector<int> cell;
    std::vector<std::uint8_t> slot;          // which place in its cell, row by row
    std::vector<std::array<int, 4>> node;    // the velocity fields it belongs to at its cell's four nodes
    std::array<std::vector<double>, 6> stiffness;  // stress from strain: xx,xx; xx,yy; yy,yy; xy,xy; xx,xy; yy,xy [Pa]
    std::vector<Eigen::Vector4d> layers;     // coefficients of LayeredElasticity; empty where all wood is the same or some orthotropic
    std::vector<double> volume;              // [m^3]
    std::vector<double> mass;                // [kg]
    std::vector<double> poisson_ratio;       // for the stress out of the plane; empty where some wood is orthotropic
    std::vector<Eigen::Vector3d> out_of_plane;  // there: stress zz per stress xx, yy, xy in plane strain
    std::vector<float> latewood;             // 0..1, for pictures
    std::vector<Change> changes;             // from a neighbouring point to this one; empty: nowhere
    std::vector<int> first_of_cell;          // [cells + 1]
    std::vector<int> lattice;                // [rows x columns of point places] point there, or -1

    int count() const { return static_cast<int>(position.size()); }
    Eigen::Matrix3d stiffness_of(int p) const {
        const auto& c = stiffness;
        Eigen::Matrix3d C;
        C << c[0][p], c[1][p], c[4][p], c[1][p], c[2][p], c[5][p], c[4][p], c[5][p], c[3][p];
        return C;
    }
    double density(int p) const { return mass[p] / volume[p]; }
    double stiffest(int p) const { return std::max(stiffness[0][p], stiffness[2][p]); }  // of both axes [Pa]
};

/// A short piece of the specimen's surface: of its sides, or of a cutout's true outline and not of the staircase of the points.
/// Together they are as long as the surface. It moves with the cell that it lies in, so that the surface stays in one piece.
struct Facet {
    int point;                     // of its cell, near it: knows the fields
    Vec2 position;                 // its middle, undeformed [m]
    double length;                 // [m]
    Vec2 normal;                   // unit, out of the specimen
    std::array<double, 4> weight;  // of the point's cell's nodes
};

/// Points, grid layout and shape functions: what both solvers share. In the undeformed specimen a point stays in its cell for
/// good (total Lagrangian form; de Vaucorbeil, Nguyen and Hutchinson 2020), so the weights are those of a few places in a cell.
class Discretisation {
  public:
    /// Throws InputError when no point is left.
    Discretisation(const Scene& scene, const MaterialMap& materials);

    Layout layout;
    Points points;
    std::vector<CellWeights> weights;  // [points per cell] by slot
    std::vector<Facet> facets;

    Box domain(int p) const {  // of a point, whatever cutouts take of it
        const int slot = points.slot[p];
        const Vec2 corner = layout.point_size().cwiseProduct(Vec2(slot % layout.per_side, slot / layout.per_side));
        const Vec2 low = layout.cell_corner(points.cell[p]) + corner;
        return {low, low + layout.point_size()};
    }
    bool cell_is_full(int c) const { return cell_is_full_[c]; }  // nothing of it is cut out or void
    int point_at(const Vec2& x) const;                 // the point whose domain holds x, or -1
    LocalWood wood_of_cell(const MaterialMap& materials, int c) const;  // on average
    int neighbour(int p, int step_x, int step_y) const;  // the point that many places away, or -1

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

  private:
    void mark_changes();
    Change change_between(int p, int other) const;
    void place_points(const Scene& scene, const MaterialMap& materials);
    int point_beside(const Vec2& x) const;
    void add_facet(int p, const Vec2& position, double length, const Vec2& normal);
    void add_void_facets(const std::vector<Shape>& cutouts);
    void find_facets(const Scene& scene);

    std::vector<bool> cell_is_full_;
};

} // namespace crampfit

#pragma once

#include "forward/material_slope.hpp"
#include "forward/seen_strain.hpp"
#include "forward/strips.hpp"
#include "forward/uneven_cells.hpp"

#include <array>
#include <vector>

namespace crampfit {

/// Adds the internal forces of all points to `force` (one entry a field): f_k -= V P grad N_k, with the stress P from the
/// displacements, and those of uneven cells. Cells next to a crack or a cutout are taken point by point, with B-splines all.
///
/// Cells that hold all their points on common fields are taken as a whole (`BilinearPiece`): the strain in a cell's middle, and q
/// = (u_0 - u_1 - u_2 + u_3) / (h_x h_y) by which the displacement gradient changes from there, (y - y_m) q in x and (x - x_m) q
/// in y. Corners that move so bend the cell, which a bilinear displacement does not allow without shear, nor nearly
/// incompressible wood at all. With its sides free to curve (incompatible modes of Wilson, Taylor, Doherty and Ghaboussi 1973; in
/// rectangles the modes that Taylor, Beresford and Wilson 1976 give any quadrilateral are the same) what is left of the energy of
/// q is that of stress along x and y alone,
///     V/2 [h_y^2 / 12 E_x q_x^2 + h_x^2 / 12 E_y q_y^2],
/// E_x and E_y as in `uniaxial_moduli`: the curvatures of the sides that minimise the energy drop out in closed form.
///
/// A point that is alone in its cell on its four fields sees one gradient: fields that hardly another point carries could move
/// crosswise, by +1, -1, -1, +1, and strain nothing. So it is integrated over its domain and not at its middle only: the gradient
/// changes there by q (y - y_p), q (x - x_p) with q = (u_0 - u_1 - u_2 + u_3) / (h_x h_y), which adds the energy k/2 |u_0 - u_1 -
/// u_2 + u_3|^2. A straight line among displacements does not feel it. (B-splines reach on into cells with more points.)
///
/// Where a crack cuts a point's domain, what lies beyond the crack (`Sliver`) counts with its own fields, at its own middle, and
/// no more with the point. So a crack lies where it was drawn and not where points end.
///
/// Points that remember are taken apart from the others: they take a step of their history along.
///
/// Cells are taken in strips: the same bits for any number of threads.
class InternalForce {
  public:
    /// `history`: of the points that have one, null where none does. `in_motion`: nothing is factored.
    InternalForce(const Discretisation& body, const MaterialMap& materials, bool rotates, History* history = nullptr,
                  bool in_motion = false);

    /// Call after points changed their fields.
    void sort_cells();

    void add(const std::vector<Vec2>& displacement, std::vector<Vec2>& force, Team& team) const;

    /// Returns the energy too [J].
    double add_with_energy(const std::vector<Vec2>& displacement, std::vector<Vec2>& force, bool side_by_side = false) const;

    /// Adds what the slope of the wood by a number of the materials makes of the forces, and returns what it makes of the energy
    /// [per the number's unit]. Where no wood remembers.
    double add_slope(const MaterialSlope& number, const std::vector<Vec2>& displacement, std::vector<Vec2>& force) const;

    /// Second derivative of the energy of all points of a cell that are on the same fields, by these fields' displacements [N/m];
    /// `geometric` as in `elastic_tangent`.
    Eigen::Matrix<double, 8, 8> tangent(const PointGroup& group, const std::vector<Vec2>& displacement, bool geometric) const;

    /// The same of a sliver, and what it changes of its point's.
    std::array<Eigen::Matrix<double, 8, 8>, 2> tangents(const Sliver& sliver, const std::vector<Vec2>& displacement,
                                                        bool geometric) const;

    struct Alone {
        int cell;
        std::array<int, 4> node;  // fields
        double volume;            // [m^3]
        Vec2 moments;             // second ones about its middle, of x and y, over its area [m^2]
        double stiffness;         // k, the mean of both directions, so that it does not feel rotation [N/m]
    };
    const std::vector<Alone>& alone() const { return alone_; }

    const UnevenCells& uneven() const { return uneven_; }

    /// Strain energy of all points; of those that remember as they were settled last [J].
    double energy(const std::vector<Vec2>& displacement) const;

  private:
    struct Place {  // in the lists below
        std::size_t whole_cell, loose_point, shortened, alone, remembering;
    };

    struct Shortened {  // a cell that would be whole without slivers
        int cell;
        Discretisation::Rest rest;
    };
    const Shortened* shortened(int cell) const;  // null: it is none
    BilinearPiece rest_of(const Shortened& cell, const Eigen::Matrix3d& stiffness, const Vec2& moduli,
                          const std::vector<Vec2>& displacement) const;
    struct Corners {              // as a place in a cell sees them
        std::array<int, 4> node;  // fields
        std::array<Vec2, 4> slope;
        double volume;  // for which they count [m^3]
        Mat2 gradient(const std::vector<Vec2>& displacement) const;
    };
    std::array<Corners, 3> changes_by(const Sliver& sliver) const;

    struct OwnWood;
    struct ChangeOfWood;
    enum class Wanted { forces, energy, both };

    // Adds the forces of a strip's points where they are wanted, and returns their strain energy where that is [J].
    template <class Wood>
    double visit(int strip, const Wood& wood, const std::vector<Vec2>& displacement, Wanted wanted,
                 std::vector<Vec2>* force) const;
    template <class Wood>
    double visit_cells(std::span<const int> cells, const Wood& wood, const std::vector<Vec2>& displacement, Wanted wanted,
                       std::vector<Vec2>* force) const;
    template <bool Rotates, class Wood>
    double visit_whole_cells(std::span<const int> cells, const Wood& wood, const std::vector<Vec2>& displacement, Wanted wanted,
                             std::vector<Vec2>* force) const;
    template <int PointsPerCell, bool Rotates, class Wood>
    double visit_splines(std::span<const int> cells, const Wood& wood, const std::vector<Vec2>& displacement, Wanted wanted,
                         std::vector<Vec2>* force) const;
    Vec2 bending_stiffness(const Vec2& moduli) const;
    Eigen::Matrix<double, 8, 8> whole_tangent(int cell, const std::vector<Vec2>& displacement, bool geometric) const;
    double crosswise_stiffness(const Alone& alone, const Eigen::Matrix3d& stiffness) const;
    void add_alone(int point);
    void add_alone(int cell, std::span<const int> fields, double volume, const Vec2& moments);
    Eigen::Matrix<double, 8, 8> elastic_tangent_of(std::span<const int> group, const std::vector<Vec2>& displacement,
                                                   bool geometric) const;
    std::span<const PointGroup> remembering_of(int strip) const {
        const auto [from, to] = std::pair(first_of_strip_[strip].remembering, first_of_strip_[strip + 1].remembering);
        return {remembering_.data() + from, to - from};
    }
    double visit_remembering(std::span<const PointGroup> groups, const std::vector<Vec2>& displacement, Wanted wanted,
                             std::vector<Vec2>* force) const;
    void add_stress(int point, const Eigen::Matrix2d& stress, std::vector<Vec2>& force) const;
    Eigen::Matrix<double, 8, 8> remembering_tangent(const PointGroup& group, const std::vector<Vec2>& displacement,
                                                    bool geometric) const;
    template <int Count>
    Eigen::Matrix<double, 8, 8> tangent_of(std::span<const int> group, const std::vector<Vec2>& displacement,
                                           bool geometric) const;

    const Discretisation& body_;
    bool rotates_;
    History* history_;
    double least_crosswise_;
    std::vector<int> whole_cells_;
    std::vector<int> loose_points_;
    std::vector<Shortened> shortened_;
    std::vector<Alone> alone_;
    std::vector<PointGroup> remembering_;
    UnevenCells uneven_;
    Strips strips_;
    std::vector<Place> first_of_strip_;  // [strips + 1]
};

}  // namespace crampfit

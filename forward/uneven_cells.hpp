#pragma once

#include "forward/bilinear_piece.hpp"
#include "forward/history.hpp"

#include <array>
#include <map>
#include <span>
#include <vector>

namespace crampfit {

/// What the wood of a cell with more than one adds to the energy of its points, which all have the cell's average stiffness, for
/// where in the cell each wood lies (`Unevenness`). It goes by pieces: rectangles of points on the same fields (`BilinearPiece`).
/// Most cells are one piece; a crack cuts them in several, each with its own wood, and where it cuts points' domains, in what is
/// left of each and the slivers.
class UnevenCells {
  public:
    /// All must outlive this. Cells with a `history` have laws of their own; null: none has.
    UnevenCells(const Discretisation& body, const MaterialMap& materials, bool rotates, const History* history);

    /// Call after points changed their fields.
    void sort();

    struct Piece {
        int cell;
        int point;       // its first
        bool is_sliver;  // of that point
        std::array<int, 4> node;
        PointBox box;  // whose wood it has
        double share;  // of the cell
        Vec2 middle;   // in cells from the cell's lower left corner
        const Unevenness* wood;
    };
    /// Those of cells `first` .. `last` - 1.
    std::span<const Piece> pieces(int first, int last) const;
    std::span<const Piece> pieces() const { return pieces_; }

    struct State {
        double energy;                      // [J]
        Eigen::Matrix<double, 8, 1> force;  // slope of the energy by the displacements of the piece's fields [N]
    };
    State state(const Piece& piece, const Unevenness& wood, const std::vector<Vec2>& displacement) const;

    /// Slope of that force [N/m]; `geometric` as in `elastic_tangent`.
    Eigen::Matrix<double, 8, 8> tangent(const Piece& piece, const std::vector<Vec2>& displacement, bool geometric) const;

  private:
    State small_state(const Piece& piece, const Unevenness& wood, const std::vector<Vec2>& displacement) const;  // small strain
    BilinearPiece bilinear(const Piece& piece, const Unevenness& wood, const std::vector<Vec2>& displacement) const;
    const Unevenness& wood_of(const Discretisation::UnevenCell& cell, const PointBox& box);

    const Discretisation& body_;
    const MaterialMap& materials_;
    bool rotates_;
    const History* history_;
    std::vector<Piece> pieces_;                           // by cell
    std::map<std::pair<int, PointBox>, Unevenness> cut_;  // of pieces of cells, as they were met
};

}  // namespace crampfit

#pragma once

#include <Eigen/SparseCore>

#include <array>
#include <functional>
#include <vector>

namespace crampfit {

/// Cholesky factor of the symmetric positive definite equations of a grid, of which each couples the unknowns at the nodes of one
/// cell. The grid is halved again and again (nested dissection, George 1973): of each box of cells the unknowns that no cell
/// outside it knows are eliminated, and what is left at its border goes to the box that it is a half of (multifrontal method,
/// Duff and Reid 1983). Boxes none of whose cells has changed keep their part, so that a crack that grows costs the boxes about
/// its tip and those that hold them: a general sparse factor would be made anew as a whole.
class GridFactor {
  public:
    /// With several threads the parts of the tree go side by side, with the same bits.
    GridFactor(int cells_x, int cells_y, int threads = 1);

    /// Place of each node in the elimination. Nodes are counted row by row, as cells are.
    const std::vector<int>& places() const { return place_; }

    /// Equations of each node, [nodes]: those from `first` on, `count` of them. Equations are numbered by the places of their
    /// nodes.
    void set_equations(const std::vector<int>& first, const std::vector<int>& count);

    /// A stiffness between equations; those below 0 are left out.
    struct Element {
        std::array<int, 8> equation;
        Eigen::Matrix<double, 8, 8> stiffness;
    };

    /// The stiffness of this cell has changed, or of all.
    void mark(int cell);
    void mark_all();

    /// Adds the elements of a cell to a list. Several threads may call it at a time.
    using Assemble = std::function<void(int cell, std::vector<Element>& elements)>;

    /// Factors anew what has changed. False when it is not positive definite.
    bool factor(const Assemble& assemble);
    /// The equation at which the last factorisation failed, or else that of its least pivot: one of those that what moves without
    /// any force moves.
    int weakest() const;

    /// Solves for right sides [equations x any number], in place. One call at a time.
    void solve(Eigen::MatrixXd& right) const;

    using Sparse = Eigen::SparseMatrix<double, Eigen::RowMajor>;

    /// What right sides [equations x any number] do on each other's solutions, R^T A^-1 R, without what `add_wide` has added.
    /// Takes half of a solution, and less as each is nil in most places.
    Eigen::MatrixXd compliance(const Sparse& right) const;

    /// Adds P R P^T, where the columns P [equations x any number] reach cells far from each other and need not be independent,
    /// and R [columns x columns] is symmetric; `factor` takes it off again. False when the sum is not positive definite.
    bool add_wide(const Sparse& columns, const Sparse& stiffness);

    /// A cheap estimate of 1 / condition number: (least / largest diagonal entry of the factor) squared.
    double reciprocal_condition() const;

  private:
    struct Box {
        int parent = -1;
        std::array<int, 2> half{-1, -1};       // children; none: a leaf
        std::vector<int> cells;                // of a leaf
        std::vector<int> nodes;                // by place: first those eliminated here, then those at the border
        int eliminated = 0;                    // how many of the nodes
        std::array<std::vector<int>, 2> slot;  // [halves][border nodes of the half] where they are in `nodes`
        bool stale = true;

        std::vector<int> offset;  // [nodes + 1] where the equations of each begin in the box's front
        int inner = 0;            // equations eliminated here
        int border = 0;           // equations at the border
        Eigen::MatrixXd factor;   // [inner + border x inner] lower triangle, and what is below
        Eigen::MatrixXd left;     // [border x border] what is left for the parent, lower triangle
        double least_pivot = 0, largest_pivot = 0;
        int failed_at = -1;  // inner equation; -1: none
    };

    // Equations that follow each other both in what a half has left and in the front of its parent.
    struct Run {
        int from, to, length;
    };

    struct Scratch {             // of one box
        std::vector<int> local;  // [equations] place in its front
        std::vector<Element> elements;
        std::array<std::vector<Run>, 2> runs;  // [halves]
    };

    int add_box(int i0, int i1, int j0, int j1);
    void place_nodes(Box& box, int i0, int i1, int j0, int j1);
    int first_within(int box) const;
    bool factor_within(int box, int forks, const Assemble& assemble);
    bool factor_box(Box& box, const Assemble& assemble, Scratch& scratch);
    void fill(Box& box, const Assemble& assemble, Scratch& scratch) const;
    void assemble_leaf(Box& box, const Assemble& assemble, Scratch& scratch) const;
    template <class Sides>
    void take_off_wide(Sides&& forward) const;
    static double* column_of(Box& box, int c);
    void find_runs(const Box& box, int half, std::vector<Run>& runs) const;
    void take_in_halves(Box& box, Scratch& scratch) const;
    static bool eliminate(Box& box);
    template <class Visit>
    void upward(int top, int forks, const Visit& visit) const;
    template <class Visit>
    void downward(int top, int forks, const Visit& visit) const;
    static void forward_columns(const Eigen::MatrixXd& factor, double* y, int sides);
    static void backward_columns(const Eigen::MatrixXd& factor, double* y, int sides);
    void solve_few(Eigen::Ref<Eigen::MatrixXd> right) const;
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    struct Part;
    std::vector<Part> forward_parts(const Sparse& right) const;
    void solve_many(Rows& right) const;

    int cells_x_, cells_y_;
    int placed_ = 0;                      // nodes that have a place
    std::vector<Box> boxes_;              // halves before what they are halves of
    std::vector<int> place_;              // [nodes]
    std::vector<int> box_of_cell_;        // its leaf
    std::vector<int> first_, count_;      // [nodes] equations
    int forks_ = 0;                       // levels of the tree at which its halves go side by side
    mutable std::vector<double> fronts_;  // room for a solution

    // What `add_wide` has added. With A = L L^T the inverse of A + P R P^T is L^-T (1 - Z W Z^T) L^-1, where Z = L^-1 P,
    // W = R - R C (1 + C^T R C)^-1 C^T R and C C^T = Z^T Z (Woodbury 1950).
    struct Part {                // of L^-1 R, R sparse
        int first;               // equation
        std::vector<int> sides;  // that are not nil in the equations from there on
        Eigen::MatrixXd rows;    // [equations x sides]
    };
    std::vector<Part> wide_;       // of Z
    Eigen::MatrixXd wide_change_;  // W
};

}  // namespace crampfit

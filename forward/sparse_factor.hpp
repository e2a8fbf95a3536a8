#pragma once

#include <Eigen/SparseCore>

#include <memory>
#include <vector>

namespace crampfit {

/// Nodes of a grid of (nodes_x) x (nodes_y), counted row by row, in the order of nested dissection (George 1973): the place of each
/// in an elimination that fills in little.
std::vector<int> dissection_order(int nodes_x, int nodes_y);

/// Cholesky factor of a sparse symmetric positive definite matrix (CHOLMOD, supernodal), on one core. The unknowns are taken in the
/// order in which they come.
class SparseFactor {
  public:
    SparseFactor();
    ~SparseFactor();
    SparseFactor(const SparseFactor&) = delete;
    SparseFactor& operator=(const SparseFactor&) = delete;

    /// Factors a matrix given by its lower triangle. The pattern is analysed anew where `new_pattern`. False when it is not positive
    /// definite.
    bool factor(const Eigen::SparseMatrix<double>& lower, bool new_pattern);

    Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const;

    /// A cheap estimate of 1 / condition number: (least / largest diagonal entry of the factor) squared.
    double reciprocal_condition() const;

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

} // namespace crampfit

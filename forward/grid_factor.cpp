#include "forward/grid_factor.hpp"

#include <Eigen/Cholesky>
#include <cblas.h>

#include <algorithm>
#include <cmath>
#include <limits>

extern "C" void dpotrf_(const char* triangle, const int* order, double* matrix, const int* leading, int* info);

namespace crampfit {

namespace {

constexpr int leaf_cells = 4;  // boxes no wider than this are not halved: measured, 3 to 6 are alike

// Below this many unknowns a call into the BLAS costs more than the work: measured.
constexpr int small_front = 48;

} // namespace

GridFactor::GridFactor(int cells_x, int cells_y) : cells_x_(cells_x), cells_y_(cells_y) {
    // Runs of a fit go side by side, a core each; and sums must not depend on the number of threads.
    openblas_set_num_threads(1);
    const std::size_t nodes = static_cast<std::size_t>(cells_x + 1) * (cells_y + 1);
    place_.assign(nodes, -1);
    box_of_cell_.assign(static_cast<std::size_t>(cells_x) * cells_y, -1);
    add_box(0, cells_x, 0, cells_y);
    std::vector<int> slot_of_node(nodes, -1);
    for (Box& box : boxes_) {
        const auto by_place = [&](int a, int b) { return place_[a] < place_[b]; };
        std::sort(box.nodes.begin() + box.eliminated, box.nodes.end(), by_place);
        for (std::size_t k = 0; k < box.nodes.size(); ++k) slot_of_node[box.nodes[k]] = static_cast<int>(k);
        for (int h = 0; h < 2 && box.half[0] >= 0; ++h) {
            const Box& half = boxes_[box.half[h]];
            for (std::size_t k = half.eliminated; k < half.nodes.size(); ++k) box.slot[h].push_back(slot_of_node[half.nodes[k]]);
        }
    }
}

int GridFactor::add_box(int i0, int i1, int j0, int j1) {
    Box box;
    if (i1 - i0 > leaf_cells || j1 - j0 > leaf_cells) {
        const bool across = i1 - i0 >= j1 - j0;
        const int middle = across ? (i0 + i1) / 2 : (j0 + j1) / 2;
        box.half = {across ? add_box(i0, middle, j0, j1) : add_box(i0, i1, j0, middle),
                    across ? add_box(middle, i1, j0, j1) : add_box(i0, i1, middle, j1)};
    }
    const int own = static_cast<int>(boxes_.size());
    for (const int half : box.half)
        if (half >= 0) boxes_[half].parent = own;
    place_nodes(box, i0, i1, j0, j1);
    if (box.half[0] < 0)
        for (int j = j0; j < j1; ++j)
            for (int i = i0; i < i1; ++i) {
                box.cells.push_back(j * cells_x_ + i);
                box_of_cell_[box.cells.back()] = own;
            }
    boxes_.push_back(std::move(box));
    return own;
}

// The nodes of a box that no box within it has eliminated: first those all of whose cells lie within the box.
void GridFactor::place_nodes(Box& box, int i0, int i1, int j0, int j1) {
    const auto whole = [&](int i, int j) {
        return (i > i0 || i0 == 0) && (i < i1 || i1 == cells_x_) && (j > j0 || j0 == 0) && (j < j1 || j1 == cells_y_);
    };
    std::vector<int> border;
    for (int j = j0; j <= j1; ++j) {
        for (int i = i0; i <= i1; ++i) {
            const int node = j * (cells_x_ + 1) + i;
            if (place_[node] >= 0) continue;
            if (!whole(i, j)) {
                border.push_back(node);
                continue;
            }
            place_[node] = placed_++;
            box.nodes.push_back(node);
        }
    }
    box.eliminated = static_cast<int>(box.nodes.size());
    box.nodes.insert(box.nodes.end(), border.begin(), border.end());
}

void GridFactor::mark(int cell) {
    for (int b = box_of_cell_[cell]; b >= 0 && !boxes_[b].stale; b = boxes_[b].parent) boxes_[b].stale = true;
}

void GridFactor::mark_all() {
    for (Box& box : boxes_) box.stale = true;
}

void GridFactor::set_equations(const std::vector<int>& first, const std::vector<int>& count) {
    for (std::size_t n = 0; n < count.size() && !count_.empty(); ++n) {
        if (count[n] == count_[n]) continue;
        const int i = static_cast<int>(n) % (cells_x_ + 1);
        const int j = static_cast<int>(n) / (cells_x_ + 1);
        for (int y = std::max(0, j - 1); y <= std::min(j, cells_y_ - 1); ++y)
            for (int x = std::max(0, i - 1); x <= std::min(i, cells_x_ - 1); ++x) mark(y * cells_x_ + x);
    }
    first_ = first;
    count_ = count;
}

// Where the equations of each node of a box begin in its front; one more entry: the front's size.
const std::vector<int>& GridFactor::offsets(const Box& box) {
    offset_.resize(box.nodes.size() + 1);
    offset_[0] = 0;
    for (std::size_t k = 0; k < box.nodes.size(); ++k) offset_[k + 1] = offset_[k] + count_[box.nodes[k]];
    return offset_;
}

void GridFactor::assemble_leaf(Box& box, const Assemble& assemble) {
    elements_.clear();
    for (const int cell : box.cells) assemble(cell, elements_);
    for (std::size_t k = 0; k < box.nodes.size(); ++k) {
        const int node = box.nodes[k];
        for (int e = 0; e < count_[node]; ++e) {
            if (local_.size() <= static_cast<std::size_t>(first_[node] + e)) local_.resize(2 * (first_[node] + e) + 64);
            local_[first_[node] + e] = offset_[k] + e;
        }
    }
    for (const Element& element : elements_) {
        std::array<int, 8> at;
        for (int a = 0; a < 8; ++a) at[a] = element.equation[a] < 0 ? -1 : local_[element.equation[a]];
        for (int b = 0; b < 8; ++b) {
            if (at[b] < 0) continue;
            double* column = column_of(box, at[b]);
            for (int a = 0; a < 8; ++a)
                if (at[a] >= at[b]) column[at[a]] += element.stiffness(a, b);
        }
    }
}

// A column of a box's front, to be indexed by the front's rows from the diagonal down.
double* GridFactor::column_of(Box& box, int c) {
    if (c < box.inner) return box.factor.data() + static_cast<std::ptrdiff_t>(c) * box.factor.rows();
    return box.left.data() + static_cast<std::ptrdiff_t>(c - box.inner) * box.border - box.inner;
}

// Adds what a half has left. Nodes that follow each other in both are taken together.
void GridFactor::take_in(Box& box, int h) {
    const Box& half = boxes_[box.half[h]];
    struct Run {
        int from, to, length;
    };
    std::vector<Run> runs;
    int at = 0;
    for (std::size_t k = 0; k < box.slot[h].size(); ++k) {
        const int to = offset_[box.slot[h][k]];
        const int length = count_[half.nodes[half.eliminated + k]];
        if (!runs.empty() && runs.back().to + runs.back().length == to) runs.back().length += length;
        else runs.push_back({at, to, length});
        at += length;
    }
    for (std::size_t r = 0; r < runs.size(); ++r) {
        for (int c = 0; c < runs[r].length; ++c) {
            const double* from = half.left.data() + static_cast<std::ptrdiff_t>(runs[r].from + c) * half.border;
            double* to = column_of(box, runs[r].to + c);
            for (std::size_t below = r; below < runs.size(); ++below) {
                const Run& rows = runs[below];
                for (int i = below == r ? c : 0; i < rows.length; ++i) to[rows.to + i] += from[rows.from + i];
            }
        }
    }
}

// Eliminates a box's inner unknowns from its front: F_ii = L_ii L_ii^T, L_bi = F_bi L_ii^-T, left over F_bb - L_bi L_bi^T.
bool GridFactor::eliminate(Box& box) {
    const int inner = box.inner;
    const int border = box.border;
    const int leading = static_cast<int>(box.factor.rows());
    box.least_pivot = std::numeric_limits<double>::infinity();
    box.largest_pivot = 0.0;
    if (inner == 0) return true;
    if (leading <= small_front) {
        Eigen::Ref<Eigen::MatrixXd> diagonal = box.factor.topRows(inner);
        if (Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(diagonal).info() != Eigen::Success) return false;
        auto below = box.factor.bottomRows(border);
        diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(below);
        box.left.selfadjointView<Eigen::Lower>().rankUpdate(below, -1.0);
    } else {
        int info = 0;
        dpotrf_("L", &inner, box.factor.data(), &leading, &info);
        if (info != 0) return false;
        if (border > 0) {
            double* below = box.factor.data() + inner;
            cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, border, inner, 1.0, box.factor.data(),
                        leading, below, leading);
            cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, border, inner, -1.0, below, leading, 1.0, box.left.data(), border);
        }
    }
    for (int k = 0; k < inner; ++k) {
        box.least_pivot = std::min(box.least_pivot, box.factor(k, k));
        box.largest_pivot = std::max(box.largest_pivot, box.factor(k, k));
    }
    return true;
}

bool GridFactor::factor(const Assemble& assemble) {
    for (Box& box : boxes_) {
        if (!box.stale) continue;
        const std::vector<int>& offset = offsets(box);
        box.inner = offset[box.eliminated];
        box.border = offset.back() - box.inner;
        box.factor.resize(offset.back(), box.inner);
        box.left.resize(box.border, box.border);
        for (int c = 0; c < box.inner; ++c) box.factor.col(c).tail(offset.back() - c).setZero();
        for (int c = 0; c < box.border; ++c) box.left.col(c).tail(box.border - c).setZero();
        if (box.half[0] < 0) assemble_leaf(box, assemble);
        for (int h = 0; h < 2 && box.half[0] >= 0; ++h) take_in(box, h);
        if (!eliminate(box)) {
            mark_all();
            return false;
        }
        box.stale = false;
    }
    return true;
}

// One right side or many: single columns have quicker kernels.
template <class Columns>
void GridFactor::solve_columns(Columns x) const {
    using Part = Eigen::Matrix<double, Eigen::Dynamic, Columns::ColsAtCompileTime>;
    Part at_border;
    const auto visit_border = [&](const Box& box, auto visit) {
        int row = 0;
        for (std::size_t k = box.eliminated; k < box.nodes.size(); ++k)
            for (int e = 0; e < count_[box.nodes[k]]; ++e) visit(row++, first_[box.nodes[k]] + e);
    };
    for (const Box& box : boxes_) {
        if (box.inner == 0) continue;
        auto own = x.middleRows(first_[box.nodes[0]], box.inner);
        if (own.isZero(0.0)) continue;
        box.factor.topRows(box.inner).template triangularView<Eigen::Lower>().solveInPlace(own);
        at_border.noalias() = box.factor.bottomRows(box.border) * own;
        visit_border(box, [&](int row, int equation) { x.row(equation) -= at_border.row(row); });
    }
    for (auto box = boxes_.rbegin(); box != boxes_.rend(); ++box) {
        if (box->inner == 0) continue;
        auto own = x.middleRows(first_[box->nodes[0]], box->inner);
        at_border.resize(box->border, x.cols());
        visit_border(*box, [&](int row, int equation) { at_border.row(row) = x.row(equation); });
        own.noalias() -= box->factor.bottomRows(box->border).transpose() * at_border;
        box->factor.topRows(box->inner).template triangularView<Eigen::Lower>().transpose().solveInPlace(own);
    }
}

void GridFactor::solve(Eigen::MatrixXd& right) const {
    if (right.cols() == 1) solve_columns(right.col(0));
    else solve_columns(right.leftCols(right.cols()));
}

double GridFactor::reciprocal_condition() const {
    double least = std::numeric_limits<double>::infinity();
    double largest = 0.0;
    for (const Box& box : boxes_) {
        least = std::min(least, box.least_pivot);
        largest = std::max(largest, box.largest_pivot);
    }
    return largest > 0.0 ? std::pow(least / largest, 2) : 0.0;
}

} // namespace crampfit

#include "forward/grid_factor.hpp"

#include "forward/side_by_side.hpp"

#include <Eigen/Cholesky>
#include <cblas.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

extern "C" void dpotrf_(const char* triangle, const int* order, double* matrix, const int* leading, int* info);

namespace crampfit {

namespace {

constexpr int most_forks = 4;

constexpr int leaf_cells = 4;  // boxes no wider than this are not halved: measured, 3 to 6 are alike

// Below this many unknowns a call into the BLAS costs more than the work: measured.
constexpr int small_front = 48;

// So many right sides are solved without the BLAS.
constexpr int few_columns = 3;

template <class First, class Second>
void run_both(bool side_by_side, const First& first, const Second& second) {
    do_side_by_side(side_by_side, 2, [&](std::size_t k) { k == 0 ? first() : second(); });
}

}  // namespace

GridFactor::GridFactor(int cells_x, int cells_y, int threads) : cells_x_(cells_x), cells_y_(cells_y) {
    while (1 << forks_ < threads && forks_ < most_forks) ++forks_;
    // Runs of a fit go side by side, a core each; and sums must not depend on the number of threads.
    [[maybe_unused]] static const bool alone = (openblas_set_num_threads(1), true);  // once: it is not safe side by side
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

void GridFactor::assemble_leaf(Box& box, const Assemble& assemble, Scratch& scratch) const {
    scratch.elements.clear();
    for (const int cell : box.cells) assemble(cell, scratch.elements);
    std::vector<int>& local = scratch.local;
    for (std::size_t k = 0; k < box.nodes.size(); ++k) {
        const int node = box.nodes[k];
        for (int e = 0; e < count_[node]; ++e) {
            if (local.size() <= static_cast<std::size_t>(first_[node] + e)) local.resize(2 * (first_[node] + e) + 64);
            local[first_[node] + e] = box.offset[k] + e;
        }
    }
    box.factor.setZero();
    box.left.setZero();
    for (const Element& element : scratch.elements) {
        std::array<int, 8> at;
        for (int a = 0; a < 8; ++a) at[a] = element.equation[a] < 0 ? -1 : local[element.equation[a]];
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

void GridFactor::find_runs(const Box& box, int h, std::vector<Run>& runs) const {
    const Box& half = boxes_[box.half[h]];
    runs.clear();
    int at = 0;
    for (std::size_t k = 0; k < box.slot[h].size(); ++k) {
        const int to = box.offset[box.slot[h][k]];
        const int length = count_[half.nodes[half.eliminated + k]];
        if (!runs.empty() && runs.back().to + runs.back().length == to) runs.back().length += length;
        else runs.push_back({at, to, length});
        at += length;
    }
}

// The front of a box is what its halves have left. Column by column, so that each is at hand.
void GridFactor::take_in_halves(Box& box, Scratch& scratch) const {
    for (int h = 0; h < 2; ++h) find_runs(box, h, scratch.runs[h]);
    std::array<std::size_t, 2> at{0, 0};
    for (int c = 0; c < box.offset.back(); ++c) {
        double* to = column_of(box, c);
        std::fill(to + c, to + box.offset.back(), 0.0);
        for (int h = 0; h < 2; ++h) {
            const std::vector<Run>& runs = scratch.runs[h];
            std::size_t& r = at[h];
            while (r < runs.size() && runs[r].to + runs[r].length <= c) ++r;
            if (r == runs.size() || runs[r].to > c) continue;
            const Box& half = boxes_[box.half[h]];
            const int column = runs[r].from + c - runs[r].to;
            const double* from = half.left.data() + static_cast<std::ptrdiff_t>(column) * half.border;
            for (std::size_t below = r; below < runs.size(); ++below) {
                const Run& rows = runs[below];
                for (int i = below == r ? c - rows.to : 0; i < rows.length; ++i) to[rows.to + i] += from[rows.from + i];
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
            cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, border, inner, -1.0, below, leading, 1.0, box.left.data(),
                        border);
        }
    }
    for (int k = 0; k < inner; ++k) {
        box.least_pivot = std::min(box.least_pivot, box.factor(k, k));
        box.largest_pivot = std::max(box.largest_pivot, box.factor(k, k));
    }
    return true;
}

void GridFactor::fill(Box& box, const Assemble& assemble, Scratch& scratch) const {
    if (box.half[0] < 0) assemble_leaf(box, assemble, scratch);
    else take_in_halves(box, scratch);
}

bool GridFactor::factor_box(Box& box, const Assemble& assemble, Scratch& scratch) {
    if (!box.stale) return true;
    std::vector<int>& offset = box.offset;
    offset.resize(box.nodes.size() + 1);
    offset[0] = 0;
    for (std::size_t k = 0; k < box.nodes.size(); ++k) offset[k + 1] = offset[k] + count_[box.nodes[k]];
    box.inner = offset[box.eliminated];
    box.border = offset.back() - box.inner;
    box.factor.resize(offset.back(), box.inner);
    box.left.resize(box.border, box.border);
    box.failed_at = -1;
    fill(box, assemble, scratch);
    box.stale = !eliminate(box);
    if (!box.stale) return true;
    fill(box, assemble, scratch);  // once more, as LAPACK tells where
    const int leading = static_cast<int>(box.factor.rows());
    int info = 0;
    dpotrf_("L", &box.inner, box.factor.data(), &leading, &info);
    box.failed_at = info > 0 ? info - 1 : box.inner - 1;
    return false;
}

// Boxes within a box follow each other; this is the first of them.
int GridFactor::first_within(int box) const {
    while (boxes_[box].half[0] >= 0) box = boxes_[box].half[0];
    return box;
}

bool GridFactor::factor_within(int top, int forks, const Assemble& assemble) {
    Box& box = boxes_[top];
    Scratch scratch;
    if (forks == 0 || box.half[0] < 0) {
        for (int b = first_within(top); b <= top; ++b)
            if (!factor_box(boxes_[b], assemble, scratch)) return false;
        return true;
    }
    bool first = true, second = true;
    run_both(
        boxes_[box.half[0]].stale && boxes_[box.half[1]].stale, [&] { first = factor_within(box.half[0], forks - 1, assemble); },
        [&] { second = factor_within(box.half[1], forks - 1, assemble); });
    return first && second && factor_box(box, assemble, scratch);
}

bool GridFactor::factor(const Assemble& assemble) {
    wide_.clear();
    const bool good = factor_within(static_cast<int>(boxes_.size()) - 1, forks_, assemble);
    if (!good) mark_all();
    return good;
}

// Boxes within `top`, halves first.
template <class Visit>
void GridFactor::upward(int top, int forks, const Visit& visit) const {
    const std::array<int, 2>& half = boxes_[top].half;
    if (forks == 0 || half[0] < 0) {
        for (int b = first_within(top); b <= top; ++b) visit(b);
        return;
    }
    run_both(
        true, [&] { upward(half[0], forks - 1, visit); }, [&] { upward(half[1], forks - 1, visit); });
    visit(top);
}

// Boxes within `top`, halves last.
template <class Visit>
void GridFactor::downward(int top, int forks, const Visit& visit) const {
    const std::array<int, 2>& half = boxes_[top].half;
    if (forks == 0 || half[0] < 0) {
        for (int b = top; b >= first_within(top); --b) visit(b);
        return;
    }
    visit(top);
    run_both(
        true, [&] { downward(half[0], forks - 1, visit); }, [&] { downward(half[1], forks - 1, visit); });
}

// y := L^-1 y for the columns of a box's factor, and what they leave at its border: y of the border less L_bi y. For `sides`
// right sides that follow each other. Four columns at a time: most of the work is to fetch them.
void GridFactor::forward_columns(const Eigen::MatrixXd& factor, double* y, int sides) {
    const auto rows = factor.rows(), columns = factor.cols();
    for (Eigen::Index c = 0; c < columns;) {
        const auto width = std::min<Eigen::Index>(4, columns - c);
        double* v = y;
        for (int side = 0; side < sides; ++side, v += rows) {
            for (Eigen::Index a = c; a < c + width; ++a) {
                v[a] /= factor(a, a);
                for (Eigen::Index r = a + 1; r < c + width; ++r) v[r] -= factor(r, a) * v[a];
            }
            if (width == 4) {
                const double *l0 = &factor(0, c), *l1 = l0 + rows, *l2 = l1 + rows, *l3 = l2 + rows;
                const double v0 = v[c], v1 = v[c + 1], v2 = v[c + 2], v3 = v[c + 3];
                for (Eigen::Index r = c + 4; r < rows; ++r) v[r] -= l0[r] * v0 + l1[r] * v1 + l2[r] * v2 + l3[r] * v3;
            } else {
                for (Eigen::Index a = c; a < c + width; ++a)
                    for (Eigen::Index r = c + width; r < rows; ++r) v[r] -= factor(r, a) * v[a];
            }
        }
        c += width;
    }
}

// The other way: y := L^-T (y - L_bi^T y of the border).
void GridFactor::backward_columns(const Eigen::MatrixXd& factor, double* y, int sides) {
    using Lane = Eigen::Array<double, 4, 1>;
    const auto rows = factor.rows(), columns = factor.cols();
    for (Eigen::Index end = columns; end > 0;) {
        const auto width = end % 4 == 0 ? 4 : end % 4;
        const auto c = end - width;
        double* v = y;
        for (int side = 0; side < sides; ++side, v += rows) {
            if (width == 4) {
                const double *l0 = &factor(0, c), *l1 = l0 + rows, *l2 = l1 + rows, *l3 = l2 + rows;
                Lane s0 = Lane::Zero(), s1 = Lane::Zero(), s2 = Lane::Zero(), s3 = Lane::Zero();
                Eigen::Index r = end;
                for (; r + 4 <= rows; r += 4) {
                    const auto four = [r](const double* from) { return Eigen::Map<const Lane>(from + r); };
                    const Lane below = four(v);
                    s0 += four(l0) * below;
                    s1 += four(l1) * below;
                    s2 += four(l2) * below;
                    s3 += four(l3) * below;
                }
                Lane sum(s0.sum(), s1.sum(), s2.sum(), s3.sum());
                for (; r < rows; ++r) sum += v[r] * Lane(l0[r], l1[r], l2[r], l3[r]);
                for (int a = 0; a < 4; ++a) v[c + a] -= sum[a];
            } else {
                const auto below = Eigen::Map<const Eigen::VectorXd>(v + end, rows - end);
                for (Eigen::Index a = c; a < end; ++a) v[a] -= factor.col(a).tail(rows - end).dot(below);
            }
            for (Eigen::Index a = end - 1; a >= c; --a) {
                for (Eigen::Index r = a + 1; r < end; ++r) v[a] -= factor(r, a) * v[r];
                v[a] /= factor(a, a);
            }
        }
        end = c;
    }
}

// From L^-1 times right sides.
template <class Sides>
void GridFactor::take_off_wide(Sides&& forward) const {
    if (wide_.empty()) return;
    Eigen::MatrixXd seen = Eigen::MatrixXd::Zero(wide_change_.rows(), forward.cols());
    for (const Part& part : wide_)
        seen(part.sides, Eigen::all) += part.rows.transpose() * forward.middleRows(part.first, part.rows.rows());
    const Eigen::MatrixXd change = wide_change_ * seen;
    for (const Part& part : wide_)
        forward.middleRows(part.first, part.rows.rows()).noalias() -= part.rows * change(part.sides, Eigen::all);
}

void GridFactor::solve_few(Eigen::Ref<Eigen::MatrixXd> right) const {
    const int sides = static_cast<int>(right.cols());
    std::vector<std::size_t> at(boxes_.size() + 1, 0);
    for (std::size_t b = 0; b < boxes_.size(); ++b)
        at[b + 1] = at[b] + static_cast<std::size_t>(sides) * (boxes_[b].inner + boxes_[b].border);
    // Of each box and right side: its own unknowns, then what it leaves for the box that it is a half of.
    std::vector<double>& fronts = fronts_;
    if (fronts.size() < at.back()) fronts.resize(at.back());
    std::vector<char> counts(boxes_.size(), 0);  // whether there is anything but zeros in it
    const int top = static_cast<int>(boxes_.size()) - 1;
    upward(top, forks_, [&](int b) {
        const Box& box = boxes_[b];
        const int size = box.inner + box.border;
        double* y = &fronts[at[b]];
        for (int h = 0; h < 2 && box.half[0] >= 0; ++h) counts[b] = counts[b] || counts[box.half[h]];
        for (int side = 0; side < sides && box.inner > 0; ++side) {
            const double* x = &right(first_[box.nodes[0]], side);
            counts[b] = counts[b] || std::any_of(x, x + box.inner, [](double value) { return value != 0.0; });
        }
        if (!counts[b]) return;
        for (int side = 0; side < sides; ++side) {
            double* border = y + side * size;
            if (box.inner > 0) border = std::copy_n(&right(first_[box.nodes[0]], side), box.inner, border);
            std::fill_n(border, box.border, 0.0);
        }
        for (int h = 0; h < 2 && box.half[0] >= 0; ++h) {
            if (!counts[box.half[h]]) continue;
            const Box& half = boxes_[box.half[h]];
            const double* from = &fronts[at[box.half[h]]];
            for (int side = 0; side < sides; ++side) {
                from += half.inner;
                for (const int slot : box.slot[h])
                    for (int to = box.offset[slot]; to < box.offset[slot + 1]; ++to) y[side * size + to] += *from++;
            }
        }
        if (box.inner == 0) return;
        forward_columns(box.factor, y, sides);
        for (int side = 0; side < sides; ++side) std::copy_n(y + side * size, box.inner, &right(first_[box.nodes[0]], side));
    });
    take_off_wide(right);
    downward(top, forks_, [&](int b) {
        const Box& box = boxes_[b];
        if (box.inner == 0) return;
        const int size = box.inner + box.border;
        for (int side = 0; side < sides; ++side) {
            double* y = &fronts[at[b]] + side * size;
            const double* x = &right(0, side);
            double* border = std::copy_n(x + first_[box.nodes[0]], box.inner, y);
            for (std::size_t k = box.eliminated; k < box.nodes.size(); ++k)
                border = std::copy_n(x + first_[box.nodes[k]], count_[box.nodes[k]], border);
        }
        backward_columns(box.factor, &fronts[at[b]], sides);
        for (int side = 0; side < sides; ++side)
            std::copy_n(&fronts[at[b]] + side * size, box.inner, &right(first_[box.nodes[0]], side));
    });
}

// Of each unknown the right sides lie together: boxes hand on rows.
void GridFactor::solve_many(Rows& x) const {
    std::vector<Rows> left(boxes_.size());  // what each box leaves for the one that it is a half of
    const int top = static_cast<int>(boxes_.size()) - 1;
    upward(top, forks_, [&](int b) {
        const Box& box = boxes_[b];
        const int first = box.inner > 0 ? first_[box.nodes[0]] : 0;
        left[b].setZero(box.border, x.cols());
        for (int h = 0; h < 2 && box.half[0] >= 0; ++h) {
            const Box& half = boxes_[box.half[h]];
            const Rows from = std::exchange(left[box.half[h]], {});
            for (std::size_t k = 0; k < box.slot[h].size(); ++k) {
                const int row = half.offset[half.eliminated + k] - half.inner;
                const int to = box.offset[box.slot[h][k]];
                const int count = half.offset[half.eliminated + k + 1] - half.offset[half.eliminated + k];
                if (to < box.inner) x.middleRows(first + to, count) += from.middleRows(row, count);
                else left[b].middleRows(to - box.inner, count) += from.middleRows(row, count);
            }
        }
        auto own = x.middleRows(first, box.inner);
        if (own.isZero(0.0)) return;
        box.factor.topRows(box.inner).triangularView<Eigen::Lower>().solveInPlace(own);
        left[b].noalias() -= box.factor.bottomRows(box.border) * own;
    });
    take_off_wide(x);
    downward(top, forks_, [&](int b) {
        const Box& box = boxes_[b];
        if (box.inner == 0) return;
        auto own = x.middleRows(first_[box.nodes[0]], box.inner);
        Rows at_border(box.border, x.cols());
        int row = 0;
        for (std::size_t k = box.eliminated; k < box.nodes.size(); ++k)
            for (int e = 0; e < count_[box.nodes[k]]; ++e) at_border.row(row++) = x.row(first_[box.nodes[k]] + e);
        own.noalias() -= box.factor.bottomRows(box.border).transpose() * at_border;
        box.factor.topRows(box.inner).triangularView<Eigen::Lower>().transpose().solveInPlace(own);
    });
}

void GridFactor::solve(Eigen::MatrixXd& right) const {
    if (right.size() == 0) return;
    if (right.cols() <= few_columns) return solve_few(right);
    constexpr Eigen::Index some = 16;  // rows whose part of all columns is at hand
    Rows rows(right.rows(), right.cols());
    const auto for_blocks = [&](const auto& visit) {
        for (Eigen::Index row = 0; row < right.rows(); row += some) visit(row, std::min(some, right.rows() - row));
    };
    for_blocks([&](Eigen::Index row, Eigen::Index count) { rows.middleRows(row, count) = right.middleRows(row, count); });
    solve_many(rows);
    for_blocks([&](Eigen::Index row, Eigen::Index count) { right.middleRows(row, count) = rows.middleRows(row, count); });
}

// L^-1 times right sides, box by box.
std::vector<GridFactor::Part> GridFactor::forward_parts(const Sparse& right) const {
    std::vector<Part> parts;
    std::vector<Part> left(boxes_.size());     // what each leaves for the box that it is a half of
    std::vector<int> column_of(right.cols());  // of a right side, in the front at hand
    std::vector<int> row_of;                   // of what a half has left, there
    for (std::size_t b = 0; b < boxes_.size(); ++b) {
        const Box& box = boxes_[b];
        Part part{box.inner > 0 ? first_[box.nodes[0]] : 0, {}, {}};
        std::vector<int>& sides = part.sides;
        for (const int half : box.half)
            if (half >= 0) sides.insert(sides.end(), left[half].sides.begin(), left[half].sides.end());
        for (int row = part.first; row < part.first + box.inner; ++row)
            for (Sparse::InnerIterator entry(right, row); entry; ++entry) sides.push_back(static_cast<int>(entry.col()));
        if (sides.empty()) continue;
        std::ranges::sort(sides);
        sides.erase(std::ranges::unique(sides).begin(), sides.end());
        const auto columns = static_cast<Eigen::Index>(sides.size());
        for (Eigen::Index k = 0; k < columns; ++k) column_of[sides[k]] = static_cast<int>(k);
        part.rows.setZero(box.inner, columns);
        Eigen::MatrixXd at_border = Eigen::MatrixXd::Zero(box.border, columns);
        for (int row = 0; row < box.inner; ++row)
            for (Sparse::InnerIterator entry(right, part.first + row); entry; ++entry)
                part.rows(row, column_of[entry.col()]) = entry.value();
        for (int h = 0; h < 2 && box.half[0] >= 0; ++h) {
            const Part from = std::exchange(left[box.half[h]], {});
            row_of.clear();
            for (const int slot : box.slot[h])
                for (int to = box.offset[slot]; to < box.offset[slot + 1]; ++to) row_of.push_back(to);
            for (Eigen::Index k = 0; k < from.rows.cols(); ++k) {
                const int column = column_of[from.sides[k]];
                for (std::size_t row = 0; row < row_of.size(); ++row) {
                    const int to = row_of[row];
                    (to < box.inner ? part.rows(to, column) : at_border(to - box.inner, column)) += from.rows(row, k);
                }
            }
        }
        box.factor.topRows(box.inner).triangularView<Eigen::Lower>().solveInPlace(part.rows);
        at_border.noalias() -= box.factor.bottomRows(box.border) * part.rows;
        left[b] = {0, sides, std::move(at_border)};
        if (box.inner > 0) parts.push_back(std::move(part));
    }
    return parts;
}

Eigen::MatrixXd GridFactor::compliance(const Sparse& right) const {
    Eigen::MatrixXd found = Eigen::MatrixXd::Zero(right.cols(), right.cols());
    for (const Part& part : forward_parts(right)) found(part.sides, part.sides) += part.rows.transpose() * part.rows;
    return found;
}

bool GridFactor::add_wide(const Sparse& columns, const Sparse& stiffness) {
    const Eigen::Index count = columns.cols();
    wide_ = forward_parts(columns);
    Eigen::MatrixXd yield = Eigen::MatrixXd::Zero(count, count);  // Z^T Z
    for (const Part& part : wide_) yield(part.sides, part.sides) += part.rows.transpose() * part.rows;
    const Eigen::LDLT<Eigen::MatrixXd> parts(yield);
    const Eigen::MatrixXd root = parts.transpositionsP().transpose() * Eigen::MatrixXd(parts.matrixL()) *
                                 parts.vectorD().cwiseMax(0.0).cwiseSqrt().asDiagonal();  // C
    const Eigen::MatrixXd across = stiffness * root;
    const Eigen::LLT<Eigen::MatrixXd> inner(Eigen::MatrixXd::Identity(count, count) + root.transpose() * across);
    if (inner.info() != Eigen::Success) {
        wide_.clear();
        return false;
    }
    wide_change_ = Eigen::MatrixXd(stiffness) - across * inner.solve(across.transpose());
    return true;
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

int GridFactor::weakest() const {
    const auto failed = std::ranges::find_if(boxes_, [](const Box& box) { return box.failed_at >= 0; });
    if (failed != boxes_.end()) return first_[failed->nodes[0]] + failed->failed_at;
    const Box& box = *std::ranges::min_element(boxes_, {}, &Box::least_pivot);
    int at = 0;
    box.factor.diagonal().minCoeff(&at);
    return first_[box.nodes[0]] + at;
}

}  // namespace crampfit

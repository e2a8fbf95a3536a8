#include "forward/sparse_factor.hpp"

#include <cblas.h>
#include <cholmod.h>
#include <malloc.h>
#include <omp.h>

#include <functional>

namespace crampfit {

std::vector<int> dissection_order(int nodes_x, int nodes_y) {
    constexpr int small = 3;  // blocks no wider than this are taken row by row
    std::vector<int> place(static_cast<std::size_t>(nodes_x) * nodes_y);
    int next = 0;
    const auto take = [&](int i0, int i1, int j0, int j1) {
        for (int j = j0; j < j1; ++j)
            for (int i = i0; i < i1; ++i) place[static_cast<std::size_t>(j) * nodes_x + i] = next++;
    };
    const std::function<void(int, int, int, int)> dissect = [&](int i0, int i1, int j0, int j1) {
        const int wide = i1 - i0;
        const int high = j1 - j0;
        if (wide <= 0 || high <= 0) return;
        if (wide <= small && high <= small) return take(i0, i1, j0, j1);
        if (wide >= high) {
            const int middle = i0 + wide / 2;
            dissect(i0, middle, j0, j1);
            dissect(middle + 1, i1, j0, j1);
            take(middle, middle + 1, j0, j1);
        } else {
            const int middle = j0 + high / 2;
            dissect(i0, i1, j0, middle);
            dissect(i0, i1, middle + 1, j1);
            take(i0, i1, middle, middle + 1);
        }
    };
    dissect(0, nodes_x, 0, nodes_y);
    return place;
}

struct SparseFactor::Parts {
    cholmod_common common;
    cholmod_factor* factor = nullptr;

    Parts() {
        cholmod_start(&common);
        common.nmethods = 1;
        common.method[0].ordering = CHOLMOD_NATURAL;
        common.postorder = 1;
        common.supernodal = CHOLMOD_SUPERNODAL;
        common.print = 0;
        common.quick_return_if_not_posdef = 1;
    }
    ~Parts() {
        cholmod_free_factor(&factor, &common);
        cholmod_finish(&common);
    }
};

SparseFactor::SparseFactor() : parts_(std::make_unique<Parts>()) {
    // Runs of a fit go side by side, a core each; and sums must not depend on the number of threads.
    openblas_set_num_threads(1);
    // A walk makes a factor after the other, each of the same tens of megabytes: giving them back to the system and asking for them
    // anew, page by page, takes a quarter of its time.
    mallopt(M_MMAP_THRESHOLD, 1 << 30);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
}

SparseFactor::~SparseFactor() = default;

bool SparseFactor::factor(const Eigen::SparseMatrix<double>& lower, bool new_pattern) {
    cholmod_sparse view{};
    view.nrow = view.ncol = static_cast<std::size_t>(lower.rows());
    view.nzmax = static_cast<std::size_t>(lower.nonZeros());
    view.p = const_cast<int*>(lower.outerIndexPtr());
    view.i = const_cast<int*>(lower.innerIndexPtr());
    view.x = const_cast<double*>(lower.valuePtr());
    view.stype = -1;
    view.itype = CHOLMOD_INT;
    view.xtype = CHOLMOD_REAL;
    view.dtype = CHOLMOD_DOUBLE;
    view.sorted = view.packed = 1;
    Parts& parts = *parts_;
    omp_set_max_active_levels(0);  // of this thread; CHOLMOD asks for four threads whatever the user says
    if (new_pattern || !parts.factor) {
        cholmod_free_factor(&parts.factor, &parts.common);
        parts.factor = cholmod_analyze(&view, &parts.common);
    }
    cholmod_factorize(&view, parts.factor, &parts.common);
    return parts.common.status == CHOLMOD_OK && parts.factor->minor == parts.factor->n;
}

Eigen::MatrixXd SparseFactor::solve(const Eigen::MatrixXd& right) const {
    cholmod_dense view{};
    view.nrow = view.d = static_cast<std::size_t>(right.rows());
    view.ncol = static_cast<std::size_t>(right.cols());
    view.nzmax = view.nrow * view.ncol;
    view.x = const_cast<double*>(right.data());
    view.xtype = CHOLMOD_REAL;
    view.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* found = cholmod_solve(CHOLMOD_A, parts_->factor, &view, &parts_->common);
    Eigen::MatrixXd result = Eigen::Map<Eigen::MatrixXd>(static_cast<double*>(found->x), right.rows(), right.cols());
    cholmod_free_dense(&found, &parts_->common);
    return result;
}

double SparseFactor::reciprocal_condition() const { return cholmod_rcond(parts_->factor, &parts_->common); }

} // namespace crampfit

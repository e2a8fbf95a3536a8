#pragma once

#include "forward/discretisation.hpp"
#include "forward/side_by_side.hpp"
#include "forward/team.hpp"

namespace crampfit {

/// Rows of cells in strips. Every second strip is taken first, then the others: strips of one turn share no node, so that any
/// number of threads adds to the nodes in the same order and comes to the same bits.
class Strips {
  public:
    explicit Strips(const Layout& layout)
        : cells_(layout.cells()), cells_a_strip_(std::max(least_rows, layout.cells_y / about_so_many) * layout.cells_x) {}

    int count() const { return (cells_ + cells_a_strip_ - 1) / cells_a_strip_; }
    int first_cell(int strip) const { return std::min(strip * cells_a_strip_, cells_); }

    /// Calls job(strip) for each.
    template <class Job>
    void each(Team& team, const Job& job) const {
        for (const int turn : {0, 1}) team.each((count() + 1 - turn) / 2, [&](int i) { job(2 * i + turn); });
    }

    /// The same in threads that are free.
    template <class Job>
    void each(bool side_by_side, const Job& job) const {
        constexpr int parts = 4;           // of a turn: more than threads that are free as a rule, as one may come late
        constexpr int least_cells = 2000;  // that are worth waking another thread
        for (const int turn : {0, 1}) {
            const int strips = (count() + 1 - turn) / 2;
            do_side_by_side(side_by_side && cells_ >= least_cells, parts, [&](std::size_t part) {
                const int k = static_cast<int>(part);
                for (int i = k * strips / parts; i < (k + 1) * strips / parts; ++i) job(2 * i + turn);
            });
        }
    }

  private:
    static constexpr int about_so_many = 32;
    static constexpr int least_rows = 2;  // of cells; three rows of nodes reach over no more
    int cells_, cells_a_strip_;
};

}  // namespace crampfit

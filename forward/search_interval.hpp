#pragma once

#include <algorithm>

namespace crampfit {

/// When what may touch must be looked for anew. A search takes in a margin about it; the next is due when anything may have gone
/// a part of that, if it goes on as since the last.
class SearchInterval {
  public:
    /// Of one step: each is a search.
    explicit SearchInterval(int most_steps) : most_(most_steps) {}

    bool searches_each_step() const { return most_ == 1; }
    bool is_due() { return ++since_ >= steps_; }  // asked once a step

    /// After a search: `way` [m] is the farthest that anything has gone since the last, `most` [m] what it may go to the next.
    void has_searched(double way, double most) {
        const int longer = std::min(2 * since_ + 1, most_);
        steps_ = way * longer > most * since_ ? std::max(1, static_cast<int>(most * since_ / way)) : longer;
        since_ = 0;
    }

  private:
    int most_;
    int since_ = 0;  // steps
    int steps_ = 1;
};

}  // namespace crampfit

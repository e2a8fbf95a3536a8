#include "inverse/farm.hpp"

#include <algorithm>

namespace crampfit {

Evaluation Sharing::operator()(const Eigen::VectorXd& values, int threads) {
    if (!farm_) {
        return here_(values, threads);
    }
    int busy = busy_;
    while (busy < threads_ && !busy_.compare_exchange_weak(busy, busy + 1)) {
    }
    if (busy == threads_) {
        return farm_->evaluate(values);
    }
    const struct Leave {
        std::atomic<int>& count;
        ~Leave() { --count; }
    } leave{busy_};
    return here_(values, std::min(threads, threads_));
}

}  // namespace crampfit

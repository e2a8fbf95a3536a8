#pragma once

#include <cstddef>
#include <future>
#include <vector>

namespace crampfit {

/// Does job(0) .. job(count - 1), each in a thread of its own, or one after the other. Throws what a job throws.
template <class Job>
void do_side_by_side(bool side_by_side, std::size_t count, const Job& job) {
    std::vector<std::future<void>> others;
    for (std::size_t k = 1; k < count; ++k)
        others.push_back(std::async(side_by_side ? std::launch::async : std::launch::deferred, [&job, k] { job(k); }));
    if (count > 0) job(0);
    for (std::future<void>& other : others) other.get();
}

}  // namespace crampfit

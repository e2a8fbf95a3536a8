#pragma once

#include <cstddef>

namespace crampfit {

namespace detail {

using Job = void (*)(const void* job, std::size_t k);
void share_out(std::size_t count, Job call, const void* job);

}  // namespace detail

/// Lets so many threads share what is done side by side, the caller's own among them, where fewer have. Whether they are more
/// than one.
bool have_threads(int threads);

/// Does job(0) .. job(count - 1), the first in this thread and others in threads that are free, or one after the other. Jobs may
/// themselves call this. Throws what the first of them throws that does.
template <class Job>
void do_side_by_side(bool side_by_side, std::size_t count, const Job& job) {
    if (side_by_side && count > 1) {
        detail::share_out(
            count, [](const void* work, std::size_t k) { (*static_cast<const Job*>(work))(k); }, &job);
    } else {
        for (std::size_t k = 0; k < count; ++k) job(k);
    }
}

}  // namespace crampfit

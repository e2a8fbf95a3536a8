#pragma once

#include <functional>

namespace crampfit {

/// Threads to use when `asked` says how many: 0 means one a core.
int thread_count(int asked);

/// Calls job(0) .. job(count - 1), at most `threads` of them at a time, each exactly once and in any order.
/// If jobs throw, the exception of the lowest index is thrown here when all have ended.
void parallel_for(int count, int threads, const std::function<void(int)>& job);

}  // namespace crampfit

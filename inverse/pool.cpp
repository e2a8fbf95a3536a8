#include "inverse/pool.hpp"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <thread>
#include <vector>

namespace crampfit {

int thread_count(int asked) { return asked > 0 ? asked : std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

void parallel_for(int count, int threads, const std::function<void(int)>& job) {
    std::vector<std::exception_ptr> thrown(static_cast<std::size_t>(count));
    std::atomic<int> next{0};
    const auto work = [&] {
        for (int i = next++; i < count; i = next++) {
            try {
                job(i);
            } catch (...) {  // kept for the caller: an exception must not end a thread
                thrown[static_cast<std::size_t>(i)] = std::current_exception();
            }
        }
    };
    {
        // A forward run takes seconds and starting a thread takes microseconds, so threads are not kept between calls.
        std::vector<std::jthread> others;
        for (int i = 1; i < std::min(threads, count); ++i) {
            others.emplace_back(work);
        }
        work();
    }
    for (const std::exception_ptr& exception : thrown) {
        if (exception) {
            std::rethrow_exception(exception);
        }
    }
}

}  // namespace crampfit

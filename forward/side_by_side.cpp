#include "forward/side_by_side.hpp"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace crampfit {

namespace {

struct Batch {
    std::size_t count;
    detail::Job call;
    const void* job;
    std::size_t next = 1, done = 0;  // of all; the first is the caller's
    std::condition_variable all_done = {};
    std::size_t thrower = count;
    std::exception_ptr error = nullptr;  // the first job's of those that throw
};

// Threads that stay: most jobs take less time than a thread that starts and fetches its memory from the system.
class Pool {
  public:
    ~Pool() {
        const std::lock_guard lock(mutex_);
        over_ = true;
        added_.notify_all();
    }

    void have(int threads) {
        const std::lock_guard lock(mutex_);
        while (static_cast<int>(others_.size()) + 1 < threads) others_.emplace_back([this] { follow(); });
    }

    // What no other thread has begun when the caller is done with the first is the caller's too, so that no batch waits for one
    // that waits for it.
    void share_out(std::size_t count, detail::Job call, const void* job) {
        Batch batch{count, call, job};
        std::unique_lock lock(mutex_);
        waiting_.push_back(&batch);
        for (std::size_t k = 1; k < std::min(count, others_.size() + 1); ++k) added_.notify_one();
        for (std::size_t k = 0; k < batch.count; k = begin(batch)) work(lock, batch, k);
        batch.all_done.wait(lock, [&] { return batch.done == batch.count; });
        if (batch.error) std::rethrow_exception(batch.error);
    }

  private:
    void follow() {
        std::unique_lock lock(mutex_);
        while (true) {
            added_.wait(lock, [&] { return over_ || !waiting_.empty(); });
            if (over_) return;
            Batch& batch = *waiting_.front();
            work(lock, batch, begin(batch));
        }
    }

    // The number of the next job, if there is one.
    std::size_t begin(Batch& batch) {
        const std::size_t k = batch.next++;
        if (batch.next == batch.count) std::erase(waiting_, &batch);
        return k;
    }

    void work(std::unique_lock<std::mutex>& lock, Batch& batch, std::size_t k) {
        lock.unlock();
        std::exception_ptr error;
        try {
            batch.call(batch.job, k);
        } catch (...) {  // kept for the caller: an exception must not end a thread
            error = std::current_exception();
        }
        lock.lock();
        if (error && k < batch.thrower) batch.thrower = k, batch.error = error;
        if (++batch.done == batch.count) batch.all_done.notify_one();
    }

    std::mutex mutex_;
    std::condition_variable added_;
    std::deque<Batch*> waiting_;  // those with jobs that nobody has begun
    bool over_ = false;
    std::vector<std::jthread> others_;
};

Pool& pool() {
    static Pool all;
    return all;
}

}  // namespace

bool have_threads(int threads) {
    if (threads > 1) pool().have(threads);
    return threads > 1;
}

void detail::share_out(std::size_t count, Job call, const void* job) { pool().share_out(count, call, job); }

}  // namespace crampfit

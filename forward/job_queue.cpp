#include "forward/job_queue.hpp"

#include <utility>

namespace crampfit {

JobQueue::~JobQueue() {
    const std::lock_guard lock(mutex_);
    over_ = true;
    changed_.notify_all();
}

std::size_t JobQueue::add(std::function<void()> job) {
    const std::lock_guard lock(mutex_);
    waiting_.push_back(std::move(job));
    changed_.notify_all();
    if (beside_ && !thread_.joinable())
        thread_ = std::jthread([this] {
            std::unique_lock held(mutex_);
            while (true) {
                changed_.wait(held, [&] { return over_ || !waiting_.empty(); });
                if (over_ || error_) return;
                work(held);
            }
        });
    return added_++;
}

void JobQueue::wait_for(std::size_t job) {
    std::unique_lock lock(mutex_);
    wait(lock, job + 1);
}

void JobQueue::wait_for_all() {
    std::unique_lock lock(mutex_);
    wait(lock, added_);
}

void JobQueue::wait(std::unique_lock<std::mutex>& lock, std::size_t least_done) {
    while (!beside_ && done_ < least_done && !error_) work(lock);
    changed_.wait(lock, [&] { return done_ >= least_done || error_; });
    if (done_ < least_done) std::rethrow_exception(error_);
}

// The next job.
void JobQueue::work(std::unique_lock<std::mutex>& lock) {
    const std::function<void()> job = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    std::exception_ptr error;
    try {
        job();
    } catch (...) {  // kept for whoever waits: an exception must not end a thread
        error = std::current_exception();
    }
    lock.lock();
    if (error) error_ = error;
    else ++done_;
    changed_.notify_all();
}

}  // namespace crampfit

#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

namespace crampfit {

/// Jobs done one after the other in the order in which they came: in a thread beside, or else as they are waited for. What is not
/// begun when this ends is not done.
class JobQueue {
  public:
    explicit JobQueue(bool beside) : beside_(beside) {}
    ~JobQueue();
    JobQueue(const JobQueue&) = delete;
    JobQueue& operator=(const JobQueue&) = delete;

    /// The number of the job, by which to wait for it.
    std::size_t add(std::function<void()> job);

    /// Returns when this job is done. Throws what it or one before it has thrown.
    void wait_for(std::size_t job);

    void wait_for_all();  // that have been added

  private:
    void wait(std::unique_lock<std::mutex>& lock, std::size_t least_done);
    void work(std::unique_lock<std::mutex>& lock);

    bool beside_, over_ = false;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<std::function<void()>> waiting_;
    std::size_t added_ = 0, done_ = 0;
    std::exception_ptr error_;
    std::jthread thread_;
};

}  // namespace crampfit

#pragma once

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace crampfit {

/// Threads that stay together for a run: a time step is too short to start them anew.
class Team {
  public:
    explicit Team(int threads);
    ~Team();
    Team(const Team&) = delete;
    Team& operator=(const Team&) = delete;

    /// Calls job(0) .. job(count - 1) side by side, each once, and returns when all are done. No job may throw.
    template <class Job>
    void each(int count, const Job& job) {
        if (others_.empty() || count < 2) {
            for (int i = 0; i < count; ++i) job(i);
        } else {
            share([](const void* work, int i) { (*static_cast<const Job*>(work))(i); }, &job, count);
        }
    }

    /// Calls job(first, last) for pieces of 0 .. count of this length, whatever the number of threads.
    static constexpr int piece = 2048;
    template <class Job>
    void pieces(int count, const Job& job) {
        each((count + piece - 1) / piece, [&](int i) { job(i * piece, std::min(count, (i + 1) * piece)); });
    }

  private:
    using Call = void (*)(const void* job, int i);
    void share(Call call, const void* job, int count);
    void work();
    void follow();

    Call call_ = nullptr;
    const void* job_ = nullptr;
    int count_ = 0;
    std::atomic<int> next_{0};  // job to be taken
    std::atomic<int> busy_{0};  // of the others
    std::atomic<unsigned> round_{0};
    std::atomic<bool> over_{false};
    std::vector<std::jthread> others_;
};

}  // namespace crampfit

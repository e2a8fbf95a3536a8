#include "forward/job_queue.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

namespace crampfit {
namespace {

TEST(UnitJobQueue, JobsAreDoneInTheirOrder) {
    for (const bool beside : {false, true}) {
        std::vector<int> done;
        JobQueue jobs(beside);
        std::vector<std::size_t> numbers;
        for (int k = 0; k < 100; ++k) numbers.push_back(jobs.add([&done, k] { done.push_back(k); }));
        jobs.wait_for(numbers[40]);
        if (!beside) {
            EXPECT_EQ(done.size(), 41u) << "no more than is waited for";
        }
        jobs.wait_for_all();
        ASSERT_EQ(done.size(), 100u);
        for (int k = 0; k < 100; ++k) EXPECT_EQ(done[k], k);
        jobs.wait_for(numbers[3]);  // once more
    }
}

TEST(UnitJobQueue, ThrowsWhatAJobHasThrown) {
    for (const bool beside : {false, true}) {
        JobQueue jobs(beside);
        const std::size_t good = jobs.add([] {});
        const std::size_t bad = jobs.add([] { throw std::runtime_error("bad"); });
        jobs.wait_for(good);
        const std::size_t after = jobs.add([] {});
        EXPECT_THROW(jobs.wait_for(bad), std::runtime_error);
        EXPECT_THROW(jobs.wait_for(after), std::runtime_error);
        jobs.wait_for(good);
    }
}

TEST(UnitJobQueue, DropsWhatIsNotBegun) {
    constexpr int count = 1000;
    for (const bool beside : {false, true}) {
        std::atomic<int> done = 0;
        {
            JobQueue jobs(beside);
            const auto job = [&] {
                std::this_thread::sleep_for(std::chrono::milliseconds(1));
                ++done;
            };
            for (int k = 0; k < count; ++k) jobs.add(job);
        }
        EXPECT_LT(done, beside ? count : 1);
    }
}

}  // namespace
}  // namespace crampfit

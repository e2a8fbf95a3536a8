#include "forward/job_queue.hpp"
#include "forward/side_by_side.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
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

// Jobs share out jobs of their own, more than there are threads, from several threads at a time.
TEST(UnitSideBySide, EachJobIsDoneOnce) {
    constexpr std::size_t callers = 3, outer = 5, inner = 7, rounds = 50;
    std::vector<std::atomic<int>> done(callers * outer * inner);
    have_threads(3);
    {
        std::vector<std::jthread> threads;
        for (std::size_t caller = 0; caller < callers; ++caller)
            threads.emplace_back([&, caller] {
                for (std::size_t round = 0; round < rounds; ++round)
                    do_side_by_side(caller != 1, outer, [&](std::size_t i) {
                        do_side_by_side(true, inner, [&](std::size_t j) { ++done[(caller * outer + i) * inner + j]; });
                    });
            });
    }
    for (const std::atomic<int>& times : done) EXPECT_EQ(times, static_cast<int>(rounds));
}

TEST(UnitSideBySide, NoMoreThreadsTakePartThanAskedFor) {
    constexpr int asked = 9;  // more than any other test of this program
    EXPECT_FALSE(have_threads(1));
    EXPECT_TRUE(have_threads(asked));
    have_threads(asked - 1);  // fewer change nothing
    std::mutex mutex;
    std::set<std::thread::id> seen;
    do_side_by_side(true, 30, [&](std::size_t) {
        do_side_by_side(true, 4, [&](std::size_t) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            const std::lock_guard lock(mutex);
            seen.insert(std::this_thread::get_id());
        });
    });
    EXPECT_EQ(seen.size(), static_cast<std::size_t>(asked));
}

TEST(UnitSideBySide, ThrowsWhatTheFirstOfItsJobsThrows) {
    have_threads(3);
    for (const bool side_by_side : {false, true})
        for (int round = 0; round < 50; ++round) {
            std::atomic<int> begun = 0;
            try {
                do_side_by_side(side_by_side, 6, [&](std::size_t k) {
                    ++begun;
                    if (k >= 2) throw std::runtime_error(std::to_string(k));
                });
                FAIL() << "nothing thrown";
            } catch (const std::runtime_error& error) {
                EXPECT_STREQ(error.what(), "2");
            }
            EXPECT_EQ(begun, side_by_side ? 6 : 3);
        }
}

}  // namespace
}  // namespace crampfit

#include "forward/team.hpp"

namespace crampfit {

namespace {

// The next round begins within microseconds as a rule: sooner than a thread that sleeps wakes up.
constexpr int looks_before_sleep = 2000;

template <class Value>
void wait_while(const std::atomic<Value>& value, Value old) {
    for (int k = 0; k < looks_before_sleep; ++k)
        if (value.load(std::memory_order_acquire) != old) return;
    value.wait(old, std::memory_order_acquire);
}

}  // namespace

Team::Team(int threads) {
    for (int i = 1; i < threads; ++i) others_.emplace_back([this] { follow(); });
}

Team::~Team() {
    over_ = true;
    ++round_;
    round_.notify_all();
}

void Team::share(Call call, const void* job, int count) {
    call_ = call;
    job_ = job;
    count_ = count;
    next_ = 0;
    busy_ = static_cast<int>(others_.size());
    ++round_;
    round_.notify_all();
    work();
    for (int busy = busy_; busy != 0; busy = busy_) wait_while(busy_, busy);
}

void Team::work() {
    for (int i = next_++; i < count_; i = next_++) call_(job_, i);
}

void Team::follow() {
    for (unsigned round = 0;;) {
        wait_while(round_, round);
        round = round_;
        if (over_) return;
        work();
        if (--busy_ == 0) busy_.notify_one();
    }
}

}  // namespace crampfit

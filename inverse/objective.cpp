#include "inverse/objective.hpp"

#include "inverse/pool.hpp"

#include <algorithm>
#include <cstddef>
#include <future>
#include <mutex>

namespace crampfit {

struct Objective::Shared {
    using Result = std::shared_ptr<const Evaluation>;

    Evaluate evaluate;
    const std::atomic<bool>* stop;
    OnRun on_run;
    std::mutex memo_mutex;
    std::map<Key, std::shared_future<Result>> memo;
    std::mutex on_run_mutex;
};

Objective::Objective(Eigen::Index parameters, Evaluate evaluate, int budget, int threads, const std::atomic<bool>* stop,
                     OnRun on_run)
    : parameters_(parameters), shared_(std::make_shared<Shared>()), budget_(budget), threads_(threads) {
    shared_->evaluate = std::move(evaluate);
    shared_->stop = stop;
    shared_->on_run = std::move(on_run);
}

const std::atomic<bool>* Objective::stop() const { return shared_->stop; }

bool Objective::stopped() const { return shared_->stop && shared_->stop->load(); }

std::shared_ptr<const Evaluation> Objective::run(const Eigen::VectorXd& point, int threads) const {
    std::promise<Shared::Result> promise;
    std::shared_future<Shared::Result> other;
    {
        const std::lock_guard lock(shared_->memo_mutex);
        const auto [entry, is_new] = shared_->memo.try_emplace(Key(point.begin(), point.end()));
        if (is_new) {
            entry->second = promise.get_future().share();
        } else {
            other = entry->second;
        }
    }
    if (other.valid()) {
        return other.get();  // another branch has run it, or is at it
    }
    try {
        auto result = std::make_shared<const Evaluation>(shared_->evaluate(point, threads));
        promise.set_value(result);
        if (shared_->on_run) {
            const std::lock_guard lock(shared_->on_run_mutex);
            shared_->on_run({point, result});
        }
        return result;
    } catch (...) {  // whoever waits for this run gets the exception too
        promise.set_exception(std::current_exception());
        throw;
    }
}

std::vector<std::shared_ptr<const Evaluation>> Objective::at(std::span<const Eigen::VectorXd> points) {
    std::vector<Eigen::VectorXd> wanted;
    for (const Eigen::VectorXd& point : points) {
        const bool known = known_.contains(Key(point.begin(), point.end()));
        const bool twice = std::find(wanted.begin(), wanted.end(), point) != wanted.end();
        if (!known && !twice && static_cast<int>(wanted.size()) < budget_left()) {
            wanted.push_back(point);
        }
    }
    std::vector<std::shared_ptr<const Evaluation>> results(wanted.size());
    const int count = static_cast<int>(wanted.size());
    parallel_for(count, threads_, [&](int i) {
        if (!stopped()) {
            const auto k = static_cast<std::size_t>(i);
            results[k] = run(wanted[k], std::max(1, threads_ / count));
        }
    });
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        if (results[i]) {
            runs_.push_back({wanted[i], results[i]});
            known_.emplace(Key(wanted[i].begin(), wanted[i].end()), results[i]);
            ++spent_;
        }
    }
    std::vector<std::shared_ptr<const Evaluation>> found;
    for (const Eigen::VectorXd& point : points) {
        const auto entry = known_.find(Key(point.begin(), point.end()));
        found.push_back(entry == known_.end() ? nullptr : entry->second);
    }
    return found;
}

std::shared_ptr<const Evaluation> Objective::at(const Eigen::VectorXd& point) { return at(std::span(&point, 1)).front(); }

Objective Objective::branch(int budget, int threads) const {
    Objective result = *this;
    result.runs_.clear();
    result.known_.clear();
    result.spent_ = 0;
    result.budget_ = budget;
    result.threads_ = threads;
    return result;
}

void Objective::join(const Objective& branch) {
    for (const Run& run : branch.runs_) {
        if (known_.emplace(Key(run.x.begin(), run.x.end()), run.evaluation).second) {
            runs_.push_back(run);
            ++spent_;
        }
    }
}

void Objective::judge_anew(const std::function<Evaluation(const Run&)>& judge) {
    for (Run& run : runs_) {
        run.evaluation = std::make_shared<const Evaluation>(judge(run));
        const Key key(run.x.begin(), run.x.end());
        known_[key] = run.evaluation;
        std::promise<Shared::Result> done;
        done.set_value(run.evaluation);
        const std::lock_guard lock(shared_->memo_mutex);
        shared_->memo[key] = done.get_future().share();
    }
}

const Run* Objective::best() const {
    const Run* best = nullptr;
    for (const Run& run : runs_) {
        if (run.evaluation->usable() && (!best || run.evaluation->misfit < best->evaluation->misfit)) {
            best = &run;
        }
    }
    return best;
}

}  // namespace crampfit

#include "inverse/scene_runs.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

namespace crampfit {
namespace {

bool finite(const Record& record) {
    return std::all_of(record.series.begin(), record.series.end(), [](const Instant& instant) {
        return std::isfinite(instant.time) && std::isfinite(instant.displacement) && std::isfinite(instant.force) &&
               std::isfinite(instant.crack_length);
    });
}

/// Asks a run to stop when the user does, and when it has taken too long.
class TimeLimit {
  public:
    TimeLimit(std::optional<double> seconds, const std::atomic<bool>* user) : user_(user), limited_(seconds) {
        if (seconds) {
            watch_ = std::jthread([this, end = Clock::now() + std::chrono::duration<double>(*seconds)](std::stop_token done) {
                while (!done.stop_requested() && !stop_) {
                    std::this_thread::sleep_for(std::chrono::milliseconds(5));
                    passed_ = Clock::now() > end;
                    stop_ = passed_ || (user_ && *user_);
                }
            });
        }
    }
    const std::atomic<bool>* stop() const { return limited_ ? &stop_ : user_; }
    bool passed() const { return passed_; }

  private:
    using Clock = std::chrono::steady_clock;

    const std::atomic<bool>* user_;
    bool limited_;
    std::atomic<bool> stop_{false}, passed_{false};
    std::jthread watch_;  // last: it ends before what it sets
};

}  // namespace

SceneRuns::SceneRuns(const Study& study, Forward forward, const std::atomic<bool>* stop)
    : scenes_(scenes_of(study)), forward_(std::move(forward)), stop_(stop), time_limit_(study.time_limit),
      settings_(scenes_.size()) {
    // A scene without latewood has no use for its toughness; some scene must have each key.
    for (std::size_t j = 0; j < study.parameters.size(); ++j) {
        for (const std::string& key : study.parameters[j].keys) {
            std::optional<InputError> unknown;
            bool found = false;
            for (std::size_t i = 0; i < scenes_.size(); ++i) {
                try {
                    get_number(*scenes_[i], key);
                    settings_[i].emplace_back(static_cast<Eigen::Index>(j), key);
                    found = true;
                } catch (const InputError& error) {
                    unknown = error;
                }
            }
            if (!found) {
                throw *unknown;
            }
        }
    }
}

SceneRuns::Outcome SceneRuns::run(std::size_t number, const Eigen::VectorXd& values) const {
    const auto begin = std::chrono::steady_clock::now();
    Outcome outcome;
    try {
        Scene scene = *scenes_[number];
        for (const auto& [parameter, key] : settings_[number]) {
            set_number(scene, key, values[parameter]);
        }
        TimeLimit limit(time_limit_, stop_);
        Record record = forward_(scene, limit.stop());
        const bool ended = record.status == RunStatus::finished || record.status == RunStatus::split;
        outcome.status = name(record.status);
        if (record.series.empty()) {
            outcome.status += ": the run gave no instants";
        } else if (!finite(record)) {
            outcome.status += ": the run gave numbers that are not finite";
        } else if (!ended) {
            outcome.status += limit.passed()          ? fmt::format(": longer than runs.time_limit = {:g} s", *time_limit_)
                              : record.message.empty() ? ""
                                                       : ": " + record.message;
        } else {
            outcome.record = std::move(record);
        }
    } catch (const std::exception& error) {
        outcome.status = error.what();
    }
    outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return outcome;
}

}  // namespace crampfit

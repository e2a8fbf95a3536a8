#include "inverse/scene_runs.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "inverse/machine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <future>
#include <mutex>
#include <thread>

namespace crampfit {
namespace {

constexpr const char* out_of_time = "longer than runs.time_limit = ";

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

bool had_less_time(const std::string& status, std::optional<double> limit) {
    constexpr double written = 1e-5;  // part of it that the digits leave open
    const std::string words = out_of_time;
    for (std::size_t at = status.find(words); at != std::string::npos; at = status.find(words, at + 1)) {
        const double had = std::strtod(status.c_str() + at + words.size(), nullptr);
        if (!limit || *limit > had * (1 + written)) {
            return true;
        }
    }
    return false;
}

/// The last records of each scene, by what was asked of it; those that are on their way too.
struct SceneRuns::Kept {
    static constexpr std::size_t most = 8;  // a scene

    using Entry = std::pair<Asked, std::shared_future<Outcome>>;

    std::mutex mutex;
    std::vector<std::deque<Entry>> of_scene;
};

SceneRuns::SceneRuns(const Study& study, Forward forward, const std::atomic<bool>* stop)
    : scenes_(scenes_of(study)), machines_(scenes_.size()), forward_(std::move(forward)), stop_(stop),
      time_limit_(study.time_limit), settings_(scenes_.size()), kept_(std::make_shared<Kept>()) {
    kept_->of_scene.resize(scenes_.size());
    for (std::size_t i = 0; i < study.experiments.size(); ++i) {
        machines_[i] = study.experiments[i].machine;
    }
    // A scene without latewood has no use for its toughness; some scene must have each key.
    for (std::size_t j = 0; j < study.parameters.size(); ++j) {
        for (std::size_t k = 0; k < study.parameters[j].keys.size(); ++k) {
            const std::string& key = study.parameters[j].keys[k];
            const Setting setting{static_cast<Eigen::Index>(j), study.parameters[j].factor(k), key};
            if (const auto found = find_machine_number(study, key, study.file.string(), "(any)")) {
                settings_[found->experiment].push_back({setting.parameter, setting.factor, key, found->number});
                continue;
            }
            std::optional<InputError> unknown;
            bool found = false;
            for (std::size_t i = 0; i < scenes_.size(); ++i) {
                try {
                    get_number(*scenes_[i], key);
                    settings_[i].push_back(setting);
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
    std::vector<double> numbers;
    Machine machine = machines_[number];
    for (const Setting& setting : settings_[number]) {
        const double value = setting.factor * values[setting.parameter];
        if (setting.of_machine) {
            machine.*setting.of_machine->value = value;
        } else {
            numbers.push_back(value);
        }
    }
    const Probes& probes = scenes_[number]->output.probes;
    Outcome outcome = once(number, {numbers, probes.instants});
    const bool moved = machine.compliance != 0 || machine.displacement_offset != 0;
    if (outcome.record && moved && probes.by_displacement && !probes.instants.empty()) {
        // Pictures that are timed by what was recorded: when that was, the run itself tells.
        const double before = outcome.seconds;
        outcome = once(number, {numbers, displacements_of_run(*outcome.record, machine, probes.instants)});
        outcome.seconds += before;
    }
    const bool seen_through = machine.compliance != 0 || machine.force_offset != 0 || machine.displacement_offset != 0;
    if (outcome.record && seen_through) {
        outcome.record = std::make_shared<const Record>(as_recorded(*outcome.record, machine));
        outcome.machine = machine;
    }
    return outcome;
}

// The kept outcome, which cost nothing now, or one to be kept.
SceneRuns::Outcome SceneRuns::once(std::size_t number, const Asked& asked) const {
    std::promise<Outcome> promise;
    std::shared_future<Outcome> known;
    {
        const std::lock_guard lock(kept_->mutex);
        std::deque<Kept::Entry>& entries = kept_->of_scene[number];
        const auto entry = std::find_if(entries.begin(), entries.end(), [&](const Kept::Entry& e) { return e.first == asked; });
        if (entry != entries.end()) {
            known = entry->second;
            std::rotate(entry, entry + 1, entries.end());  // to the back, as the one used last
        } else {
            entries.emplace_back(asked, promise.get_future().share());
            if (entries.size() > Kept::most) {
                entries.pop_front();
            }
        }
    }
    if (known.valid()) {
        Outcome outcome = known.get();
        outcome.seconds = 0;
        return outcome;
    }
    const Outcome outcome = run_scene(number, asked);
    promise.set_value(outcome);
    return outcome;
}

SceneRuns::Outcome SceneRuns::run_scene(std::size_t number, const Asked& asked) const {
    const auto begin = std::chrono::steady_clock::now();
    Outcome outcome;
    try {
        Scene scene = *scenes_[number];
        std::size_t next = 0;
        for (const Setting& setting : settings_[number]) {
            if (!setting.of_machine) {
                set_number(scene, setting.key, asked.numbers[next++]);
            }
        }
        scene.output.probes.instants = asked.pictures;
        TimeLimit limit(time_limit_, stop_);
        Record record = forward_(scene, limit.stop());
        const bool ended = record.status == RunStatus::finished || record.status == RunStatus::split;
        outcome.status = name(record.status);
        if (record.series.empty()) {
            outcome.status += ": the run gave no instants";
        } else if (!finite(record)) {
            outcome.status += ": the run gave numbers that are not finite";
        } else if (!ended) {
            outcome.status += limit.passed()           ? fmt::format(": {}{:g} s", out_of_time, *time_limit_)
                              : record.message.empty() ? ""
                                                       : ": " + record.message;
        } else {
            outcome.record = std::make_shared<const Record>(std::move(record));
        }
    } catch (const std::exception& error) {
        outcome.status = error.what();
    }
    outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return outcome;
}

}  // namespace crampfit

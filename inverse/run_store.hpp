#pragma once

#include "datasets/experiment.hpp"
#include "datasets/run_journal.hpp"
#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace crampfit {

/// Where forward runs are kept as they end, so that a study can go on after any end of the process.
struct RunKeeping {
    std::filesystem::path file;  // empty: they are not kept
    bool resume = false;         // take the runs that are there already, instead of beginning anew
};

/// All forward evaluations of a study, by the parameters' values: none is made twice, in this process or after it.
class RunStore {
  public:
    /// `stop` may be null. Throws InputError when the runs cannot be kept, or belong to another study.
    RunStore(const RunKeeping& keeping, const Study& study, const std::atomic<bool>* stop);

    /// What the study gave with these values [parameters], SI, before; or else what `run` gives now. Called from several
    /// threads at a time. A run that the user has stopped is not kept.
    Evaluation at(const Eigen::VectorXd& values, const std::function<Evaluation()>& run);

    /// What is known of a run; empty where it has not been made.
    std::optional<Evaluation> known(const Eigen::VectorXd& values);

    /// Counts searches: the number of the next one.
    std::size_t begin_search() { return begun_++; }

    /// What the n-th search among cheap runs has found; empty where `asked`, which tells what it was to look for, differs.
    std::optional<std::vector<double>> found_by_search(std::size_t n, std::uint64_t asked) const;
    void keep_search(std::size_t n, std::uint64_t asked, const std::vector<double>& found);

  private:
    std::unique_ptr<RunJournal> journal_;
    const std::atomic<bool>* stop_;
    std::mutex mutex_;
    std::map<std::vector<double>, Evaluation> known_;
    std::map<std::size_t, std::pair<std::uint64_t, std::vector<double>>> searches_;  // of an earlier process
    std::size_t begun_ = 0;
};

/// What --set changed in the scenes of a study, as it stands on a command line after its other words.
std::string scene_settings_text(const Study& study);

/// A word of a command line, in quotes where a shell would make something else of it.
std::string quoted_for_shell(const std::string& word);

/// Whether the user ended this run, which is no failure of its.
bool was_stopped(const Evaluation& evaluation);

/// Why an evaluation failed and the commands that run its scenes again with these values [parameters], SI; empty for one
/// that did not fail, or that the user has stopped.
std::string failure_text(const Study& study, const Eigen::VectorXd& values, const Evaluation& evaluation);

}  // namespace crampfit

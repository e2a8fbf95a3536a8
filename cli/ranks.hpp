#pragma once

#include "inverse/farm.hpp"

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace crampfit::cli {

/// The processes that `mpirun` or `srun` has started with this one. Rank 0 leads: it runs the method, and writes; the others
/// serve it with forward runs. A process started alone is rank 0 of one, and MPI is not even initialised.
///
/// A rank that is lost takes the others with it, as MPI has it; runs that have ended are kept beside the output.
class Ranks : private Farm {
  public:
    /// `threads` of this process serve. One object at a time.
    explicit Ranks(int threads);
    ~Ranks() override;  // the leader lets the others go
    Ranks(const Ranks&) = delete;
    Ranks& operator=(const Ranks&) = delete;

    bool leads() const { return rank_ == 0; }

    /// The leader's way to the others, who are waited for; null where it is alone. Throws std::runtime_error with the reason of
    /// one that cannot serve.
    Farm* farm();

    /// The others' part: evaluates what the leader asks for, until it lets them go. `prepare` makes the study's function, of one
    /// of the models that it compares; what it throws the leader is told.
    void serve(const std::function<StudyFunction(int model)>& prepare);

  private:
    struct Place {
        int rank;
        int tag;
    };

    int places() const override { return count_; }
    void choose_model(int model) override { model_ = model; }
    Evaluation evaluate(const Eigen::VectorXd& values) override;

    void greet();
    Place take_place();
    void leave(Place place);

    bool started_ = false;  // MPI
    bool greeted_ = false;
    int rank_ = 0, size_ = 1;
    int threads_;
    int count_ = 0;
    int model_ = 0;
    std::vector<std::string> reasons_;  // of those that cannot serve
    std::mutex mpi_;                    // one thread at a time talks
    std::mutex places_mutex_;
    std::condition_variable place_is_free_;
    std::vector<Place> free_;
};

/// Cores of this machine for each rank that runs on it.
int cores_of_rank();

}  // namespace crampfit::cli

#include "cli/ranks.hpp"

#include <fmt/format.h>

#define OMPI_SKIP_MPICXX 1  // the C interface is all that is used
#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <stdexcept>
#include <thread>

namespace crampfit::cli {

namespace {

// Tags of messages: to a place by its number from 1, back from it by the same.
constexpr int greeting = 1'000'000;
constexpr int farewell = 1'000'001;

bool started_by_mpi() {
    for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"})
        if (std::getenv(name)) return true;
    return false;
}

/// Waits without keeping a core busy, as MPI's own waiting does; a run takes milliseconds at least.
class Patience {
  public:
    void wait() {
        std::this_thread::sleep_for(pause_);
        pause_ = std::min(2 * pause_, std::chrono::microseconds(2000));
    }

  private:
    std::chrono::microseconds pause_{50};
};

template <class Number>
void put(std::string& bytes, Number number) {
    bytes.append(reinterpret_cast<const char*>(&number), sizeof(number));
}

void put(std::string& bytes, const Eigen::VectorXd& numbers) {
    put(bytes, static_cast<std::int64_t>(numbers.size()));
    bytes.append(reinterpret_cast<const char*>(numbers.data()), static_cast<std::size_t>(numbers.size()) * sizeof(double));
}

/// Takes apart what `put` has put together.
class Reader {
  public:
    explicit Reader(const std::string& bytes) : bytes_(bytes) {}

    template <class Number>
    Number number() {
        Number number{};
        std::memcpy(&number, bytes_.data() + at_, sizeof(number));
        at_ += sizeof(number);
        return number;
    }
    Eigen::VectorXd vector() {
        Eigen::VectorXd numbers(number<std::int64_t>());
        const std::size_t size = static_cast<std::size_t>(numbers.size()) * sizeof(double);
        std::memcpy(numbers.data(), bytes_.data() + at_, size);
        at_ += size;
        return numbers;
    }
    std::string rest() const { return bytes_.substr(at_); }

  private:
    const std::string& bytes_;
    std::size_t at_ = 0;
};

std::string packed(const Evaluation& evaluation) {
    std::string bytes;
    put(bytes, evaluation.misfit);
    put(bytes, evaluation.seconds);
    put(bytes, evaluation.residuals);
    put(bytes, evaluation.modelled);
    return bytes + evaluation.status;
}

Evaluation unpacked(const std::string& bytes) {
    Reader reader(bytes);
    Evaluation evaluation;
    evaluation.misfit = reader.number<double>();
    evaluation.seconds = reader.number<double>();
    evaluation.residuals = reader.vector();
    evaluation.modelled = reader.vector();
    evaluation.status = reader.rest();
    return evaluation;
}

void send(const std::string& bytes, int rank, int tag) {
    MPI_Send(bytes.data(), static_cast<int>(bytes.size()), MPI_BYTE, rank, tag, MPI_COMM_WORLD);
}

struct Message {
    int tag;
    std::string bytes;
};

/// A message that has come, if one has.
std::optional<Message> receive(int rank, int tag) {
    int there = 0, size = 0;
    MPI_Status status;
    MPI_Iprobe(rank, tag, MPI_COMM_WORLD, &there, &status);
    if (!there) return std::nullopt;
    MPI_Get_count(&status, MPI_BYTE, &size);
    Message message{status.MPI_TAG, std::string(static_cast<std::size_t>(size), '\0')};
    MPI_Recv(message.bytes.data(), size, MPI_BYTE, status.MPI_SOURCE, status.MPI_TAG, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    return message;
}

/// The serving ranks' study, model by model, made when it is first asked for.
class Functions {
  public:
    explicit Functions(const std::function<StudyFunction(int)>& prepare) : prepare_(prepare) {}

    Evaluation evaluate(const std::string& request) {
        Reader reader(request);
        const auto model = reader.number<std::int32_t>();
        const Eigen::VectorXd values = reader.vector();
        try {
            return of(model)(values, 1);
        } catch (const std::exception& error) {
            Evaluation failed;
            failed.status = error.what();
            return failed;
        }
    }

    const StudyFunction& of(int model) {
        const std::lock_guard lock(mutex_);
        const auto found = made_.find(model);
        return found != made_.end() ? found->second : made_.emplace(model, prepare_(model)).first->second;
    }

  private:
    const std::function<StudyFunction(int)>& prepare_;
    std::mutex mutex_;
    std::map<int, StudyFunction> made_;
};

}  // namespace

int cores_of_rank() {
    const char* const local = std::getenv("OMPI_COMM_WORLD_LOCAL_SIZE");
    const int ranks = local ? std::max(1, std::atoi(local)) : 1;
    return std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / ranks);
}

Ranks::Ranks(int threads) : threads_(threads) {
    if (!started_by_mpi()) return;
    int provided = MPI_THREAD_SINGLE;
    if (MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &provided) != MPI_SUCCESS || provided < MPI_THREAD_SERIALIZED)
        throw std::runtime_error("MPI could not be started for several threads");
    started_ = true;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
}

Ranks::~Ranks() {
    if (!started_) return;
    if (leads()) {
        greet();
        for (int rank = 1; rank < size_; ++rank) send("", rank, farewell);
    }
    MPI_Finalize();
}

void Ranks::greet() {
    for (int rank = 1; rank < size_ && !greeted_; ++rank) {
        std::optional<Message> hello;
        for (Patience patience; !(hello = receive(rank, greeting)); patience.wait()) {
        }
        Reader reader(hello->bytes);
        const int threads = reader.number<std::int32_t>();
        if (threads == 0) reasons_.push_back(fmt::format("rank {}: {}", rank, reader.rest()));
        for (int place = 1; place <= threads; ++place) free_.push_back({rank, place});
        count_ += threads;
    }
    greeted_ = true;
}

Farm* Ranks::farm() {
    if (size_ == 1) return nullptr;
    greet();
    if (!reasons_.empty()) throw std::runtime_error(reasons_.front());
    return this;
}

Ranks::Place Ranks::take_place() {
    std::unique_lock lock(places_mutex_);
    place_is_free_.wait(lock, [&] { return !free_.empty(); });
    const Place place = free_.back();
    free_.pop_back();
    return place;
}

void Ranks::leave(Place place) {
    {
        const std::lock_guard lock(places_mutex_);
        free_.push_back(place);
    }
    place_is_free_.notify_one();
}

Evaluation Ranks::evaluate(const Eigen::VectorXd& values) {
    std::string request;
    put(request, static_cast<std::int32_t>(model_));
    put(request, values);
    const Place place = take_place();
    {
        const std::lock_guard lock(mpi_);
        send(request, place.rank, place.tag);
    }
    std::optional<Message> answer;
    for (Patience patience;; patience.wait()) {
        const std::lock_guard lock(mpi_);
        if ((answer = receive(place.rank, place.tag))) break;
    }
    leave(place);
    return unpacked(answer->bytes);
}

void Ranks::serve(const std::function<StudyFunction(int model)>& prepare) {
    Functions functions(prepare);
    std::string hello;
    try {
        functions.of(0);
        put(hello, static_cast<std::int32_t>(threads_));
    } catch (const std::exception& error) {
        put(hello, std::int32_t{0});
        hello += error.what();
    }
    send(hello, 0, greeting);

    // Threads evaluate; this one alone talks to the leader.
    std::mutex mutex;
    std::deque<Message> answers;
    std::map<int, std::jthread> at_work;
    for (Patience patience;; patience.wait()) {
        while (std::optional<Message> request = receive(0, MPI_ANY_TAG)) {
            if (request->tag == farewell) return;
            patience = {};
            at_work[request->tag] = std::jthread([&, message = *request] {
                const Message answer{message.tag, packed(functions.evaluate(message.bytes))};
                const std::lock_guard lock(mutex);
                answers.push_back(answer);
            });
        }
        std::deque<Message> ready;
        {
            const std::lock_guard lock(mutex);
            ready.swap(answers);
        }
        for (const Message& answer : ready) send(answer.bytes, 0, answer.tag);
    }
}

}  // namespace crampfit::cli

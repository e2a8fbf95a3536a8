#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace crampfit {

/// A forward run as it is kept on disk.
struct StoredRun {
    std::vector<double> parameters;  // SI
    std::vector<double> results;     // what the study makes of the run; empty when it failed
    std::string status;
    double seconds = 0;
};

/// Forward runs of a study on disk, so that no end of the process, kill -9 included, loses one that has ended. HDF5 files are not
/// whole while they are written; this one is at every moment: entries of length, checksum and bytes, each appended in one write,
/// and a last one that is torn is cut off when the file is opened again.
class RunJournal {
  public:
    /// Opens `file` for appending. `study` says what the runs depend on besides their parameters. With `resume` the runs that are
    /// there are read; without, or where there is no such file, it begins empty, and what was there is kept in a file with ~ at
    /// its end. Throws InputError when the file cannot be
    /// written, is in use, or holds runs of another study.
    RunJournal(const std::filesystem::path& file, std::uint64_t study, bool resume);
    ~RunJournal();
    RunJournal(const RunJournal&) = delete;
    RunJournal& operator=(const RunJournal&) = delete;

    const std::vector<StoredRun>& found() const { return found_; }  // when it was opened

    /// Appends a run. May be called from several threads.
    void add(const StoredRun& run);

  private:
    std::size_t read(const std::string& bytes, std::uint64_t study);
    void append(std::string_view bytes);

    std::filesystem::path file_;
    int descriptor_ = -1;
    std::vector<StoredRun> found_;
    std::mutex mutex_;
    std::chrono::steady_clock::time_point synced_;
};

/// A number for what was put in, in its order: FNV-1a (Fowler, Noll and Vo 1991), 64 bits.
class Fingerprint {
  public:
    Fingerprint& add(std::string_view bytes);
    Fingerprint& add(double number);
    Fingerprint& add(const std::vector<double>& numbers);
    std::uint64_t value() const { return value_; }

  private:
    std::uint64_t value_ = 0xcbf29ce484222325u;
};

}  // namespace crampfit

#pragma once

#include "tests/temporary_folder.hpp"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <sstream>
#include <string>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

/// What a run of the command left.
struct Outcome {
    int status;  // as a shell would say it: 128 + the signal's number for one that a signal ended
    std::string out;
    std::string error;
};

/// The real command, run with its own streams in a folder of its own.
class Command {
  public:
    TemporaryFolder folder;

    /// Starts it and returns; `finish` must follow.
    void start(const std::vector<std::string>& arguments) {
        std::fflush(nullptr);  // or the new process writes out once more what this one has printed
        process_ = ::fork();
        if (process_ != 0) return;
        std::vector<char*> words{const_cast<char*>(COMMAND)};
        for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
        words.push_back(nullptr);
        if (!std::freopen((folder / "out.txt").c_str(), "w", stdout) ||
            !std::freopen((folder / "error.txt").c_str(), "w", stderr))
            ::_exit(126);
        ::execv(COMMAND, words.data());
        ::_exit(127);
    }

    void send(int signal) const { ::kill(process_, signal); }

    Outcome finish() {
        int status = 0;
        while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
        }
        const int code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
        return {code, folder.read("out.txt"), folder.read("error.txt")};
    }

    Outcome run(const std::vector<std::string>& arguments) {
        start(arguments);
        return finish();
    }

    /// Waits until `text` stands in a file of the folder, a minute at most; false when it did not come.
    bool wait_for(const std::string& file, const std::string& text) const {
        for (int i = 0; i < 6000; ++i) {
            if (folder.read(file).find(text) != std::string::npos) return true;
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        return false;
    }

    std::string path(const std::string& name) const { return (folder / name).string(); }

  private:
    pid_t process_ = -1;
};

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// A table as `csv` writes it, by the names of its columns.
inline std::vector<std::map<std::string, std::string>> rows_of(const std::string& csv) {
    const auto fields = [](const std::string& line) {
        std::vector<std::string> parts;
        std::istringstream in(line);
        for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
        return parts;
    };
    std::istringstream lines(csv);
    std::string line;
    std::getline(lines, line);
    const std::vector<std::string> names = fields(line);
    std::vector<std::map<std::string, std::string>> rows;
    while (std::getline(lines, line)) {
        const std::vector<std::string> values = fields(line);
        for (std::size_t i = 0; i < names.size(); ++i) (i == 0 ? rows.emplace_back() : rows.back())[names[i]] = values.at(i);
    }
    return rows;
}

/// A table of runs without its last column.
inline std::string without_seconds(const std::string& table) {
    std::istringstream lines(table);
    std::string kept, line;
    while (std::getline(lines, line)) kept += line.substr(0, line.rfind(',')) + '\n';
    return kept;
}

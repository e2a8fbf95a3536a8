#include "datasets/run_journal.hpp"

#include "datasets/error.hpp"
#include "datasets/text_file.hpp"
#include "datasets/whole_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <optional>
#include <sys/file.h>
#include <unistd.h>

namespace crampfit {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view title = "crampfit runs 1";
constexpr auto between_syncs = 1s;  // what a power cut may cost; the end of the process costs nothing

std::uint64_t checksum(std::string_view bytes) { return Fingerprint().add(bytes).value(); }

void put(std::string& bytes, const void* value, std::size_t size) { bytes.append(static_cast<const char*>(value), size); }

void put(std::string& bytes, std::uint64_t value) { put(bytes, &value, sizeof value); }

void put(std::string& bytes, const std::vector<double>& values) {
    put(bytes, values.size());
    put(bytes, values.data(), values.size() * sizeof(double));
}

/// Takes from bytes what `put` has put there; false when they are too few.
class Reader {
  public:
    explicit Reader(std::string_view bytes) : bytes_(bytes) {}

    bool take(void* value, std::size_t size) {
        if (bytes_.size() < size) {
            return false;
        }
        std::copy_n(bytes_.data(), size, static_cast<char*>(value));  // of nothing too
        bytes_.remove_prefix(size);
        return true;
    }
    bool take(std::uint64_t& value) { return take(&value, sizeof value); }
    bool take(std::vector<double>& values) {
        std::uint64_t count = 0;
        if (!take(count) || count > bytes_.size() / sizeof(double)) {
            return false;
        }
        values.resize(count);
        return take(values.data(), count * sizeof(double));
    }
    std::optional<std::string_view> take_text(std::uint64_t size) {
        if (bytes_.size() < size) {
            return std::nullopt;
        }
        const std::string_view text = bytes_.substr(0, size);
        bytes_.remove_prefix(size);
        return text;
    }
    std::string_view rest() const { return bytes_; }

  private:
    std::string_view bytes_;
};

std::string entry(std::string_view content) {
    std::string bytes;
    put(bytes, content.size());
    put(bytes, checksum(content));
    bytes.append(content);
    return bytes;
}

/// The next whole entry's content.
std::optional<std::string_view> next_entry(Reader& reader) {
    std::uint64_t size = 0, sum = 0;
    if (!reader.take(size) || !reader.take(sum)) {
        return std::nullopt;
    }
    const auto content = reader.take_text(size);
    return content && checksum(*content) == sum ? content : std::nullopt;
}

std::string head(std::uint64_t study) {
    std::string bytes(title);
    put(bytes, study);
    return bytes;
}

/// Whether a file's first entry, which may be torn, is a head of whatever study.
bool begins_as_ours(std::string_view bytes) {
    const std::string ours = entry(head(0));
    const auto alike = [&](std::size_t first, std::size_t count) {
        const std::size_t from = std::min(first, bytes.size());
        return bytes.substr(from, count) == std::string_view(ours).substr(from, std::min(count, bytes.size() - from));
    };
    return alike(0, sizeof(std::uint64_t)) && alike(2 * sizeof(std::uint64_t), title.size());
}

}  // namespace

RunJournal::RunJournal(const std::filesystem::path& file, std::uint64_t study, bool resume) : file_(file) {
    require_writable(file);
    descriptor_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (descriptor_ < 0) {
        throw InputError(file.string(), "", "", fmt::format("cannot be written: {}", std::strerror(errno)));
    }
    try {
        if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
            throw InputError(file.string(), "", "", "another crampfit is at work on it");
        }
        const std::string bytes = read_bytes(file);
        // What is not ours, by the name or for the study, is not touched.
        if (!begins_as_ours(bytes)) {
            throw InputError(file.string(), "", "", "does not hold runs: another name is needed for -o");
        }
        if (!resume && bytes.size() > entry(head(study)).size()) {  // a night's runs are not lost to a word left out
            write_whole_file(file.string() + "~", bytes);
        }
        const std::size_t whole = resume ? read(bytes, study) : 0;
        if (::ftruncate(descriptor_, static_cast<off_t>(whole)) != 0) {
            throw InputError(file.string(), "", "", fmt::format("cannot be written: {}", std::strerror(errno)));
        }
        if (::lseek(descriptor_, 0, SEEK_END) == 0) {
            append(entry(head(study)));
        }
    } catch (...) {  // no destructor follows
        ::close(descriptor_);
        throw;
    }
}

RunJournal::~RunJournal() { ::close(descriptor_); }

// Takes in the runs, and returns how many bytes hold whole entries.
std::size_t RunJournal::read(const std::string& bytes, std::uint64_t study) {
    Reader reader(bytes);
    const auto first = next_entry(reader);
    if (!first) {
        return 0;
    }
    if (*first != head(study)) {
        throw InputError(
            file_.string(), "", "",
            "holds runs of another study, other scenes or data, or another version of crampfit: start without --resume");
    }
    std::size_t whole = bytes.size() - reader.rest().size();
    while (const auto content = next_entry(reader)) {
        StoredRun run;
        Reader fields(*content);
        if (!fields.take(run.parameters) || !fields.take(run.results) || !fields.take(&run.seconds, sizeof run.seconds)) {
            break;
        }
        run.status = fields.rest();
        found_.push_back(std::move(run));
        whole = bytes.size() - reader.rest().size();
    }
    return whole;
}

void RunJournal::append(std::string_view bytes) {
    while (!bytes.empty()) {  // one write but where the disk is full or a signal comes
        const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
        if (written < 0 && errno == EINTR) {
            continue;
        }
        if (written < 0) {
            throw InputError(file_.string(), "", "", fmt::format("cannot be written: {}", std::strerror(errno)));
        }
        bytes.remove_prefix(static_cast<std::size_t>(written));
    }
    const auto now = std::chrono::steady_clock::now();
    if (now - synced_ > between_syncs) {
        ::fdatasync(descriptor_);
        synced_ = now;
    }
}

void RunJournal::add(const StoredRun& run) {
    std::string content;
    put(content, run.parameters);
    put(content, run.results);
    put(content, &run.seconds, sizeof run.seconds);
    content += run.status;
    const std::lock_guard lock(mutex_);
    append(entry(content));
}

Fingerprint& Fingerprint::add(std::string_view bytes) {
    for (const char byte : bytes) {
        value_ = (value_ ^ static_cast<unsigned char>(byte)) * 0x100000001b3u;
    }
    return *this;
}

Fingerprint& Fingerprint::add(double number) {
    return add(std::string_view(reinterpret_cast<const char*>(&number), sizeof number));
}

Fingerprint& Fingerprint::add(const std::vector<double>& numbers) {
    add(static_cast<double>(numbers.size()));
    return add(std::string_view(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(double)));
}

}  // namespace crampfit

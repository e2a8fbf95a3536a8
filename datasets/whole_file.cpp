#include "datasets/whole_file.hpp"

#include "datasets/error.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

namespace crampfit {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void refuse(const fs::path& file, const std::string& why) {
    throw InputError(file.string(), "", "", "cannot be written: " + why);
}

/// With what the system said last.
[[noreturn]] void refuse(const fs::path& file) { refuse(file, std::strerror(errno)); }

fs::path folder_of(const fs::path& file) { return file.has_parent_path() ? file.parent_path() : fs::path("."); }

/// A symbolic link stays one: what it points to is written, whether or not it is there already.
fs::path behind_links(const fs::path& file) {
    constexpr int most = 40;
    std::error_code error;
    fs::path target = file;
    for (int links = 0; fs::is_symlink(target, error); ++links) {
        if (links == most) refuse(file, "its symbolic link leads to itself");
        target = folder_of(target) / fs::read_symlink(target, error);
    }
    return target;
}

/// A file that did not exist before, removed again unless it has been given its final name.
class TemporaryFile {
  public:
    explicit TemporaryFile(const fs::path& final_name) : final_name_(final_name) {
        for (int attempt = 0; descriptor_ < 0; ++attempt) {
            const std::string name = fmt::format(".{}.{}-{}.part", final_name.filename().string(), ::getpid(), attempt);
            name_ = folder_of(final_name) / name;
            descriptor_ = ::open(name_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
            if (descriptor_ < 0 && errno != EEXIST) refuse(final_name);
        }
    }

    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;

    ~TemporaryFile() {
        if (descriptor_ >= 0) ::close(descriptor_);
        if (!renamed_) ::unlink(name_.c_str());
    }

    void write(std::string_view bytes) {
        while (!bytes.empty()) {
            const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
            if (written < 0 && errno == EINTR) continue;
            if (written < 0) refuse(final_name_);
            bytes.remove_prefix(static_cast<std::size_t>(written));
        }
    }

    void give_final_name() {
        if (::fsync(descriptor_) != 0) refuse(final_name_);
        // A delayed write error of a network file system shows only here.
        if (::close(std::exchange(descriptor_, -1)) != 0) refuse(final_name_);
        if (::rename(name_.c_str(), final_name_.c_str()) != 0) refuse(final_name_);
        renamed_ = true;
    }

  private:
    fs::path final_name_;
    fs::path name_;
    int descriptor_ = -1;
    bool renamed_ = false;
};

/// Brings the new name itself to the disk. The content is safe already, so a file system that cannot do this is no
/// error.
void sync_folder(const fs::path& folder) {
    const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) return;
    ::fsync(descriptor);
    ::close(descriptor);
}

}  // namespace

void require_writable(const fs::path& named) {
    const fs::path file = behind_links(named);
    std::error_code error;
    if (!file.has_filename()) refuse(file, "the name of a file is needed");
    const fs::path folder = folder_of(file);
    if (!fs::is_directory(folder, error)) refuse(file, fmt::format("the folder '{}' does not exist", folder.string()));
    // Renaming onto a device or a pipe would replace it.
    if (fs::exists(file, error) && !fs::is_regular_file(file, error))
        refuse(file, "something that is not a plain file has that name");
    // Permissions, quotas and read-only file systems: only an attempt tells.
    const TemporaryFile attempt(file);
}

void write_whole_file(const fs::path& file, std::string_view bytes) {
    require_writable(file);
    const fs::path target = behind_links(file);
    TemporaryFile temporary(target);
    temporary.write(bytes);
    temporary.give_final_name();
    sync_folder(folder_of(target));
}

}  // namespace crampfit

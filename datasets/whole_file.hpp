#pragma once

#include <filesystem>
#include <string_view>

namespace crampfit {

/// Throws InputError unless `file` could be written now: its folder exists and lets us write, and what may stand under
/// that name is a plain file.
void require_writable(const std::filesystem::path& file);

/// Writes `bytes` to a temporary name beside `file`, brings them to the disk and renames, so that `file` is at every
/// moment either what it was or the whole new content. Throws InputError, and leaves no temporary, when that cannot be
/// done.
void write_whole_file(const std::filesystem::path& file, std::string_view bytes);

}  // namespace crampfit

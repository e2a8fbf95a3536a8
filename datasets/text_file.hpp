#pragma once

#include <filesystem>
#include <string>

namespace crampfit {

/// The whole of a file as it is. Throws InputError when there is none or it cannot be read.
std::string read_bytes(const std::filesystem::path& file);

/// The whole of a text file, without a byte order mark, lines ended by \n. Throws InputError as read_bytes, and for UTF-16.
std::string read_text(const std::filesystem::path& file);

}  // namespace crampfit

#pragma once

#include <filesystem>
#include <string>

namespace crampfit {

/// The whole of a text file, without a byte order mark. Throws InputError when there is none or it cannot be read.
std::string read_text(const std::filesystem::path& file);

}  // namespace crampfit

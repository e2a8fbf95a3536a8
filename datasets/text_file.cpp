#include "datasets/text_file.hpp"

#include "datasets/error.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>

namespace crampfit {

std::string read_bytes(const std::filesystem::path& file) {
    std::error_code error;
    if (std::filesystem::is_directory(file, error)) {
        throw InputError(file.string(), "", "", "is a folder: a file is needed");
    }
    if (!std::filesystem::exists(file, error)) {
        throw InputError(file.string(), "", "", "there is no such file");
    }
    if (!std::filesystem::is_regular_file(file, error) && !std::filesystem::is_fifo(file, error)) {
        throw InputError(file.string(), "", "", "is neither a plain file nor a pipe");
    }
    std::ifstream in(file, std::ios::binary);
    std::ostringstream bytes;
    bytes << in.rdbuf();
    if (!in) {
        throw InputError(file.string(), "", "", "the file cannot be read");
    }
    return std::move(bytes).str();
}

std::string read_text(const std::filesystem::path& file) {
    std::string content = read_bytes(file);
    if (content.starts_with("\xEF\xBB\xBF")) {
        content.erase(0, 3);
    }
    if (content.find('\n') == std::string::npos) {
        std::ranges::replace(content, '\r', '\n');  // lines that end as on early Macs
    }
    if (content.starts_with("\xFF\xFE") || content.starts_with("\xFE\xFF")) {
        throw InputError(file.string(), "", "", "is UTF-16 text: save it as UTF-8");
    }
    return content;
}

}  // namespace crampfit

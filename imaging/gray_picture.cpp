#include "imaging/gray_picture.hpp"

#include "datasets/error.hpp"
#include "imaging/pixels.hpp"
#include "imaging/resolution_tag.hpp"

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <fstream>
#include <iostream>
#include <mutex>
#include <sstream>
#include <string>
#include <string_view>

namespace crampfit {
namespace {

constexpr std::size_t largest_pixel_count = std::size_t{1} << 28;
constexpr std::uintmax_t largest_file = 0x7fffffff;  // OpenCV counts a buffer's bytes as int

/// Refuses matrices of too many pixels. OpenCV believes a header and allocates what it says before it reads a pixel,
/// and its own limit, 2^30 pixels, can only be set in the environment.
class BoundedAllocator : public cv::MatAllocator {
  public:
    cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, size_t* step, cv::AccessFlag flags,
                           cv::UMatUsageFlags usage) const override {
        std::size_t count = 1;
        for (int i = 0; i < dims; ++i) {
            count *= static_cast<std::size_t>(sizes[i]);
            CV_Assert(count <= largest_pixel_count);
        }
        return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
    }
    bool allocate(cv::UMatData* data, cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
        return cv::Mat::getStdAllocator()->allocate(data, flags, usage);
    }
    void deallocate(cv::UMatData* data) const override { cv::Mat::getStdAllocator()->deallocate(data); }
};

/// While it lives, OpenCV keeps quiet (it writes to its log and to std::cerr) and its matrices are bounded. These are
/// settings of the whole process: one at a time.
class QuietBoundedDecoding {
  public:
    QuietBoundedDecoding()
        : alone_(mutex()), allocator_(cv::Mat::getDefaultAllocator()),
          level_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)), errors_(std::cerr.rdbuf(nullptr)) {
        static BoundedAllocator bounded;
        cv::Mat::setDefaultAllocator(&bounded);
    }
    ~QuietBoundedDecoding() {
        cv::Mat::setDefaultAllocator(allocator_);
        cv::utils::logging::setLogLevel(level_);
        std::cerr.rdbuf(errors_);
    }
    QuietBoundedDecoding(const QuietBoundedDecoding&) = delete;
    QuietBoundedDecoding& operator=(const QuietBoundedDecoding&) = delete;

  private:
    static std::mutex& mutex() {
        static std::mutex one;
        return one;
    }
    std::lock_guard<std::mutex> alone_;
    cv::MatAllocator* allocator_;
    cv::utils::logging::LogLevel level_;
    std::streambuf* errors_;
};

/// Whether a picture is seen to be cut short before it is decoded. A JPEG that is cut decodes without complaint, its
/// rest gray: a whole one has an end mark after the last start of scan, and neither mark can occur within coded data.
/// For a PNG the library would write its complaint past ours.
bool is_cut_short(const std::vector<std::uint8_t>& bytes) {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (text.starts_with("\xff\xd8\xff")) {
        const std::size_t last_scan = text.rfind("\xff\xda");
        return last_scan == text.npos || text.find("\xff\xd9", last_scan) == text.npos;
    }
    return text.starts_with("\x89PNG") && text.rfind("IEND") == text.npos;
}

/// What white is in a PGM or PPM, which cameras of 10 and 12 bits write: the third number of the header, comments aside; 0: it is
/// none. The library takes numbers as they are, but for those of 8 bits in text.
int white_of_netpbm(const std::vector<std::uint8_t>& bytes) {
    constexpr std::size_t longest_header = 4096;
    const std::string text(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bytes.size(), longest_header)));
    std::istringstream header(text);
    std::string word;
    header >> word;
    if (word != "P2" && word != "P3" && word != "P5" && word != "P6") {
        return 0;
    }
    int number = 0;
    for (int k = 0; k < 3; ++k) {
        while ((header >> std::ws).peek() == '#') {
            std::getline(header, word);
        }
        header >> number;
    }
    return header ? number : 0;
}

std::vector<std::uint8_t> read_bytes(const std::filesystem::path& file, const PictureKey& asked_by) {
    const auto fail = [&](const char* rule) { throw InputError(asked_by.file, asked_by.key, file.string(), rule); };
    std::error_code error;
    if (!std::filesystem::exists(file, error)) {
        fail("there is no such file");
    }
    if (!std::filesystem::is_regular_file(file, error)) {
        fail("must be a file");
    }
    const std::uintmax_t size = std::filesystem::file_size(file, error);
    if (!error && size == 0) {
        fail("the file is empty");
    }
    if (!error && size > largest_file) {
        fail("must be a picture of at most 2 GiB");
    }
    std::vector<std::uint8_t> bytes(error ? 0 : size);
    std::ifstream in(file, std::ios::binary);
    if (error || !in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()))) {
        fail("the file cannot be read");
    }
    return bytes;
}

cv::Mat to_gray(const cv::Mat& picture, int depth) {
    cv::Mat gray = picture;
    if (picture.channels() == 3) {
        cv::cvtColor(picture, gray, cv::COLOR_BGR2GRAY);
    }
    gray.convertTo(gray, depth, gray.depth() == CV_16U ? 1.0 / 257.0 : 1.0);
    return gray;
}

}  // namespace

cv::Mat read_pixels(const std::filesystem::path& file, const PictureKey& asked_by) {
    const auto fail = [&](const std::string& rule) { throw InputError(asked_by.file, asked_by.key, file.string(), rule); };
    const std::vector<std::uint8_t> bytes = read_bytes(file, asked_by);
    if (is_cut_short(bytes)) {
        fail("the picture is cut short");
    }
    try {
        const QuietBoundedDecoding decoding;
        cv::Mat picture = cv::imdecode(bytes, cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR);
        if (picture.empty()) {
            fail("is no picture in a known format, or is damaged or cut short");
        }
        if (picture.depth() != CV_8U && picture.depth() != CV_16U) {
            fail("must be a picture of 8 or 16 bits a channel");
        }
        const bool is_fine = picture.depth() == CV_16U, is_text = bytes.size() > 1 && (bytes[1] == '2' || bytes[1] == '3');
        if (const int white = white_of_netpbm(bytes); white > 0 && (is_fine || !is_text)) {
            picture *= (is_fine ? 65535.0 : 255.0) / white;
        }
        if (is_fine && picture.channels() == 1 && white_is_zero(file)) {  // of 8 bits the library turns it
            cv::subtract(cv::Scalar(65535), picture, picture);
        }
        return picture;
    } catch (const cv::Exception&) {
        fail("is damaged, or its header asks for more than 2^28 pixels");
    }
    return {};
}

GrayPicture read_gray(const std::filesystem::path& file, const PictureKey& asked_by) {
    const cv::Mat gray = to_gray(read_pixels(file, asked_by), CV_8U);
    return {gray.cols, gray.rows, {gray.begin<std::uint8_t>(), gray.end<std::uint8_t>()}};
}

FinePicture read_fine_gray(const std::filesystem::path& file, const PictureKey& asked_by) {
    const cv::Mat gray = to_gray(read_pixels(file, asked_by), CV_32F);
    return {gray.cols, gray.rows, {gray.begin<float>(), gray.end<float>()}};
}

}  // namespace crampfit

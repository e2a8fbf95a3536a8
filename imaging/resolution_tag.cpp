#include "imaging/resolution_tag.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <sstream>
#include <string_view>

namespace crampfit {
namespace {

/// Whole numbers of a file's bytes; nothing where the file ends before.
class Bytes {
  public:
    explicit Bytes(std::string bytes) : bytes_(std::move(bytes)) {}
    bool big_endian = true;

    std::string_view text(std::size_t at, std::size_t count) const {
        return at <= bytes_.size() ? std::string_view(bytes_).substr(at, count) : std::string_view();
    }
    /// 0 beyond the end: no resolution is 0.
    std::uint32_t number(std::size_t at, int count) const {
        const std::string_view part = text(at, count);
        std::uint32_t value = 0;
        if (part.size() == static_cast<std::size_t>(count))
            for (int i = 0; i < count; ++i) value = value << 8 | static_cast<std::uint8_t>(part[big_endian ? i : count - 1 - i]);
        return value;
    }
    std::size_t size() const { return bytes_.size(); }

  private:
    std::string bytes_;
};

std::optional<PixelTag> pixel(double x_per_metre, double y_per_metre) {
    if (!(x_per_metre > 0 && y_per_metre > 0)) return std::nullopt;
    return PixelTag{1 / x_per_metre, 1 / y_per_metre};
}

/// PNG specification (ISO/IEC 15948), 11.3.5.3.
std::optional<PixelTag> png(const Bytes& bytes) {
    for (std::size_t at = 8; at + 12 <= bytes.size(); at += 12 + bytes.number(at, 4)) {
        const std::string_view type = bytes.text(at + 4, 4);
        if (type == "pHYs" && bytes.number(at + 16, 1) == 1) return pixel(bytes.number(at + 8, 4), bytes.number(at + 12, 4));
        if (type == "pHYs" || type == "IDAT") break;
    }
    return std::nullopt;
}

/// Dots an inch or a centimetre to dots a metre.
double per_metre(double value, bool inch) { return inch ? value / 0.0254 : value * 100; }

/// JFIF 1.02: the APP0 segment right after the start of the image.
std::optional<PixelTag> jpeg(const Bytes& bytes) {
    const std::uint32_t unit = bytes.number(13, 1);
    if (bytes.number(2, 2) != 0xffe0 || bytes.text(6, 5) != std::string_view("JFIF\0", 5) || unit < 1 || unit > 2)
        return std::nullopt;
    return pixel(per_metre(bytes.number(14, 2), unit == 1), per_metre(bytes.number(16, 2), unit == 1));
}

bool is_tiff(const Bytes& bytes) {
    return bytes.text(0, 4) == std::string_view("II*\0", 4) || bytes.text(0, 4) == std::string_view("MM\0*", 4);
}

/// What the first picture of a TIFF file says of itself (TIFF 6.0): tag 262 is its colours (0: of gray, white is 0), 282 and 283
/// are fractions, 296 is their unit (2: inch, the default; 3: centimetre).
struct TiffTags {
    std::uint32_t colours = 1, unit = 2;
    double x = 0, y = 0;
};

TiffTags tiff_tags(Bytes bytes) {
    bytes.big_endian = bytes.text(0, 2) == "MM";
    const std::size_t directory = bytes.number(4, 4);
    const std::uint32_t entries = bytes.number(directory, 2);
    TiffTags tags;
    for (std::uint32_t i = 0; i < entries; ++i) {
        const std::size_t entry = directory + 2 + 12 * std::size_t{i};
        const auto fraction = [&] {
            const std::size_t at = bytes.number(entry + 8, 4);
            const double below = bytes.number(at + 4, 4);
            return below > 0 ? bytes.number(at, 4) / below : 0;
        };
        switch (bytes.number(entry, 2)) {
        case 262:
            tags.colours = bytes.number(entry + 8, 2);
            break;
        case 282:
            tags.x = fraction();
            break;
        case 283:
            tags.y = fraction();
            break;
        case 296:
            tags.unit = bytes.number(entry + 8, 2);
            break;
        default:
            break;
        }
    }
    return tags;
}

std::optional<PixelTag> tiff(Bytes bytes) {
    const auto [colours, unit, x, y] = tiff_tags(std::move(bytes));
    if (unit != 2 && unit != 3) return std::nullopt;
    return pixel(per_metre(x, unit == 2), per_metre(y, unit == 2));
}

Bytes bytes_of(const std::filesystem::path& image) {
    std::ifstream in(image, std::ios::binary);
    std::ostringstream text;
    text << in.rdbuf();
    return Bytes(std::move(text).str());
}

}  // namespace

bool PixelTag::square() const { return std::abs(width / height - 1) < 1e-3; }

std::string PixelTag::dots() const { return fmt::format("{:.6g} x {:.6g} dpi", 0.0254 / width, 0.0254 / height); }

std::optional<PixelTag> pixel_by_tag(const std::filesystem::path& image) {
    Bytes bytes = bytes_of(image);
    if (bytes.text(0, 8) == "\x89PNG\r\n\x1a\n") return png(bytes);
    if (bytes.text(0, 3) == "\xff\xd8\xff") return jpeg(bytes);
    if (is_tiff(bytes)) return tiff(std::move(bytes));
    if (bytes.text(0, 2) == "BM") {
        bytes.big_endian = false;
        return pixel(bytes.number(38, 4), bytes.number(42, 4));
    }
    return std::nullopt;
}

bool white_is_zero(const std::filesystem::path& image) {
    Bytes bytes = bytes_of(image);
    return is_tiff(bytes) && tiff_tags(std::move(bytes)).colours == 0;
}

}  // namespace crampfit

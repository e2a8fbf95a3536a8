#include "cli/progress.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sys/ioctl.h>
#include <unistd.h>

namespace crampfit::cli {

namespace {

using namespace std::chrono_literals;

constexpr auto between_bars = 100ms;  // faster than an eye follows
constexpr auto between_lines = 10s;   // unless a tenth of the work is done sooner
constexpr int bar_width = 30;         // [characters]

std::size_t terminal_width() {
    winsize size{};
    const bool known = ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
    return known ? size.ws_col : 80;
}

/// A number of three digits, as in "12.3k".
std::string rate_text(double rate) {
    if (rate >= 1e6) return fmt::format("{:.3g}M", rate / 1e6);
    if (rate >= 1e3) return fmt::format("{:.3g}k", rate / 1e3);
    return fmt::format("{:.3g}", rate);
}

}  // namespace

std::string duration_text(double seconds) {
    if (seconds < 9.5) return fmt::format("{:.2g} s", seconds);
    const auto whole = static_cast<long>(std::lround(std::min(seconds, 1e9)));
    if (whole >= 3600) return fmt::format("{}:{:02} h", whole / 3600, whole / 60 % 60);
    if (whole >= 60) return fmt::format("{}:{:02} min", whole / 60, whole % 60);
    return fmt::format("{} s", whole);
}

ProgressLine::ProgressLine(const CommonOptions& common, std::string counted, std::string left)
    : common_(common), counted_(std::move(counted)), left_(std::move(left)), on_terminal_(::isatty(STDERR_FILENO) == 1),
      started_(Clock::now()), last_bar_(started_), last_line_(started_) {}

ProgressLine::~ProgressLine() {
    if (bar_is_drawn_) std::fputs("\r\033[K", stderr);
}

void ProgressLine::show(double fraction, long count, const std::string& details) {
    const auto now = Clock::now();
    const bool bar_is_due = on_terminal_ && !common_.quiet && now - last_bar_ >= between_bars;
    const bool line_is_due = plain_line_is_due(fraction, now);
    if (!bar_is_due && !line_is_due) return;

    const double elapsed = std::chrono::duration<double>(now - started_).count();
    std::string text = fmt::format("{:3.0f} %", 100 * fraction);
    if (elapsed > 0) text += fmt::format("  {} {}/s", rate_text(static_cast<double>(count) / elapsed), counted_);
    if (fraction > 0) text += fmt::format("  {} {}", duration_text(elapsed * (1 - fraction) / fraction), left_);
    text += "  " + details;

    if (bar_is_due) {
        last_bar_ = now;
        draw_bar(fraction, text);
    }
    if (line_is_due) {
        spdlog::info(text);
        if (!on_terminal_ && !common_.quiet) complain(text);
    }
}

bool ProgressLine::plain_line_is_due(double fraction, Clock::time_point now) {
    const int tenths = static_cast<int>(10 * fraction);
    if (tenths <= tenths_told_ && now - last_line_ < between_lines) return false;
    tenths_told_ = std::max(tenths_told_, tenths);
    last_line_ = now;
    return true;
}

void ProgressLine::draw_bar(double fraction, const std::string& text) {
    const auto full = static_cast<std::size_t>(std::lround(bar_width * std::clamp(fraction, 0.0, 1.0)));
    std::string line = '[' + std::string(full, '=') + std::string(bar_width - full, ' ') + "] " + text;
    // A line that wraps could not be drawn over.
    line.resize(std::min(line.size(), terminal_width() - 1));
    std::fputs(("\r" + line + "\033[K").c_str(), stderr);
    std::fflush(stderr);
    bar_is_drawn_ = true;
}

}  // namespace crampfit::cli

#pragma once

#include "cli/common.hpp"

#include <chrono>
#include <string>

namespace crampfit::cli {

/// Shows how far the work is on standard error: a bar with rate and time left on a terminal, plain lines elsewhere,
/// nothing with --quiet. The plain lines go to the log as well.
class ProgressLine {
  public:
    /// `counted` names what is done many times, such as "steps"; `left` stands behind the time that is left.
    ProgressLine(const CommonOptions& common, std::string counted, std::string left = "left");
    ~ProgressLine();
    ProgressLine(const ProgressLine&) = delete;
    ProgressLine& operator=(const ProgressLine&) = delete;

    /// `fraction` of the whole is done, 0..1, in `count` steps; `details` says what else there is to say.
    void show(double fraction, long count, const std::string& details);

  private:
    using Clock = std::chrono::steady_clock;

    void draw_bar(double fraction, const std::string& text);
    bool plain_line_is_due(double fraction, Clock::time_point now);

    const CommonOptions& common_;
    std::string counted_;
    std::string left_;
    bool on_terminal_;
    bool bar_is_drawn_ = false;
    Clock::time_point started_;
    Clock::time_point last_bar_;
    Clock::time_point last_line_;
    int tenths_told_ = 0;
};

/// A duration for a person: "0.25 s", "12 s", "3:05 min", "2:10 h".
std::string duration_text(double seconds);

}  // namespace crampfit::cli

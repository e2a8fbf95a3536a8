#include "cli/stop.hpp"

#include "cli/common.hpp"

#include <csignal>
#include <string_view>
#include <unistd.h>

namespace crampfit::cli {

namespace {

std::atomic<bool> requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch nothing else");

extern "C" void on_signal(int) {
    if (requested.exchange(true)) ::_exit(static_cast<int>(ExitStatus::interrupted));
    constexpr std::string_view answer = "\ncrampfit: stopping to save what there is; once more ends at once\n";
    // Nothing can be done where even this cannot be written.
    [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, answer.data(), answer.size());
}

}  // namespace

void stop_on_signals() {
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
    // A terminal that goes away, but for `nohup`.
    struct sigaction before {};
    if (::sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN) ::sigaction(SIGHUP, &action, nullptr);
}

const std::atomic<bool>& stop_requested() { return requested; }

}  // namespace crampfit::cli

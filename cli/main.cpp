#include "cli/verbs.hpp"
#include "datasets/error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/null_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <csignal>
#include <fcntl.h>
#include <fstream>
#include <new>
#include <unistd.h>

namespace crampfit::cli {

namespace {

/// Whether lines can be added without harm: to a file that is not there, or empty, or a log.
bool may_take_lines(const std::filesystem::path& log) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(log, error)) return true;
    std::ifstream in(log);
    std::string time, level;
    return !(in >> time) || (in >> level && (level == "info:" || level == "error:"));
}

/// From here on, what is logged goes to the file of --log.
void start_log(const CommonOptions& common, const std::vector<std::string>& words) {
    if (common.log.empty()) return;
    if (!may_take_lines(common.log))
        throw InputError("command line", "--log", common.log.string(),
                         "must be a new file or an earlier log: this one has other things in it");
    if (const auto folder = common.log.parent_path(); !folder.empty() && !std::filesystem::is_directory(folder))
        throw InputError("command line", "--log", common.log.string(),
                         fmt::format("the folder '{}' does not exist", folder.string()));
    try {
        spdlog::set_default_logger(spdlog::basic_logger_mt("file", common.log.string()));
    } catch (const spdlog::spdlog_ex&) {
        throw InputError("command line", "--log", common.log.string(), "must be a file that can be written");
    }
    spdlog::set_pattern("%Y-%m-%dT%H:%M:%S%z %l: %v");
    spdlog::flush_on(spdlog::level::trace);
    spdlog::info("crampfit {}: {}", CRAMPFIT_VERSION, fmt::join(words, " "));
}

/// Stands in for closed standard streams, so that no file of ours gets their numbers. Printing to a closed standard
/// output stays an error.
void fill_closed_streams() {
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        if (::fcntl(stream, F_GETFD) < 0) ::open("/dev/null", stream == STDERR_FILENO ? O_WRONLY : O_RDONLY);
}

ExitStatus fail(ExitStatus status, const std::string& message) {
    spdlog::error(message);
    complain("error: " + message);
    return status;
}

/// `--help` and `--version` end the reading as well, with success.
ExitStatus end_of_reading(const CLI::App& command, const CLI::ParseError& end) {
    if (end.get_exit_code() != 0) {
        const std::vector<std::string> unknown = command.remaining();
        const bool no_verb = command.get_subcommands().empty() && !unknown.empty();
        return fail(ExitStatus::bad_input,
                    fmt::format("{} (see crampfit --help)",
                                no_verb ? fmt::format("there is no verb \"{}\"", unknown.front()) : std::string(end.what())));
    }
    command.exit(end);
    return ExitStatus::done;
}

/// An empty shell variable must not pass for an option left out.
void refuse_empty(const CLI::App& command) {
    for (const CLI::Option* option : command.get_options())
        if (option->count() > 0 && option->get_type_size() > 0 && std::ranges::count(option->results(), "") > 0)
            throw InputError("command line", option->get_name(), "\"\"", "must not be empty");
}

ExitStatus run_verb(const std::vector<Verb>& verbs) {
    for (const Verb& verb : verbs)
        if (verb.arguments->parsed()) {
            refuse_empty(*verb.arguments);
            return verb.run();
        }
    throw std::logic_error("a command line without a verb was accepted");
}

ExitStatus run_command(int argc, const char* const* argv) {
    CLI::App command("Couples crack-growth simulations of wood to experiments.", "crampfit");
    command.set_version_flag("--version", "crampfit " CRAMPFIT_VERSION);
    command.require_subcommand(1);
    command.fallthrough();  // common options may stand after the verb
    command.footer("Exit status: 0 done; 1 the run or fit did not reach its end; 2 bad input or usage; 130 interrupted.");
    CommonOptions common;
    add_common_options(command, common);
    const std::vector<Verb> verbs{
        simulate_verb(command, common),    explain_verb(command, common),  fit_verb(command, common),
        sensitivity_verb(command, common), evaluate_verb(command, common), segment_verb(command, common),
        correlate_verb(command, common),   track_verb(command, common),    camera_verb(command, common),
        csv_verb(command, common),         report_verb(command, common),   bench_verb(command, common)};
    for (const Verb& verb : verbs)
        verb.arguments->footer("Every verb also takes --threads, --quiet, --log, --version, those that read a scene or a study "
                               "--set: see crampfit --help");
    try {
        command.parse(argc, argv);
    } catch (const CLI::ParseError& end) {
        return end_of_reading(command, end);
    }
    refuse_empty(command);
    start_log(common, {argv, argv + argc});
    return run_verb(verbs);
}

}  // namespace

}  // namespace crampfit::cli

int main(int argc, char** argv) {
    using crampfit::cli::ExitStatus, crampfit::cli::fail;
    crampfit::cli::fill_closed_streams();
    // A reader that leaves and a file that grows too large are errors of a write, not ends of the process.
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
    // What is logged before --log is read, or without it, goes nowhere.
    spdlog::set_default_logger(spdlog::null_logger_mt("nowhere"));
    try {
        return static_cast<int>(crampfit::cli::run_command(argc, argv));
    } catch (const crampfit::InputError& error) {
        return static_cast<int>(fail(ExitStatus::bad_input, error.what()));
    } catch (const std::bad_alloc&) {
        return static_cast<int>(fail(ExitStatus::incomplete, "not enough memory"));
    } catch (const std::exception& error) {
        return static_cast<int>(fail(ExitStatus::incomplete, error.what()));
    }
}

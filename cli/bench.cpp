#include "benchmarks/speed_error.hpp"
#include "cli/progress.hpp"
#include "cli/stop.hpp"
#include "cli/verbs.hpp"
#include "datasets/error.hpp"
#include "datasets/whole_file.hpp"

#include <fmt/format.h>

#include <memory>

namespace crampfit::cli {

namespace {

ExitStatus bench(const std::filesystem::path& output, const CommonOptions& common) {
    if (!common.settings.empty())
        throw InputError("command line", "--set", common.settings.front(),
                         "the problems are built in; there is nothing to override");
    require_writable(output);
    stop_on_signals();
    const std::vector<reference::BenchRun> runs = reference::bench_runs();
    std::vector<reference::SpeedError> rows;
    {
        ProgressLine line(common, "runs");
        for (const reference::BenchRun& run : runs) {
            if (stop_requested()) break;
            line.show(static_cast<double>(rows.size()) / static_cast<double>(runs.size()), static_cast<long>(rows.size()),
                      fmt::format("{}, {}, {:g} cells", run.problem.name, run.solver, run.cells));
            rows.push_back(reference::measure(run));
        }
    }
    write_whole_file(output, reference::csv(rows));
    report(common, fmt::format("{} of {} runs, saved as {}", rows.size(), runs.size(), output.string()));
    return rows.size() == runs.size() ? ExitStatus::done : ExitStatus::interrupted;
}

}  // namespace

Verb bench_verb(CLI::App& command, const CommonOptions& common) {
    auto output = std::make_shared<std::filesystem::path>();
    CLI::App* verb = command.add_subcommand("bench", "Speed against error on the built-in reference problems, one run at a time");
    verb->add_option("-o,--output", *output, "Where the table goes")->type_name("SPEED_ERROR.csv")->required();
    return {verb, [output, &common] { return bench(*output, common); }};
}

}  // namespace crampfit::cli

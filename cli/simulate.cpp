#include "forward/simulate.hpp"
#include "cli/progress.hpp"
#include "cli/stop.hpp"
#include "cli/verbs.hpp"
#include "imaging/picture.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <memory>

namespace crampfit::cli {

namespace {

struct SimulateArguments {
    std::filesystem::path scene;
    std::filesystem::path output;
};

ExitStatus exit_status(RunStatus status) {
    switch (status) {
    case RunStatus::finished:
    case RunStatus::split:
        return ExitStatus::done;
    case RunStatus::interrupted:
        return ExitStatus::interrupted;
    case RunStatus::unstable:
        return ExitStatus::incomplete;
    }
    throw std::logic_error("a run status without an exit status");
}

Record run(const Scene& scene, const CommonOptions& common) {
    ProgressLine line(common, "steps");
    SimulateOptions options;
    options.threads = common.threads;
    options.stop_requested = &stop_requested();
    options.progress = [&](const Progress& progress) {
        line.show(progress.fraction, progress.step,
                  fmt::format("at {:.4g} ms, crack {:.4g} mm", 1e3 * progress.time, 1e3 * progress.crack_length));
    };
    return simulate(scene, options);
}

ExitStatus simulate_and_save(const SimulateArguments& arguments, const CommonOptions& common) {
    check_output(arguments.output, {arguments.scene});
    Scene scene = read_scene(arguments.scene, overrides_of(common));
    check_output(arguments.output, files_of(scene));
    load_specimen(scene);
    stop_on_signals();
    spdlog::info("the scene is read");
    const Record record = run(scene, common);
    save(record, arguments.output);
    const ExitStatus status = exit_status(record.status);
    const std::string end = fmt::format("{}: {}; {} points, {} steps in {}, saved as {}", name(record.status), record.message,
                                        record.points, record.steps, duration_text(record.seconds), arguments.output.string());
    report_end(common, end, status);
    if (const double share = kinetic_share(record); share > quasistatic_share)
        report(common, fmt::format("not quasi-static: the kinetic energy was up to {:.2g} times the strain energy", share));
    return status;
}

}  // namespace

Verb simulate_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<SimulateArguments>();
    CLI::App* verb = command.add_subcommand("simulate", "Run one scene");
    verb->add_option("scene", arguments->scene, "The scene")->type_name("SCENE.toml")->required();
    verb->add_option("-o,--output", arguments->output, "Where the record goes")->type_name("RECORD.h5")->required();
    return {verb, [arguments, &common] { return simulate_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli

#include "cli/report_pages.hpp"
#include "cli/verbs.hpp"
#include "datasets/error.hpp"
#include "datasets/hdf5.hpp"
#include "datasets/whole_file.hpp"

#include <fmt/format.h>

#include <memory>

namespace crampfit::cli {

namespace {

struct ReportArguments {
    std::filesystem::path file;
    std::filesystem::path output;
};

std::string page_of(const std::filesystem::path& file) {
    const hdf5::Group root = hdf5::open(file);
    const Origin origin{file, root.attribute("version"), root.attribute("created")};
    const std::string kind = root.attribute("kind");
    if (kind == "record") return record_page(read_record(file), origin);
    if (kind == "fit") return fit_page(read_fit(file), origin);
    if (kind == "sensitivity") return sensitivity_page(read_sensitivity(file), origin);
    if (kind == "specimen") return specimen_page(read_specimen(file), origin);
    if (kind == "field") return field_page(file, origin);
    if (kind == "track") return track_page(read_crack_track(file), origin);
    root.refuse("kind", kind, "must be a record, a fit, a sensitivity study, a specimen, a displacement field or a crack track");
}

ExitStatus write_report(const ReportArguments& arguments, const CommonOptions& common) {
    if (!common.settings.empty())
        throw InputError("command line", "--set", common.settings.front(), "has nothing to override in a file of results");
    check_output(arguments.output, {arguments.file});
    write_whole_file(arguments.output, page_of(arguments.file));
    report(common, fmt::format("saved as {}", arguments.output.string()));
    return ExitStatus::done;
}

}  // namespace

Verb report_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<ReportArguments>();
    CLI::App* verb = command.add_subcommand("report", "One page in HTML to look at a result, self-contained");
    verb->add_option("file", arguments->file, "What a verb of this command has saved")->type_name("FILE.h5")->required();
    verb->add_option("-o,--output", arguments->output, "Where the page goes")->type_name("REPORT.html")->required();
    return {verb, [arguments, &common] { return write_report(*arguments, common); }};
}

}  // namespace crampfit::cli

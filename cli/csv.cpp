#include "cli/verbs.hpp"
#include "datasets/error.hpp"

#include <memory>
#include <sstream>

namespace crampfit::cli {

namespace {

struct CsvArguments {
    std::filesystem::path file;
    std::string table;
};

}  // namespace

Verb csv_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<CsvArguments>();
    CLI::App* verb = command.add_subcommand("csv", "Print a table of a result as CSV");
    verb->add_option("file", arguments->file, "What a verb of this command has saved")->type_name("FILE.h5")->required();
    verb->add_option("table", arguments->table, "Which table; an unknown name lists those that there are")
        ->type_name("TABLE")
        ->required();
    return {verb, [arguments, &common] {
                if (!common.settings.empty())
                    throw InputError("command line", "--set", common.settings.front(),
                                     "has nothing to override in a file of results");
                std::ostringstream text;
                print_table(arguments->file, arguments->table, text);
                print(text.str());
                return ExitStatus::done;
            }};
}

}  // namespace crampfit::cli

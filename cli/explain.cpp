#include "cli/verbs.hpp"
#include "forward/simulate.hpp"
#include "imaging/picture.hpp"

#include <memory>

namespace crampfit::cli {

Verb explain_verb(CLI::App& command, const CommonOptions& common) {
    auto file = std::make_shared<std::filesystem::path>();
    CLI::App* verb = command.add_subcommand("explain", "What will be modelled, by which solver, why, and what it will cost");
    verb->add_option("scene", *file, "The scene")->type_name("SCENE.toml")->required();
    return {verb, [file, &common] {
                Scene scene = read_scene(*file, overrides_of(common));
                load_specimen(scene);
                print(explain(scene));
                return ExitStatus::done;
            }};
}

}  // namespace crampfit::cli

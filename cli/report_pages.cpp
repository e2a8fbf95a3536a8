#include "cli/report_pages.hpp"

#include "cli/html.hpp"
#include "datasets/error.hpp"
#include "datasets/toml_reader.hpp"
#include "inverse/run_store.hpp"

#include <fmt/format.h>

namespace crampfit::cli {

std::string title_of(const std::string& toml, const Origin& origin) {
    try {
        const Document document(toml, origin.file, {});
        if (const auto title = document.root().find("title"); title && title->is_text()) return title->text();
    } catch (const InputError&) {
        // A result without its input can be looked at all the same.
    }
    return origin.file.filename().string();
}

std::string heading(const std::string& title, const std::string& kind, const Origin& origin) {
    return fmt::format("<header>\n<p class=\"kind\">{} &#183; {} &#183; crampfit {} &#183; {}</p>\n<h1>{}</h1>\n</header>\n",
                       kind, escaped(origin.file.filename().string()), escaped(origin.version), escaped(origin.created),
                       escaped(title));
}

std::string repeat_section(const std::string& toml, const std::string& verb, const std::string& input, const Origin& origin,
                           const std::string& settings) {
    return section("How to repeat it",
                   paragraph(fmt::format("Save the text below as {}, with the files that it names beside it; it holds what --set "
                                         "changed in it. The result was written by crampfit {}.",
                                         input, origin.version)) +
                       verbatim(fmt::format("crampfit {} {}{} -o {}", verb, input, settings,
                                            quoted_for_shell(origin.file.filename().string()))) +
                       verbatim(toml));
}

}  // namespace crampfit::cli

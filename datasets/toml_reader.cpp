#include "datasets/toml_reader.hpp"

#include "datasets/error.hpp"
#include "datasets/keys.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string_view>

namespace crampfit {
namespace {

/// What a member of a list is called: its name, else its side, else (a body, an experiment) its kind and number from 0,
/// else its number.
std::string member_name(const std::string& list, const toml::array& array, std::size_t number) {
    if (const toml::table* table = array[number].as_table()) {
        for (const char* key : {"name", list == "edges" ? "side" : "name"}) {
            if (const auto name = (*table)[key].value<std::string>(); name && !name->empty()) {
                return *name;
            }
        }
        if (list == "bodies") {
            return fmt::format("body {}", number);
        }
        if (list == "experiments") {
            return fmt::format("experiment {}", number);
        }
    }
    return std::to_string(number);
}

/// The member of a list that a part of a key addresses, by name or by number; `size()` when there is none.
std::size_t find_member(const std::string& list, const toml::array& array, const std::string& part) {
    for (std::size_t i = 0; i < array.size(); ++i) {
        if (member_name(list, array, i) == part) {
            return i;
        }
    }
    return member_number(part, array.size());
}

/// The value of an override as a TOML table with the one key "value": TOML where it is TOML, bare text otherwise.
toml::table parse_value(const std::string& text) {
    try {
        toml::table table = toml::parse("value = " + text);
        if (table.size() == 1 && table.contains("value")) {
            return table;
        }
    } catch (const toml::parse_error&) {
        // "120 J/m^2" is no TOML, and need not be: --set takes bare text
    }
    return toml::table{{"value", text}};
}

bool is_under(const std::string& key, const std::string& parent) {
    return key.size() > parent.size() && key.compare(0, parent.size(), parent) == 0 && key[parent.size()] == '.';
}

toml::table parse_toml(const std::string& text, const std::string& file) {
    try {
        return toml::parse(text);
    } catch (const toml::parse_error& error) {
        const toml::source_position& at = error.source().begin;
        std::string what(error.description());
        std::ranges::replace(what, '\n', ' ');  // a message is one line
        throw InputError(file, "", "", fmt::format("line {}, column {}: {}", at.line, at.column, what));
    }
}

}  // namespace

Document::Document(const std::string& text, std::filesystem::path file, const Overrides& overrides)
    : file_(std::move(file)), text_(text), root_(parse_toml(text, file_.string())) {
    for (const auto& [key, value] : overrides) {
        applied_.push_back(apply(key, value));
    }
    if (!overrides.empty()) {
        std::ostringstream out;
        out << root_ << '\n';
        text_ = out.str();
    }
}

Entry Document::root() const { return {*this, &root_, "", ""}; }

Document::Applied Document::apply(const std::string& key, const std::string& value) {
    const std::vector<std::string> parts = split_key(key, command_line, value);
    Applied applied{"", "", key, value};
    toml::table parsed = parse_value(value);
    const toml::node& fresh = *parsed.get("value");
    toml::node* node = &root_;
    for (std::size_t i = 0; i < parts.size(); ++i) {
        const bool last = i + 1 == parts.size();
        const std::string& part = parts[i];
        if (toml::table* table = node->as_table()) {
            const bool made = !table->contains(part);
            applied.target = join_key(applied.target, part);
            if (applied.address.empty() && (made || last)) {
                applied.address = applied.target;
            }
            if (last) {
                table->insert_or_assign(part, fresh);
            } else if (made) {
                table->insert(part, toml::table{});
            }
            node = table->get(part);
        } else if (toml::array* array = node->as_array()) {
            const std::size_t member = find_member(applied.target, *array, part);
            if (member == array->size()) {
                throw InputError(command_line, key, value,
                                 fmt::format("{} has no member \"{}\"; a member is addressed by its name or its number from 0",
                                             applied.target, part));
            }
            applied.target = join_key(applied.target, std::to_string(member));
            if (last) {
                array->replace(array->cbegin() + static_cast<std::ptrdiff_t>(member), fresh);
                applied.address = applied.target;
            }
            node = array->get(member);
        } else {
            throw InputError(command_line, key, value, fmt::format("{} is neither a table nor a list", applied.target));
        }
    }
    return applied;
}

// For errors: tables and lists on a line, and no more of them than tells which one is meant.
std::string Entry::written() const {
    constexpr std::size_t most = 60;
    if (node_ == nullptr) {
        return "(missing)";
    }
    if (is_table()) {
        return "(a table)";
    }
    if (const auto text = node_->value_exact<std::string>()) {
        return *text;
    }
    if (const auto number = node_->value_exact<double>()) {
        return fmt::format("{}", *number);
    }
    std::ostringstream out;
    node_->visit([&](const auto& node) { out << node; });
    const std::string whole = out.str();
    return whole.size() <= most ? whole : whole.substr(0, most) + " ...";
}

std::pair<Place, std::string> Entry::origin() const {
    for (auto applied = document_->applied_.rbegin(); applied != document_->applied_.rend(); ++applied) {
        if (address_ == applied->target ||
            ((address_ == applied->address || is_under(address_, applied->address)) && is_under(applied->target, address_))) {
            return {{command_line, applied->key}, applied->value};
        }
        if (is_under(address_, applied->target)) {
            return {{command_line, applied->key + address_.substr(applied->target.size())}, written()};
        }
        if (is_under(address_, applied->address)) {
            return {{command_line, key_}, written()};
        }
    }
    return {{document_->file().string(), key_}, written()};
}

Place Entry::place() const { return origin().first; }

void Entry::fail(const std::string& rule) const {
    const auto [place, value] = origin();
    throw InputError(place.file, place.key, value, rule);
}

void Entry::fail_choice(const std::string& word, const std::vector<std::string>& words, const std::string& or_else) const {
    fail(fmt::format("must be one of \"{}\"{}{}", fmt::join(words, "\", \""), or_else.empty() ? "" : ", or " + or_else,
                     suggestion(word, words)));
}

const toml::table& Entry::table() const {
    if (!is_table()) {
        fail("must be a table of keys and values");
    }
    return *node_->as_table();
}

void Entry::only(const std::vector<std::string>& known) const {
    for (const auto& [name, entry] : members()) {
        if (std::find(known.begin(), known.end(), name) == known.end()) {
            entry.fail("unknown key" + suggestion(name, known));
        }
    }
}

bool Entry::has(const std::string& name) const { return table().contains(name); }

std::optional<Entry> Entry::find(const std::string& name) const {
    const toml::node* node = table().get(name);
    return node == nullptr ? std::nullopt
                           : std::optional(Entry(*document_, node, join_key(key_, name), join_key(address_, name)));
}

Entry Entry::at(const std::string& name) const {
    if (const auto entry = find(name)) {
        return *entry;
    }
    for (const Document::Applied& applied : document_->applied_) {
        const bool made_this = address_ == applied.address || is_under(address_, applied.address);
        if (made_this && is_under(applied.target, address_)) {
            throw InputError(command_line, applied.key, applied.value,
                             fmt::format("there is no {} in {}, and {} would be missing in a new one", key_,
                                         document_->file().string(), join_key(key_, name)));
        }
    }
    Entry(*document_, nullptr, join_key(key_, name), join_key(address_, name)).fail("missing key: it must be given");
}

std::vector<std::pair<std::string, Entry>> Entry::members() const {
    std::vector<std::pair<std::string, Entry>> members;
    for (const auto& [name, node] : table()) {
        members.emplace_back(std::string(name.str()), at(std::string(name.str())));
    }
    return members;
}

std::string Entry::text() const {
    const auto text = node_->value_exact<std::string>();
    if (!text || text->empty()) {
        fail("must be a text in quotes, not empty");
    }
    return *text;
}

bool Entry::boolean() const {
    const auto value = node_->value_exact<bool>();
    if (!value) {
        fail(is_text() ? "must be true or false, without quotes" : "must be true or false");
    }
    return *value;
}

int Entry::integer(int low, int high) const {
    const auto value = node_->value_exact<std::int64_t>();
    if (!value || *value < low || *value > high) {
        fail(fmt::format("must be a whole number from {} to {}{}", low, high, is_text() ? ", without quotes" : ""));
    }
    return static_cast<int>(*value);
}

Quantity Entry::quantity() const {
    if (is_text()) {
        return parse_quantity(text(), place());
    }
    if (!node_->is_number()) {
        fail("must be a number, or a text with number and unit");
    }
    const double value = node_->value<double>().value_or(std::numeric_limits<double>::quiet_NaN());
    if (!std::isfinite(value)) {
        fail("must be finite, not infinite and not NaN");
    }
    return {value, "", 1, dimension::number};
}

double Entry::number(const NumberRule& rule) const {
    if (!is_text() && !node_->is_number()) {
        fail("must be " + describe(rule.dimension));
    }
    const Quantity value = quantity();
    check_dimension(value, rule.dimension, written(), place());
    if (!rule.allows(value.value)) {
        fail(rule.rule);
    }
    return value.value;
}

std::vector<Entry> Entry::list() const {
    const toml::array* array = node_->as_array();
    if (array == nullptr) {
        fail("must be a list in square brackets; tables are listed as [[name]]");
    }
    std::vector<Entry> entries;
    for (std::size_t i = 0; i < array->size(); ++i) {
        entries.push_back(Entry(*document_, array->get(i), join_key(key_, member_name(key_, *array, i)),
                                join_key(address_, std::to_string(i))));
    }
    return entries;
}

std::vector<Entry> Entry::list(std::size_t size, const char* what) const {
    if (const toml::array* array = node_->as_array(); array == nullptr || array->size() != size) {
        fail(fmt::format("must be a list of {}", what));
    }
    return list();
}

Vec2 Entry::point() const {
    const std::vector<Entry> coordinates = list(2, "two lengths, such as [\"1 mm\", \"2 mm\"]");
    return {coordinates[0].number(limits::coordinate), coordinates[1].number(limits::coordinate)};
}

std::filesystem::path Entry::existing_file() const {
    const std::filesystem::path file = document_->file().parent_path() / text();
    std::error_code error;
    if (std::filesystem::is_directory(file, error)) {
        fail(fmt::format("is a folder, and a file is needed: {}", file.string()));
    }
    if (!std::filesystem::is_regular_file(file, error)) {
        fail(fmt::format("there is no such file: {}", file.string()));
    }
    return file;
}

}  // namespace crampfit

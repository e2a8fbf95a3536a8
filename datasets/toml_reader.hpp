#pragma once

#include "datasets/io.hpp"
#include "datasets/limits.hpp"
#include "datasets/units.hpp"

#include <toml++/toml.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace crampfit {

/// What stands for the file in errors about overrides.
inline constexpr const char* command_line = "command line (--set)";

class Entry;

/// A TOML file with the overrides of the command line in it. Entries point into it: it stays where it is.
class Document {
  public:
    /// Throws InputError for a syntax error (with line and column) and for an override whose key leads nowhere.
    Document(const std::string& text, std::filesystem::path file, const Overrides& overrides);
    Document(const Document&) = delete;
    Document& operator=(const Document&) = delete;

    Entry root() const;
    const std::string& text() const { return text_; }  // as used
    const std::filesystem::path& file() const { return file_; }

  private:
    friend class Entry;

    struct Applied {
        std::string address;  // what it made or replaced; list members by number
        std::string target;   // the key itself, list members by number
        std::string key;      // as the command line wrote it
        std::string value;    // as the command line wrote it
    };

    Applied apply(const std::string& key, const std::string& value);

    std::filesystem::path file_;
    std::string text_;
    toml::table root_;
    std::vector<Applied> applied_;
};

template <class T>
using Choices = std::vector<std::pair<std::string, T>>;

/// One value of a document, with the dotted key that leads to it. What is not as asked for is an InputError that names
/// file (or the command line), key, value and rule.
class Entry {
  public:
    [[noreturn]] void fail(const std::string& rule) const;

    const std::string& key() const { return key_; }
    Place place() const;  // file and key, the command line's where an override set it
    bool is_table() const { return node_ != nullptr && node_->is_table(); }
    bool is_text() const { return node_ != nullptr && node_->is_string(); }

    // A table's members. `only` comes first: it refuses every key that is not one of `known`.
    void only(const std::vector<std::string>& known) const;
    bool has(const std::string& name) const;
    Entry at(const std::string& name) const;  // must be there
    std::optional<Entry> find(const std::string& name) const;
    std::vector<std::pair<std::string, Entry>> members() const;

    // Values.
    std::string text() const;  // not empty
    bool boolean() const;
    int integer(int low, int high) const;
    double number(const NumberRule& rule) const;  // SI; a dimensional one needs its unit
    Quantity quantity() const;                    // of any dimension
    std::vector<Entry> list() const;
    std::vector<Entry> list(std::size_t size, const char* what) const;
    Vec2 point() const;                           // [m]
    std::filesystem::path existing_file() const;  // relative to the document's folder
    template <class T>
    T choice(const Choices<T>& choices, const std::string& or_else = "") const;  // what else it may be, for the error

  private:
    friend class Document;
    Entry(const Document& document, const toml::node* node, std::string key, std::string address)
        : document_(&document), node_(node), key_(std::move(key)), address_(std::move(address)) {}

    const toml::table& table() const;
    std::string written() const;
    std::pair<Place, std::string> origin() const;  // where it was set, and the value as written there
    [[noreturn]] void fail_choice(const std::string& word, const std::vector<std::string>& words,
                                  const std::string& or_else) const;

    const Document* document_;
    const toml::node* node_;  // null: absent, for the error about it
    std::string key_;         // as people read it: list members by name where they have one
    std::string address_;     // list members by number
};

template <class T>
T Entry::choice(const Choices<T>& choices, const std::string& or_else) const {
    const std::string word = text();
    std::vector<std::string> words;
    for (const auto& [name, value] : choices) {
        if (name == word) {
            return value;
        }
        words.push_back(name);
    }
    fail_choice(word, words, or_else);
}

}  // namespace crampfit

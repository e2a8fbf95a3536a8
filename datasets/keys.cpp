#include "datasets/keys.hpp"

#include "datasets/error.hpp"

#include <algorithm>
#include <charconv>
#include <numeric>

namespace crampfit {
namespace {

constexpr std::size_t deepest_key = 32;  // far beyond any scene; keeps recursions over tables off the end of the stack

/// Letters to insert, delete or replace to get from one word to the other, case aside (Levenshtein 1966).
std::size_t edit_distance(const std::string& a, const std::string& b) {
    const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replaced = diagonal + (lower(a[i - 1]) == lower(b[j - 1]) ? 0 : 1);
            diagonal = row[j];
            row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row.back();
}

}  // namespace

std::vector<std::string> split_key(const std::string& key, const std::string& file, const std::string& value) {
    std::vector<std::string> parts;
    std::size_t at = 0;
    for (;;) {
        std::size_t end = 0;
        if (at < key.size() && (key[at] == '"' || key[at] == '\'')) {
            const std::size_t close = key.find(key[at], at + 1);
            if (close == std::string::npos) {
                throw InputError(file, key, value, "a quote in the key is not closed");
            }
            parts.push_back(key.substr(at + 1, close - at - 1));
            end = close + 1;
            if (end < key.size() && key[end] != '.') {
                throw InputError(file, key, value, "a quoted part of the key must be followed by a dot or the end");
            }
        } else {
            end = std::min(key.find('.', at), key.size());
            parts.push_back(key.substr(at, end - at));
        }
        if (parts.back().empty()) {
            throw InputError(file, key, value, "a part of the key is empty");
        }
        if (end == key.size()) {
            return parts;
        }
        if (parts.size() == deepest_key) {
            throw InputError(file, key, value, "the key has too many parts");
        }
        at = end + 1;
    }
}

std::string join_key(const std::string& key, const std::string& part) {
    const bool plain = !part.empty() && part.find('.') == std::string::npos;
    return (key.empty() ? "" : key + ".") + (plain ? part : '"' + part + '"');
}

std::string nearest(const std::string& word, const std::vector<std::string>& candidates) {
    std::string best;
    std::size_t smallest = std::max<std::size_t>(2, word.size() / 3) + 1;
    for (const std::string& candidate : candidates) {
        const std::size_t distance = edit_distance(word, candidate);
        if (distance < smallest && distance < candidate.size()) {
            smallest = distance;
            best = candidate;
        }
    }
    return best;
}

std::string suggestion(const std::string& word, const std::vector<std::string>& candidates) {
    const std::string near = nearest(word, candidates);
    return near.empty() ? "" : "; did you mean \"" + near + "\"?";
}

std::size_t member_number(const std::string& part, std::size_t size) {
    std::size_t number = 0;
    const char* const end = part.data() + part.size();
    const auto [rest, error] = std::from_chars(part.data(), end, number);
    return error == std::errc() && rest == end && number < size ? number : size;
}

}  // namespace crampfit

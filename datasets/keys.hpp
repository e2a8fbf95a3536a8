#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace crampfit {

/// The parts of a dotted key; a part with a dot in it stands in quotes: materials."EW 2.1".toughness.
/// Throws InputError, which names `file` and `value`, for an empty part, an open quote or far too many parts.
std::vector<std::string> split_key(const std::string& key, const std::string& file, const std::string& value);

/// A dotted key with one part more.
std::string join_key(const std::string& key, const std::string& part);

/// The candidate that `word` is most likely a slip of the pen for; empty when none is near.
std::string nearest(const std::string& word, const std::vector<std::string>& candidates);

/// "; did you mean X?" for the nearest candidate, or nothing.
std::string suggestion(const std::string& word, const std::vector<std::string>& candidates);

/// The number that a list member is addressed by: digits alone, below `size`; otherwise `size`.
std::size_t member_number(const std::string& part, std::size_t size);

}  // namespace crampfit

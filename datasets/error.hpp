#pragma once

#include <stdexcept>
#include <string>

namespace crampfit {

/// Bad input: names the file, the key in it, the value found and the rule that it breaks.
/// The one exception type for input of any kind; the command turns it into exit status 2.
class InputError : public std::runtime_error {
  public:
    InputError(std::string in_file, std::string at_key, std::string found, std::string broken_rule)
        : std::runtime_error(in_file + ": " + (at_key.empty() ? "" : at_key + " = " + found + ": ") + broken_rule),
          file(std::move(in_file)), key(std::move(at_key)), value(std::move(found)), rule(std::move(broken_rule)) {}

    std::string file;   // where it stands; "command line" for options
    std::string key;    // dotted, as in "materials.EW.toughness"; empty when the file itself is at fault
    std::string value;  // as written
    std::string rule;   // what must hold, as a sentence that a user can act on
};

}  // namespace crampfit

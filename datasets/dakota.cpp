#include "datasets/dakota.hpp"

#include "datasets/error.hpp"
#include "datasets/keys.hpp"
#include "datasets/text_file.hpp"
#include "datasets/units.hpp"
#include "datasets/whole_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <numeric>
#include <sstream>

namespace crampfit {
namespace {

/// A line: what it is called and what it says.
struct Tagged {
    std::string tag;
    std::string value;
};

// { tag = value }, a text in quotes.
Tagged aprepro_line(const std::string& line, const std::string& file) {
    const std::size_t equals = line.find('=');
    if (line.back() != '}' || equals == std::string::npos) {
        throw InputError(file, "", line, "must be { tag = value }, as in Dakota's APREPRO format");
    }
    std::string value = trim(std::string_view(line).substr(equals + 1, line.size() - equals - 2));
    if (value.size() > 1 && value.front() == '"' && value.back() == '"') {
        value = value.substr(1, value.size() - 2);
    }
    return {trim(std::string_view(line).substr(1, equals - 1)), value};
}

// value tag: a text may hold spaces, a tag not.
Tagged standard_line(const std::string& line, const std::string& file) {
    const std::size_t space = line.find_last_of(" \t");
    if (space == std::string::npos) {
        throw InputError(file, "", line, "must be a value and its tag, as in Dakota's standard format");
    }
    return {line.substr(space + 1), trim(std::string_view(line).substr(0, space))};
}

/// Goes through the lines in Dakota's order: a count, then as many members, section by section.
class RequestReader {
  public:
    explicit RequestReader(const std::filesystem::path& file) : file_(file.string()) {
        std::istringstream text(read_text(file));
        for (std::string line; std::getline(text, line);) {
            const std::string trimmed = trim(line);
            if (!trimmed.empty()) {
                lines_.push_back(trimmed.front() == '{' ? aprepro_line(trimmed, file_) : standard_line(trimmed, file_));
            }
        }
    }

    /// The members of a section, which has one name in either format; an `optional` one may be absent.
    std::vector<Tagged> section(const char* standard, const char* aprepro, bool optional = false) {
        if (optional && next_ == lines_.size()) {
            return {};
        }
        const Tagged head = take(standard);
        if (head.tag != standard && head.tag != aprepro) {
            throw InputError(file_, head.tag, head.value, fmt::format("must be {} here, or {}", standard, aprepro));
        }
        std::vector<Tagged> members;
        for (int left = number(head); left > 0; --left) {
            members.push_back(take(standard));
        }
        return members;
    }

    /// The line with the evaluation's number, which may be absent.
    void skip_evaluation_number() {
        if (next_ < lines_.size() && (lines_[next_].tag == "eval_id" || lines_[next_].tag == "DAKOTA_EVAL_ID")) {
            ++next_;
        }
    }

    int number(const Tagged& line) const {
        constexpr int most = 1'000'000;
        int value = 0;
        const char* const end = line.value.data() + line.value.size();
        const auto [rest, error] = std::from_chars(line.value.data(), end, value);
        if (error != std::errc() || rest != end || value < 0 || value > most) {
            throw InputError(file_, line.tag, line.value, "must be a whole number from 0");
        }
        return value;
    }

    const std::string& file() const { return file_; }

  private:
    Tagged take(const char* section) {
        if (next_ == lines_.size()) {
            throw InputError(file_, section, "", "the file ends before it");
        }
        return lines_[next_++];
    }

    std::string file_;
    std::vector<Tagged> lines_;
    std::size_t next_ = 0;
};

// ASV_1:label: the label, which older versions leave out.
std::string label_of(const std::string& tag) {
    const std::size_t colon = tag.find(':');
    return colon == std::string::npos ? "" : tag.substr(colon + 1);
}

}  // namespace

DakotaRequest read_dakota_request(const std::filesystem::path& file) {
    RequestReader reader(file);
    DakotaRequest request;
    for (const Tagged& variable : reader.section("variables", "DAKOTA_VARS")) {
        request.variables.emplace_back(variable.tag, variable.value);
    }
    for (const Tagged& function : reader.section("functions", "DAKOTA_FNS")) {
        request.active.push_back(reader.number(function));
        request.labels.push_back(label_of(function.tag));
        if (request.active.back() > 7) {
            throw InputError(reader.file(), function.tag, function.value,
                             "must be 0 to 7: 1 for the value, 2 the gradient, 4 the Hessian");
        }
    }
    for (const Tagged& variable : reader.section("derivative_variables", "DAKOTA_DER_VARS")) {
        const int number = reader.number(variable);
        if (number < 1 || static_cast<std::size_t>(number) > request.variables.size()) {
            throw InputError(reader.file(), variable.tag, variable.value, "must be the number of a variable, from 1");
        }
        request.derivative_variables.push_back(static_cast<std::size_t>(number) - 1);
    }
    reader.section("analysis_components", "DAKOTA_AN_COMPS", true);
    reader.skip_evaluation_number();
    const std::vector<Tagged> metadata = reader.section("metadata", "DAKOTA_METADATA", true);
    if (!metadata.empty()) {
        throw InputError(reader.file(), metadata.front().tag, metadata.front().value, "there is no metadata to give");
    }
    return request;
}

std::vector<std::size_t> outputs_asked_for(const DakotaRequest& request, const std::vector<std::string>& names,
                                           const std::filesystem::path& file) {
    std::vector<std::string> known = names;
    for (std::string& name : known) {
        std::ranges::replace(name, ' ', '_');
    }
    const auto number_of = [&](const std::string& label) {
        return static_cast<std::size_t>(std::ranges::find(known, label) - known.begin());
    };
    std::vector<std::size_t> order(request.labels.size());
    std::iota(order.begin(), order.end(), 0);
    const bool by_name = std::ranges::any_of(request.labels, [&](const auto& l) { return number_of(l) < known.size(); });
    std::vector<bool> taken(known.size(), false);
    for (std::size_t k = 0; k < order.size(); ++k) {
        const std::string& label = request.labels[k];
        const std::string key = fmt::format("ASV_{}", k + 1);
        if (by_name) {
            order[k] = number_of(label);
            if (order[k] < known.size() && taken[order[k]]) {
                throw InputError(file.string(), key, label, "is the same output as another function");
            }
        }
        if (by_name ? order[k] == known.size() : !label.empty() && !label.ends_with(std::to_string(k + 1))) {
            throw InputError(file.string(), key, label,
                             fmt::format("is no output of the study: name it as the study does, with _ for each space, or number "
                                         "all functions in the study's order, as f1, f2{}",
                                         suggestion(label, known)));
        }
        taken[order[k]] = true;
    }
    return order;
}

void write_dakota_results(const DakotaRequest& request, const std::vector<double>& values,
                          const std::vector<std::vector<double>>& gradients, const std::filesystem::path& file) {
    std::string text;
    for (std::size_t k = 0; k < request.active.size(); ++k) {
        if (request.active[k] & DakotaRequest::value) {
            text += fmt::format("{} {}\n", values[k], request.labels[k].empty() ? fmt::format("f{}", k + 1) : request.labels[k]);
        }
    }
    for (std::size_t k = 0; k < request.active.size(); ++k) {
        if (request.active[k] & DakotaRequest::gradient) {
            text += "[";
            for (const double slope : gradients[k]) {
                text += fmt::format(" {}", slope);
            }
            text += " ]\n";
        }
    }
    write_whole_file(file, text);
}

bool may_hold_dakota_answer(const std::filesystem::path& file) {
    std::ifstream in(file);
    std::string word;
    if (!(in >> word)) {
        return true;
    }
    double number = 0;
    const auto [rest, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    return word == "fail:" || word == "[" || (error == std::errc() && rest == word.data() + word.size());
}

void write_dakota_failure(const std::string& reason, const std::filesystem::path& file) {
    std::string line = reason;
    std::replace(line.begin(), line.end(), '\n', ' ');
    write_whole_file(file, "fail: " + line + "\n");
}

}  // namespace crampfit

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "datasets/keys.hpp"
#include "datasets/text_file.hpp"
#include "datasets/units.hpp"
#include "datasets/whole_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

namespace crampfit {
namespace {

/// A column that a file of curves may have, and the unit that it is written in.
struct ColumnKind {
    const char* name;
    Dimension dimension;
    const char* unit;
    double factor;  // SI units in one `unit`
    std::vector<double> Curves::*values;
    double most;  // that a test can read, in `unit`: a logger that overflows writes more
};

const std::array<ColumnKind, 4> column_kinds{{
    {"time", dimension::time, "s", 1, &Curves::time, 1e12},
    {"displacement", dimension::length, "mm", 1e-3, &Curves::displacement, 1e6},
    {"force", dimension::force, "N", 1, &Curves::force, 1e9},
    {"crack_length", dimension::length, "mm", 1e-3, &Curves::crack_length, 1e6},
}};

/// A column of the file at hand.
struct Column {
    const ColumnKind* kind;
    double factor;  // SI units in one of the file's
};

/// Fields of a line, without white space and double quotes around them.
std::vector<std::string> split_fields(std::string_view line) {
    std::vector<std::string> fields;
    for (std::size_t begin = 0; begin <= line.size();) {
        const std::size_t end = std::min(line.find(',', begin), line.size());
        std::string field = trim(line.substr(begin, end - begin));
        if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
            field = trim(std::string_view(field).substr(1, field.size() - 2));
        }
        fields.push_back(std::move(field));
        begin = end + 1;
    }
    return fields;
}

std::string at_line(const std::string& column, std::size_t line) { return fmt::format("{}, line {}", column, line); }

std::vector<Column> read_head(std::string_view line, std::size_t number, const std::string& file) {
    std::vector<Column> columns;
    std::vector<std::string> known;
    for (const ColumnKind& kind : column_kinds) {
        known.emplace_back(kind.name);
    }
    for (const char other : {';', '\t'}) {
        if (line.find(other) != std::string_view::npos && line.find(',') == std::string_view::npos) {
            throw InputError(file, at_line("head", number), std::string(line),
                             fmt::format("columns must be separated by commas, not {}, and decimals by points",
                                         other == ';' ? "semicolons" : "tabs"));
        }
    }
    for (const std::string& field : split_fields(line)) {
        const Place place{file, at_line(fmt::format("column {}", columns.size() + 1), number)};
        const auto fail = [&](const std::string& rule) { throw InputError(place.file, place.key, field, rule); };
        const std::string name = trim(std::string_view(field).substr(0, field.find('[')));
        const auto kind = std::find_if(column_kinds.begin(), column_kinds.end(),
                                       [&](const ColumnKind& candidate) { return candidate.name == name; });
        if (kind == column_kinds.end() && field.find('[') != std::string::npos) {
            fail("unknown column; known are time, displacement, force and crack_length" + suggestion(name, known));
        }
        const ColumnHeader header = parse_header(field, place);
        if (!(header.unit.dimension == kind->dimension)) {
            fail(fmt::format("wrong dimension: got {}, expected {}", describe(header.unit.dimension), describe(kind->dimension)));
        }
        for (const Column& other : columns) {
            if (other.kind == &*kind) {
                fail("this column is there twice");
            }
        }
        columns.push_back({&*kind, header.unit.factor});
    }
    return columns;
}

double read_field(const std::string& text, const Place& place) {
    if (text.empty()) {
        return std::numeric_limits<double>::quiet_NaN();
    }
    double value = 0;
    const char* const begin = text.data() + (text.size() > 1 && text[0] == '+' && text[1] != '-' ? 1 : 0);
    const auto [rest, error] = std::from_chars(begin, text.data() + text.size(), value);
    if (error != std::errc() || rest != text.data() + text.size() || !std::isfinite(value)) {
        throw InputError(place.file, place.key, text, "must be a finite number; leave the field empty for a gap");
    }
    return value;
}

void read_row(std::string_view line, std::size_t number, const std::vector<Column>& columns, const std::string& file,
              Curves& curves) {
    const std::vector<std::string> fields = split_fields(line);
    if (fields.size() != columns.size()) {
        throw InputError(file, at_line("row", number), std::string(line),
                         fmt::format("has {} fields, but the head has {} columns", fields.size(), columns.size()));
    }
    for (std::size_t i = 0; i < columns.size(); ++i) {
        const ColumnKind& kind = *columns[i].kind;
        const double value = columns[i].factor * read_field(fields[i], {file, at_line(kind.name, number)});
        if (std::abs(value) > kind.most * kind.factor) {
            throw InputError(
                file, at_line(kind.name, number), fields[i],
                fmt::format("no test reads more than {:g} {}: leave the field empty for a gap", kind.most, kind.unit));
        }
        (curves.*kind.values).push_back(value);
    }
}

}  // namespace

Curves read_curves(const std::filesystem::path& file) {
    const std::string text = read_text(file);
    if (text.find('\0') != std::string::npos) {
        throw InputError(file.string(), "", "", "is no text: columns of numbers as CSV are needed");
    }
    Curves curves;
    std::vector<Column> columns;
    std::size_t rows = 0;
    std::size_t number = 0;
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        const std::string line = trim(std::string_view(text).substr(begin, end - begin));
        begin = end + 1;
        ++number;
        if (line.empty() || line.front() == '#') {
            continue;
        }
        if (columns.empty()) {
            columns = read_head(line, number, file.string());
        } else {
            read_row(line, number, columns, file.string(), curves);
            ++rows;
        }
    }
    if (rows == 0) {
        throw InputError(file.string(), "", "",
                         "has no data: a head such as \"displacement [mm],force [N]\" and one line a row are needed");
    }
    return curves;
}

void write_curves(const Curves& curves, const std::filesystem::path& file) {
    std::vector<const ColumnKind*> columns;
    std::size_t rows = 0;
    for (const ColumnKind& kind : column_kinds) {
        if (const std::vector<double>& values = curves.*kind.values; !values.empty()) {
            if (!columns.empty() && values.size() != rows) {
                throw InputError(file.string(), kind.name, fmt::format("{} rows", values.size()),
                                 fmt::format("all columns need the same number of rows; {} has {}", columns[0]->name, rows));
            }
            columns.push_back(&kind);
            rows = values.size();
        }
    }
    std::string text;
    for (const ColumnKind* kind : columns) {
        text += fmt::format("{}{} [{}]", kind == columns.front() ? "" : ",", kind->name, kind->unit);
    }
    text += '\n';
    for (std::size_t row = 0; row < rows; ++row) {
        for (const ColumnKind* kind : columns) {
            const double value = (curves.*kind->values)[row] / kind->factor;
            text += kind == columns.front() ? "" : ",";
            text += std::isnan(value) ? "" : fmt::format("{:.9g}", value);
        }
        text += '\n';
    }
    write_whole_file(file, text);
}

}  // namespace crampfit

#include "datasets/borders_file.hpp"

#include "datasets/error.hpp"
#include "datasets/text_file.hpp"
#include "datasets/units.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <sstream>

namespace crampfit {
namespace {

const std::array<std::string, 3> column_names{"ring", "x_px", "y_px"};

std::vector<std::string> fields_of(const std::string& line) {
    std::vector<std::string> fields;
    std::istringstream in(line + ',');
    for (std::string field; std::getline(in, field, ',');) fields.push_back(trim(field));
    return fields;
}

/// Where each of our columns stands.
std::array<std::size_t, 3> read_head(const std::string& line, const std::string& file) {
    const std::vector<std::string> fields = fields_of(line);
    std::array<std::size_t, 3> place{};
    for (std::size_t i = 0; i < 3; ++i) {
        place[i] = std::find(fields.begin(), fields.end(), column_names[i]) - fields.begin();
        if (place[i] == fields.size()) throw InputError(file, "head", line, "must name the columns ring, x_px and y_px");
    }
    return place;
}

double read_number(const std::string& text, const std::string& file, const std::string& column, std::size_t line) {
    double value = 0;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool whole = error == std::errc() && rest == text.data() + text.size() && std::isfinite(value);
    const bool ring = column == "ring";
    if (!whole || (ring && (value != std::floor(value) || std::abs(value) > 1e9)))
        throw InputError(file, fmt::format("{}, line {}", column, line), text,
                         ring ? "must be a whole number" : "must be a finite number of pixels");
    return value;
}

}  // namespace

std::vector<BorderPolyline> read_borders(const std::filesystem::path& file) {
    std::istringstream text(read_text(file));
    std::map<std::int64_t, BorderPolyline> borders;
    std::array<std::size_t, 3> place{};
    bool head = false;
    std::string line;
    for (std::size_t number = 1; std::getline(text, line); ++number) {
        line = trim(line);
        if (line.empty() || line.front() == '#') continue;
        if (!head) {
            place = read_head(line, file.string());
            head = true;
            continue;
        }
        const std::vector<std::string> fields = fields_of(line);
        std::array<double, 3> value{};
        for (std::size_t i = 0; i < 3; ++i)
            value[i] = read_number(place[i] < fields.size() ? fields[place[i]] : "", file.string(), column_names[i], number);
        BorderPolyline& border = borders[static_cast<std::int64_t>(value[0])];
        border.ring = static_cast<std::int64_t>(value[0]);
        border.points.emplace_back(value[1], value[2]);
    }
    if (borders.empty())
        throw InputError(file.string(), "", "", "has no borders: a head \"ring,x_px,y_px\" and a row a vertex are needed");
    std::vector<BorderPolyline> sorted;
    for (auto& [ring, border] : borders) {
        if (border.points.size() < 2)
            throw InputError(file.string(), "ring", std::to_string(ring), "a border has at least 2 vertices");
        sorted.push_back(std::move(border));
    }
    return sorted;
}

}  // namespace crampfit

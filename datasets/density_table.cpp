#include "datasets/density_table.hpp"

#include "datasets/error.hpp"
#include "datasets/text_file.hpp"
#include "datasets/units.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <sstream>

namespace crampfit {
namespace {

std::pair<std::string, std::string> halves_of(const std::string& line, const std::string& file) {
    const std::size_t comma = line.find(',');
    if (comma == std::string::npos || line.find(',', comma + 1) != std::string::npos)
        throw InputError(file, "row", line, "must have two columns: gray,density [kg/m^3]");
    return {trim(line.substr(0, comma)), trim(line.substr(comma + 1))};
}

double number_in(const std::string& text, const Place& place) {
    double value = 0;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || rest != text.data() + text.size() || !std::isfinite(value))
        throw InputError(place.file, place.key, text, "must be a finite number");
    return value;
}

/// SI units in one of the density column's.
double read_factor(const std::string& line, const std::string& file) {
    const auto [gray, density] = halves_of(line, file);
    if (gray != "gray") throw InputError(file, "head", line, "must be gray,density [kg/m^3]");
    const ColumnHeader header = parse_header(density, {file, "head"});
    if (header.name != "density" || !(header.unit.dimension == dimension::density))
        throw InputError(file, "head", line, "must be gray,density [kg/m^3], the density in any unit of density");
    return header.unit.factor;
}

}  // namespace

double DensityTable::at(double gray_value) const {
    const auto after = std::ranges::lower_bound(gray, gray_value);
    if (after == gray.begin()) return density.front();
    if (after == gray.end()) return density.back();
    const auto i = static_cast<std::size_t>(after - gray.begin());
    return std::lerp(density[i - 1], density[i], (gray_value - gray[i - 1]) / (gray[i] - gray[i - 1]));
}

DensityTable read_density_table(const std::filesystem::path& file) {
    std::istringstream text(read_text(file));
    const std::string name = file.string();
    DensityTable table;
    double factor = 0;
    std::string line;
    for (int number = 1; std::getline(text, line); ++number) {
        line = trim(line);
        if (line.empty() || line.front() == '#') continue;
        if (factor == 0) {
            factor = read_factor(line, name);
            continue;
        }
        const auto [gray, density] = halves_of(line, name);
        table.gray.push_back(number_in(gray, {name, fmt::format("gray, line {}", number)}));
        table.density.push_back(factor * number_in(density, {name, fmt::format("density, line {}", number)}));
        const bool rises = table.gray.size() == 1 || table.gray.back() > table.gray[table.gray.size() - 2];
        if (!rises || !(table.gray.back() >= 0 && table.gray.back() <= 255))
            throw InputError(name, fmt::format("gray, line {}", number), gray, "must rise from row to row, from 0 to 255");
        if (!(table.density.back() >= 0))
            throw InputError(name, fmt::format("density, line {}", number), density, "must not be negative");
    }
    if (!std::ranges::is_sorted(table.density) && !std::ranges::is_sorted(table.density, std::ranges::greater{}))
        throw InputError(name, "density", "rises and falls", "must rise all the way or fall all the way");
    if (table.gray.size() < 2)
        throw InputError(name, "", fmt::format("{} rows", table.gray.size()),
                         "needs a head gray,density [kg/m^3] and two rows at least");
    return table;
}

}  // namespace crampfit

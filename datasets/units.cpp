#include "datasets/units.hpp"

#include "datasets/error.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <utility>

namespace crampfit {
namespace {

struct NamedDimension {
    Dimension dimension;
    const char* name;
    const char* example;
};

constexpr std::array named_dimensions{
    NamedDimension{dimension::length, "a length", "25 um"},
    NamedDimension{dimension::time, "a time", "1 ms"},
    NamedDimension{dimension::angle, "an angle", "30 deg"},
    NamedDimension{dimension::velocity, "a velocity", "1 mm/min"},
    NamedDimension{dimension::rate, "a rate", "2e4 1/s"},
    NamedDimension{dimension::force, "a force", "2 N"},
    NamedDimension{dimension::compliance, "a compliance", "0.5 um/N"},
    NamedDimension{dimension::pressure, "a pressure", "40 MPa"},
    NamedDimension{dimension::density, "a density", "300 kg/m^3"},
    NamedDimension{dimension::energy_release_rate, "an energy per area", "100 J/m^2"},
    NamedDimension{dimension::stress_intensity, "a stress intensity", "0.35 MPa*m^0.5"},
};

struct Symbol {
    std::string_view name;
    double factor;
    Dimension dimension;
    bool takes_prefix;
};

constexpr std::array symbols{
    Symbol{"m", 1, dimension::length, true},     Symbol{"g", 1e-3, {0, 1, 0, 0}, true},
    Symbol{"s", 1, dimension::time, true},       Symbol{"N", 1, dimension::force, true},
    Symbol{"Pa", 1, dimension::pressure, true},  Symbol{"J", 1, {2, 1, -2, 0}, true},
    Symbol{"W", 1, {2, 1, -3, 0}, true},         Symbol{"Hz", 1, dimension::rate, true},
    Symbol{"rad", 1, dimension::angle, true},    Symbol{"deg", std::numbers::pi / 180, dimension::angle, false},
    Symbol{"min", 60, dimension::time, false},   Symbol{"h", 3600, dimension::time, false},
    Symbol{"%", 0.01, dimension::number, false},
};

constexpr std::array<std::pair<char, double>, 11> prefixes{{{'p', 1e-12},
                                                            {'n', 1e-9},
                                                            {'u', 1e-6},
                                                            {'m', 1e-3},
                                                            {'c', 1e-2},
                                                            {'d', 1e-1},
                                                            {'h', 1e2},
                                                            {'k', 1e3},
                                                            {'M', 1e6},
                                                            {'G', 1e9},
                                                            {'T', 1e12}}};

/// Signs beyond ASCII that people write in units, as ASCII.
constexpr std::array<std::pair<std::string_view, std::string_view>, 10> spellings{{{"\u00b5", "u"},
                                                                                   {"\u03bc", "u"},
                                                                                   {"\u00b0", "deg"},
                                                                                   {"\u00b7", "*"},
                                                                                   {"\u22c5", "*"},
                                                                                   {"\u00b2", "^2"},
                                                                                   {"\u00b3", "^3"},
                                                                                   {"\u00a0", " "},
                                                                                   {"\u202f", " "},
                                                                                   {"\u2212", "-"}}};

std::string to_ascii(std::string_view text) {
    std::string ascii(text);
    for (const auto& [sign, plain] : spellings) {
        for (auto at = ascii.find(sign); at != std::string::npos; at = ascii.find(sign, at)) {
            ascii.replace(at, sign.size(), plain);
        }
    }
    return ascii;
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '%'; }

Unit power(const Unit& unit, double exponent) {
    const Dimension& d = unit.dimension;
    return {std::pow(unit.factor, exponent), {d.length * exponent, d.mass * exponent, d.time * exponent, d.angle * exponent}};
}

Unit product(const Unit& a, const Unit& b) {
    return {a.factor * b.factor,
            {a.dimension.length + b.dimension.length, a.dimension.mass + b.dimension.mass, a.dimension.time + b.dimension.time,
             a.dimension.angle + b.dimension.angle}};
}

/// Recursive descent over: product = power { (* | / | space) power }, power = primary [^ exponent],
/// primary = symbol | 1 | ( product ) | sqrt( product ).
class UnitParser {
  public:
    UnitParser(std::string_view text, std::string_view written, const Place& place)
        : text_(text), written_(written), place_(place) {}

    Unit parse() {
        skip_spaces();
        const Unit unit = parse_product();
        if (!at_end()) {
            fail(is_digit(peek()) ? "a unit holds no number but 1; write powers with ^, as in m^2"
                                  : fmt::format("cannot read the unit from '{}' on", rest()));
        }
        if (!std::isfinite(unit.factor) || unit.factor <= 0) {
            fail("the unit is too large or too small");
        }
        return unit;
    }

  private:
    static constexpr int deepest_bracket = 16;  // keeps the recursion off the end of the stack

    [[noreturn]] void fail(const std::string& rule) const {
        throw InputError(place_.file, place_.key, std::string(written_), rule);
    }

    bool at_end() const { return at_ >= text_.size(); }
    char peek() const { return at_end() ? '\0' : text_[at_]; }
    std::string_view rest() const { return text_.substr(at_); }

    void skip_spaces() {
        while (!at_end() && is_space(peek())) {
            ++at_;
        }
    }

    bool take(char c) {
        if (peek() != c) {
            return false;
        }
        ++at_;
        return true;
    }

    Unit parse_product() {
        Unit unit = parse_power();
        bool divided = false;
        for (;;) {
            const bool spaced = is_space(peek());
            skip_spaces();
            if (take('/')) {
                divided = true;
                skip_spaces();
                unit = product(unit, power(parse_power(), -1));
            } else if (take('*')) {
                skip_spaces();
                unit = product(unit, parse_power());
            } else if (spaced && !at_end() && peek() != ')') {
                if (divided) {
                    fail("a space after / is ambiguous: write * or brackets, as in J/(m^2*s)");
                }
                unit = product(unit, parse_power());
            } else {
                return unit;
            }
        }
    }

    Unit parse_power() {
        const Unit unit = parse_primary();
        return take('^') ? power(unit, parse_exponent()) : unit;
    }

    Unit parse_primary() {
        if (take('(')) {
            return parse_bracket();
        }
        if (take('1')) {
            return {};
        }
        const std::size_t begin = at_;
        while (is_letter(peek())) {
            ++at_;
        }
        const std::string_view symbol = text_.substr(begin, at_ - begin);
        if (symbol.empty()) {
            fail(at_end() ? "the unit is incomplete" : fmt::format("unknown unit '{}'", rest()));
        }
        if (symbol == "sqrt" && take('(')) {
            return power(parse_bracket(), 0.5);
        }
        return find_symbol(symbol);
    }

    Unit parse_bracket() {
        if (++depth_ > deepest_bracket) {
            fail("too many brackets in the unit");
        }
        skip_spaces();
        const Unit unit = parse_product();
        if (!take(')')) {
            fail("a bracket of the unit is not closed");
        }
        --depth_;
        return unit;
    }

    double parse_exponent() {
        const bool bracket = take('(');
        double exponent = parse_number();
        if (bracket) {
            if (take('/')) {
                exponent /= parse_number();
            }
            if (!take(')')) {
                fail("a bracket of the unit is not closed");
            }
        }
        constexpr double largest_exponent = 12;
        if (!(std::abs(exponent) <= largest_exponent)) {
            fail(fmt::format("a unit's power must lie between -{0:g} and {0:g}", largest_exponent));
        }
        return exponent;
    }

    double parse_number() {
        double number = 0;
        const char* const begin = text_.data() + at_;
        const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), number, std::chars_format::fixed);
        if (error != std::errc()) {
            fail("a unit's power must be a number, as in m^2 or m^0.5");
        }
        at_ += static_cast<std::size_t>(end - begin);
        return number;
    }

    Unit find_symbol(std::string_view name) const {
        for (const Symbol& symbol : symbols) {
            if (symbol.name == name) {
                return {symbol.factor, symbol.dimension};
            }
        }
        for (const Symbol& symbol : symbols) {
            for (const auto& [prefix, factor] : prefixes) {
                if (symbol.takes_prefix && name.front() == prefix && name.substr(1) == symbol.name) {
                    return {factor * symbol.factor, symbol.dimension};
                }
            }
        }
        fail(fmt::format("unknown unit '{}'", name));
    }

    std::string_view text_;     // ASCII
    std::string_view written_;  // for errors
    const Place& place_;
    std::size_t at_ = 0;
    int depth_ = 0;
};

/// The number at the head of a text, and what follows it.
std::pair<double, std::string_view> parse_head(std::string_view text, std::string_view written, const Place& place) {
    const auto fail = [&](const char* rule) { throw InputError(place.file, place.key, std::string(written), rule); };
    const bool plus = text.size() > 1 && text[0] == '+' && text[1] != '-';
    const char* const begin = text.data() + (plus ? 1 : 0);
    const char* const end = text.data() + text.size();
    double number = 0;
    const auto [rest, error] = std::from_chars(begin, end, number);
    if (error == std::errc::invalid_argument || std::isnan(number)) {
        fail("not a number with a unit");
    }
    if (error == std::errc::result_out_of_range || !std::isfinite(number)) {
        fail("the number is infinite, or too large or too small");
    }
    if (rest != end && *rest == ',') {
        fail("write a decimal point, not a comma");
    }
    return {number, std::string_view(rest, static_cast<std::size_t>(end - rest))};
}

}  // namespace

bool operator==(const Dimension& a, const Dimension& b) {
    constexpr double rounding = 1e-9;  // exponents such as 1/3 + 2/3
    return std::abs(a.length - b.length) < rounding && std::abs(a.mass - b.mass) < rounding &&
           std::abs(a.time - b.time) < rounding && std::abs(a.angle - b.angle) < rounding;
}

std::string describe(const Dimension& dimension) {
    if (dimension == dimension::number) {
        return "a pure number";
    }
    for (const NamedDimension& named : named_dimensions) {
        if (dimension == named.dimension) {
            return fmt::format("{} such as \"{}\"", named.name, named.example);
        }
    }
    std::string text = "a quantity in";
    for (const auto& [exponent, unit] :
         {std::pair{dimension.mass, "kg"}, {dimension.length, "m"}, {dimension.time, "s"}, {dimension.angle, "rad"}}) {
        if (exponent == 1) {
            text += fmt::format(" {}", unit);
        } else if (exponent != 0) {
            text += fmt::format(" {}^{:g}", unit, exponent);
        }
    }
    return text;
}

std::string trim(std::string_view text) {
    while (!text.empty() && is_space(text.front())) {
        text.remove_prefix(1);
    }
    while (!text.empty() && is_space(text.back())) {
        text.remove_suffix(1);
    }
    return std::string(text);
}

Unit parse_unit(std::string_view text, const Place& place) {
    const std::string ascii = to_ascii(text);
    return UnitParser(ascii, text, place).parse();
}

Quantity parse_quantity(std::string_view text, const Place& place) {
    const std::string ascii = trim(to_ascii(text));
    const auto [number, rest] = parse_head(ascii, text, place);
    const std::string unit_text = trim(rest);
    if (unit_text.empty()) {
        return {number, "", 1, dimension::number};
    }
    const Unit unit = UnitParser(unit_text, text, place).parse();
    const double value = number * unit.factor;
    if (!std::isfinite(value)) {
        throw InputError(place.file, place.key, std::string(text), "the number is infinite, or too large");
    }
    return {value, unit_text, unit.factor, unit.dimension};
}

void check_dimension(const Quantity& quantity, const Dimension& expected, std::string_view text, const Place& place) {
    if (quantity.dimension == expected) {
        return;
    }
    throw InputError(place.file, place.key, std::string(text),
                     quantity.unit.empty()
                         ? fmt::format("missing unit: expected {}", describe(expected))
                         : fmt::format("wrong dimension: got {}, expected {}", describe(quantity.dimension), describe(expected)));
}

double parse_quantity(std::string_view text, const Dimension& expected, const Place& place) {
    const Quantity quantity = parse_quantity(text, place);
    check_dimension(quantity, expected, text, place);
    return quantity.value;
}

ColumnHeader parse_header(std::string_view text, const Place& place) {
    const auto fail = [&](const char* rule) { throw InputError(place.file, place.key, std::string(text), rule); };
    const std::string header = trim(text);
    const std::size_t open = header.find('[');
    if (open == std::string::npos) {
        fail("missing unit: a column's head is its name and its unit, as in force [N]");
    }
    if (header.back() != ']') {
        fail("a column's head ends with its unit in square brackets, as in force [N]");
    }
    const std::string name = trim(std::string_view(header).substr(0, open));
    const std::string unit = trim(std::string_view(header).substr(open + 1, header.size() - open - 2));
    if (name.empty()) {
        fail("missing name: a column's head is its name and its unit, as in force [N]");
    }
    if (unit.empty()) {
        fail("missing unit: a column's head is its name and its unit, as in force [N]");
    }
    return {name, parse_unit(unit, place)};
}

}  // namespace crampfit

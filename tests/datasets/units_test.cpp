// Units at the border, against the definitions of the SI (BIPM, 2019). Tolerances are a few roundings of a double.
#include "datasets/error.hpp"
#include "datasets/units.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

using namespace crampfit;

namespace {

const Place place{"scene.toml", "some.key"};

void expect_value(const char* text, const Dimension& dimension, double expected) {
    EXPECT_NEAR(parse_quantity(text, dimension, place), expected, 1e-14 * std::abs(expected)) << text;
}

void expect_error(const char* text, const Dimension& dimension, const char* phrase) {
    try {
        const double value = parse_quantity(text, dimension, place);
        FAIL() << "'" << text << "' was taken for " << value;
    } catch (const InputError& error) {
        EXPECT_EQ(error.file, "scene.toml");
        EXPECT_EQ(error.key, "some.key");
        EXPECT_EQ(error.value, text);
        EXPECT_NE(error.rule.find(phrase), std::string::npos) << text << ": " << error.rule;
    }
}

}  // namespace

TEST(UnitUnits, QuantitiesOfAScene) {
    expect_value("40 MPa", dimension::pressure, 40e6);
    expect_value("25 um", dimension::length, 25e-6);
    expect_value("300 kg/m^3", dimension::density, 300);
    expect_value("0.45 g/cm^3", dimension::density, 450);
    expect_value("1 mm/min", dimension::velocity, 1e-3 / 60);
    expect_value("36 m/h", dimension::velocity, 0.01);
    expect_value("100 J/m^2", dimension::energy_release_rate, 100);
    expect_value("100 N/m", dimension::energy_release_rate, 100);
    expect_value("0.1 kJ m^-2", dimension::energy_release_rate, 100);
    expect_value("30 deg", dimension::angle, std::numbers::pi / 6);
    expect_value("2 %", dimension::number, 0.02);
    expect_value("0.33", dimension::number, 0.33);
    expect_value("2e4 1/s", dimension::rate, 2e4);
    expect_value("2 kHz", dimension::rate, 2000);
    expect_value("0.35 MPa*m^0.5", dimension::stress_intensity, 0.35e6);
    expect_value("0.35 MPa sqrt(m)", dimension::stress_intensity, 0.35e6);
    expect_value("0.35 MPa m^(1/2)", dimension::stress_intensity, 0.35e6);
    expect_value("10 N/mm^2", dimension::pressure, 10e6);
    expect_value("10 N/(m*mm)", dimension::pressure, 10e3);
}

TEST(UnitUnits, SpellingsOfTheSame) {
    expect_value("25 \u00b5m", dimension::length, 25e-6);
    expect_value("25 \u03bcm", dimension::length, 25e-6);
    expect_value("30\u00b0", dimension::angle, std::numbers::pi / 6);
    expect_value("300 kg/m\u00b3", dimension::density, 300);
    expect_value("2 N\u00b7m/m\u00b2", dimension::energy_release_rate, 2);
    expect_value("  +1.5e1mm ", dimension::length, 15e-3);
    expect_value("\u22122 mm", dimension::length, -2e-3);
    expect_value("5 min", dimension::time, 300);
    expect_value("5 ms", dimension::time, 5e-3);
    expect_value("3 hPa", dimension::pressure, 300);
}

TEST(UnitUnits, WhatIsWrongIsSaid) {
    expect_error("40", dimension::pressure, "missing unit: expected a pressure such as \"40 MPa\"");
    expect_error("40 mm", dimension::pressure, "wrong dimension: got a length such as \"25 um\", expected a pressure");
    expect_error("1 m/s^2", dimension::length, "wrong dimension: got a quantity in m s^-2");
    expect_error("0.5", dimension::angle, "missing unit");
    expect_error("5 %", dimension::angle, "wrong dimension: got a pure number");
    expect_error("40 furlong", dimension::length, "unknown unit 'furlong'");
    expect_error("40 mpa", dimension::pressure, "unknown unit 'mpa'");
    expect_error("40 kdeg", dimension::angle, "unknown unit 'kdeg'");
    expect_error("forty MPa", dimension::pressure, "not a number");
    expect_error("", dimension::pressure, "not a number");
    expect_error("MPa", dimension::pressure, "not a number");
    expect_error("nan m", dimension::length, "not a number");
    expect_error("inf m", dimension::length, "infinite");
    expect_error("1e999 m", dimension::length, "infinite");
    expect_error("1e308 km", dimension::length, "infinite");
    expect_error("1,5 mm", dimension::length, "decimal point");
    expect_error("1 m2", dimension::length, "write powers with ^");
    expect_error("1 m^", dimension::length, "power must be a number");
    expect_error("1 m^99", dimension::length, "power must lie between");
    expect_error("1 J/m^2 s", dimension::length, "ambiguous");
    expect_error("1 N/(m", dimension::length, "not closed");
    expect_error("1 N/", dimension::length, "incomplete");
    expect_error("1 m]", dimension::length, "cannot read the unit from ']'");
    expect_error(("1 " + std::string(10'000, '(')).c_str(), dimension::length, "too many brackets");
}

TEST(UnitUnits, FactorOfAUnit) {
    EXPECT_NEAR(parse_unit("J/cm^2", place).factor, 1e4, 1e-10);
    EXPECT_EQ(parse_unit("MPa", place).dimension, dimension::pressure);
    const Quantity quantity = parse_quantity("80 J/m^2", place);
    EXPECT_EQ(quantity.unit, "J/m^2");
    EXPECT_EQ(quantity.factor, 1);
    EXPECT_EQ(quantity.value, 80);
}

TEST(UnitUnits, HeadOfAColumn) {
    const ColumnHeader header = parse_header(" crack_length [mm]", place);
    EXPECT_EQ(header.name, "crack_length");
    EXPECT_EQ(header.unit.factor, 1e-3);
    EXPECT_EQ(header.unit.dimension, dimension::length);
    for (const auto& [text, phrase] : {std::pair{"force", "missing unit"},
                                       {"force []", "missing unit"},
                                       {"[N]", "missing name"},
                                       {"force [N", "square brackets"},
                                       {"force [M]", "unknown unit 'M'"}}) {
        try {
            parse_header(text, place);
            FAIL() << text;
        } catch (const InputError& error) {
            EXPECT_NE(error.rule.find(phrase), std::string::npos) << error.rule;
        }
    }
}

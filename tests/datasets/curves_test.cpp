#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <cmath>

using namespace crampfit;

TEST(UnitCurves, AnyColumnsInAnyUnits) {
    const TemporaryFolder folder;
    const Curves curves = read_curves(folder.write("curves.csv", "\xEF\xBB\xBF# wedge test, spruce\r\n"
                                                                 "\"crack_length [cm]\", force [kN] ,time [min]\r\n"
                                                                 "1, +0.002, 1\r\n"
                                                                 "\r\n"
                                                                 "# a gap in the force\r\n"
                                                                 "1.5,,2\r\n"));
    ASSERT_EQ(curves.force.size(), 2U);
    EXPECT_DOUBLE_EQ(curves.force[0], 2);
    EXPECT_TRUE(std::isnan(curves.force[1]));
    EXPECT_DOUBLE_EQ(curves.crack_length[1], 0.015);
    EXPECT_DOUBLE_EQ(curves.time[1], 120);
    EXPECT_TRUE(curves.displacement.empty());
}

TEST(UnitCurves, WrittenAndReadAgain) {
    const TemporaryFolder folder;
    Curves curves;
    curves.displacement = {0, 0.1e-3, 1.0 / 3e3};
    curves.force = {-1, NAN, 123456.7891};
    write_curves(curves, folder / "curves.csv");
    EXPECT_EQ(folder.read("curves.csv"), "displacement [mm],force [N]\n0,-1\n0.1,\n0.333333333,123456.789\n");
    const Curves again = read_curves(folder / "curves.csv");
    EXPECT_NEAR(again.displacement[2], curves.displacement[2], 1e-12) << "9 digits of 0.33 mm";
    EXPECT_TRUE(std::isnan(again.force[1]));
    EXPECT_TRUE(again.time.empty());

    curves.force.pop_back();
    EXPECT_THROW(write_curves(curves, folder / "curves.csv"), InputError);
}

TEST(UnitCurves, WhatIsWrongIsSaid) {
    const TemporaryFolder folder;
    struct Bad {
        std::string text, key, phrase;
    };
    for (const Bad& bad : {
             Bad{"force\n1\n", "column 1, line 1", "missing unit"},
             {"# note\ntime [s],forces [N]\n1,1\n", "column 2, line 2", "did you mean \"force\"?"},
             {"force [mm]\n1\n", "column 1, line 1", "wrong dimension: got a length"},
             {"force [M]\n1\n", "column 1, line 1", "unknown unit 'M'"},
             {"force [N],force [kN]\n1,1\n", "column 2, line 1", "there twice"},
             {"force [N]\n1\none\n", "force, line 3", "finite number"},
             {"force [N]\n1 N\n", "force, line 2", "finite number"},
             {"force [N]\ninf\n", "force, line 2", "finite number"},
             {"force [N]\nnan\n", "force, line 2", "leave the field empty"},
             {"force [kN]\n1e307\n", "force, line 2", "no test reads more than 1e+09 N"},
             {"displacement [mm],force [N]\n0,1\n1,9.9e37\n", "force, line 3", "leave the field empty"},
             {"temperature [K]\n1\n", "column 1, line 1", "unknown column"},
             {std::string("\x89PNG\0\r", 6), "", "no text"},
             {"force [N]\n1e999\n", "force, line 2", "finite number"},
             {"force [N],time [s]\n1,2,3\n", "row, line 2", "has 3 fields, but the head has 2 columns"},
             {"force [N],time [s]\n1\n", "row, line 2", "has 1 fields"},
             {"time [s];force [N]\n1,5;2\n", "head, line 1", "separated by commas, not semicolons"},
             {"time [s]\tforce [N]\n1\t2\n", "head, line 1", "separated by commas, not tabs"},
             {std::string("\xFF\xFE", 2) + "f", "", "UTF-16"},
             {"force [N]\n", "", "has no data"},
             {"", "", "has no data"},
         }) {
        const auto file = folder.write("bad.csv", bad.text);
        try {
            read_curves(file);
            FAIL() << bad.text;
        } catch (const InputError& error) {
            EXPECT_EQ(error.file, file.string());
            EXPECT_EQ(error.key, bad.key) << error.what();
            EXPECT_NE(error.rule.find(bad.phrase), std::string::npos) << error.what();
        }
    }
    EXPECT_EQ(read_curves(folder.write("wide.csv", "time [s],\tforce [N]\n1,\t2\n")).force, std::vector<double>{2.0});
    EXPECT_THROW(read_curves(folder / "none.csv"), InputError);
    EXPECT_THROW(read_curves(folder / ""), InputError);
}

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>
#include <sstream>

using namespace crampfit;

namespace {

std::string table(const std::filesystem::path& file, const std::string& name) {
    std::ostringstream out;
    print_table(file, name, out);
    return out.str();
}

std::string refusal(const std::filesystem::path& file, const std::string& name) {
    try {
        table(file, name);
    } catch (const InputError& error) {
        EXPECT_EQ(error.key, "table");
        EXPECT_EQ(error.value, name);
        return error.rule;
    }
    return "no InputError was thrown";
}

Record small_record() {
    Record record;
    record.series.resize(2);
    record.series[1] = {.time = 1e-6,
                        .displacement = 0.1,
                        .force = -2.5,
                        .crack_length = 1.0 / 3.0,
                        .tip = {4, 5},
                        .G = 100,
                        .K_I = 1e5,
                        .K_II = -0.0,
                        .strain_energy = std::numeric_limits<double>::quiet_NaN(),
                        .kinetic_energy = std::numeric_limits<double>::infinity(),
                        .fracture_energy = 1e300,
                        .external_work = 12345678.9};
    record.paths = {{{0.01, 0.005}, {0.0075, 0.005}}, {{0, 0}, {1, 1}}};
    record.cracks = {{{0, 0.25}, {{0, 0}, {1, 2}}, {0, 3}, {0, 4}, {0, 5}}};
    record.reactions = {{"top", {{0, 0}, {1, 2}}}, {"left, wheel", {{0, 0}, {-3, 4}}}};
    record.driving = {{.crack_length = 0.25, .tip = {0.5, 0}, .displacement = 1e-6, .force = -2.5, .G = 90, .toughness = 100},
                      {.crack_length = 1.0 / 3.0,
                       .tip = {0.75, -1},
                       .displacement = std::numeric_limits<double>::infinity(),
                       .force = 0,
                       .G = 0,
                       .toughness = 125}};
    return record;
}

Fit small_fit() {
    Fit fit;
    fit.parameters = {{"EW toughness", "materials.EW.toughness", 103.25, "J/m^2", 2.5, 98.35, 108.15, 80, false},
                      {"the \"hard\", late one", "materials.LW.toughness", 400, "J/m^2", 1, 2, 3, 4, true}};
    fit.correlation = Eigen::MatrixXd{{1, -0.5}, {-0.5, 1}};
    fit.runs = {{{80, 120}, std::numeric_limits<double>::infinity(), "unstable", 0.5}};
    fit.residuals = {{"wedge 1", "force", 1e-4, 12, 12.5, 0.2, 2.5}};
    return fit;
}

}  // namespace

// INTERFACE.md, "Scene": the header to the letter. The numbers: the shortest text that reads back as the same bits.
TEST(UnitTables, Series) {
    const TemporaryFolder folder;
    write(small_record(), folder / "record.h5");
    EXPECT_EQ(table(folder / "record.h5", "series"),
              "time_s,displacement_m,force_N,crack_length_m,tip_x_m,tip_y_m,G_J_m2,K_I_Pa_sqrt_m,K_II_Pa_sqrt_m,"
              "strain_energy_J,kinetic_energy_J,fracture_energy_J,external_work_J\n"
              "0,0,0,0,0,0,0,0,0,0,0,0,0\n"
              "1e-06,0.1,-2.5,0.3333333333333333,4,5,100,100000,-0,nan,inf,1e+300,12345678.9\n");
}

TEST(UnitTables, PathIsThatOfTheTrackedCrack) {
    const TemporaryFolder folder;
    Record record = small_record();
    write(record, folder / "record.h5");
    const std::string first = "x_m,y_m\n0.01,0.005\n0.0075,0.005\n";
    const std::string second = "x_m,y_m\n0,0\n1,1\n";
    EXPECT_EQ(table(folder / "record.h5", "path"), first);
    EXPECT_EQ(table(folder / "record.h5", "path1"), second);
    record.tracked_crack = 1;
    write(record, folder / "record.h5");
    EXPECT_EQ(table(folder / "record.h5", "path"), second);
    EXPECT_EQ(table(folder / "record.h5", "path1"), first);
}

TEST(UnitTables, FurtherCracks) {
    const TemporaryFolder folder;
    write(small_record(), folder / "record.h5");
    EXPECT_EQ(table(folder / "record.h5", "crack1"),
              "time_s,displacement_m,crack_length_m,tip_x_m,tip_y_m,G_J_m2,K_I_Pa_sqrt_m,K_II_Pa_sqrt_m\n"
              "0,0,0,0,0,0,0,0\n"
              "1e-06,0.1,0.25,1,2,3,4,5\n");
}

// A name with a comma is quoted (RFC 4180, section 2, rule 6).
TEST(UnitTables, Reactions) {
    const TemporaryFolder folder;
    write(small_record(), folder / "record.h5");
    EXPECT_EQ(table(folder / "record.h5", "reactions"), "time_s,top_x_N,top_y_N,\"left, wheel_x_N\",\"left, wheel_y_N\"\n"
                                                        "0,0,0,0,0\n"
                                                        "1e-06,1,2,-3,4\n");
}

// The load at which the crack moves on from each place, also from those that it jumps over.
TEST(UnitTables, Driving) {
    const TemporaryFolder folder;
    write(small_record(), folder / "record.h5");
    EXPECT_EQ(table(folder / "record.h5", "driving"),
              "tip_x_m,tip_y_m,crack_length_m,displacement_m,force_N,G_J_m2,toughness_J_m2\n"
              "0.5,0,0.25,1e-06,-2.5,90,100\n"
              "0.75,-1,0.3333333333333333,inf,0,0,125\n");
    write(Record{}, folder / "explicit.h5");
    EXPECT_EQ(table(folder / "explicit.h5", "driving"),
              "tip_x_m,tip_y_m,crack_length_m,displacement_m,force_N,G_J_m2,toughness_J_m2\n");
}

// A quote in a field is doubled (RFC 4180, section 2, rule 7).
TEST(UnitTables, Parameters) {
    const TemporaryFolder folder;
    write(small_fit(), folder / "fit.h5");
    EXPECT_EQ(table(folder / "fit.h5", "parameters"),
              "name,key,value,unit,standard_error,lower_95,upper_95,initial,at_bound\n"
              "EW toughness,materials.EW.toughness,103.25,J/m^2,2.5,98.35,108.15,80,false\n"
              "\"the \"\"hard\"\", late one\",materials.LW.toughness,400,J/m^2,1,2,3,4,true\n");
}

TEST(UnitTables, RunsResidualsCorrelation) {
    const TemporaryFolder folder;
    write(small_fit(), folder / "fit.h5");
    EXPECT_EQ(table(folder / "fit.h5", "runs"), "EW toughness,\"the \"\"hard\"\", late one\",misfit,status,seconds\n"
                                                "80,120,inf,unstable,0.5\n");
    EXPECT_EQ(table(folder / "fit.h5", "residuals"), "experiment,kind,at,measured,modelled,sigma,residual\n"
                                                     "wedge 1,force,0.0001,12,12.5,0.2,2.5\n");
    EXPECT_EQ(table(folder / "fit.h5", "correlation"), "parameter,EW toughness,\"the \"\"hard\"\", late one\"\n"
                                                       "EW toughness,1,-0.5\n"
                                                       "\"the \"\"hard\"\", late one\",-0.5,1\n");
}

TEST(UnitTables, SensitivityTables) {
    const TemporaryFolder folder;
    Sensitivity sensitivity;
    sensitivity.parameters = {{"EW toughness", "materials.EW.toughness", "J/m^2", 100, 20, 400}};
    sensitivity.outputs = {{"peak force", "N"}};
    sensitivity.indices = {{"peak force", "EW toughness", "sobol", 0.25, -0.5, 1.5, "first"}};
    sensitivity.runs = {{{80}, {1.5}, "finished", 0.5}};
    write(sensitivity, folder / "out.h5");
    EXPECT_EQ(table(folder / "out.h5", "indices"), "output,parameter,method,value,lower_95,upper_95,kind\n"
                                                   "peak force,EW toughness,sobol,0.25,-0.5,1.5,first\n");
    EXPECT_EQ(table(folder / "out.h5", "runs"), "EW toughness,peak force,status,seconds\n80,1.5,finished,0.5\n");
}

TEST(UnitTables, UnknownTableListsThoseThatThereAre) {
    const TemporaryFolder folder;
    write(small_record(), folder / "record.h5");
    EXPECT_EQ(refusal(folder / "record.h5", "serie"), "must be one of: series, path, crack1, path1, driving, reactions");
    write(small_fit(), folder / "fit.h5");
    EXPECT_EQ(refusal(folder / "fit.h5", "series"), "must be one of: parameters, runs, residuals, correlation, checks, "
                                                    "distances, models, paths, path_distances, profile, posterior");
    Specimen specimen;
    specimen.pixel = 1e-5;
    write(specimen, folder / "specimen.h5");
    EXPECT_EQ(refusal(folder / "specimen.h5", "series"), "must be one of: borders, rings, orientation");
}

TEST(UnitTables, TablesOfASpecimen) {
    const TemporaryFolder folder;
    Specimen specimen;
    specimen.columns = 2;
    specimen.rows = 1;
    specimen.pixel = 1e-3;
    specimen.classes = {"EW"};
    specimen.label = {0, 0};
    specimen.orientation = {0.0f, std::numbers::pi_v<float> / 2};
    specimen.coherency = {1.0f, 0.5f};
    specimen.borders = {{3, {{0, 0.5}, {1, 0.25}}}};
    specimen.rings = {{3, 2.5, 0.125}};
    write(specimen, folder / "specimen.h5");
    EXPECT_EQ(table(folder / "specimen.h5", "borders"), "ring,x_px,y_px\n3,0.00,0.50\n3,1.00,0.25\n");
    EXPECT_EQ(table(folder / "specimen.h5", "rings"), "ring,width_mm,latewood_fraction\n3,2.5,0.125\n");
    EXPECT_EQ(table(folder / "specimen.h5", "orientation"),
              "x_px,y_px,radial_deg,coherency\n0,0,0.000,1.0000\n1,0,90.000,0.5000\n");
    specimen.pixel = 0;
    write(specimen, folder / "specimen.h5");
    EXPECT_EQ(table(folder / "specimen.h5", "rings"), "ring,width_mm,latewood_fraction\n3,nan,0.125\n");
}

#include "datasets/error.hpp"
#include "datasets/hdf5.hpp"
#include "datasets/io.hpp"
#include "datasets/record_file.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <cstring>
#include <limits>
#include <random>
#include <regex>
#include <sys/resource.h>

using namespace crampfit;

// A round trip through a file must give back every bit: there is no tolerance in this file.

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

/// Numbers that are easily spoilt: signed zero, the smallest and largest, infinities, not a number, and ones with all digits.
std::vector<double> awkward_numbers() {
    return {0.0, -0.0, 1.0 / 3.0, std::numeric_limits<double>::denorm_min(), std::numeric_limits<double>::max(),
            -infinite, infinite, not_a_number, 0.1};
}

template <class Value> bool same_bits(const std::vector<Value>& a, const std::vector<Value>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(Value)) == 0);
}
bool same_bits(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    return a.rows() == b.rows() && a.cols() == b.cols() &&
           same_bits(std::vector<double>(a.data(), a.data() + a.size()), std::vector<double>(b.data(), b.data() + b.size()));
}
bool same_bits(double a, double b) { return same_bits(std::vector<double>{a}, std::vector<double>{b}); }

std::vector<Vec2> some_points(std::size_t count) {
    std::mt19937_64 random(count);
    std::normal_distribution<double> normal;
    std::vector<Vec2> points(count);
    for (Vec2& point : points)
        point = {normal(random), normal(random)};
    return points;
}

/// Two cracks, of which the second one is tracked, two reactions with names that no HDF5 path could hold, two frames.
Record full_record() {
    Record record;
    record.status = RunStatus::split;
    record.message = "the crack left the specimen";
    record.tracked_crack = 1;
    record.paths = {some_points(2), some_points(17)};
    CrackHistory crack;
    for (const double number : awkward_numbers()) {
        Instant instant;
        for (const SeriesColumn& column : series_columns)
            column.value(instant) = number;
        instant.time = 1e-6 * static_cast<double>(record.series.size());
        record.series.push_back(instant);
        crack.length.push_back(number);
        crack.tip.push_back({number, -number});
        crack.G.push_back(number);
        crack.K_I.push_back(number);
        crack.K_II.push_back(number);
    }
    record.cracks = {crack};
    record.reactions = {{"left/right wheel", some_points(record.series.size())}, {"Auflager ä", crack.tip}};
    record.point_position = some_points(5000);
    record.point_latewood.assign(5000, 0.25f);
    for (int i = 0; i < 2; ++i) {
        Frame frame{.time = 0.1 * i, .displacement = not_a_number, .moved = {}, .stress = {}, .crack = some_points(3)};
        for (const Vec2& point : record.point_position) {
            frame.moved.push_back(point.cast<float>() * static_cast<float>(i));
            frame.stress.push_back({static_cast<float>(point.x()), std::numeric_limits<float>::infinity(), -0.0f, 1e-40f});
        }
        record.frames.push_back(frame);
    }
    record.scene_text = "title = \"TR+ über μm 年輪\"\n[model]\n";
    record.explanation = "explicit dynamics";
    record.steps = 123456789012;
    record.points = 5000;
    record.seconds = 1.5;
    record.worst_energy_imbalance = not_a_number;
    return record;
}

Fit full_fit() {
    Fit fit;
    fit.status = FitStatus::run_limit;
    fit.message = "max_runs was used up";
    fit.method = "ceres: few parameters";
    fit.parameters = {{"EW, toughness", "materials.EW.toughness materials.ray.toughness", 103.25, "J/m^2", 1.0 / 3.0, -infinite,
                       infinite, 80.0, false},
                      {"LW \"hard\"", "materials.LW.toughness", not_a_number, "", 0.0, -0.0, 5e-324, 1.0, true}};
    fit.covariance = Eigen::MatrixXd{{1.0, 0.1}, {0.3, infinite}};
    fit.correlation = Eigen::MatrixXd{{1.0, -0.5}, {-0.25, 1.0}};
    fit.misfit = 12.75;
    fit.reduced_chi_square = 0.9;
    fit.residuals = {{"wedge 1", "force", 1e-4, 12.0, 12.5, 0.2, 2.5}, {"wedge 1", "arrival", 2e-3, not_a_number, 0, 1e-4, 0}};
    fit.runs = {{{80.0, 120.0}, infinite, "unstable", 0.5}, {{103.25, not_a_number}, 12.75, "finished", 0.625}};
    fit.seconds = 3.25;
    fit.seed = 4000000000u;
    fit.study_text = "title = 'ü'";
    return fit;
}

Specimen full_specimen() {
    Specimen specimen;
    specimen.columns = 7;
    specimen.rows = 3;
    specimen.pixel = 25e-6;
    specimen.classes = {"EW", "Spätholz"};
    specimen.label.assign(21, 0);
    specimen.label[4] = 1;
    specimen.label[20] = Specimen::void_label;
    specimen.grade.assign(21, 0.0f);
    specimen.grade[1] = 1.0f / 3.0f;
    specimen.density.assign(21, 312.5f);
    specimen.density[3] = std::numeric_limits<float>::quiet_NaN();
    specimen.source = "block.png";
    return specimen;
}

/// The InputError that `action` must throw.
template <class Action> InputError error_of(const Action& action) {
    try {
        action();
    } catch (const InputError& error) {
        return error;
    }
    throw std::runtime_error("no InputError was thrown");
}

std::string message_of(const std::function<void()>& action) { return error_of(action).what(); }

/// A specimen file of which `spoil` writes one dataset differently.
void save_specimen_with(const std::filesystem::path& file, const std::function<void(hdf5::Group&)>& labels) {
    hdf5::save(file, "specimen", [&](hdf5::Group& root) {
        root.write_text("source", "", "");
        root.write("pixel", 1e-5, {"m", ""});
        root.write_texts("classes", {"EW", "LW"}, "");
        labels(root);
    });
}

} // namespace

TEST(UnitHdf5, RecordComesBackBitForBit) {
    const TemporaryFolder folder;
    const Record before = full_record();
    write(before, folder / "record.h5");
    const Record after = read_record(folder / "record.h5");

    EXPECT_EQ(after.status, before.status);
    EXPECT_EQ(after.message, before.message);
    EXPECT_TRUE(same_bits(after.series, before.series));
    EXPECT_EQ(after.tracked_crack, 1);
    ASSERT_EQ(after.paths.size(), 2u);
    EXPECT_TRUE(same_bits(after.paths[0], before.paths[0]));
    EXPECT_TRUE(same_bits(after.paths[1], before.paths[1]));
    ASSERT_EQ(after.cracks.size(), 1u);
    EXPECT_TRUE(same_bits(after.cracks[0].length, before.cracks[0].length));
    EXPECT_TRUE(same_bits(after.cracks[0].tip, before.cracks[0].tip));
    EXPECT_TRUE(same_bits(after.cracks[0].G, before.cracks[0].G));
    EXPECT_TRUE(same_bits(after.cracks[0].K_I, before.cracks[0].K_I));
    EXPECT_TRUE(same_bits(after.cracks[0].K_II, before.cracks[0].K_II));
    ASSERT_EQ(after.reactions.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(after.reactions[i].name, before.reactions[i].name);
        EXPECT_TRUE(same_bits(after.reactions[i].force, before.reactions[i].force));
    }
    EXPECT_TRUE(same_bits(after.point_position, before.point_position));
    EXPECT_TRUE(same_bits(after.point_latewood, before.point_latewood));
    ASSERT_EQ(after.frames.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_TRUE(same_bits(after.frames[i].time, before.frames[i].time));
        EXPECT_TRUE(same_bits(after.frames[i].displacement, before.frames[i].displacement));
        EXPECT_TRUE(same_bits(after.frames[i].moved, before.frames[i].moved));
        EXPECT_TRUE(same_bits(after.frames[i].stress, before.frames[i].stress));
        EXPECT_TRUE(same_bits(after.frames[i].crack, before.frames[i].crack));
    }
    EXPECT_EQ(after.scene_text, before.scene_text);
    EXPECT_EQ(after.explanation, before.explanation);
    EXPECT_EQ(after.steps, before.steps);
    EXPECT_EQ(after.points, before.points);
    EXPECT_TRUE(same_bits(after.seconds, before.seconds));
    EXPECT_TRUE(same_bits(after.worst_energy_imbalance, before.worst_energy_imbalance));
}

TEST(UnitHdf5, FitComesBackBitForBit) {
    const TemporaryFolder folder;
    const Fit before = full_fit();
    write(before, folder / "fit.h5");
    const Fit after = read_fit(folder / "fit.h5");

    EXPECT_EQ(after.status, before.status);
    EXPECT_EQ(after.message, before.message);
    EXPECT_EQ(after.method, before.method);
    ASSERT_EQ(after.parameters.size(), before.parameters.size());
    for (std::size_t i = 0; i < 2; ++i) {
        const FittedParameter& a = after.parameters[i];
        const FittedParameter& b = before.parameters[i];
        EXPECT_EQ(a.name, b.name);
        EXPECT_EQ(a.key, b.key);
        EXPECT_EQ(a.unit, b.unit);
        EXPECT_EQ(a.at_bound, b.at_bound);
        EXPECT_TRUE(same_bits(std::vector{a.value, a.standard_error, a.lower_95, a.upper_95, a.initial},
                              std::vector{b.value, b.standard_error, b.lower_95, b.upper_95, b.initial}));
    }
    EXPECT_TRUE(same_bits(after.covariance, before.covariance));
    EXPECT_TRUE(same_bits(after.correlation, before.correlation));
    ASSERT_EQ(after.residuals.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        const FitResidual& a = after.residuals[i];
        const FitResidual& b = before.residuals[i];
        EXPECT_EQ(a.experiment, b.experiment);
        EXPECT_EQ(a.kind, b.kind);
        EXPECT_TRUE(same_bits(std::vector{a.at, a.measured, a.modelled, a.sigma, a.residual},
                              std::vector{b.at, b.measured, b.modelled, b.sigma, b.residual}));
    }
    ASSERT_EQ(after.runs.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_TRUE(same_bits(after.runs[i].parameters, before.runs[i].parameters));
        EXPECT_TRUE(same_bits(after.runs[i].misfit, before.runs[i].misfit));
        EXPECT_EQ(after.runs[i].status, before.runs[i].status);
        EXPECT_TRUE(same_bits(after.runs[i].seconds, before.runs[i].seconds));
    }
    EXPECT_TRUE(same_bits(std::vector{after.misfit, after.reduced_chi_square, after.seconds},
                          std::vector{before.misfit, before.reduced_chi_square, before.seconds}));
    EXPECT_EQ(after.seed, before.seed);
    EXPECT_EQ(after.study_text, before.study_text);
}

TEST(UnitHdf5, SpecimenComesBackBitForBit) {
    const TemporaryFolder folder;
    const Specimen before = full_specimen();
    write(before, folder / "specimen.h5");
    const Specimen after = read_specimen(folder / "specimen.h5");

    EXPECT_EQ(after.columns, 7);
    EXPECT_EQ(after.rows, 3);
    EXPECT_TRUE(same_bits(after.pixel, before.pixel));
    EXPECT_EQ(after.classes, before.classes);
    EXPECT_EQ(after.label, before.label);
    EXPECT_TRUE(same_bits(after.grade, before.grade));
    EXPECT_TRUE(same_bits(after.density, before.density));
    EXPECT_TRUE(after.orientation.empty());
    EXPECT_EQ(after.source, before.source);
}

TEST(UnitHdf5, WhatIsEmptyComesBackEmpty) {
    const TemporaryFolder folder;
    write(Record{}, folder / "record.h5");
    const Record record = read_record(folder / "record.h5");
    EXPECT_TRUE(record.series.empty() && record.paths.empty() && record.cracks.empty() && record.reactions.empty() &&
                record.point_position.empty() && record.frames.empty() && record.scene_text.empty());

    write(Fit{}, folder / "fit.h5");
    const Fit fit = read_fit(folder / "fit.h5");
    EXPECT_TRUE(fit.parameters.empty() && fit.runs.empty() && fit.residuals.empty() && fit.covariance.size() == 0);

    Fit unrun = full_fit();
    unrun.runs.clear();
    unrun.covariance.resize(0, 0);
    write(unrun, folder / "fit.h5");
    EXPECT_TRUE(read_fit(folder / "fit.h5").runs.empty());
    EXPECT_EQ(read_fit(folder / "fit.h5").covariance.size(), 0);
}

TEST(UnitHdf5, FileSaysWhatItIs) {
    const TemporaryFolder folder;
    write(full_record(), folder / "record.h5");
    const hdf5::Group root = hdf5::open(folder / "record.h5");
    EXPECT_EQ(root.attribute("program"), "crampfit");
    EXPECT_EQ(root.attribute("version"), CRAMPFIT_VERSION);
    EXPECT_EQ(root.attribute("kind"), "record");
    const std::regex iso8601("20\\d\\d-\\d\\d-\\d\\dT\\d\\d:\\d\\d:\\d\\dZ");
    EXPECT_TRUE(std::regex_match(root.attribute("created"), iso8601)) << root.attribute("created");
    EXPECT_EQ(root.attribute_of("series/force", "units"), "N");
    EXPECT_EQ(root.attribute_of("frames/0001/stress", "units"), "Pa");
    EXPECT_EQ(root.attribute_of("series/K_I", "units"), "Pa sqrt(m)");
    EXPECT_FALSE(root.attribute_of("series/K_I", "description").empty());
}

TEST(UnitHdf5, LargeMapsAreCompressed) {
    const TemporaryFolder folder;
    Specimen specimen = full_specimen();
    specimen.columns = specimen.rows = 2000;
    specimen.label.assign(4000000, 1);
    specimen.grade.clear();
    specimen.density.clear();
    write(specimen, folder / "specimen.h5");
    // Four million equal bytes; deflate reaches a thousandth.
    EXPECT_LT(std::filesystem::file_size(folder / "specimen.h5"), 100000u);
    EXPECT_EQ(read_specimen(folder / "specimen.h5").label, specimen.label);
}

TEST(UnitHdf5, WritingReplacesTheOldFileAndLeavesNothingElse) {
    const TemporaryFolder folder;
    folder.write("record.h5", "old");
    write(full_record(), folder / "record.h5");
    EXPECT_EQ(read_record(folder / "record.h5").steps, 123456789012);
    EXPECT_EQ(folder.size(), 1);
}

TEST(UnitHdf5, FailureWhileWritingChangesNothing) {
    const TemporaryFolder folder;
    folder.write("record.h5", "old");
    const auto fail = [](hdf5::Group& root) {
        root.write_text("message", "half", "");
        throw std::runtime_error("the power went");
    };
    EXPECT_THROW(hdf5::save(folder / "record.h5", "record", fail), std::runtime_error);
    EXPECT_EQ(folder.read("record.h5"), "old");
    EXPECT_EQ(folder.size(), 1);
}

TEST(UnitHdf5, FullDiskIsAnErrorAndChangesNothing) {
    const TemporaryFolder folder;
    folder.write("record.h5", "old");
    // A limit on the size of a file stands for the full disk: both end a write in the middle.
    rlimit before;
    getrlimit(RLIMIT_FSIZE, &before);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{20000, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    const std::string message = message_of([&] { write(full_record(), folder / "record.h5"); });
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    EXPECT_NE(message.find("record.h5: cannot be written: File too large"), std::string::npos) << message;
    EXPECT_EQ(folder.read("record.h5"), "old");
    EXPECT_EQ(folder.size(), 1);
}

TEST(UnitHdf5, FolderMustExistAndLetUsWrite) {
    const TemporaryFolder folder;
    EXPECT_NE(message_of([&] { write(Record{}, folder / "none/record.h5"); }).find("does not exist"), std::string::npos);
    // Nobody, not even the superuser, makes files in /proc.
    EXPECT_NE(message_of([] { write(Record{}, "/proc/record.h5"); }).find("cannot be written"), std::string::npos);
}

TEST(UnitHdf5, OnlyPlainFilesAreReplaced) {
    const TemporaryFolder folder;
    EXPECT_NE(message_of([] { write(Record{}, "/dev/null"); }).find("plain file"), std::string::npos);
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
    std::filesystem::create_directory(folder / "record.h5");
    EXPECT_NE(message_of([&] { write(Record{}, folder / "record.h5"); }).find("plain file"), std::string::npos);
}

TEST(UnitHdf5, SymbolicLinkStaysAndItsTargetIsReplaced) {
    const TemporaryFolder folder;
    folder.write("target.h5", "old");
    std::filesystem::create_symlink("target.h5", folder / "link.h5");
    write(full_record(), folder / "link.h5");
    EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.h5"));
    EXPECT_EQ(read_record(folder / "target.h5").points, 5000);
}

TEST(UnitHdf5, MissingFileIsNamed) {
    const TemporaryFolder folder;
    const InputError error = error_of([&] { read_record(folder / "none.h5"); });
    EXPECT_EQ(error.file, (folder / "none.h5").string());
    EXPECT_EQ(error.rule, "the file does not exist");
}

TEST(UnitHdf5, NotAnHdf5File) {
    const TemporaryFolder folder;
    folder.write("record.h5", "time_s,force_N\n0,1\n");
    EXPECT_EQ(error_of([&] { read_record(folder / "record.h5"); }).rule, "cannot be read as an HDF5 file");
    folder.write("record.h5", "");
    EXPECT_EQ(error_of([&] { read_record(folder / "record.h5"); }).rule, "cannot be read as an HDF5 file");
}

TEST(UnitHdf5, TruncatedFileIsAnError) {
    const TemporaryFolder folder;
    write(full_record(), folder / "record.h5");
    std::filesystem::resize_file(folder / "record.h5", std::filesystem::file_size(folder / "record.h5") / 2);
    EXPECT_THROW(read_record(folder / "record.h5"), InputError);
}

TEST(UnitHdf5, WrongKindOfFileIsNamed) {
    const TemporaryFolder folder;
    write(full_fit(), folder / "fit.h5");
    const InputError error = error_of([&] { read_specimen(folder / "fit.h5"); });
    EXPECT_EQ(error.key, "kind");
    EXPECT_EQ(error.value, "fit");
    EXPECT_EQ(error.rule, "a specimen file is needed here");
}

TEST(UnitHdf5, MissingDatasetIsNamed) {
    const TemporaryFolder folder;
    save_specimen_with(folder / "specimen.h5", [](hdf5::Group&) {});
    const InputError error = error_of([&] { read_specimen(folder / "specimen.h5"); });
    EXPECT_EQ(error.key, "label");
    EXPECT_EQ(error.value, "missing");
}

TEST(UnitHdf5, WrongShapeIsNamed) {
    const TemporaryFolder folder;
    save_specimen_with(folder / "specimen.h5", [](hdf5::Group& root) {
        root.write("label", std::vector<std::uint8_t>(6), {2, 3}, {"1", ""});
        root.write("density", std::vector<float>(6), {3, 2}, {"kg/m^3", ""});
    });
    const InputError error = error_of([&] { read_specimen(folder / "specimen.h5"); });
    EXPECT_EQ(error.key, "density");
    EXPECT_EQ(error.value, "[3 x 2]");
    EXPECT_EQ(error.rule, "the shape must be [2 x 3]");
}

TEST(UnitHdf5, WrongTypeIsNamed) {
    const TemporaryFolder folder;
    save_specimen_with(folder / "specimen.h5", [](hdf5::Group& root) {
        root.write("label", std::vector<double>(6), {2, 3}, {"1", ""});
    });
    const InputError error = error_of([&] { read_specimen(folder / "specimen.h5"); });
    EXPECT_EQ(error.key, "label");
    EXPECT_EQ(error.rule, "must hold integers of at most 1 bytes");
}

TEST(UnitHdf5, LabelWithoutClassIsNamed) {
    const TemporaryFolder folder;
    Specimen specimen = full_specimen();
    specimen.label[2] = 2;
    write(specimen, folder / "specimen.h5");
    EXPECT_EQ(error_of([&] { read_specimen(folder / "specimen.h5"); }).key, "label");

    specimen = full_specimen();
    specimen.grade[4] = 0.5f;  // of the last class: nothing to grade into
    write(specimen, folder / "specimen.h5");
    EXPECT_EQ(error_of([&] { read_specimen(folder / "specimen.h5"); }).key, "grade");
}

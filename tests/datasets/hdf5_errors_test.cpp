#include "datasets/error.hpp"
#include "datasets/hdf5.hpp"
#include "datasets/io.hpp"
#include "tests/datasets/full_results.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <functional>
#include <sys/resource.h>

using namespace crampfit;

namespace {

/// The InputError that `action` must throw.
template <class Action>
InputError error_of(const Action& action) {
    try {
        action();
    } catch (const InputError& error) {
        return error;
    }
    throw std::runtime_error("no InputError was thrown");
}

std::string message_of(const std::function<void()>& action) { return error_of(action).what(); }

/// A specimen file in which `labels` writes the maps.
void save_specimen_with(const std::filesystem::path& file, const std::function<void(hdf5::Group&)>& labels) {
    hdf5::save(file, "specimen", [&](hdf5::Group& root) {
        root.write_text("source", "", "");
        root.write("pixel", 1e-5, {"m", ""});
        root.write_texts("classes", {"EW", "LW"}, "");
        labels(root);
    });
}

}  // namespace

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
    std::filesystem::create_directory(folder / "inner");
    std::filesystem::create_symlink("inner/new.h5", folder / "dangling.h5");
    write(full_record(), folder / "dangling.h5");
    EXPECT_TRUE(std::filesystem::is_symlink(folder / "dangling.h5"));
    EXPECT_EQ(read_record(folder / "inner/new.h5").points, 5000);
    std::filesystem::create_symlink("ring.h5", folder / "ring.h5");
    EXPECT_NE(message_of([&] { write(full_record(), folder / "ring.h5"); }).find("leads to itself"), std::string::npos);
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

// Pictures to classes. References are worked out by hand from the rule that a test names.
#include "imaging/gray_picture.hpp"
#include "imaging/picture.hpp"
#include "tests/temporary_folder.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "datasets/text_file.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <numbers>

using namespace crampfit;

namespace {

const std::vector<GrayClass> two_classes{{"LW", 0, 127}, {"EW", 128, 255}};

Picture picture_of(const std::filesystem::path& file, std::vector<GrayClass> classes = two_classes) {
    Picture picture;
    picture.file = file;
    picture.pixel = 25e-6;
    picture.classes = std::move(classes);
    return picture;
}

Specimen write_and_read(const cv::Mat& pixels, const std::string& name, std::vector<GrayClass> classes = two_classes) {
    const TemporaryFolder folder;
    EXPECT_TRUE(cv::imwrite((folder / name).string(), pixels));
    return read_picture(picture_of(folder / name, std::move(classes)));
}

/// One class a gray: the label shows the gray that a pixel was read as.
std::vector<GrayClass> classes_around(int gray) {
    std::vector<GrayClass> classes{{"exact", gray, gray}};
    if (gray > 0) classes.push_back({"darker", 0, gray - 1});
    if (gray < 255) classes.push_back({"brighter", gray + 1, 255});
    return classes;
}

std::string class_of_one_pixel(const cv::Mat& pixels, const std::string& name, int gray) {
    const Specimen specimen = write_and_read(pixels, name, classes_around(gray));
    return specimen.classes.at(specimen.label.at(0));
}

/// A checkerboard-like pattern that has no symmetry.
cv::Mat pattern(int rows, int columns) {
    cv::Mat pixels(rows, columns, CV_8UC1);
    for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column)
            pixels.at<std::uint8_t>(row, column) = (row * 7 + column * column) % 5 < 2 ? 220 : 30;
    return pixels;
}

void expect_pattern(const Specimen& specimen, const cv::Mat& pixels) {
    ASSERT_EQ(specimen.rows, pixels.rows);
    ASSERT_EQ(specimen.columns, pixels.cols);
    for (int row = 0; row < pixels.rows; ++row)
        for (int column = 0; column < pixels.cols; ++column)
            EXPECT_EQ(specimen.label[row * pixels.cols + column], pixels.at<std::uint8_t>(row, column) == 220 ? 0 : 1);
}

/// A gray picture of one row.
cv::Mat gray_row(const std::vector<std::uint8_t>& grays) { return cv::Mat(grays, true).reshape(1, 1); }

}  // namespace

TEST(UnitPicture, ClassesRunFromBrightToDarkWithTheTopRowFirst) {
    const Specimen specimen = write_and_read(gray_row({0, 127, 128, 255, 200, 50}).reshape(1, 2), "a.png");
    EXPECT_EQ(specimen.columns, 3);
    EXPECT_EQ(specimen.rows, 2);
    EXPECT_EQ(specimen.pixel, 25e-6);
    EXPECT_EQ(specimen.classes, (std::vector<std::string>{"EW", "LW"}));
    EXPECT_EQ(specimen.label, (std::vector<std::uint8_t>{1, 1, 0, 0, 0, 1}));
    EXPECT_TRUE(specimen.grade.empty());
    EXPECT_TRUE(specimen.density.empty());
    EXPECT_TRUE(specimen.orientation.empty());
    EXPECT_NE(specimen.source.find("a.png"), std::string::npos);
}

TEST(UnitPicture, EveryLosslessFormatAndOddWidthGivesTheSameLabels) {
    // A BMP row is padded to four bytes, so that widths of 1 to 5 meet every padding.
    for (const char* name : {"a.bmp", "a.png", "a.tiff", "a.pgm"})
        for (int columns = 1; columns <= 5; ++columns) {
            SCOPED_TRACE(std::string(name) + " of width " + std::to_string(columns));
            const cv::Mat pixels = pattern(3, columns);
            expect_pattern(write_and_read(pixels, name), pixels);
        }
}

TEST(UnitPicture, ColourBmpOfOddWidth) {
    const cv::Mat gray = pattern(4, 7);
    cv::Mat colour;
    cv::merge(std::vector<cv::Mat>{gray, gray, gray}, colour);
    expect_pattern(write_and_read(colour, "a.bmp"), gray);
}

TEST(UnitPicture, ColourBecomesGrayWithTheWeightsOfBt601) {
    // 0.299 R + 0.587 G + 0.114 B, rounded: 0.299 * 200 + 0.587 * 100 + 0.114 * 50 = 124.2; pure colours 76.2,
    // 149.7, 29.1.
    EXPECT_EQ(class_of_one_pixel(cv::Mat(1, 1, CV_8UC3, cv::Scalar(50, 100, 200)), "a.png", 124), "exact");
    EXPECT_EQ(class_of_one_pixel(cv::Mat(1, 1, CV_8UC3, cv::Scalar(0, 0, 255)), "a.png", 76), "exact");
    EXPECT_EQ(class_of_one_pixel(cv::Mat(1, 1, CV_8UC3, cv::Scalar(0, 255, 0)), "a.bmp", 150), "exact");
    EXPECT_EQ(class_of_one_pixel(cv::Mat(1, 1, CV_8UC3, cv::Scalar(255, 0, 0)), "a.tiff", 29), "exact");
}

TEST(UnitPicture, TransparencyIsDropped) {
    for (const double alpha : {0.0, 128.0, 255.0})
        EXPECT_EQ(class_of_one_pixel(cv::Mat(1, 1, CV_8UC4, cv::Scalar(50, 100, 200, alpha)), "a.png", 124), "exact") << alpha;
}

TEST(UnitPicture, SixteenBitIsDividedBy257AndRounded) {
    // 128 * 257 = 32896; half a gray is 128.5.
    for (const auto& [value, gray] :
         {std::pair{0, 0}, {128, 0}, {129, 1}, {32896, 128}, {33024, 128}, {33025, 129}, {65535, 255}})
        for (const char* name : {"a.png", "a.tiff"})
            EXPECT_EQ(class_of_one_pixel(cv::Mat(1, 1, CV_16UC1, cv::Scalar(value)), name, gray), "exact") << value << name;
    EXPECT_EQ(class_of_one_pixel(cv::Mat(1, 1, CV_16UC3, cv::Scalar(50 * 257, 100 * 257, 200 * 257)), "a.png", 124), "exact");
    EXPECT_EQ(class_of_one_pixel(cv::Mat(1, 1, CV_16UC4, cv::Scalar(12850, 25700, 51400, 9)), "a.png", 124), "exact");
}

TEST(UnitPicture, WhiteOfAPgmIsWhatItsHeaderSays) {
    // As cameras of 12 bits write it: 124 / 255 of 4095 is 1991.3, of 65535 it is 31868.
    const TemporaryFolder folder;
    const auto gray_of = [&](const std::string& header, int value) {
        const std::string pixel{static_cast<char>(value / 256), static_cast<char>(value % 256)};
        return int{read_gray(folder.write("camera.pgm", header + pixel), {"test", "picture"}).gray.at(0)};
    };
    EXPECT_EQ(gray_of("P5\n# a camera's\n1 1\n4095\n", 1991), 124);
    EXPECT_EQ(gray_of("P5 1 1 65535\n", 31868), 124);
    // Of 8 bits: 49 of 100 are 124.95 of 255.
    for (const char* text : {"P5 1 1 100\n1", "P2 1 1 100\n49\n"})
        EXPECT_NEAR(int{read_gray(folder.write("camera.pgm", text), {"test", "picture"}).gray.at(0)}, 124.95, 1) << text;
}

// PhotometricInterpretation 0, tag 262 of a TIFF.
TEST(UnitPicture, ATiffThatCountsFromWhiteIsTurned) {
    const TemporaryFolder folder;
    const auto file = folder / "white.tiff";
    cv::imwrite(file.string(), cv::Mat(1, 2, CV_16UC1, cv::Scalar(50 * 257)), {cv::IMWRITE_TIFF_COMPRESSION, 1});
    std::string bytes = read_text(file);
    const std::string black_is_zero("\x06\x01\x03\0\x01\0\0\0\x01", 9);
    const std::size_t at = bytes.find(black_is_zero);
    ASSERT_NE(at, std::string::npos);
    EXPECT_EQ(int{read_gray(file, {"test", "picture"}).gray.at(0)}, 50);
    bytes[at + 8] = 0;
    EXPECT_EQ(int{read_gray(folder.write("turned.tiff", bytes), {"test", "picture"}).gray.at(0)}, 205);
}

TEST(UnitPicture, PaletteBmp) {
    // 3 x 1 pixels of 8 bits into a palette of two colours: red (gray 76) and white; then a row's padding.
    const std::string little_endian_header("BM"
                                           "\x42\0\0\0"
                                           "\0\0\0\0"
                                           "\x3e\0\0\0"
                                           "\x28\0\0\0"
                                           "\x03\0\0\0"
                                           "\x01\0\0\0"
                                           "\x01\0"
                                           "\x08\0"
                                           "\0\0\0\0"
                                           "\x04\0\0\0"
                                           "\0\0\0\0"
                                           "\0\0\0\0"
                                           "\x02\0\0\0"
                                           "\x02\0\0\0",
                                           54);
    const std::string palette("\0\0\xff\0"
                              "\xff\xff\xff\0",
                              8);
    const std::string row("\0\1\0\0", 4);
    const TemporaryFolder folder;
    const auto file = folder.write("palette.bmp", little_endian_header + palette + row);
    const Specimen specimen = read_picture(picture_of(file, {{"red", 76, 76}, {"white", 255, 255}}));
    EXPECT_EQ(specimen.classes, (std::vector<std::string>{"white", "red"}));
    EXPECT_EQ(specimen.label, (std::vector<std::uint8_t>{1, 0, 1}));
}

TEST(UnitPicture, GraysBetweenRangesAreTransitionWoodWhenGraded) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), gray_row({255, 200, 175, 150, 101, 100, 0}));
    Picture picture = picture_of(folder / "a.png", {{"LW", 0, 100}, {"EW", 200, 255}});
    picture.graded = true;
    const Specimen specimen = read_picture(picture);
    EXPECT_EQ(specimen.label, (std::vector<std::uint8_t>{0, 0, 0, 0, 0, 1, 1}));
    // Linear between the edges 200 and 100; exact in float but for one rounding.
    const std::vector<float> grade{0, 0, 0.25f, 0.5f, 0.99f, 0, 0};
    ASSERT_EQ(specimen.grade.size(), grade.size());
    for (std::size_t i = 0; i < grade.size(); ++i) EXPECT_FLOAT_EQ(specimen.grade[i], grade[i]) << i;
}

TEST(UnitPicture, ThreeGradedClassesGradeToTheirOwnNeighbour) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), gray_row({225, 175, 75}));
    Picture picture = picture_of(folder / "a.png", {{"B", 150, 200}, {"C", 0, 50}, {"A", 250, 255}});
    picture.graded = true;
    const Specimen specimen = read_picture(picture);
    EXPECT_EQ(specimen.classes, (std::vector<std::string>{"A", "B", "C"}));
    EXPECT_EQ(specimen.label, (std::vector<std::uint8_t>{0, 1, 1}));
    EXPECT_FLOAT_EQ(specimen.grade[0], 0.5f);
    EXPECT_FLOAT_EQ(specimen.grade[1], 0.0f);
    EXPECT_FLOAT_EQ(specimen.grade[2], 0.75f);
}

TEST(UnitPicture, OrientationIsLinearInGray) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), cv::Mat(1, 3, CV_8UC1, cv::Scalar(200)));
    cv::imwrite((folder / "angles.png").string(), gray_row({0, 51, 255}));
    Picture picture = picture_of(folder / "a.png");
    picture.orientation = folder / "angles.png";
    const Specimen specimen = read_picture(picture);
    ASSERT_EQ(specimen.orientation.size(), 3u);
    const auto pi = std::numbers::pi_v<float>;
    EXPECT_FLOAT_EQ(specimen.orientation[0], 0);
    EXPECT_FLOAT_EQ(specimen.orientation[1], pi / 5);
    EXPECT_FLOAT_EQ(specimen.orientation[2], pi);
}

TEST(UnitPicture, LoadSpecimenFillsTheMapFromPictureOrFileAndLeavesOtherScenesAlone) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), pattern(3, 5));
    Scene scene;
    scene.materials["EW"];
    scene.materials["LW"];
    load_specimen(scene);
    EXPECT_EQ(scene.specimen.map, nullptr);

    scene.specimen.picture = picture_of(folder / "a.png");
    load_specimen(scene);
    ASSERT_NE(scene.specimen.map, nullptr);
    expect_pattern(*scene.specimen.map, pattern(3, 5));

    write(*scene.specimen.map, folder / "specimen.h5");
    Scene other;
    other.materials = scene.materials;
    other.specimen.file = folder / "specimen.h5";
    load_specimen(other);
    ASSERT_NE(other.specimen.map, nullptr);
    expect_pattern(*other.specimen.map, pattern(3, 5));
}

TEST(VerificationPicture, RealEndGrainFallsIntoTwoClasses) {
    // Pine and a Mediterranean core: LW is a clear minority of a ring and never absent; bounds are those of softwoods.
    const std::filesystem::path wood = std::filesystem::path(SHARED_DATA) / "wood";
    if (!std::filesystem::exists(wood)) GTEST_SKIP() << "no shared data at " << wood;
    for (const auto& [name, threshold, columns, rows] :
         {std::tuple{"mtreering_001.png", 110, 2357, 170}, {"urudendro_f02c_crop.png", 185, 600, 600}}) {
        const Specimen specimen = read_picture(picture_of(wood / name, {{"LW", 0, threshold - 1}, {"EW", threshold, 255}}));
        EXPECT_EQ(specimen.columns, columns);
        EXPECT_EQ(specimen.rows, rows);
        const auto latewood = std::count(specimen.label.begin(), specimen.label.end(), 1);
        const double fraction = static_cast<double>(latewood) / (columns * rows);
        EXPECT_GT(fraction, 0.15) << name;
        EXPECT_LT(fraction, 0.55) << name;
    }
}

// Pictures and classes that cannot be used: each is an InputError naming file, key, value and rule.
#include "imaging/picture.hpp"
#include "tests/temporary_folder.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <limits>
#include <random>

using namespace crampfit;

namespace {

Picture picture_of(const std::filesystem::path& file) {
    Picture picture;
    picture.file = file;
    picture.pixel = 25e-6;
    picture.classes = {{"EW", 128, 255}, {"LW", 0, 127}};
    return picture;
}

void expect_error(const Picture& picture, const std::string& key, const std::string& value, const std::string& phrase) {
    try {
        read_picture(picture);
        ADD_FAILURE() << picture.file << " was taken";
    } catch (const InputError& error) {
        EXPECT_EQ(error.file, picture.file.string());
        EXPECT_EQ(error.key, key);
        EXPECT_NE(error.value.find(value), std::string::npos) << error.value;
        EXPECT_NE(error.rule.find(phrase), std::string::npos) << error.rule;
    }
}

/// Noise, so that no format can make it short.
cv::Mat noisy() {
    cv::Mat pixels(64, 64, CV_8UC3);
    cv::RNG(1).fill(pixels, cv::RNG::UNIFORM, 0, 256);
    return pixels;
}

std::string big_endian(std::uint32_t value) {
    std::string bytes;
    for (const int shift : {24, 16, 8, 0}) bytes += static_cast<char>(value >> shift & 0xff);
    return bytes;
}

std::string little_endian(std::uint32_t value) {
    const std::string bytes = big_endian(value);
    return {bytes.rbegin(), bytes.rend()};
}

/// CRC-32 as the PNG specification (ISO/IEC 15948, annex D) defines it, bit by bit.
std::uint32_t checksum(const std::string& bytes) {
    std::uint32_t remainder = 0xffffffffu;
    for (const char byte : bytes) {
        remainder ^= static_cast<std::uint8_t>(byte);
        for (int bit = 0; bit < 8; ++bit) remainder = remainder >> 1 ^ (remainder & 1 ? 0xedb88320u : 0u);
    }
    return ~remainder;
}

/// A gray picture of one row.
cv::Mat gray_row(const std::vector<std::uint8_t>& grays) { return cv::Mat(grays, true).reshape(1, 1); }

}  // namespace

TEST(UnitBadPicture, MissingEmptyFolderAndNoPicture) {
    const TemporaryFolder folder;
    expect_error(picture_of(folder / "none.png"), "specimen.image", "none.png", "no such file");
    expect_error(picture_of(folder.write("empty.png", "")), "specimen.image", "empty.png", "empty");
    expect_error(picture_of(folder.write("text.png", "not a picture\n")), "specimen.image", "text.png", "no picture");
    std::filesystem::create_directory(folder / "folder.png");
    expect_error(picture_of(folder / "folder.png"), "specimen.image", "folder.png", "must be a file");
}

TEST(UnitBadPicture, CutShortInEveryFormatAtManyLengths) {
    const TemporaryFolder folder;
    for (const char* name : {"a.png", "a.bmp", "a.jpg", "a.tiff", "a.ppm"}) {
        ASSERT_TRUE(cv::imwrite((folder / name).string(), noisy()));
        EXPECT_NO_THROW(read_picture(picture_of(folder / name))) << name;
        const std::string whole = folder.read(name);
        for (const int percent : {1, 5, 20, 50, 80, 95}) {
            SCOPED_TRACE(std::string(name) + " cut to " + std::to_string(percent) + " %");
            expect_error(picture_of(folder.write(std::string("cut ") + name, whole.substr(0, whole.size() * percent / 100))),
                         "specimen.image", "cut a", "cut short");
        }
    }
}

TEST(UnitBadPicture, OtherDepths) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "float.tiff").string(), cv::Mat(4, 4, CV_32FC1, cv::Scalar(0.5)));
    expect_error(picture_of(folder / "float.tiff"), "specimen.image", "float.tiff", "8 or 16 bit");
    cv::imwrite((folder / "double.tiff").string(), cv::Mat(4, 4, CV_64FC1, cv::Scalar(0.5)));
    expect_error(picture_of(folder / "double.tiff"), "specimen.image", "double.tiff", "8 or 16 bit");
}

TEST(UnitBadPicture, HeadersThatClaimAbsurdSizes) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), noisy());
    cv::imwrite((folder / "a.bmp").string(), noisy());
    const std::string png = folder.read("a.png"), bmp = folder.read("a.bmp");
    // 20,000 x 20,000 is within what OpenCV itself takes, and beyond what is taken here.
    for (const std::uint32_t side : {20'000u, 100'000u, 0x7fffffffu, 0u}) {
        SCOPED_TRACE(side);
        const std::string phrase = side == 20'000u ? "2^28 pixels" : "";
        std::string bytes = bmp;
        bytes.replace(18, 8, little_endian(side) + little_endian(side));
        expect_error(picture_of(folder.write("huge.bmp", bytes)), "specimen.image", "huge.bmp", phrase);
        bytes = "P6\n" + std::to_string(side) + " " + std::to_string(side) + "\n255\n";
        expect_error(picture_of(folder.write("huge.ppm", bytes)), "specimen.image", "huge.ppm", phrase);
        bytes = png;
        bytes.replace(16, 8, big_endian(side) + big_endian(side));
        bytes.replace(29, 4, big_endian(checksum(bytes.substr(12, 17))));
        expect_error(picture_of(folder.write("huge.png", bytes)), "specimen.image", "huge.png", phrase);
    }
}

TEST(UnitBadPicture, MutatedFilesGiveAPictureOrANamedError) {
    const TemporaryFolder folder;
    std::mt19937_64 random(1);
    int refused = 0;
    for (const char* name : {"a.png", "a.bmp", "a.jpg", "a.tiff", "a.ppm"}) {
        cv::imwrite((folder / name).string(), noisy());
        const std::string whole = folder.read(name);
        for (int i = 0; i < 200; ++i) {
            std::string bytes = whole;
            // Half of the changes hit the first bytes, where headers are.
            for (int change = 0; change < 4; ++change)
                bytes[random() % (change % 2 == 0 ? std::min<std::size_t>(64, bytes.size()) : bytes.size())] =
                    static_cast<char>(random());
            try {
                const Specimen specimen = read_picture(picture_of(folder.write("mutated", bytes)));
                EXPECT_EQ(specimen.label.size(), static_cast<std::size_t>(specimen.columns) * specimen.rows);
            } catch (const InputError& error) {
                EXPECT_EQ(error.key, "specimen.image");
                ++refused;
            }
        }
    }
    EXPECT_GT(refused, 200);
}

TEST(UnitBadPicture, WholePictureOfTooManyPixels) {
    // 1 bit a pixel, whole and valid: 16,385 x 16,384 is one row above 2^28 pixels.
    const TemporaryFolder folder;
    const std::string header = "P4\n16384 16385\n";
    const auto file = folder.write("large.pbm", header + std::string(2048ul * 16385, '\0'));
    expect_error(picture_of(file), "specimen.image", "large.pbm", "2^28 pixels");
}

TEST(UnitBadPicture, GrayThatNoClassCovers) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), gray_row({255, 110, 110, 115, 5, 100}));
    Picture picture = picture_of(folder / "a.png");
    picture.classes = {{"EW", 128, 255}, {"LW", 0, 105}};
    expect_error(picture, "specimen.classes", "EW [128, 255], LW [0, 105]", "gray 110 (2 pixels)");
    expect_error(picture, "specimen.classes", "", "3 pixels in all");
    picture.graded = true;
    EXPECT_NO_THROW(read_picture(picture));
    // Beyond all ranges there is nothing to grade into.
    picture.classes = {{"EW", 128, 255}, {"LW", 10, 105}};
    expect_error(picture, "specimen.classes", "", "gray 5 (1 pixel");
    picture.classes = {{"EW", 128, 254}, {"LW", 0, 105}};
    expect_error(picture, "specimen.classes", "", "gray 255 (1 pixel");
}

TEST(UnitBadPicture, Classes) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), cv::Mat(2, 2, CV_8UC1, cv::Scalar(200)));
    Picture picture = picture_of(folder / "a.png");
    picture.classes = {};
    expect_error(picture, "specimen.classes", "0 classes", "1 to 254");
    picture.classes = {{"EW", 255, 128}};
    expect_error(picture, "specimen.classes", "EW [255, 128]", "low <= high");
    picture.classes = {{"EW", 128, 256}};
    expect_error(picture, "specimen.classes", "EW [128, 256]", "255");
    picture.classes = {{"EW", -1, 255}};
    expect_error(picture, "specimen.classes", "EW [-1, 255]", "0 <=");
    picture.classes = {{"EW", 128, 255}, {"LW", 0, 128}};
    expect_error(picture, "specimen.classes", "LW [0, 128]", "overlap");
}

TEST(UnitBadPicture, PixelSize) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), cv::Mat(2, 2, CV_8UC1, cv::Scalar(200)));
    for (const double pixel : {0.0, -1e-6, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        Picture picture = picture_of(folder / "a.png");
        picture.pixel = pixel;
        expect_error(picture, "specimen.pixel", " m", "positive");
    }
}

TEST(UnitBadPicture, Orientation) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), cv::Mat(2, 3, CV_8UC1, cv::Scalar(200)));
    cv::imwrite((folder / "angles.png").string(), cv::Mat(3, 2, CV_8UC1, cv::Scalar(200)));
    Picture picture = picture_of(folder / "a.png");
    picture.orientation = folder / "angles.png";
    expect_error(picture, "specimen.orientation", "angles.png", "2 x 3 pixels, the picture 3 x 2");
    picture.orientation = folder / "none.png";
    expect_error(picture, "specimen.orientation", "none.png", "no such file");
}

TEST(UnitBadPicture, ASceneIsNamedAsThePlaceOfTheKey) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "a.png").string(), cv::Mat(2, 2, CV_8UC1, cv::Scalar(200)));
    Scene scene;
    scene.file = "scene.toml";
    scene.materials["EW"];
    scene.specimen.picture = picture_of(folder / "none.png");
    const auto expect_scene_error = [&](const std::string& key, const std::string& value) {
        try {
            load_specimen(scene);
            ADD_FAILURE() << key << " was taken";
        } catch (const InputError& error) {
            EXPECT_EQ(error.file, "scene.toml");
            EXPECT_EQ(error.key, key);
            EXPECT_NE(error.value.find(value), std::string::npos) << error.value;
        }
    };
    expect_scene_error("specimen.image", "none.png");
    scene.specimen.picture = picture_of(folder / "a.png");
    expect_scene_error("specimen.classes", "LW");

    write(read_picture(*scene.specimen.picture), folder / "specimen.h5");
    scene.specimen.picture.reset();
    scene.specimen.file = folder / "specimen.h5";
    expect_scene_error("specimen.file", "LW");
    scene.specimen.file = folder / "a.png";
    expect_scene_error("specimen.file", "a.png");
    EXPECT_EQ(scene.specimen.map, nullptr);
}

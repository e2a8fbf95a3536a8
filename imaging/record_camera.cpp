#include "imaging/record_camera.hpp"

#include "datasets/error.hpp"
#include "datasets/whole_file.hpp"
#include "imaging/frame_motion.hpp"

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>

#include <cmath>

namespace crampfit {
namespace {

constexpr int most_side = 16384;  // pixels

Vec2 upper_right(const Record& record, const std::filesystem::path& file) {
    if (record.point_position.empty())
        throw InputError(file.string(), "frames", "none", "there is nothing to photograph: give output.frames in the scene");
    Vec2 corner = Vec2::Zero();
    for (const Vec2& place : record.point_position) corner = corner.cwiseMax(place + 0.5 * record.point_size);
    return corner;
}

VirtualCameraOptions sized(VirtualCameraOptions options, const Vec2& size, double pixel) {
    const Vec2 count = (size / pixel - Vec2::Constant(1e-6)).array().ceil();  // 1e-6 of a pixel is rounding
    if (!(count.maxCoeff() <= most_side))
        throw InputError(
            "command line", "--pixel", fmt::format("{:g} um", 1e6 * pixel),
            fmt::format("makes a picture of {:.0f} x {:.0f} pixels: at most {} a side", count.x(), count.y(), most_side));
    options.columns = static_cast<int>(count.x());
    options.rows = static_cast<int>(count.y());
    return options;
}

Surface seen_in(const CameraView& view, const std::function<double(const Vec2&)>& wood) {
    if (!wood) return {};
    return [=](const Vec2& px) { return wood(view.to_specimen(px)); };
}

}  // namespace

RecordCamera::RecordCamera(const Record& record, const std::filesystem::path& file, double pixel, double margin,
                           VirtualCameraOptions options, const std::function<double(const Vec2&)>& wood)
    : record_(record),
      file_(file), view_{Vec2::Constant(-margin), pixel,
                         (options = sized(options, upper_right(record, file) + Vec2::Constant(2 * margin), pixel)).rows},
      camera_(options, seen_in(view_, wood)) {}

GrayPicture RecordCamera::reference() const {
    const FrameMotion motion(record_, 0, file_);
    return camera_.photograph([](const Vec2&) { return Vec2(0, 0); }, 0,
                              [&](const Vec2& px) { return motion.is_material(view_.to_specimen(px)); });
}

GrayPicture RecordCamera::photograph(int frame) const {
    const FrameMotion motion(record_, frame, file_);
    const auto displacement = [&](const Vec2& px) {
        const Vec2 moved = motion(view_.to_specimen(px)) / view_.pixel;
        return Vec2(moved.x(), -moved.y());
    };
    return camera_.photograph(displacement, static_cast<std::uint64_t>(frame) + 1,
                              [&](const Vec2& px) { return motion.is_material(view_.to_specimen(px)); });
}

void write_gray(const GrayPicture& picture, const std::filesystem::path& file) {
    const cv::Mat pixels(picture.rows, picture.columns, CV_8U, const_cast<std::uint8_t*>(picture.gray.data()));
    std::vector<std::uint8_t> bytes;
    cv::imencode(".png", pixels, bytes);
    write_whole_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace crampfit

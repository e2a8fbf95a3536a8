#pragma once

#include "datasets/record.hpp"
#include "imaging/virtual_camera.hpp"

#include <filesystem>

namespace crampfit {

/// How a picture lies on the specimen: upright, its lower left corner at `corner`. Pixels count from the centre of the first one,
/// x to the right and y down.
struct CameraView {
    Vec2 corner = Vec2::Zero();  // in the specimen [m]
    double pixel = 0;            // edge of a pixel [m]
    int rows = 0;                // of the picture

    Vec2 to_specimen(const Vec2& px) const { return corner + pixel * Vec2(px.x() + 0.5, rows - 0.5 - px.y()); }
    Vec2 to_picture(const Vec2& place) const {
        const Vec2 in_pixels = (place - corner) / pixel;
        return {in_pixels.x() - 0.5, rows - 0.5 - in_pixels.y()};
    }
};

/// A virtual camera before the specimen of a record: its frames displace what is to be seen on the material, a speckle pattern or
/// its own wood.
class RecordCamera {
  public:
    /// Looks at the whole specimen and `margin` [m] around it; `options` give all but the size of the picture. The record must
    /// outlive this; `file` is what errors call it. `wood` is the gray of the bare wood at a place of the specimen [m]; empty:
    /// there is a pattern on it. Throws InputError for a record without points, or a picture of more than 16384 pixels a side.
    RecordCamera(const Record& record, const std::filesystem::path& file, double pixel, double margin,
                 VirtualCameraOptions options, const std::function<double(const Vec2&)>& wood = {});

    const CameraView& view() const { return view_; }

    GrayPicture reference() const;            // of the unloaded specimen
    GrayPicture photograph(int frame) const;  // may be called from several threads

  private:
    const Record& record_;
    std::filesystem::path file_;
    CameraView view_;
    VirtualCamera camera_;
};

/// Writes a PNG. Throws InputError when the file cannot be written.
void write_gray(const GrayPicture& picture, const std::filesystem::path& file);

}  // namespace crampfit

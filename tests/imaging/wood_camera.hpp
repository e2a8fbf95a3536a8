#pragma once

#include "imaging/end_grain.hpp"
#include "imaging/gray_picture.hpp"
#include "imaging/virtual_camera.hpp"

#include <opencv2/imgproc.hpp>

#include <cmath>

/// How a picture of wood is taken.
struct WoodShot {
    crampfit::PlaneDisplacement displacement = [](const crampfit::Vec2&) {
        return crampfit::Vec2(0, 0);
    };                                      // of the reference's places [px]
    cv::Matx23d camera{1, 0, 0, 0, 1, 0};   // where it sees the displaced places [px]
    double gain = 1, tilt = 0, offset = 0;  // light: gray * (gain + tilt * (x from -1 to 1)) + offset
    double noise = 2;                       // standard deviation of each pixel [gray]
    int seed = 1;
};

/// Takes pictures of plain wood, its own picture warped by a displacement that may jump across a crack; the gap shows `gap` gray.
class WoodCamera {
  public:
    WoodCamera(const cv::Mat& wood, double gap) : gap_(gap) { wood.convertTo(wood_, CV_32F); }

    crampfit::FinePicture take(const WoodShot& shot) const {
        cv::Matx23d back;
        cv::invertAffineTransform(shot.camera, back);
        constexpr int fine = 3;  // squares a pixel, each way, so that a narrow gap darkens a pixel by its share
        cv::Mat places(wood_.size() * fine, CV_32FC2), seen, picture;
        for (int y = 0; y < places.rows; ++y)
            for (int x = 0; x < places.cols; ++x) {
                const cv::Vec2d at = back * cv::Vec3d((x + 0.5) / fine - 0.5, (y + 0.5) / fine - 0.5, 1);
                places.at<cv::Vec2f>(y, x) = origin({at[0], at[1]}, shot.displacement);
            }
        cv::remap(wood_, seen, places, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REFLECT_101);
        for (int y = 0; y < places.rows; ++y)
            for (int x = 0; x < places.cols; ++x)
                if (std::isnan(places.at<cv::Vec2f>(y, x)[0])) seen.at<float>(y, x) = static_cast<float>(gap_);
        cv::resize(seen, picture, wood_.size(), 0, 0, cv::INTER_AREA);
        cv::GaussianBlur(picture, picture, {}, 0.7);  // the lens
        cv::Mat noise(picture.size(), CV_32F);
        cv::RNG(static_cast<std::uint64_t>(shot.seed)).fill(noise, cv::RNG::NORMAL, 0, shot.noise);
        crampfit::FinePicture taken{picture.cols, picture.rows, {}};
        for (int y = 0; y < picture.rows; ++y)
            for (int x = 0; x < picture.cols; ++x) {
                const double light = shot.gain + shot.tilt * (2.0 * x / picture.cols - 1);
                const double gray = picture.at<float>(y, x) * light + shot.offset + noise.at<float>(y, x);
                taken.gray.push_back(static_cast<float>(std::lround(std::clamp(gray, 0.0, 255.0))));
            }
        return taken;
    }

  private:
    /// Where what is seen came from; not a number in an open crack, where either side points to the other.
    static cv::Vec2f origin(const crampfit::Vec2& seen, const crampfit::PlaneDisplacement& displacement) {
        crampfit::Vec2 place = seen;
        for (int i = 0; i < 50; ++i) {
            const crampfit::Vec2 next = seen - displacement(place);
            if ((next - place).norm() < 1e-6) return {static_cast<float>(next.x()), static_cast<float>(next.y())};
            place = next;
        }
        return {NAN, NAN};
    }

    cv::Mat wood_;
    double gap_;
};

/// Gray end grain without rays' and cells' fine texture beyond what wood has.
inline cv::Mat end_grain_picture(int columns, int rows, double period_px, crampfit::Vec2 pith_px, std::uint64_t seed) {
    constexpr double pixel = 25e-6;
    crampfit::EndGrainOptions options;
    options.size = pixel * crampfit::Vec2(columns, rows);
    options.pixel = pixel;
    options.pith = pixel * pith_px;
    options.period = pixel * period_px;
    options.period_sd = 0.1 * options.period;
    options.transition = 0.15 * options.period;
    options.seed = seed;
    const crampfit::EndGrain grown = crampfit::grow_end_grain(options);
    return cv::Mat(grown.rows, grown.columns, CV_8U, const_cast<std::uint8_t*>(grown.gray.data())).clone();
}

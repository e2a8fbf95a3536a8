#include "imaging/wood_surface.hpp"

#include "imaging/spline_picture.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <memory>

namespace crampfit {

std::function<double(const Vec2&)> wood_surface(const FinePicture& picture, const Placement& placement, double finest) {
    cv::Mat gray(picture.rows, picture.columns, CV_32F, const_cast<float*>(picture.gray.data()));
    if (const double factor = placement.pixel / finest; factor < 1)
        cv::resize(gray, gray,
                   {std::max(1, static_cast<int>(std::lround(factor * picture.columns))),
                    std::max(1, static_cast<int>(std::lround(factor * picture.rows)))},
                   0, 0, cv::INTER_AREA);
    const Vec2 scale(static_cast<double>(gray.cols) / picture.columns, static_cast<double>(gray.rows) / picture.rows);
    const auto spline =
        std::make_shared<const SplinePicture>(FinePicture{gray.cols, gray.rows, {gray.begin<float>(), gray.end<float>()}});
    return [=](const Vec2& place) {
        const Vec2 at = (placement.pixel_at(place) + Vec2::Constant(0.5)).cwiseProduct(scale) - Vec2::Constant(0.5);
        return spline->gray(at.x(), at.y());
    };
}

bool covers(const FinePicture& picture, const Placement& placement, const Vec2& size) {
    const double most = 0.01 * size.maxCoeff() / placement.pixel;
    for (const Vec2& corner : {Vec2(0, 0), Vec2(size.x(), 0), Vec2(0, size.y()), size}) {
        const Vec2 at = placement.pixel_at(corner);
        if (at.minCoeff() < -0.5 - most || at.x() > picture.columns - 0.5 + most || at.y() > picture.rows - 0.5 + most)
            return false;
    }
    return true;
}

}  // namespace crampfit

#include "imaging/photograph.hpp"

#include "datasets/error.hpp"
#include "imaging/picture.hpp"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr int longer_side = 1600;  // of what is kept [px]
constexpr double around = 0.03;    // shown on each side, of the specimen's longer one

/// From pixels of the kept picture to those of the photograph, shrunk by `shrunk` along x and y.
cv::Matx23d to_photograph(const PlanePicture& kept, double kept_pixel, const Placement& placement, const Vec2& shrunk) {
    const auto source = [&](double x, double y) {
        const Vec2 place(kept.low.x() + kept_pixel * (x + 0.5), kept.high.y() - kept_pixel * (y + 0.5));
        return Vec2((placement.pixel_at(place) + Vec2::Constant(0.5)).cwiseQuotient(shrunk) - Vec2::Constant(0.5));
    };
    const Vec2 origin = source(0, 0), by_x = source(1, 0) - origin, by_y = source(0, 1) - origin;
    return {by_x.x(), by_y.x(), origin.x(), by_x.y(), by_y.y(), origin.y()};
}

}  // namespace

void load_photograph(Photograph& photograph, const Vec2& size, const PictureKey& asked_by) {
    if (photograph.file.empty()) return;
    GrayPicture whole = read_gray(photograph.file, asked_by);
    const auto refuse = [&](const std::string& rule) {
        throw InputError(asked_by.file, asked_by.key, photograph.file.string(), rule);
    };
    if (photograph.rows > 0 && (whole.columns != photograph.columns || whole.rows != photograph.rows))
        refuse(fmt::format("is {} x {} pixels, those that the crack was tracked in {} x {}: must have their size", whole.columns,
                           whole.rows, photograph.columns, photograph.rows));
    Placement& placement = photograph.placement;
    placement.rows = whole.rows;

    PlanePicture& kept = photograph.picture;
    const Vec2 margin = Vec2::Constant(around * size.maxCoeff());
    const double pixel = std::max(placement.pixel, (size + 2 * margin).maxCoeff() / longer_side);
    const Vec2 count = ((size + 2 * margin) / pixel).array().ceil();
    kept.columns = static_cast<int>(count.x());
    kept.rows = static_cast<int>(count.y());
    kept.low = -margin;
    kept.high = kept.low + pixel * count;

    cv::Mat source(whole.rows, whole.columns, CV_8U, whole.gray.data());
    if (const double factor = placement.pixel / pixel; factor < 1)
        cv::resize(source, source,
                   {std::max(1, static_cast<int>(std::lround(factor * whole.columns))),
                    std::max(1, static_cast<int>(std::lround(factor * whole.rows)))},
                   0, 0, cv::INTER_AREA);
    const Vec2 shrunk(static_cast<double>(whole.columns) / source.cols, static_cast<double>(whole.rows) / source.rows);
    const cv::Matx23d map = to_photograph(kept, pixel, placement, shrunk);
    constexpr int how = cv::INTER_LINEAR | cv::WARP_INVERSE_MAP;
    cv::Mat turned, shown;
    cv::warpAffine(source, turned, map, {kept.columns, kept.rows}, how, cv::BORDER_CONSTANT, cv::Scalar::all(255));
    cv::warpAffine(cv::Mat(source.size(), CV_8U, cv::Scalar(255)), shown, map, {kept.columns, kept.rows}, how);
    if (cv::countNonZero(shown) == 0)
        refuse(fmt::format("shows nothing of the specimen, {:g} x {:g} mm: check pixel, offset and rotation", 1e3 * size.x(),
                           1e3 * size.y()));
    kept.gray.assign(turned.datastart, turned.dataend);
}

void load_pictures(Study& study) {
    if (study.scene) load_specimen(*study.scene);
    for (Experiment& experiment : study.experiments) {
        load_specimen(experiment.scene);
        if (experiment.photograph)
            load_photograph(*experiment.photograph, experiment.scene.specimen.size,
                            {study.file.string(), "experiments." + experiment.name + ".photograph.picture"});
    }
    for (ModelChoice& model : study.models)
        for (Scene& scene : model.scenes) load_specimen(scene);
}

}  // namespace crampfit

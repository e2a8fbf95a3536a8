#include "imaging/frame_motion.hpp"

#include "datasets/error.hpp"

#include <Eigen/Dense>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr int least_points = 4;  // for a plane, with one to spare
constexpr int near_bins = 2;     // to each side, where points are dense
constexpr int far_bins = 12;     // where the specimen's side is near or beyond

double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

FrameMotion::FrameMotion(const Record& record, int frame, const std::filesystem::path& file) {
    const auto frames = static_cast<int>(record.frames.size());
    if (frame < 0 || frame >= frames || record.point_position.empty())
        throw InputError(file.string(), "frames", fmt::format("{} of {}", frame, frames),
                         "there is no such frame: give output.frames in the scene");
    if (!(record.point_size.minCoeff() > 0))
        throw InputError(file.string(), "points", "no size",
                         "the record is older than the size of its points: simulate it again");
    places_ = record.point_position;
    moved_ = record.frames[static_cast<std::size_t>(frame)].moved;
    size_ = record.point_size;
    Vec2 highest = Vec2::Zero();
    for (const Vec2& place : places_) highest = highest.cwiseMax(place);
    bins_ = (highest.cwiseQuotient(size_)).array().floor().cast<int>() + 1;
    points_.resize(static_cast<std::size_t>(bins_.prod()));
    crossed_.resize(points_.size());
    const auto index = [&](const Eigen::Vector2i& bin) { return static_cast<std::size_t>(bin.y() * bins_.x() + bin.x()); };
    for (int p = 0; p < static_cast<int>(places_.size()); ++p)
        points_[index(bin_of(places_[static_cast<std::size_t>(p)]))].push_back(p);
    for (int crack = 0; crack < static_cast<int>(record.paths.size()); ++crack) {
        const auto& line = crack == record.tracked_crack ? record.frames[static_cast<std::size_t>(frame)].crack
                                                         : record.paths[static_cast<std::size_t>(crack)];
        for (std::size_t k = 0; k + 1 < line.size(); ++k) {
            const Eigen::Vector2i low = bin_of(line[k].cwiseMin(line[k + 1])), high = bin_of(line[k].cwiseMax(line[k + 1]));
            for (int j = low.y(); j <= high.y(); ++j)
                for (int i = low.x(); i <= high.x(); ++i) crossed_[index({i, j})].push_back(static_cast<int>(segments_.size()));
            segments_.push_back({line[k], line[k + 1]});
        }
    }
}

Eigen::Vector2i FrameMotion::bin_of(const Vec2& place) const {
    const Vec2 bin = place.cwiseQuotient(size_).array().floor();
    return bin.cwiseMax(Vec2::Zero()).cwiseMin((bins_.array() - 1).cast<double>().matrix()).cast<int>();
}

// Of points on a crack rounding has said to which side they belong: they are left out.
bool FrameMotion::parted(const Vec2& place, const Vec2& point, const std::vector<int>& segments) const {
    constexpr double hair = 1e-3;  // of a point
    return std::ranges::any_of(segments, [&](int k) {
        const auto& [from, to] = segments_[static_cast<std::size_t>(k)];
        const Vec2 along = to - from;
        const bool crosses = (cross(along, place - from) >= 0) != (cross(along, point - from) >= 0) &&
                             (cross(point - place, from - place) >= 0) != (cross(point - place, to - place) >= 0);
        const double share = std::clamp((point - from).dot(along) / std::max(along.squaredNorm(), 1e-300), 0.0, 1.0);
        return crosses || (from + share * along - point).norm() < hair * size_.minCoeff();
    });
}

std::vector<int> FrameMotion::segments_near(const Eigen::Vector2i& bin, int reach) const {
    std::vector<int> near;
    for (int j = std::max(0, bin.y() - reach); j <= std::min(bins_.y() - 1, bin.y() + reach); ++j)
        for (int i = std::max(0, bin.x() - reach); i <= std::min(bins_.x() - 1, bin.x() + reach); ++i) {
            const auto& here = crossed_[static_cast<std::size_t>(j * bins_.x() + i)];
            near.insert(near.end(), here.begin(), here.end());
        }
    std::ranges::sort(near);
    near.erase(std::unique(near.begin(), near.end()), near.end());
    return near;
}

Vec2 FrameMotion::operator()(const Vec2& place) const {
    const Eigen::Vector2i bin = bin_of(place);
    // Beyond the sides what counts is the distance from the nearest place of the specimen.
    const Vec2 inside = place.cwiseMax(Vec2::Zero()).cwiseMin(bins_.cast<double>().cwiseProduct(size_));
    for (int reach = near_bins; reach <= far_bins; reach *= 2) {
        const std::vector<int> segments = segments_near(bin, reach);
        Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
        Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
        int count = 0;
        for (int j = std::max(0, bin.y() - reach); j <= std::min(bins_.y() - 1, bin.y() + reach); ++j)
            for (int i = std::max(0, bin.x() - reach); i <= std::min(bins_.x() - 1, bin.x() + reach); ++i)
                for (const int p : points_[static_cast<std::size_t>(j * bins_.x() + i)]) {
                    const Vec2& x = places_[static_cast<std::size_t>(p)];
                    const Vec2 offset = (x - inside).cwiseQuotient(size_);
                    const double share = offset.squaredNorm() / (reach * reach);
                    if (share >= 1 || (!segments.empty() && parted(inside, x, segments))) continue;
                    const double weight = (1 - share) * (1 - share);
                    const Eigen::Vector3d term(1, offset.x(), offset.y());
                    normal += weight * term * term.transpose();
                    right += weight * term * moved_[static_cast<std::size_t>(p)].cast<double>().transpose();
                    ++count;
                }
        const Eigen::LDLT<Eigen::Matrix3d> factor(normal);
        if (count < least_points || !(factor.vectorD().minCoeff() > 1e-6 * factor.vectorD().maxCoeff())) continue;
        const Vec2 beyond = (place - inside).cwiseQuotient(size_);
        return factor.solve(right).transpose() * Eigen::Vector3d(1, beyond.x(), beyond.y());
    }
    return Vec2::Zero();  // far from all material
}

bool FrameMotion::is_material(const Vec2& place) const {
    const Eigen::Vector2i bin = bin_of(place);
    for (int j = std::max(0, bin.y() - 1); j <= std::min(bins_.y() - 1, bin.y() + 1); ++j)
        for (int i = std::max(0, bin.x() - 1); i <= std::min(bins_.x() - 1, bin.x() + 1); ++i)
            for (const int p : points_[static_cast<std::size_t>(j * bins_.x() + i)])
                if (((places_[static_cast<std::size_t>(p)] - place).cwiseAbs().array() <= 0.5001 * size_.array()).all())
                    return true;
    return false;
}

}  // namespace crampfit

#pragma once

#include "datasets/record.hpp"

#include <vector>

namespace crampfit {

/// The displacement of the material between the points of a record's frame. Linear about each place, by weighted least squares
/// over the points within some two spacings (moving least squares; Lancaster and Salkauskas 1981) that no crack parts from it, so
/// that it jumps across cracks and nowhere else.
class FrameMotion {
  public:
    /// `frame` counts from 0. The cracks that the frame does not hold are taken as they are at the end of the record. Throws
    /// InputError, naming `file`, for a record without such a frame, or without the size of its points.
    FrameMotion(const Record& record, int frame, const std::filesystem::path& file);

    /// At a place of the undeformed specimen [m]; beyond its sides as the nearest points go on.
    Vec2 operator()(const Vec2& place) const;

    /// Whether a place lies in the rectangle of a point.
    bool is_material(const Vec2& place) const;

  private:
    struct Segment {
        Vec2 from, to;  // [m]
    };

    Eigen::Vector2i bin_of(const Vec2& place) const;
    bool parted(const Vec2& place, const Vec2& point, const std::vector<int>& segments) const;
    std::vector<int> segments_near(const Eigen::Vector2i& bin, int reach) const;

    std::vector<Vec2> places_;               // [m]
    std::vector<Eigen::Vector2f> moved_;     // [m]
    std::vector<Segment> segments_;          // of all cracks
    Vec2 size_;                              // of a point [m]
    Eigen::Vector2i bins_;                   // of a point's size, side by side and one above the other
    std::vector<std::vector<int>> points_;   // [bins]
    std::vector<std::vector<int>> crossed_;  // [bins] segments whose box touches the bin
};

}  // namespace crampfit

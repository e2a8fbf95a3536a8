#pragma once

#include "forward/deformation.hpp"
#include "forward/history.hpp"

#include <array>
#include <span>

namespace crampfit {

constexpr int most_in_group = 25;

/// All points of a cell that are on the same fields, in order. Of a cell that a crack cuts they need not follow each other: which
/// do is another matter in a mirrored scene.
struct PointGroup {
    std::array<int, most_in_group> point;
    int count = 0;

    std::span<const int> points() const { return {point.data(), static_cast<std::size_t>(count)}; }
};

/// Calls visit(group) for those of a cell.
template <class Visit>
void for_groups(const Points& points, int cell, const Visit& visit) {
    const int first = points.first_of_cell[cell], last = points.first_of_cell[cell + 1];
    for (int p = first; p < last; ++p) {
        int like = first;
        while (!points.node.same(p, like)) ++like;
        if (like < p) continue;
        PointGroup group;
        for (int q = p; q < last; ++q)
            if (points.node.same(p, q)) group.point[group.count++] = q;
        visit(group);
    }
}

/// Strain xx, yy, 2 xy.
inline Eigen::Vector3d strain_of(const Mat2& gradient, bool rotates) {
    const Mat2 strain =
        rotates ? Mat2(Polar(gradient).stretch - Mat2::Identity()) : Mat2(0.5 * (gradient + gradient.transpose()));
    return {strain(0, 0), strain(1, 1), 2.0 * strain(0, 1)};
}

/// What the law of points that remember is told of their strain. Plastic wood flows without a change of volume, which in plane
/// strain four points a cell cannot all do at once: there they share the mean of their dilatation (Nagtegaal, Parks and Rice
/// 1974; Hughes 1980). The work of stresses s then is that of `shared(s)` with the strains themselves.
class SeenStrains {
  public:
    SeenStrains(const Discretisation& body, const History& history, const PointGroup& group,
                const std::vector<Vec2>& displacement, bool rotates)
        : count_(group.count), shares_(group.count > 1 && history.flows_in_plane(body.points.cell[group.point[0]])) {
        for (int i = 0; i < count_; ++i) {
            volume_[i] = body.points.volume[group.point[i]];
            gradient[i] = gradient_at(body, group.point[i], displacement);
            strain[i] = strain_of(gradient[i], rotates);
        }
        share(strain);
    }

    /// Puts the mean trace of all in the place of each one's.
    template <class Rows>
    void share(std::array<Rows, most_in_group>& values) const {
        if (!shares_) return;
        const auto trace = [](const Rows& value) { return (value.row(0) + value.row(1)).eval(); };
        auto mean = (volume_[0] * trace(values[0])).eval();
        double sum = volume_[0];
        for (int i = 1; i < count_; ++i) {
            mean += volume_[i] * trace(values[i]);
            sum += volume_[i];
        }
        mean /= sum;
        for (int i = 0; i < count_; ++i) {
            const auto change = (0.5 * (mean - trace(values[i]))).eval();
            values[i].row(0) += change;
            values[i].row(1) += change;
        }
    }

    std::array<Mat2, most_in_group> gradient;
    std::array<Eigen::Vector3d, most_in_group> strain;

  private:
    std::array<double, most_in_group> volume_;  // [m^3]
    int count_;
    bool shares_;
};

}  // namespace crampfit

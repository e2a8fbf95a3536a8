#include "forward/face_pieces.hpp"

#include <algorithm>
#include <limits>

namespace crampfit {

namespace {

// How far behind a tip, along the crack, the place of the crack lies that is nearest to x; below 0: ahead of the tip [m].
double distance_behind(const CrackLine& line, bool at_end, const Vec2& x) {
    const CrackTip& tip = line.tip(at_end);
    if (const double ahead = (x - tip.position).dot(tip.direction); ahead > 0.0) return -ahead;
    const int n = static_cast<int>(line.points.size());
    double nearest = std::numeric_limits<double>::infinity();
    double behind = 0.0, gone = 0.0;
    for (int k = 0; k + 1 < n; ++k) {
        const Vec2& a = at_end ? line.points[n - 1 - k] : line.points[k];
        const Vec2& b = at_end ? line.points[n - 2 - k] : line.points[k + 1];
        const double share = nearest_on_segment(a, b, x);
        const double distance = (x - a - share * (b - a)).norm();
        if (distance < nearest) {
            nearest = distance;
            behind = gone + share * (b - a).norm();
        }
        gone += (b - a).norm();
    }
    return behind;
}

}  // namespace

std::vector<FacePiece> face_pieces(const CrackFields& cracks, int crack, bool at_end, std::span<const Vec2> forces,
                                   const Layout& layout) {
    const CrackLine& line = cracks.lines[crack];
    const double width = line.tip(at_end).direction.cwiseProduct(layout.cell).lpNorm<1>();
    std::vector<FacePiece> pieces;
    for (std::size_t k = 0; k < forces.size(); ++k) {
        const FieldPair& pair = cracks.pairs[k];
        if (pair.crack != crack || forces[k].isZero(0.0)) continue;
        const double behind = distance_behind(line, at_end, layout.node_position(pair.node));
        const double near = std::max(0.0, behind - 0.5 * width), far = behind + 0.5 * width;
        if (far <= near) continue;
        const double share = (at_end ? 1.0 : -1.0) * (far - near) / width;
        pieces.push_back({share * forces[k], near, far});
    }
    return pieces;
}

}  // namespace crampfit

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

} // namespace

std::vector<FacePiece> face_pieces(const CrackFields& cracks, int crack, bool at_end, std::span<const Vec2> forces, const Layout& layout) {
    struct Place {
        double behind;
        Vec2 force;
    };
    std::vector<Place> places;
    for (std::size_t k = 0; k < forces.size(); ++k) {
        const FieldPair& pair = cracks.pairs[k];
        if (pair.crack != crack) continue;
        const double behind = distance_behind(cracks.lines[crack], at_end, layout.node_position(pair.node));
        if (behind > 0.0) places.push_back({behind, at_end ? forces[k] : Vec2(-forces[k])});
    }
    std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.behind < b.behind; });
    std::vector<FacePiece> pieces;
    for (std::size_t k = 0; k < places.size(); ++k) {
        const double near = k == 0 ? 0.0 : 0.5 * (places[k - 1].behind + places[k].behind);
        const double far = k + 1 < places.size() ? 0.5 * (places[k].behind + places[k + 1].behind) : places[k].behind;
        if (!places[k].force.isZero()) pieces.push_back({places[k].force, near, far});
    }
    return pieces;
}

} // namespace crampfit

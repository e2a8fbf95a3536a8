#include "forward/face_facets.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {

bool slides_on_faces(const Scene& scene) {
    const auto slides = [](const Body& body) { return body.contact.kind != Contact::Kind::bonded; };
    return !scene.cracks.empty() && std::ranges::any_of(scene.bodies, slides);
}

FaceFacets::FaceFacets(const Scene& scene, const Discretisation& body, const CrackFields& cracks)
    : specimen_(scene.specimen), body_(body), cracks_(cracks) {
    for (int k = 0; k < static_cast<int>(cracks.lines.size()); ++k) {
        const Vec2 start = cracks.lines[k].points[0];
        covered_.push_back({Covered{start}, Covered{start}});
        cover(k, true);
    }
}

void FaceFacets::take_in(const Box& changed) {
    for (std::size_t i = 0; i < facets_.size(); ++i) {
        Facet& facet = facets_[i];
        if (!changed.contains(facet.position)) continue;
        const int p = point_of(of_[i].crack, of_[i].left, facet.position);
        if (p < 0 || p == facet.point) continue;
        facet.point = p;
        facet.weight = body_.values_at(body_.points.cell[p], facet.position);
    }
    for (int k = 0; k < static_cast<int>(covered_.size()); ++k)
        for (const bool at_end : {false, true}) cover(k, at_end);
}

// Goes on from where the crack is covered to its tip.
void FaceFacets::cover(int crack, bool at_end) {
    const CrackLine& line = cracks_.lines[crack];
    Vec2& covered = covered_[crack][at_end].to;
    const int n = static_cast<int>(line.points.size());
    const auto vertex = [&](int from_tip) { return line.points[at_end ? n - 1 - from_tip : from_tip]; };
    const auto distance = [&](int piece) {
        const Vec2 along = vertex(piece + 1) - vertex(piece);
        return (vertex(piece) + nearest_on_segment(vertex(piece), vertex(piece + 1), covered) * along - covered).norm();
    };
    int piece = 0;
    for (int k = 1; k + 1 < n; ++k)
        if (distance(k) < distance(piece)) piece = k;
    const double step = facet_in_points * body_.layout.point_size().minCoeff();
    for (; piece >= 0; --piece) {
        const Vec2 way = vertex(piece) - covered;
        const double steps = way.norm() / step;
        const bool goes_on = piece == 0 && line.tip(at_end).inside && line.tip(at_end).grows;
        const int count = static_cast<int>(goes_on ? std::floor(steps) : std::ceil(steps - 1e-6));
        const Vec2 each = goes_on ? Vec2(step * way.normalized()) : Vec2(way / std::max(1, count));
        for (int k = 0; k < count; ++k, covered += each) {
            if (at_end) add_piece(crack, at_end, covered, covered + each);
            else add_piece(crack, at_end, covered + each, covered);
        }
    }
}

void FaceFacets::add_piece(int crack, bool at_end, const Vec2& from, const Vec2& to) {
    const Vec2 middle = 0.5 * (from + to), normal = left_of((to - from).normalized());
    for (const bool left : {true, false}) {
        const int p = point_of(crack, left, middle);
        int& last = covered_[crack][at_end].last[left];
        const int before = last, here = static_cast<int>(facets_.size());
        last = p < 0 ? -1 : here;
        if (p < 0) continue;
        if (covered_[crack][!at_end].last[left] < 0 && before < 0) covered_[crack][!at_end].last[left] = here;  // the first one
        next_.push_back({-1, -1});
        next_[here][!at_end] = before;
        if (before >= 0) next_[before][at_end] = here;
        facets_.push_back(
            {p, middle, (to - from).norm(), left ? Vec2(-normal) : normal, body_.values_at(body_.points.cell[p], middle)});
        of_.push_back({crack, left});
    }
}

// The nearest point on that side of a crack, near x on it; -1 where there is no wood.
int FaceFacets::point_of(int crack, bool left, const Vec2& x) const {
    if (body_.point_at(x) < 0 || !has_wood(specimen_, x)) return -1;
    int nearest = -1;
    bool nearest_is_apart = true;
    double least = 0.0;
    for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
            const int p = body_.point_at(x + body_.layout.point_size().cwiseProduct(Vec2(i, j)));
            if (p < 0) continue;
            const Vec2& middle = body_.points.position[p];
            if (cracks_.is_left(crack, middle) != left) continue;
            bool is_apart = false;  // by another crack
            for (int k = 0; k < static_cast<int>(cracks_.lines.size()); ++k)
                is_apart |= k != crack && cracks_.is_left(k, middle) != cracks_.is_left(k, x);
            const double distance = (middle - x).squaredNorm();
            if (nearest >= 0 && (is_apart > nearest_is_apart || (is_apart == nearest_is_apart && distance >= least))) continue;
            nearest = p;
            nearest_is_apart = is_apart;
            least = distance;
        }
    return nearest;
}

}  // namespace crampfit

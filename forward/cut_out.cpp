#include "forward/cut_out.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace crampfit {

namespace {

constexpr double a_little = 1e-6;  // of the displacements: closes nothing, and leaves ten digits of a difference

// What is cut out, its wood a part of the specimen's.
Scene scene_in(const Scene& whole, const Box& box) {
    Scene scene = whole;
    SpecimenPlan& specimen = scene.specimen;
    specimen.size = box.high - box.low;
    const auto move = [&](Shape& shape) {
        if (auto* circle = std::get_if<Circle>(&shape)) circle->centre -= box.low;
        else
            for (Vec2& x : std::get<Polygon>(shape).points) x -= box.low;
    };
    for (Shape& shape : specimen.cutouts) move(shape);
    for (Part& part : specimen.parts) move(part.shape);
    scene.cracks.clear();
    scene.bodies.clear();
    scene.edges.clear();
    return scene;
}

// The part of a crack that a place in a box can be nearest to: the crack runs through it.
std::vector<Vec2> part_about(const std::vector<Vec2>& points, const Box& box) {
    const Vec2 reach = Vec2::Constant((box.high - box.low).norm());
    const Box about{box.low - reach, box.high + reach};
    const auto counts = [&](std::size_t k) {
        return about.touches({points[k].cwiseMin(points[k + 1]), points[k].cwiseMax(points[k + 1])});
    };
    std::size_t first = 0, last = points.size() - 2;
    while (first < last && !counts(first)) ++first;
    while (last > first && !counts(last)) --last;
    return {points.begin() + static_cast<std::ptrdiff_t>(first), points.begin() + static_cast<std::ptrdiff_t>(last) + 2};
}

}  // namespace

std::optional<GridView::Wood> GridView::wood_about(const Vec2& x) const {
    const int found = body.point_at(x);
    if (found < 0) return std::nullopt;
    const Vec2& at = body.points.position[found];
    const bool is_same = (at - x).squaredNorm() <= 1e-18 * body.layout.cell.squaredNorm();
    if (is_same || cracks.is_left(crack, at) == cracks.is_left(crack, x))
        return Wood{body.points.cell[found], body.points.node[found]};
    const auto sliver = std::ranges::lower_bound(body.slivers, found, {}, &Sliver::point);
    if (sliver == body.slivers.end() || sliver->point != found) return std::nullopt;
    return Wood{body.points.cell[found], sliver->node};
}

std::vector<GridView::Wood> GridView::wood_beside(const Vec2& x, const Vec2& node) const {
    constexpr double more_than_any_distance = 1e3;  // what a cell is off the node counts before what a point is off x
    const bool left = cracks.is_left(crack, x);
    const double as_near = 1e-6 * body.layout.cell.minCoeff();
    std::vector<Wood> nearest;
    double least = INFINITY;
    body.for_cells_near(x, body.layout.cell.maxCoeff(), [&](int c) {
        const Vec2 low = body.layout.cell_corner(c), high = low + body.layout.cell;
        const double beyond = more_than_any_distance * (node.cwiseMax(low).cwiseMin(high) - node).norm();
        for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p) {
            const double distance = beyond + (body.points.position[p] - x).norm();
            if (distance > least + as_near || cracks.is_left(crack, body.points.position[p]) != left) continue;
            if (distance < least - as_near) nearest.clear();
            least = std::min(least, distance);
            nearest.push_back({c, body.points.node[p]});
        }
    });
    return nearest;
}

CutOutWood::CutOutWood(const Scene& whole, const MaterialMap& wood, const Box& place, const Vec2& width)
    : box(place), cell(width), scene(scene_in(whole, place)), materials(wood.part(place.low)),
      body(scene, materials, Layout::of(scene, width)) {
    // The sides that are not the specimen's own are held, and those of its own on which it is held or loaded, where there is wood
    // at them.
    const Vec2 size = whole.specimen.size, hair = 1e-6 * size;
    const auto hold = [&](Side side, int axis, bool high) {
        const double end = high ? body.layout.size()[axis] : 0.0;
        for (int p = 0; p < body.points.count(); ++p) {
            const Box domain = body.domain(p);
            if (std::abs((high ? domain.high : domain.low)[axis] - end) > hair[axis]) continue;
            scene.edges.push_back({"", side, {}, {0.0, 0.0}, {}, {}});
            return;
        }
    };
    const auto has_edge = [&](Side side) {
        return std::any_of(whole.edges.begin(), whole.edges.end(), [&](const Edge& edge) { return edge.side == side; });
    };
    if (box.low.x() > hair.x() || has_edge(Side::left)) hold(Side::left, 0, false);
    if (box.high.x() < size.x() - hair.x() || has_edge(Side::right)) hold(Side::right, 0, true);
    if (box.low.y() > hair.y() || has_edge(Side::bottom)) hold(Side::bottom, 1, false);
    if (box.high.y() < size.y() - hair.y() || has_edge(Side::top)) hold(Side::top, 1, true);
}

const std::vector<MaterialSlope>& CutOutWood::slopes_by(const std::vector<MaterialSlope>& numbers) {
    if (slopes_.empty()) slopes_ = MaterialSlope::of(numbers, body, box.low);
    return slopes_;
}

CutOut::CutOut(const Scene& whole, const Plan& plan, const std::vector<MaterialSlope>& numbers, std::shared_ptr<CutOutWood> wood)
    : whole_(whole), plan_(plan), numbers_(numbers), wood_(std::move(wood)), scene_(wood_->scene), cracked_(wood_->body) {}

std::optional<std::vector<Vec2>> CutOut::way_to(const CrackLine& line, int crack, bool at_end) const {
    const std::size_t known = points_.size();
    if (crack_ != crack || line.points.size() < known) return std::nullopt;
    const auto nth = [&](const std::vector<Vec2>& points, std::size_t k) {
        return at_end ? points[k] : points[points.size() - 1 - k];
    };
    for (std::size_t k = 0; k + 1 < known; ++k)
        if (nth(points_, k) != nth(line.points, k)) return std::nullopt;
    // A crack that goes straight on has its last point moved.
    const Vec2 before = nth(points_, known - 2), tip = nth(points_, known - 1), further = nth(line.points, known - 1);
    const Vec2 along = (tip - before).normalized(), step = further - tip;
    if (std::abs(cross(along, step)) > 1e-9 * (further - before).norm() || along.dot(step) < 0.0) return std::nullopt;
    std::vector<Vec2> way;
    if (further != tip) way.push_back(further);
    for (std::size_t k = known; k < line.points.size(); ++k) way.push_back(nth(line.points, k));
    if (!way.empty() && !(equilibrium_->cracks().lines[0].tip(at_end).inside && line.tip(at_end).inside)) return std::nullopt;
    return way;
}

bool CutOut::solve(const CrackLine& line, int crack, bool at_end, const GridView& from, bool solved_there) {
    if (const auto way = way_to(line, crack, at_end)) {
        for (const Vec2& to : *way) equilibrium_->grow(0, at_end, to - wood_->box.low);
    } else {
        scene_.cracks = {whole_.cracks[crack]};
        scene_.cracks[0].points = part_about(line.points, wood_->box);
        for (Vec2& x : scene_.cracks[0].points) x -= wood_->box.low;
        cracked_ = wood_->body;
        equilibrium_.emplace(scene_, plan_, wood_->materials, cracked_);
    }
    crack_ = crack;
    points_ = line.points;
    return take_over(from, solved_there);
}

// Holds the outline where the other grid has it and solves, or takes all from there.
bool CutOut::take_over(const GridView& from, bool solved_there) {
    taken_.clear();
    solved_there_ = solved_there;
    const Layout& layout = cracked_.layout;
    const CrackFields& cracks = equilibrium_->cracks();
    std::vector<bool> is_held(cracks.fields(), false);
    for (const Boundary::Held& h : equilibrium_->boundary().held) is_held[h.field] = true;
    std::vector<bool> unknown = is_held;
    // All else follows, but crack faces that begin closed would count as closed.
    for (const FieldPair& pair : cracks.pairs) unknown[pair.left] = unknown[pair.right] = true;
    if (solved_there) unknown.assign(cracks.fields(), true);
    const Vec2 shift = wood_->box.low - from.origin;
    const int nodes = layout.nodes_per_cell();
    std::vector<int> count(cracks.fields(), 0);
    std::vector<Hold> holds;
    // As the wood beside the node moves, on its side of the crack. All points around it count, so that a mirrored scene is held
    // alike; those of a node that is the same on both grids, and that no crack parts on either, all say the same.
    std::vector<bool> say_the_same(cracks.fields(), solved_there);
    if (solved_there) {
        for (const FieldPair& pair : cracks.pairs) say_the_same[pair.left] = say_the_same[pair.right] = false;
        for (const FieldPair& pair : from.cracks.pairs) {
            const Vec2 at = (from.body.layout.node_position(pair.node) - shift).cwiseQuotient(layout.cell);
            const int i = static_cast<int>(std::lround(at.x())), j = static_cast<int>(std::lround(at.y()));
            if (i >= 0 && j >= 0 && i <= layout.cells_x && j <= layout.cells_y) say_the_same[layout.node_index(i, j)] = false;
        }
    }
    const auto for_wood = [&](const auto& visit) {
        for (int p = 0; p < cracked_.points.count(); ++p)
            visit(cracked_.points.position[p], std::as_const(cracked_.points).node[p]);
        for (const Sliver& sliver : cracked_.slivers) visit(sliver.position, sliver.node);
    };
    const auto take = [&](auto&& find_wood) {
        for_wood([&](const Vec2& at, std::span<const int> fields) {
            for (const int field : fields.first(nodes)) {
                if (!unknown[field] || (say_the_same[field] && count[field] > 0)) continue;
                const Vec2 x = layout.node_position(cracks.node_of_field[field]) + shift;
                for (const GridView::Wood& other : find_wood(at, x)) {
                    holds.push_back({field, {}, from.body.values_at(other.cell, x)});
                    std::copy_n(other.fields.begin(), nodes, holds.back().from.begin());
                    ++count[field];
                }
            }
        });
        for (int field = 0; field < cracks.fields(); ++field) unknown[field] = unknown[field] && count[field] == 0;
    };
    take([&, last = Vec2(INFINITY, INFINITY),
          about = std::vector<GridView::Wood>{}](const Vec2& at, const Vec2&) mutable -> const std::vector<GridView::Wood>& {
        if (std::exchange(last, at) == at) return about;
        about.clear();
        if (const auto found = from.wood_about(at + shift)) about.push_back(*found);
        return about;
    });
    take([&](const Vec2& at, const Vec2& x) { return from.wood_beside(at + shift, x); });
    bool all_known = true;
    for_wood([&](const Vec2&, std::span<const int> fields) {
        for (const int field : fields.first(nodes)) all_known = all_known && !unknown[field];
    });
    if (!all_known) return false;
    std::vector<Vec2> displacement(cracks.fields(), Vec2::Zero());
    for (Hold& hold : holds) {
        for (int k = 0; k < nodes; ++k) {
            hold.weight[k] /= count[hold.field];
            displacement[hold.field] += hold.weight[k] * from.displacement[hold.from[k]];
        }
        if (solved_there || is_held[hold.field]) taken_.push_back(hold);
    }
    if (!solved_there) return equilibrium_->relax(displacement);
    equilibrium_->set_displacements(displacement, 0.0);
    return true;
}

std::vector<Vec2> CutOut::slope_by(const GridView& from, const std::vector<Vec2>& inner, double sign,
                                   std::vector<double>& by_number) {
    const std::vector<MaterialSlope>& numbers = wood_->slopes_by(numbers_);
    const Equilibrium::Slopes slopes = equilibrium_->slopes(numbers);
    for (std::size_t n = 0; n < numbers.size(); ++n) by_number[n] += sign * slopes.potential[n];
    std::vector<Vec2> pull = equilibrium_->out_of_balance_forces();
    for (Vec2& f : pull) f *= -1.0;
    if (!solved_there_ && !inner.empty()) {
        const Equilibrium::Motion yielding = equilibrium_->yield_to(inner);
        for (std::size_t n = 0; n < numbers.size(); ++n) by_number[n] -= sign * slopes.along(yielding, static_cast<int>(n));
        // What the yielding puts on the outline, by a little of it: all of it could close faces that stand open.
        const std::vector<Vec2> here = equilibrium_->displacements(), held_by = equilibrium_->out_of_balance_forces();
        const auto largest = [](const std::vector<Vec2>& of) {
            double most = 0.0;
            for (const Vec2& v : of) most = std::max(most, v.lpNorm<Eigen::Infinity>());
            return most;
        };
        const double way = largest(yielding.fields);
        const double little = way > 0.0 && largest(here) > 0.0 ? a_little * largest(here) / way : 1.0;
        std::vector<Vec2> beside = here;
        for (std::size_t f = 0; f < beside.size(); ++f) beside[f] += little * yielding.fields[f];
        equilibrium_->set_displacements(beside, 0.0);
        for (std::size_t f = 0; f < pull.size(); ++f)
            pull[f] += inner[f] + (equilibrium_->out_of_balance_forces()[f] - held_by[f]) / little;
        equilibrium_->set_displacements(here, 0.0);
    }
    std::vector<Vec2> slope(from.displacement.size(), Vec2::Zero());
    for (const Hold& hold : taken_)
        for (int k = 0; k < cracked_.layout.nodes_per_cell(); ++k) slope[hold.from[k]] += hold.weight[k] * pull[hold.field];
    return slope;
}

}  // namespace crampfit

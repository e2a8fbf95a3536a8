#include "forward/cut_out.hpp"

#include <cmath>

namespace crampfit {

namespace {

// What is cut out, its wood a part of the specimen's.
Scene scene_in(const Scene& whole, const Box& box, double cell) {
    Scene scene = whole;
    scene.model.cell = cell;
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

} // namespace

int GridView::point_beside(const Vec2& x) const {
    int nearest = -1;
    double least = INFINITY;
    const bool left = cracks.is_left(crack, x);
    body.for_cells_near(x, body.layout.cell.maxCoeff(), [&](int c) {
        for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p) {
            const double distance = (body.points.position[p] - x).squaredNorm();
            if (distance >= least || cracks.is_left(crack, body.points.position[p]) != left) continue;
            least = distance;
            nearest = p;
        }
    });
    return nearest;
}

CutOut::CutOut(const Scene& whole, const Plan& plan, const MaterialMap& wood, const std::vector<MaterialSlope>& numbers, const Box& place,
               double cell)
    : whole_(whole), plan_(plan), numbers_(numbers), box_(place), scene_(scene_in(whole, place, cell)), materials_(wood.part(place.low)),
      body_(scene_, materials_), cracked_(body_) {
    hold_outline(whole.specimen.size);
}

// The sides that are not the specimen's own, where there is wood at them.
void CutOut::hold_outline(const Vec2& size) {
    const Vec2 hair = 1e-6 * size;
    const auto hold = [&](Side side, int axis, bool high) {
        const double end = high ? body_.layout.size()[axis] : 0.0;
        for (int p = 0; p < body_.points.count(); ++p) {
            const Box domain = body_.domain(p);
            if (std::abs((high ? domain.high : domain.low)[axis] - end) > hair[axis]) continue;
            scene_.edges.push_back({"", side, {}, {0.0, 0.0}, {}, {}});
            return;
        }
    };
    if (box_.low.x() > hair.x()) hold(Side::left, 0, false);
    if (box_.high.x() < size.x() - hair.x()) hold(Side::right, 0, true);
    if (box_.low.y() > hair.y()) hold(Side::bottom, 1, false);
    if (box_.high.y() < size.y() - hair.y()) hold(Side::top, 1, true);
}

bool CutOut::solve(const CrackLine& line, int crack, const GridView& from) {
    scene_.cracks = {whole_.cracks[crack]};
    scene_.cracks[0].points = line.points;
    for (Vec2& x : scene_.cracks[0].points) x -= box_.low;
    cracked_ = body_;
    equilibrium_.emplace(scene_, plan_, materials_, cracked_);
    outline_.clear();
    const CrackFields& cracks = equilibrium_->cracks();
    std::vector<bool> is_held(cracks.fields(), false);
    for (const Boundary::Held& h : equilibrium_->boundary().held) is_held[h.field] = true;
    std::vector<bool> unknown = is_held;
    // All else follows, but crack faces that begin closed would count as closed.
    for (const FieldPair& pair : cracks.pairs) unknown[pair.left] = unknown[pair.right] = true;
    std::vector<Vec2> displacement(cracks.fields(), Vec2::Zero());
    const Vec2 shift = box_.low - from.origin;
    const int nodes = body_.layout.nodes_per_cell();
    for (int p = 0; p < cracked_.points.count(); ++p) {
        for (const int field : cracked_.points.node[p].first(nodes)) {
            if (!unknown[field]) continue;
            unknown[field] = false;  // once is enough
            // As the wood beside the node moves, on its side of the crack.
            const int other = from.point_beside(cracked_.points.position[p] + shift);
            if (other < 0) return false;
            const Vec2 x = body_.layout.node_position(cracks.node_of_field[field]) + shift;
            Hold hold{field, {}, from.body.values_at(from.body.points.cell[other], x)};
            for (int k = 0; k < nodes; ++k) {
                hold.from[k] = from.body.points.node[other][k];
                displacement[field] += hold.weight[k] * from.displacement[hold.from[k]];
            }
            if (is_held[field]) outline_.push_back(hold);
        }
    }
    return equilibrium_->relax(displacement);
}

std::vector<Vec2> CutOut::slope_by(const GridView& from, const std::vector<Vec2>& inner, double sign, std::vector<double>& by_number) {
    if (slopes_.empty())
        for (const MaterialSlope& number : numbers_) slopes_.emplace_back(number, body_, box_.low);
    const Equilibrium::Slopes slopes = equilibrium_->slopes(slopes_);
    const Equilibrium::Motion yielding = equilibrium_->yield_to(inner);
    for (std::size_t n = 0; n < slopes_.size(); ++n)
        by_number[n] += sign * (slopes.potential[n] - slopes.along(yielding, static_cast<int>(n)));
    std::vector<Vec2> pull = equilibrium_->out_of_balance_forces();
    equilibrium_->set_displacements(yielding.fields, 0.0);
    for (std::size_t f = 0; f < pull.size(); ++f) pull[f] = inner[f] + equilibrium_->out_of_balance_forces()[f] - pull[f];
    std::vector<Vec2> slope(from.displacement.size(), Vec2::Zero());
    for (const Hold& hold : outline_)
        for (int k = 0; k < body_.layout.nodes_per_cell(); ++k) slope[hold.from[k]] += hold.weight[k] * pull[hold.field];
    return slope;
}

} // namespace crampfit

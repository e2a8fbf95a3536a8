#include "forward/fine_tip.hpp"

#include "forward/deformation.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

namespace crampfit {

namespace {

// Half widths of the boxes, in cells of the grid that each is cut out of. What the held outlines take from the wood beyond leaves 1 % in
// the load that carries a crack across a boundary 30 : 1, half of that with 8 in place of 6; as much is left by cells of a quarter,
// where an eighth would leave a fourth of it (`VerificationFineTip`).
constexpr std::array<double, 2> half_widths{6.0, 4.0};

// Woods are told apart where stiffness differs by this factor between two cells that share a side.
constexpr double least_contrast = 2.0;

// In cells from the tip to such a side: all that is missed counts up to the first, nothing from the second on.
constexpr double near = 3.0, far = 4.0;

// A grid, or a part of one, with the displacements of its fields.
struct View {
    const Discretisation& body;
    const CrackFields& cracks;
    const std::vector<Vec2>& displacement;
    Vec2 origin;  // of its lower left corner in the specimen [m]
    int crack;    // its number there

    /// The point nearest to a place on the same side of the crack; -1: none near it is.
    int point_beside(const Vec2& x) const {
        int nearest = -1;
        double least = INFINITY;
        body.for_cells_near(x, body.layout.cell.maxCoeff(), [&](int c) {
            for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p) {
                const double distance = (body.points.position[p] - x).squaredNorm();
                if (distance >= least || cracks.is_left(crack, body.points.position[p]) != cracks.is_left(crack, x)) continue;
                least = distance;
                nearest = p;
            }
        });
        return nearest;
    }
};

// What part of the energy missed counts.
double share_that_counts(const Discretisation& body, const Vec2& tip) {
    const Layout& layout = body.layout;
    const auto has_wood = [&](int c) { return body.points.first_of_cell[c] < body.points.first_of_cell[c + 1]; };
    double nearest = far;
    body.for_cells_near(tip, (far + 1.0) * layout.cell.maxCoeff(), [&](int c) {
        const auto& here = body.points.stiffness[c];
        const auto compare = [&](int other, const Vec2& from, const Vec2& to) {
            if (!has_wood(c) || !has_wood(other)) return;
            const auto& there = body.points.stiffness[other];
            double contrast = 1.0;
            for (const int k : {0, 2}) contrast = std::max({contrast, here[k] / there[k], there[k] / here[k]});
            if (contrast < least_contrast) return;
            const Vec2 away = (from + nearest_on_segment(from, to, tip) * (to - from) - tip).cwiseQuotient(layout.cell);
            nearest = std::min(nearest, away.norm());
        };
        const Vec2 low = layout.cell_corner(c), high = low + layout.cell;
        if (c % layout.cells_x + 1 < layout.cells_x) compare(c + 1, {high.x(), low.y()}, high);
        if (c / layout.cells_x + 1 < layout.cells_y) compare(c + layout.cells_x, {low.x(), high.y()}, high);
    });
    return std::clamp((far - nearest) / (far - near), 0.0, 1.0);
}

// A box around a place, along grid lines, as far as there is grid.
Box box_around(const Layout& layout, const Vec2& x, double half_width) {
    const Vec2 middle = x.cwiseQuotient(layout.cell), all(layout.cells_x, layout.cells_y);
    const Vec2 low = (middle.array() - half_width).round().max(0.0), high = (middle.array() + half_width).round().min(all.array());
    return {low.cwiseProduct(layout.cell), high.cwiseProduct(layout.cell)};
}

// Whether nothing but the wood around it acts on a box of the specimen, and no crack but this one runs through it.
bool stands_alone(const Scene& scene, const CrackFields& cracks, int crack, const Box& box, const Vec2& size) {
    const Vec2 hair = 1e-6 * size;
    const bool meets[] = {box.high.y() > size.y() - hair.y(), box.low.y() < hair.y(), box.low.x() < hair.x(), box.high.x() > size.x() - hair.x()};
    for (const Edge& edge : scene.edges)
        if (meets[static_cast<int>(edge.side)]) return false;
    const Vec2 middle = 0.5 * (box.low + box.high);
    const double reach = 0.5 * (box.high - box.low).norm();
    for (const Body& rigid : scene.bodies)
        if (inside(rigid.shape, middle) || nearest_on_outline(rigid.shape, middle).distance < reach) return false;
    for (int k = 0; k < static_cast<int>(cracks.lines.size()); ++k) {
        const auto& points = cracks.lines[k].points;
        for (std::size_t i = 0; k != crack && i + 1 < points.size(); ++i)
            if (box.touches({points[i].cwiseMin(points[i + 1]), points[i].cwiseMax(points[i + 1])})) return false;
    }
    return true;
}

// What is cut out and the crack in a box of the specimen as a scene of their own; its wood is a part of the specimen's.
Scene scene_in(const Scene& whole, const CrackLine& line, int crack, const Box& box, double cell) {
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
    scene.cracks = {whole.cracks[crack]};
    scene.cracks[0].points = line.points;
    for (Vec2& x : scene.cracks[0].points) x -= box.low;
    scene.bodies.clear();
    scene.edges.clear();
    return scene;
}

// Holds the sides that are not the specimen's own.
const Scene& held(Scene& scene, const Discretisation& body, const Box& box, const Vec2& size) {
    const Vec2 hair = 1e-6 * size;
    const auto hold = [&](Side side, int axis, bool high) {
        const double end = high ? body.layout.size()[axis] : 0.0;
        for (int p = 0; p < body.points.count(); ++p) {
            const Box domain = body.domain(p);
            if (std::abs((high ? domain.high : domain.low)[axis] - end) > hair[axis]) continue;
            scene.edges.push_back({"", side, {}, {0.0, 0.0}, {}, {}});
            return;
        }
    };
    if (box.low.x() > hair.x()) hold(Side::left, 0, false);
    if (box.high.x() < size.x() - hair.x()) hold(Side::right, 0, true);
    if (box.low.y() > hair.y()) hold(Side::bottom, 1, false);
    if (box.high.y() < size.y() - hair.y()) hold(Side::top, 1, true);
    return scene;
}

// A box cut out of a grid, its outline held where that has it.
struct CutOut {
    Box box;                                     // in the specimen
    Scene scene;
    MaterialMap materials;
    Discretisation body;
    Equilibrium equilibrium;
    struct Hold {
        int field;
        std::array<int, most_nodes> from;        // fields of the other grid
        std::array<double, most_nodes> weight;
    };
    std::vector<Hold> outline;

    CutOut(const Scene& whole, const Plan& plan, const MaterialMap& wood, const CrackLine& line, int crack, const Box& place, double cell)
        : box(place), scene(scene_in(whole, line, crack, place, cell)), materials(wood.part(place.low)), body(scene, materials),
          equilibrium(held(scene, body, place, whole.specimen.size), plan, materials, body) {}

    bool solve(const View& from);
    std::vector<Vec2> slope_by(const View& from, const std::vector<Vec2>& inner, const std::vector<MaterialSlope>& numbers,
                               std::vector<double>& by_number);
    View view() const { return {body, equilibrium.cracks(), equilibrium.displacements(), box.low, 0}; }
};

bool CutOut::solve(const View& from) {
    const int fields = equilibrium.cracks().fields();
    std::vector<bool> is_held(fields, false);
    for (const Boundary::Held& h : equilibrium.boundary().held) is_held[h.field] = true;
    std::vector<Vec2> displacement(fields, Vec2::Zero());
    const Vec2 shift = box.low - from.origin;
    const int nodes = body.layout.nodes_per_cell();
    for (int p = 0; p < body.points.count(); ++p) {
        for (const int field : body.points.node[p].first(nodes)) {
            if (!is_held[field]) continue;
            is_held[field] = false;  // once is enough
            // As the wood beside the node moves, on its side of the crack.
            const int other = from.point_beside(body.points.position[p] + shift);
            if (other < 0) return false;
            const Vec2 x = body.layout.node_position(equilibrium.cracks().node_of_field[field]) + shift;
            outline.push_back({field, {}, from.body.values_at(from.body.points.cell[other], x)});
            Hold& hold = outline.back();
            for (int k = 0; k < nodes; ++k) {
                hold.from[k] = from.body.points.node[other][k];
                displacement[field] += hold.weight[k] * from.displacement[hold.from[k]];
            }
        }
    }
    return equilibrium.relax(displacement);
}

// Slope of the energy by the displacements of the other grid, with `inner` that of what is cut out of this one by its displacements. Adds
// the slopes by the numbers.
std::vector<Vec2> CutOut::slope_by(const View& from, const std::vector<Vec2>& inner, const std::vector<MaterialSlope>& numbers,
                                   std::vector<double>& by_number) {
    const Equilibrium::Slopes slopes = equilibrium.slopes(numbers);
    const Equilibrium::Motion yielding = equilibrium.yield_to(inner);
    for (std::size_t n = 0; n < numbers.size(); ++n)
        by_number[n] += slopes.potential[n] - slopes.along(yielding, static_cast<int>(n));
    std::vector<Vec2> pull = equilibrium.out_of_balance_forces();
    equilibrium.set_displacements(yielding.fields, 0.0);
    for (std::size_t f = 0; f < pull.size(); ++f) pull[f] = inner[f] + equilibrium.out_of_balance_forces()[f] - pull[f];
    std::vector<Vec2> slope(from.displacement.size(), Vec2::Zero());
    for (const Hold& hold : outline)
        for (int k = 0; k < body.layout.nodes_per_cell(); ++k) slope[hold.from[k]] += hold.weight[k] * pull[hold.field];
    return slope;
}

} // namespace

MissedEnergy energy_missed_at_tip(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                                  const Equilibrium& equilibrium, int crack, bool at_end, const std::vector<MaterialSlope>& numbers) {
    const CrackFields& cracks = equilibrium.cracks();
    const CrackLine& line = cracks.lines[crack];
    const Vec2 tip = line.tip(at_end).position, size = body.layout.size();
    const double share = share_that_counts(body, tip);
    const Box first = box_around(body.layout, tip, half_widths[0]);
    const double opening = opening_behind(cracks, crack, at_end, body.layout.cell.maxCoeff(), equilibrium.displacements())
                               .dot(left_of(line.direction_near(true, tip)));
    if (share == 0.0 || opening <= 0.0 || !stands_alone(scene, cracks, crack, first, size)) return {};

    // Small strain: of what is left when the turn of the box as a whole is taken off.
    Mat2 turn = Mat2::Identity();
    std::vector<Vec2> displacement = equilibrium.displacements();
    if (plan.rotates) {
        Mat2 mean = Mat2::Zero();
        int points = 0;
        body.for_cells_in({first.low + 0.5 * body.layout.cell, first.high - 0.5 * body.layout.cell}, [&](int c) {
            for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p, ++points)
                mean += gradient_at(body, p, displacement);
        });
        turn = Polar(mean / points).turn;
        for (std::size_t f = 0; f < displacement.size(); ++f) {
            const Vec2 x = body.layout.node_position(cracks.node_of_field[f]);
            displacement[f] = turn.transpose() * (x + displacement[f]) - x;
        }
    }
    Plan small = plan;
    small.rotates = small.friction = false;
    small.linear = true;

    // Down: each box with cells as they are and half as wide.
    std::vector<std::unique_ptr<CutOut>> coarse, fine;
    std::vector<View> views{{body, cracks, displacement, Vec2::Zero(), crack}};
    double cell = std::sqrt(body.layout.cell.prod());
    MissedEnergy missed;
    for (const double half_width : half_widths) {
        const View& from = views.back();
        Box box = box_around(from.body.layout, tip - from.origin, half_width);
        box = {box.low + from.origin, box.high + from.origin};
        coarse.push_back(std::make_unique<CutOut>(scene, small, materials, line, crack, box, cell));
        fine.push_back(std::make_unique<CutOut>(scene, small, materials, line, crack, box, 0.5 * cell));
        if (!coarse.back()->solve(from) || !fine.back()->solve(from)) return {};
        missed.energy += share * (fine.back()->equilibrium.potential() - coarse.back()->equilibrium.potential());
        views.push_back(fine.back()->view());
        cell *= 0.5;
    }
    if (numbers.empty()) return missed;

    // And up: the slopes.
    missed.by_number.assign(numbers.size(), 0.0);
    std::vector<Vec2> slope(views.back().displacement.size(), Vec2::Zero());
    for (std::size_t k = fine.size(); k-- > 0;) {
        const auto slope_of = [&](CutOut& cut, const std::vector<Vec2>& inner, double sign) {
            std::vector<MaterialSlope> here;
            for (const MaterialSlope& number : numbers) here.emplace_back(number, cut.body, cut.box.low);
            std::vector<double> by_number(numbers.size(), 0.0);
            const std::vector<Vec2> found = cut.slope_by(views[k], inner, here, by_number);
            for (std::size_t n = 0; n < by_number.size(); ++n) missed.by_number[n] += sign * share * by_number[n];
            return found;
        };
        slope = slope_of(*fine[k], slope, 1.0);
        const std::vector<Vec2> still(coarse[k]->equilibrium.displacements().size(), Vec2::Zero());
        const std::vector<Vec2> less = slope_of(*coarse[k], still, -1.0);
        for (std::size_t f = 0; f < slope.size(); ++f) slope[f] -= less[f];
    }
    for (const Vec2& s : slope) missed.by_displacement.push_back(share * turn * s);
    return missed;
}

} // namespace crampfit

#include "forward/fine_tip.hpp"

#include "forward/deformation.hpp"
#include "forward/side_by_side.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <span>

namespace crampfit {

namespace {

// Half widths of the boxes beside the tip's way, in cells of the grid that each is cut out of: of the outermost the first for
// which there is room among bodies and other cracks, and of those within it. The first, and two within it, are for ways of which
// an end lies within `close_by` cells of a boundary between woods as unlike as `strong_contrast`. Over 0.2 mm that end at a
// boundary 30 : 1, wherever that lies in a cell, the energy released is off by 1.5 % with cells of 0.1 mm and 2.0 % with 0.2 mm
// (root of the mean square, `VerificationFineTip`), and by 1.3 and 3.4 % with the boxes for elsewhere: outlines that are held
// take from the wood beyond, and where the tip passes the boundary within a cell, that gives up the energy of both woods evenly.
constexpr std::array<double, 4> outermost_half_widths{8.0, 6.0, 4.5, 3.0};
constexpr std::array<double, 2> half_widths_close_by{6.0, 4.0};
constexpr std::array<double, 1> half_widths_elsewhere{4.0};
constexpr double close_by = 0.5 + 1e-6;  // half a cell too

// Boxes begin and end at every so many of these cells, so that those of neighbouring places are the same more often.
constexpr std::array<double, 3> pitches{2.0, 2.0, 4.0};

// As many cut-outs are kept as two sets of boxes take, for the ends of an advance, and as many again for another tip.
constexpr std::size_t most_kept = 24;

// Woods are told apart where stiffness differs by this factor between two cells that share a side.
constexpr double least_contrast = 2.0, strong_contrast = 4.0;

// In cells from the way to such a side: all that is missed counts up to the first, nothing from the second on.
constexpr double near = 3.0, far = 4.0;

// Finer cells about a tip hold less energy under the same outline, or little more where they average woods otherwise. Where a
// crack has turned sharply far more, or less than half, says that both do not see it alike. These bounds are a judgement: in the
// paper's scenes sound boxes hold 5 % more to 25 % less. About a straight crack that has just left wood 38 times as stiff they
// hold as little as two fifths, and rightly so.
constexpr double most_of_coarse = 1.1, least_of_coarse = 0.5;
// About straight cracks nothing sound comes near these.
constexpr double far_above_coarse = 1.5, far_below_coarse = 0.2;
constexpr double least_sharp_turn = 0.5;  // [rad]: from cell to cell a crack turns by 45 degrees

// Between two straight lines that do not cross [m].
double distance_between(const std::array<Vec2, 2>& a, const std::array<Vec2, 2>& b) {
    double least = INFINITY;
    for (int k = 0; k < 2; ++k) {
        least = std::min(least, (b[0] + nearest_on_segment(b[0], b[1], a[k]) * (b[1] - b[0]) - a[k]).norm());
        least = std::min(least, (a[0] + nearest_on_segment(a[0], a[1], b[k]) * (a[1] - a[0]) - b[k]).norm());
    }
    return least;
}

bool turns_sharply(const CrackLine& line, const Box& box) {
    for (std::size_t k = 1; k + 1 < line.points.size(); ++k) {
        const Vec2 before = (line.points[k] - line.points[k - 1]).normalized();
        const Vec2 after = (line.points[k + 1] - line.points[k]).normalized();
        if (box.contains(line.points[k]) && before.dot(after) < std::cos(least_sharp_turn)) return true;
    }
    return false;
}

// How far a way, and its ends alone, are from sharp boundaries, in cells; `far` where they are as far or farther.
struct Nearest {
    double way = far, ends = far;
};

Nearest nearest_boundary(const Discretisation& body, const Vec2& from, const Vec2& to) {
    const Layout& layout = body.layout;
    const auto in_cells = [&](const Vec2& a, const Vec2& b) {
        return std::array<Vec2, 2>{a.cwiseQuotient(layout.cell), b.cwiseQuotient(layout.cell)};
    };
    const auto has_wood = [&](int c) { return body.points.first_of_cell[c] < body.points.first_of_cell[c + 1]; };
    Nearest nearest;
    const Vec2 reach = (far + 1.0) * layout.cell;
    body.for_cells_in({from.cwiseMin(to) - reach, from.cwiseMax(to) + reach}, [&](int c) {
        const auto& here = body.points.stiffness[c];
        const auto compare = [&](int other, const Vec2& side_from, const Vec2& side_to) {
            if (!has_wood(c) || !has_wood(other)) return;
            const auto& there = body.points.stiffness[other];
            double contrast = 1.0;
            for (const int k : {0, 2}) contrast = std::max({contrast, here[k] / there[k], there[k] / here[k]});
            // A way that crosses the side ends within `near` of it.
            if (contrast < least_contrast) return;
            const auto side = in_cells(side_from, side_to);
            nearest.way = std::min(nearest.way, distance_between(in_cells(from, to), side));
            for (const Vec2& end : in_cells(from, to))
                if (contrast >= strong_contrast)
                    nearest.ends = std::min(
                        nearest.ends, (side[0] + nearest_on_segment(side[0], side[1], end) * (side[1] - side[0]) - end).norm());
        };
        const Vec2 low = layout.cell_corner(c), high = low + layout.cell;
        if (c % layout.cells_x + 1 < layout.cells_x) compare(c + 1, {high.x(), low.y()}, high);
        if (c / layout.cells_x + 1 < layout.cells_y) compare(c + layout.cells_x, {low.x(), high.y()}, high);
    });
    return nearest;
}

// A box around a way, along the nearest lines of the grid, as far as that goes. Of two as near the one outside, and lines are
// counted from the side of the specimen that they are on, so that a mirrored scene has the same.
Box box_around(const Box& way, double half_width, double pitch, const Vec2& cell, const Vec2& size, const Box& within) {
    constexpr double hair = 1e-6;
    const auto lines = [&](const Eigen::Array2d& from) { return pitch * ((from - half_width) / pitch - 0.5 - hair).ceil(); };
    const Eigen::Array2d cells = size.cwiseQuotient(cell).array().round();
    const Eigen::Array2d low = lines(way.low.cwiseQuotient(cell).array());
    const Eigen::Array2d high = cells - lines(cells - way.high.cwiseQuotient(cell).array());
    return {(cell.array() * low).matrix().cwiseMax(within.low), (cell.array() * high).matrix().cwiseMin(within.high)};
}

// Whether no body acts on a box inside, and no crack but this one parts a node of it, or is to.
bool stands_alone(const Scene& scene, const Layout& layout, const CrackFields& cracks, int crack, const Box& box,
                  std::span<const TipWay> others) {
    constexpr double hair = 1e-6;
    constexpr double margin = 2.0;  // of ways [cells]: where a crack ends on another one nodes are parted ahead of it
    for (const Body& rigid : scene.bodies) {
        const auto* circle = std::get_if<Circle>(&rigid.shape);
        if (!box.touches(bounds(rigid.shape))) continue;
        if (!circle || (circle->centre.cwiseMax(box.low).cwiseMin(box.high) - circle->centre).norm() <= circle->radius)
            return false;
    }
    const auto about = [&](double cells) { return Box{box.low - cells * layout.cell, box.high + cells * layout.cell}; };
    const Box nodes = about(hair), ways = about(margin + hair);
    return std::ranges::none_of(
               cracks.pairs,
               [&](const FieldPair& pair) { return pair.crack != crack && nodes.contains(layout.node_position(pair.node)); }) &&
           std::ranges::none_of(others, [&](const TipWay& way) {
               return way.crack != crack && ways.touches({way.from.cwiseMin(way.to), way.from.cwiseMax(way.to)});
           });
}

// Whether a body, where it has come to, presses on the wood in a box. Beside the outline, which is held, it may: within a cell.
bool is_pressed(const Scene& scene, const Discretisation& body, const Box& box, const Equilibrium& equilibrium, bool may_follow) {
    const Boundary& boundary = equilibrium.boundary();
    const double beside = 0.5 * body.layout.point_size().maxCoeff();  // from a point to its face
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        const int driver = boundary.first_body() + static_cast<int>(b);
        Vec2 gone = boundary.travel(driver, equilibrium.time());
        if (may_follow) gone += equilibrium.contacts().moved[driver];
        const Shape& shape = scene.bodies[b].shape;
        const Box about{bounds(shape).low.array() - beside, bounds(shape).high.array() + beside};
        bool pressed = false;
        body.for_cells_in({box.low + 1.5 * body.layout.cell, box.high - 1.5 * body.layout.cell}, [&](int c) {
            for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1] && !pressed; ++p) {
                Vec2 x = body.points.position[p] - gone;
                for (int k = 0; k < body.layout.nodes_per_cell(); ++k)
                    x += body.weights[body.points.slot[p]].value[k] * equilibrium.displacements()[body.points.node[p][k]];
                pressed = about.contains(x) && (inside(shape, x) || nearest_on_outline(shape, x).distance < beside);
            }
        });
        if (pressed) return true;
    }
    return false;
}

// Whether a crack stands open behind its tip, and its faces touch nowhere in a box of the specimen: what is cut out is solved as
// linear.
bool is_open(const GridView& grid, bool at_end, const Box& box, bool rotates) {
    const CrackTip& tip = grid.cracks.lines[grid.crack].tip(at_end);
    const Mat2 turn = rotates ? turn_about(grid.body, tip, grid.displacement) : Mat2(Mat2::Identity());
    const Vec2 opening = opening_behind(grid.body, grid.cracks, grid.crack, at_end, grid.displacement);
    return opening.dot(turn * left_of(grid.cracks.lines[grid.crack].direction_near(true, tip.position))) > 0.0 &&
           std::ranges::none_of(grid.cracks.pairs, [&](const FieldPair& pair) {
               return pair.crack == grid.crack && pair.freed >= 1.0 &&
                      box.contains(grid.origin + grid.body.layout.node_position(pair.node)) &&
                      (grid.displacement[pair.left] - grid.displacement[pair.right]).dot(turn * pair.normal) < 0.0;
           });
}

GridView view_of(const Discretisation& body, const Equilibrium& equilibrium, int crack) {
    return {body, equilibrium.cracks(), equilibrium.displacements(), Vec2::Zero(), crack};
}

// The turn of a box as a whole, taken off the displacements: what is left is small.
Mat2 take_off_turn(const Mat2& gradient, const Layout& layout, const CrackFields& cracks, std::vector<Vec2>& displacement) {
    const Mat2 turn = Polar(gradient).turn;
    for (std::size_t f = 0; f < displacement.size(); ++f) {
        const Vec2 x = layout.node_position(cracks.node_of_field[f]);
        displacement[f] = turn.transpose() * (x + displacement[f]) - x;
    }
    return turn;
}

// Adds the slope by the displacements of something whose slope by the turn of the box's mean gradient is `moment`.
void add_slope_of_turn(const Discretisation& body, const Box& box, const Mat2& gradient, double moment,
                       std::vector<Vec2>& slope) {
    // The turn's angle is that of (c, w) in `Polar`.
    const double c = 2.0 + gradient.trace(), w = gradient(1, 0) - gradient(0, 1);
    int points = 0;
    body.for_points_in(box, [&](int) { ++points; });
    const Vec2 by = moment / (points * (c * c + w * w)) * Vec2(c, w);
    body.for_points_in(box, [&](int p) {
        const CellWeights& weights = body.weights[body.points.slot[p]];
        const auto node = body.points.node[p];
        for (std::size_t k = 0; k < node.size(); ++k) {
            const double x = weights.slope_x[k], y = weights.slope_y[k];
            slope[node[k]] += Vec2(-by[0] * y - by[1] * x, by[0] * x - by[1] * y);
        }
    });
}

}  // namespace

bool TipBoxes::hold(const Vec2& tip, const Vec2& cell) const {
    const double half = 0.5 * std::ldexp(half_widths_elsewhere.back(), 1 - static_cast<int>(boxes.size()));
    const Vec2 depth = half * cell;
    return Box{boxes.back().low + depth, boxes.back().high - depth}.contains(tip);
}

FineTip::FineTip(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                 const std::vector<MaterialSlope>& numbers, bool side_by_side)
    : scene_(scene), materials_(materials), body_(body), numbers_(numbers), rotates_(plan.rotates), side_by_side_(side_by_side),
      small_(plan) {
    small_.rotates = small_.friction = false;
    small_.linear = true;
}

std::optional<TipBoxes> FineTip::about(const CrackFields& cracks, const TipWay& tip, std::span<const TipWay> others) const {
    const auto& [crack, from, to] = tip;
    const Nearest nearest = nearest_boundary(body_, from, to);
    if (nearest.way >= far) return std::nullopt;
    const bool is_close = nearest.ends <= close_by;
    std::span<const double> inner = half_widths_elsewhere;
    if (is_close) inner = half_widths_close_by;
    const Vec2 size = body_.layout.size();
    const Box way{from.cwiseMin(to), from.cwiseMax(to)};
    Vec2 cell = body_.layout.cell;
    for (std::size_t k = is_close ? 0 : 1; k < outermost_half_widths.size(); ++k) {
        const Box outermost = box_around(way, outermost_half_widths[k], pitches[0], cell, size, {Vec2::Zero(), size});
        if (!stands_alone(scene_, body_.layout, cracks, crack, outermost, others)) continue;
        TipBoxes found{{outermost}, std::min(1.0, (far - nearest.way) / (far - near))};
        for (const double half_width : inner)
            found.boxes.push_back(
                box_around(way, half_width, pitches[found.boxes.size()], cell *= 0.5, size, found.boxes.back()));
        return found;
    }
    return std::nullopt;
}

// The one that has been solved with this crack, or one from whose crack it goes on, but for one that is in use: where there is
// little room two boxes may be the same.
std::shared_ptr<CutOut> FineTip::cut(const Box& box, const Vec2& cell, const CrackLine& line, int crack, bool at_end,
                                     const CutOut* in_use, const Woods& made) {
    auto found = kept_.end();
    std::shared_ptr<CutOutWood> wood;
    for (const std::shared_ptr<CutOutWood>& one : made)
        if (one->is(box, cell)) wood = one;
    for (auto one = kept_.begin(); one != kept_.end(); ++one) {
        if (!(*one)->wood()->is(box, cell)) continue;
        wood = (*one)->wood();
        if (one->get() == in_use) continue;
        const auto way = (*one)->way_to(line, crack, at_end);
        if (!way || (found != kept_.end() && !way->empty())) continue;
        found = one;
        if (way->empty()) break;
    }
    if (found == kept_.end()) {
        if (!wood) wood = std::make_shared<CutOutWood>(scene_, materials_, box, cell);
        if (kept_.size() == most_kept) kept_.pop_back();
        kept_.push_front(std::make_shared<CutOut>(scene_, small_, numbers_, std::move(wood)));
    } else {
        std::rotate(kept_.begin(), found, found + 1);
    }
    return kept_.front();
}

// The wood of boxes that is not kept.
FineTip::Woods FineTip::make_woods(std::span<const TipBoxes* const> places) const {
    std::vector<std::pair<Box, Vec2>> wanted;
    const auto want = [&](const Box& box, const Vec2& cell) {
        const auto is_kept = [&](const std::shared_ptr<CutOut>& one) { return one->wood()->is(box, cell); };
        const auto is_wanted = [&](const auto& one) {
            return one.first.low == box.low && one.first.high == box.high && one.second == cell;
        };
        if (std::ranges::none_of(kept_, is_kept) && std::ranges::none_of(wanted, is_wanted)) wanted.emplace_back(box, cell);
    };
    for (const TipBoxes* place : places) {
        Vec2 cell = body_.layout.cell;
        for (const Box& box : place->boxes) {
            want(box, 0.5 * cell);  // most work first
            want(box, cell);
            cell *= 0.5;
        }
    }
    Woods made(wanted.size());
    do_side_by_side(side_by_side_, made.size(), [&](std::size_t k) {
        made[k] = std::make_shared<CutOutWood>(scene_, materials_, wanted[k].first, wanted[k].second);
    });
    return made;
}

// Whether the grid misses something there.
bool FineTip::counts(const TipPlace& place, const Equilibrium& equilibrium) const {
    const Box& outermost = place.boxes.boxes[0];
    return is_open(view_of(body_, equilibrium, place.crack), place.at_end, outermost, rotates_) &&
           stands_alone(scene_, body_.layout, equilibrium.cracks(), place.crack, outermost, {}) &&
           !is_pressed(scene_, body_, outermost, equilibrium, small_.free_bodies);
}

// Each box with cells as they are and half as wide.
FineTip::Parts FineTip::parts_of(const TipPlace& place, const CrackLine& line, const Woods& made) {
    const auto& [about, crack, at_end] = place;
    Parts parts;
    Vec2 cell = body_.layout.cell;
    for (const Box& box : about.boxes) {
        for (std::vector<std::shared_ptr<CutOut>>* of : {&parts.coarse, &parts.fine}) {
            const Vec2 width = of == &parts.fine ? Vec2(0.5 * cell) : cell;
            of->push_back(cut(box, width, line, crack, at_end, parts.fine.empty() ? nullptr : parts.fine.back().get(), made));
        }
        cell *= 0.5;
    }
    return parts;
}

std::vector<MissedEnergy> FineTip::missed(const std::vector<TipPlace>& places, const Equilibrium& equilibrium, bool with_slopes) {
    std::vector<const TipBoxes*> counted;
    for (const TipPlace& place : places)
        if (counts(place, equilibrium)) counted.push_back(&place.boxes);
    const Woods made = make_woods(counted);
    std::vector<Parts> parts;
    std::set<const CutOutWood*> woods;
    std::size_t count = 0;
    for (const TipPlace& place : places) {
        std::set<const CutOutWood*> own;
        const bool is_counted = std::ranges::find(counted, &place.boxes) != counted.end();
        parts.push_back(is_counted ? parts_of(place, equilibrium.cracks().lines[place.crack], made) : Parts());
        for (const auto* of : {&parts.back().coarse, &parts.back().fine})
            for (const auto& part : *of) own.insert(part->wood().get());
        count += own.size();
        woods.merge(own);
    }
    std::vector<MissedEnergy> found(places.size());
    do_side_by_side(side_by_side_ && woods.size() == count, places.size(), [&](std::size_t k) {
        if (!parts[k].fine.empty()) found[k] = missed(places[k], parts[k], equilibrium, with_slopes);
    });
    return found;
}

FineTip::Ahead FineTip::ahead(const CrackFields& cracks, int crack, bool at_end, const std::vector<Vec2>& displacement,
                              const std::vector<double>& ways, const Box& box) {
    CrackLine line = cracks.lines[crack];
    CrackTip& tip = line.tip(at_end);
    const Vec2 start = tip.position;
    const auto boxes = about(cracks, {crack, start, start + ways.back() * tip.direction});
    if (!boxes) return {};
    const Vec2& cell = body_.layout.cell;
    const Box within{Vec2::Zero(), body_.layout.size()}, &outermost = boxes->boxes[0];
    Box around = box_around(box, 0.0, pitches[0], cell, within.high, within);
    around = {around.low.cwiseMin((outermost.low - cell).cwiseMax(within.low)),
              around.high.cwiseMax((outermost.high + cell).cwiseMin(within.high))};
    if (!stands_alone(scene_, body_.layout, cracks, crack, around, {})) return {};
    std::vector<Vec2> turned_back = displacement;
    if (rotates_) take_off_turn(mean_gradient(body_, around, displacement), body_.layout, cracks, turned_back);

    CutOut at_rest(scene_, small_, numbers_, std::make_shared<CutOutWood>(scene_, materials_, around, cell));
    Ahead found{boxes->share, {}};
    TipBoxes all_of_it = *boxes;
    all_of_it.share = 1.0;
    const TipPlace place{all_of_it, crack, at_end};
    for (const double way : ways) {
        tip.position = start + way * tip.direction;
        if (found.potential.size() == 1) line.points.insert(at_end ? line.points.end() : line.points.begin(), tip.position);
        (at_end ? line.points.back() : line.points.front()) = tip.position;
        if (!at_rest.solve(line, crack, at_end, {body_, cracks, turned_back, Vec2::Zero(), crack}, false)) return {};
        if (!is_open(at_rest.view(), at_end, outermost, false)) return {};
        std::vector<GridView> views{at_rest.view()};
        const auto missed = go_down(place, parts_of(place, line, {}), line, true, views);
        if (!missed) return {};
        found.potential.push_back(at_rest.potential() + *missed);
    }
    return found;
}

// What is missed in each of the boxes, which are seen from each other in `views` from the grid on; none where they do not all see
// the crack alike. `at_rest`: the grid is in equilibrium.
std::optional<double> FineTip::go_down(const TipPlace& tip, const Parts& parts, const CrackLine& line, bool at_rest,
                                       std::vector<GridView>& views) const {
    const auto& [place, crack, at_end] = tip;
    const auto& [coarse, fine] = parts;
    double missed = 0.0;
    for (std::size_t k = 0; k < fine.size(); ++k) {
        std::array<bool, 2> good{};
        do_side_by_side(side_by_side_, 2, [&](std::size_t other) {
            good[other] = other ? coarse[k]->solve(line, crack, at_end, views[k], at_rest || k > 0)
                                : fine[k]->solve(line, crack, at_end, views[k], false);
        });
        if (!good[0] || !good[1]) return std::nullopt;
        const double held = fine[k]->potential(), of = coarse[k]->potential();
        const auto within = [&](double least, double most) { return held >= least * of && held <= most * of; };
        if (!within(far_below_coarse, far_above_coarse)) return std::nullopt;
        if (!within(least_of_coarse, most_of_coarse) && turns_sharply(line, place.boxes[k])) return std::nullopt;
        missed += place.share * (held - of);
        views.push_back(fine[k]->view());
    }
    return missed;
}

MissedEnergy FineTip::missed(const TipPlace& tip, const Parts& parts, const Equilibrium& equilibrium, bool with_slopes) const {
    const auto& [place, crack, at_end] = tip;
    const CrackFields& cracks = equilibrium.cracks();
    const CrackLine& line = cracks.lines[crack];
    // Small strain: of what is left when the turn of the box as a whole is taken off.
    Mat2 gradient = Mat2::Zero(), turn = Mat2::Identity();
    std::vector<Vec2> displacement = equilibrium.displacements();
    if (rotates_) {
        gradient = mean_gradient(body_, place.boxes[0], displacement);
        turn = take_off_turn(gradient, body_.layout, cracks, displacement);
    }

    std::vector<GridView> views{{body_, cracks, displacement, Vec2::Zero(), crack}};
    // Without the turn of its tip the wood of a scene that rotates is not quite in equilibrium.
    const auto energy = go_down(tip, parts, line, !rotates_, views);
    if (!energy) return {};
    MissedEnergy missed{*energy, {}, {}};
    if (!with_slopes) return missed;

    // And up: the slopes.
    const auto& [coarse, fine] = parts;
    missed.by_number.assign(numbers_.size(), 0.0);
    std::vector<Vec2> slope;  // of the innermost nothing is cut out
    for (std::size_t k = fine.size(); k-- > 0;) {
        std::vector<Vec2> less;
        std::vector<double> less_by_number(numbers_.size(), 0.0);
        do_side_by_side(side_by_side_, 2, [&](std::size_t other) {
            if (other) less = coarse[k]->slope_by(views[k], {}, -place.share, less_by_number);
            else slope = fine[k]->slope_by(views[k], slope, place.share, missed.by_number);
        });
        for (std::size_t f = 0; f < slope.size(); ++f) slope[f] -= less[f];
        for (std::size_t n = 0; n < numbers_.size(); ++n) missed.by_number[n] += less_by_number[n];
    }
    double moment = 0.0;
    for (std::size_t f = 0; f < slope.size(); ++f) {
        moment += cross(slope[f], body_.layout.node_position(cracks.node_of_field[f]) + displacement[f]);
        slope[f] = place.share * turn * slope[f];
    }
    if (rotates_) add_slope_of_turn(body_, place.boxes[0], gradient, place.share * moment, slope);
    missed.by_displacement = std::move(slope);
    return missed;
}

}  // namespace crampfit

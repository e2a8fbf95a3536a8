#include "forward/cracks.hpp"

#include "datasets/error.hpp"
#include "forward/near_tip_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace crampfit {

namespace {

// Compliance of the pair of fields one cell behind the tip, times E' and the thickness. Freeing it releases G h = F^2 c / 2, and
// its opening F c would be that of the near-tip field there, 8 K / E' sqrt(h / (2 pi)), so that c E' = 16 / pi = 5.09; the grid,
// which is stiffer than that field, has 4.1 to 4.3 at nu = 0 to 0.33 and 3.7 at 0.45 (`UnitTies.EnergyGoesLinearlyWithTheTip`).
constexpr double pair_compliance_of_hats = 4.2;
// On B-splines a pair opens twice as far. From where a crack under a slow load begins to grow, with its tip in quarters of a
// cell: at 0.94 to 1.05 of its toughness (`VerificationSplineCrack.BeginsToGrowAtItsToughness`); with that of hats at 0.5 to 1.7.
constexpr double pair_compliance_of_splines = 8.5;

// Half way between two rows the masses alone, 1 : 7 on either side, would leave both pairs together 0.875 of the tie: 7 % less
// than what lets the energy go evenly with the tip (`UnitTies`).
constexpr double sharing_exponent = 0.92;

// A pair is half free when the tip has passed its node by this part of a cell: the cells at the tip are stiffer than the near-tip
// field, so that the crack of a grid ends behind the tip. Hats: from how the energy of a plate with an edge crack under mode I
// converges, which is where the error of the first power of the cell is this shift alone: with the tip anywhere in a cell and the
// crack on a line of the grid or half way between two, what is left of the shift at nu = 0, 0.33 and 0.45 is -0.005, +0.01 and
// +0.02, and -0.05, -0.02 and -0.02 cells (`VerificationEnergy.TheCrackOfAGridIsAsLongAsDrawn`). B-splines: from G of centre
// and edge cracks of five and ten cells.
constexpr double tip_lag_of_hats = 0.29;
// Askew to the grid it is less: by so much at 45 degrees, where G of centre cracks of ten cells, with all of that lag, is 0.65 %
// low.
constexpr double less_lag_askew = 0.06;
constexpr double tip_lag_of_splines = 0.48;

double tip_lag(const Vec2& direction, const Layout& layout) {
    const double sine = 2.0 * direction.x() * direction.y();  // of twice the angle to the grid
    return layout.degree == 1 ? tip_lag_of_hats - less_lag_askew * sine * sine : tip_lag_of_splines;
}

// A tip that comes nearer to another crack than this part of a cell has met it.
constexpr double meeting_distance = 0.5;

// Cracks that meet tip at tip at less than this angle become one; else one runs into the other's face.
constexpr double least_sine_of_a_junction = 0.5;

// How far ahead of where a crack ends, at a hole or on another crack, a node's support can still be cut by it, in cells.
constexpr double reach_of_an_end = 1.5;

// Masks are kept in eight bits.
constexpr int most_cracks = 8;

// Slopes to the grid, in cells, up to which a tip frees pairs by columns alone and from which on by places alone. What a tip in
// one wood gives up over two cells is evener by columns up to the first, and by places from the second on; in between the one law
// goes over into the other, lest a tip that turns frees pairs at once. Chosen by that.
constexpr double slope_of_columns = 0.5;
constexpr double slope_of_places = 0.7;

// How a tip that goes so passes nodes: by columns, or by rows if it goes through more of these, and by places along its way.
struct Passing {
    Passing(const Vec2& direction, const Vec2& cell) {
        const Vec2 in_cells = direction.cwiseQuotient(cell).cwiseAbs();
        axis = in_cells.x() >= in_cells.y() ? 0 : 1;
        const double slope = in_cells[1 - axis] / in_cells[axis];
        by_columns = std::clamp((slope_of_places - slope) / (slope_of_places - slope_of_columns), 0.0, 1.0);
        way = std::lerp(direction.cwiseProduct(cell).lpNorm<1>(), 1.0 / in_cells[axis], by_columns);
    }

    double ahead(const Vec2& arm, const Vec2& direction) const {
        return std::lerp(arm.dot(direction), arm[axis] / direction[axis], by_columns);
    }

    int axis;
    double by_columns;  // share of that law
    double way;         // on which a pair is freed [m]
};

// Share freed of what no tip comes to, below any share from which on a pair is there.
constexpr double not_begun = -1.0;

double length_inside(const std::vector<Vec2>& points, const Box& box) {
    double length = 0.0;
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
        const Vec2 along = points[k + 1] - points[k];
        const double whole = along.norm();
        const Vec2 direction = along / whole;
        const auto leave = exit_distance(points[k], direction, box);
        if (!leave) continue;
        const auto enter = exit_distance(points[k + 1], -direction, box);
        if (!enter) continue;
        length += std::max(0.0, std::min(whole, *leave) + std::min(whole, *enter) - whole);
    }
    return length;
}

// Told by the box around a segment: it comes no nearer to x than this. Of a long crack few segments are left by it.
bool lies_beyond(double distance, const Vec2& from, const Vec2& to, const Vec2& x) {
    return (from.cwiseMin(to) - x).maxCoeff() > distance || (x - from.cwiseMax(to)).maxCoeff() > distance;
}

}  // namespace

double share_freed(const Vec2& node, const CrackTip& tip, const Layout& layout) {
    const Passing passing(tip.direction, layout.cell);
    const double lag = tip_lag(tip.direction, layout) * tip.direction.cwiseProduct(layout.cell).norm();
    return 0.5 - (passing.ahead(node - tip.position, tip.direction) + lag) / passing.way;
}

double way_past_a_node(const Vec2& direction, const Vec2& cell) { return Passing(direction, cell).way; }

double tie_share(double left, double right) {
    return std::pow(4.0 * left * right / ((left + right) * (left + right)), sharing_exponent);
}

double tie_stiffness(double freed, double stiffness) { return (1.0 - freed) / freed * stiffness / pair_compliance_of_hats; }

double opening_modulus(const MaterialMap& materials, const Vec2& centre, const Vec2& half, const Vec2& along) {
    const LocalWood wood = materials.average(centre, half);
    if (!materials.orthotropic() || wood.filled == 0.0) return wood.plane_modulus();
    return 1.0 / near_tip_field(wood.elasticity.stiffness(), along).release()(0, 0);
}

bool CrackLine::comes_to(const Box& box) const {
    for (std::size_t k = 0; k + 1 < points.size(); ++k)
        if (box.touches({points[k].cwiseMin(points[k + 1]), points[k].cwiseMax(points[k + 1])})) return true;
    return false;
}

Vec2 CrackLine::behind(bool at_end, double distance) const {
    const int n = static_cast<int>(points.size());
    for (int k = 0; k + 1 < n; ++k) {
        const Vec2& a = at_end ? points[n - 1 - k] : points[k];
        const Vec2& b = at_end ? points[n - 2 - k] : points[k + 1];
        const double whole = (b - a).norm();
        if (distance <= whole) return a + distance / whole * (b - a);
        distance -= whole;
    }
    return at_end ? points.front() : points.back();
}

Vec2 CrackLine::direction_near(bool at_end, const Vec2& x) const {
    const double sense = at_end ? 1.0 : -1.0;
    Vec2 direction = tip(at_end).direction;
    double nearest = (x - tip(at_end).position).norm();
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
        if (lies_beyond(nearest, points[k], points[k + 1], x)) continue;
        const Vec2 along = points[k + 1] - points[k];
        const double distance = (x - points[k] - nearest_on_segment(points[k], points[k + 1], x) * along).norm();
        if (distance < nearest * (1.0 - 1e-12)) {
            nearest = distance;
            direction = sense * along.normalized();
        }
    }
    return direction;
}

CrackFields::CrackFields(const Scene& scene, Discretisation& body, const MaterialMap& materials, double least_freed,
                         bool cuts_domains)
    : scene_(&scene), body_(&body), materials_(&materials), least_freed_(least_freed), cuts_domains_(cuts_domains) {
    if (scene.cracks.size() > most_cracks)
        throw InputError(scene.file.string(), "cracks", std::to_string(scene.cracks.size()),
                         "at most " + std::to_string(most_cracks) + " cracks");
    node_of_field.resize(body.layout.nodes());
    for (int n = 0; n < body.layout.nodes(); ++n) node_of_field[n] = n;
    if (scene.cracks.empty()) return;
    mask_ = PointTable<std::uint8_t>(body.layout.nodes_per_cell());
    mask_.resize(body.points.count());
    for (const Crack& crack : scene.cracks) {
        CrackLine line;
        line.points = crack.points;
        const std::size_t last = crack.points.size() - 1;
        line.start = {crack.grows == Growth::start || crack.grows == Growth::both, is_inside(crack.points[0]), crack.points[0],
                      (crack.points[0] - crack.points[1]).normalized()};
        line.end = {crack.grows == Growth::end || crack.grows == Growth::both, is_inside(crack.points[last]), crack.points[last],
                    (crack.points[last] - crack.points[last - 1]).normalized()};
        line.length = length_inside(line.points, {Vec2::Zero(), body.layout.size()});
        lines.push_back(line);
    }
    for (int k = 0; k < static_cast<int>(lines.size()); ++k) {
        for (const bool at_end : {false, true}) {
            CrackTip& tip = lines[k].tip(at_end);
            const double hair = 1e-3 * body.layout.cell.minCoeff();
            if (!tip.inside) continue;
            const auto found = meeting(k, tip.position - hair * tip.direction, tip.position + hair * tip.direction, hair);
            if (found) end_at(tip, *found);  // it begins on another crack
        }
    }
    const Box everywhere{Vec2::Zero(), body.layout.size()};
    for (int k = 0; k < static_cast<int>(lines.size()); ++k) sort_points(k, everywhere);
    if (cuts_domains_) cut_domains(everywhere);
    for (int k = 0; k < static_cast<int>(lines.size()); ++k) renew_ties(k);
    new_fields_.clear();  // all at rest: nothing to hand on
    moves.clear();
}

bool CrackFields::is_inside(const Vec2& x) const {
    const Vec2 margin = 1e-6 * body_->layout.cell;
    const Box rectangle{margin, body_->layout.size() - margin};
    if (!rectangle.contains(x) || body_->point_at(x) < 0) return false;
    // A tip on the outline of a cutout lies at a free surface, even where a point's corner covers it.
    const double reach = body_->layout.point_size().maxCoeff();
    const auto& cutouts = scene_->specimen.cutouts;
    return std::none_of(cutouts.begin(), cutouts.end(),
                        [&](const Shape& s) { return inside(s, x) || nearest_on_outline(s, x).distance < 0.5 * reach; });
}

bool CrackFields::is_left(int crack, const Vec2& x) const {
    const auto& points = lines[crack].points;
    const double rounding = 1e-9 * body_->layout.cell.minCoeff();  // a node on the crack counts as left of it
    double nearest = std::numeric_limits<double>::infinity();
    double side = 0.0;
    const double reach =
        std::sqrt(std::min((x - points.front()).squaredNorm(), (x - points.back()).squaredNorm())) + 2.0 * rounding;
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
        const bool at_an_end = k == 0 || k + 2 == points.size();
        if (!at_an_end && lies_beyond(reach, points[k], points[k + 1], x)) continue;
        const Vec2 along = points[k + 1] - points[k];
        const double whole = along.norm();
        // The first and the last segment go on beyond the crack: a tip's cell is cut as if the crack ran on straight.
        double t = (x - points[k]).dot(along) / (whole * whole);
        if (k > 0) t = std::max(t, 0.0);
        if (k + 2 < points.size()) t = std::min(t, 1.0);
        const double distance = (x - points[k] - t * along).norm();
        const double here = cross(along, x - points[k]) / whole;
        if (distance < nearest - rounding) {
            nearest = distance;
            side = here;
        } else if (distance < nearest + rounding && std::abs(here) > std::abs(side)) {
            side = here;  // nearest to a corner: the segment that x stands off farther knows the side
        }
    }
    return side >= -rounding;
}

// Where a straight step of a crack first meets another one, or comes nearer to it than `near`.
std::optional<CrackFields::Meeting> CrackFields::meeting(int crack, const Vec2& from, const Vec2& to, double near) const {
    const Vec2 step = to - from;
    std::optional<Meeting> found;
    double first = 1.0;
    double nearest = near;
    for (int k = 0; k < static_cast<int>(lines.size()); ++k) {
        const auto& points = lines[k].points;
        for (std::size_t i = 0; i + 1 < points.size() && k != crack; ++i) {
            const Vec2 along = points[i + 1] - points[i];
            const double turn = cross(step, along);
            const double gone = turn != 0.0 ? cross(points[i] - from, along) / turn : -1.0;  // of the step, where the lines cross
            const double there = turn != 0.0 ? cross(points[i] - from, step) / turn : -1.0;
            if (gone > 1e-9 && gone <= first && there >= 0.0 && there <= 1.0) {
                first = gone;
                nearest = 0.0;
                found = {from + gone * step, k};
            }
            const auto nearest_to = [&](const Vec2& x) -> Vec2 {
                return points[i] + nearest_on_segment(points[i], points[i + 1], x) * along;
            };
            const double distance = (nearest_to(to) - to).norm();
            const bool comes_nearer = distance < (1.0 - 1e-9) * (nearest_to(from) - from).norm();
            if (distance >= nearest || !comes_nearer) continue;
            nearest = distance;
            found = {nearest_to(to), k};
        }
    }
    return found;
}

// Ends a tip where its crack meets another one.
void CrackFields::end_at(CrackTip& tip, const Meeting& there) {
    const double h = body_->layout.cell.minCoeff();
    tip.position = there.at;
    tip.inside = false;
    bool one = false;
    for (const bool at_end : {false, true}) {
        CrackTip& other = lines[there.crack].tip(at_end);
        if ((other.position - there.at).norm() > meeting_distance * h) continue;
        one |= std::abs(cross(tip.direction, other.direction)) < least_sine_of_a_junction;
        if (!other.inside) continue;
        other.inside = false;
        renew_ties(there.crack);
    }
    if (one) return;
    tip.wall = there.crack;
    tip.wall_on_left = is_left(there.crack, there.at - 0.5 * h * tip.direction);
}

// Beyond the face of another crack at which this one ends. Off that crack's own ends nothing is.
bool CrackFields::beyond_wall(int crack, const Vec2& x) const {
    const double reach = 3.0 * body_->layout.cell.maxCoeff();
    for (const CrackTip* tip : {&lines[crack].start, &lines[crack].end}) {
        if (tip->wall < 0 || (x - tip->position).dot(tip->direction) < -reach) continue;
        const CrackLine& wall = lines[tip->wall];
        const auto lies_off = [&](const CrackTip& end) {
            return (x - end.position).dot(end.direction) > 0.0 && (tip->position - end.position).norm() < reach;
        };
        if (lies_off(wall.start) || lies_off(wall.end)) continue;
        if (is_left(tip->wall, x) != tip->wall_on_left) return true;
    }
    return false;
}

// Whether the straight way on from a tip that has come out of the wood meets wood again within a distance: the flanks of a notch
// lie beside it, and it has to keep them apart.
bool CrackFields::wood_lies_ahead(const CrackTip& tip, double distance) const {
    const double cell = body_->layout.cell.minCoeff();
    const Box specimen{Vec2::Zero(), body_->layout.size()};
    for (double way = reach_of_an_end * cell; way < distance; way += 0.25 * cell) {
        const Vec2 x = tip.position + way * tip.direction;
        if ((x.array() < specimen.low.array()).any() || (x.array() > specimen.high.array()).any()) return false;
        if (body_->point_at(x) >= 0 && has_wood(scene_->specimen, x)) return true;  // a point's corner may cover a void
    }
    return false;
}

double CrackFields::freed(int crack, int node) const {
    const Vec2 x = body_->layout.node_position(node);
    const Box support = body_->layout.support(node);
    double least = 1.0;
    for (const CrackTip* tip : {&lines[crack].start, &lines[crack].end}) {
        // Ahead of the tip or behind it: a tie lasts until the tip has gone its way, though it has left the support.
        if (!exit_distance(tip->position, tip->direction, support) && !exit_distance(tip->position, -tip->direction, support))
            continue;
        if (!tip->inside) {  // on another crack the cut ends, and where a hole does: what lies behind it is whole
            const double ahead = (x - tip->position).dot(tip->direction);
            const double reach = reach_of_an_end * tip->direction.cwiseProduct(body_->layout.cell).norm();
            if (ahead > reach && (tip->wall >= 0 || wood_lies_ahead(*tip, ahead + reach))) return not_begun;
            continue;
        }
        least = std::min(least, share_freed(x, *tip, body_->layout));
    }
    return least;
}

void CrackFields::sort_points(int crack, const Box& window) {
    const Layout& layout = body_->layout;
    Points& points = body_->points;
    const std::uint8_t bit = static_cast<std::uint8_t>(1u << crack);
    struct Node {
        bool left, split, free;
    };
    std::vector<bool> is_free(layout.nodes(), false);  // whether the crack has cut the node's whole support
    for (const FieldPair& pair : pairs)
        if (pair.crack == crack && pair.freed >= 1.0) is_free[pair.node] = true;
    std::vector<std::optional<Node>> known(layout.nodes());  // several cells ask
    std::vector<bool> left;                                  // [points of a cell]
    body_->for_cells_in(window, [&](int c) {
        const auto nodes = layout.cell_nodes(c);
        const int first = points.first_of_cell[c], last = points.first_of_cell[c + 1];
        left.clear();
        for (int p = first; p < last; ++p) left.push_back(is_left(crack, points.position[p]));
        for (int k = 0; k < layout.nodes_per_cell(); ++k) {
            std::optional<Node>& node = known[nodes[k]];
            if (!node)
                node = {is_left(crack, layout.node_position(nodes[k])), freed(crack, nodes[k]) >= least_freed_,
                        is_free[nodes[k]]};
            for (int p = first; p < last; ++p) {
                std::uint8_t& mask = mask_[p][k];
                const bool was_apart = mask & bit;
                const bool stays = was_apart && node->free;  // behind a wall what ties still held grows together
                const bool apart = left[p - first] != node->left && (stays || !beyond_wall(crack, points.position[p]));
                mask = static_cast<std::uint8_t>(apart && (node->split || was_apart) ? mask | bit : mask & ~bit);
                const int to = field(nodes[k], mask, crack);
                if (const int from = std::exchange(points.node[p][k], to); from != to) moves.push_back({p, k, from, to});
            }
        }
    });
}

int CrackFields::field(int node, unsigned mask, int crack) {
    if (mask == 0) return node;
    const auto known = field_of_.find({node, mask});
    if (known != field_of_.end()) return known->second;
    const unsigned own = 1u << crack;
    const int from = field(node, mask & own ? mask & ~own : mask & (mask - 1u), crack);  // a crack less cuts it off
    const int added = fields();
    node_of_field.push_back(node);
    field_of_[{node, mask}] = added;
    new_fields_.push_back({added, from});
    add_pairs(node, mask);
    return added;
}

void CrackFields::add_pairs(int node, unsigned mask) {
    const Vec2 x = body_->layout.node_position(node);
    const int own = field_of_.at({node, mask});
    for (int k = 0; k < static_cast<int>(lines.size()); ++k) {
        const unsigned other_mask = mask ^ (1u << k);
        const auto known = field_of_.find({node, other_mask});
        if (other_mask != 0 && known == field_of_.end()) continue;
        const int other = other_mask == 0 ? node : known->second;
        // The wood that counts is where the tip is, on the way, when it frees the pair.
        const bool at_end = (x - lines[k].end.position).squaredNorm() <= (x - lines[k].start.position).squaredNorm();
        const Vec2 along = lines[k].tip(at_end).direction;
        const Vec2 on_the_way = x + tip_lag(along, body_->layout) * along.cwiseProduct(body_->layout.cell);
        const double plane_modulus = opening_modulus(*materials_, on_the_way, 0.5 * body_->layout.cell, along);
        const int with_node = mask >> k & 1u ? other : own;
        const int beyond = mask >> k & 1u ? own : other;
        const bool node_is_left = is_left(k, x);
        const double compliance = body_->layout.degree == 1 ? pair_compliance_of_hats : pair_compliance_of_splines;
        const auto like =
            std::ranges::find_if(pairs, [&](const FieldPair& pair) { return pair.node == node && pair.crack == k; });
        const bool is_first = like == pairs.end();
        pairs.push_back({node_is_left ? with_node : beyond, node_is_left ? beyond : with_node, with_node, node, k,
                         left_of(lines[k].direction_near(true, x)), on_the_way, along, plane_modulus,
                         compliance / (plane_modulus * body_->layout.thickness), is_first ? freed(k, node) : like->freed, 0.0,
                         is_first ? -1 : static_cast<int>(like - pairs.begin())});
        set_tie(pairs.back());
    }
}

// A crack that turns just before a node may pass on its other side.
void CrackFields::renew_sides(int crack) {
    for (FieldPair& pair : pairs) {
        if (pair.crack != crack || pair.freed >= 1.0) continue;
        const bool node_is_left = is_left(crack, body_->layout.node_position(pair.node));
        if ((pair.left == pair.with_node) != node_is_left) std::swap(pair.left, pair.right);
    }
}

void CrackFields::set_tie(FieldPair& pair) const {
    constexpr double smallest = 1e-6;
    const double f = std::max({least_freed_, pair.freed, smallest});
    pair.tie = (1.0 - f) / (f * pair.compliance);
}

void CrackFields::renew_ties(int crack) {
    for (FieldPair& pair : pairs) {
        if (pair.crack != crack) continue;
        const double now = freed(crack, pair.node);
        // A turn makes the way past a pair longer; what the crack has cut stays so.
        if (pair.freed < 1.0) pair.freed = now;
        set_tie(pair);
    }
}

std::vector<CrackFields::NewField> CrackFields::grow(int crack, bool at_end, const Vec2& to) {
    CrackLine& line = lines[crack];
    CrackTip& tip = line.tip(at_end);
    const Vec2 from = tip.position;
    const Vec2 step = to - from;
    const Vec2 old_direction = tip.direction;
    tip.direction = step.normalized();
    tip.position = to;
    tip.inside = is_inside(to);
    if (const auto found = meeting(crack, from, to, meeting_distance * body_->layout.cell.minCoeff())) end_at(tip, *found);
    line.length += length_inside({from, tip.position}, {Vec2::Zero(), body_->layout.size()});
    const bool straight = std::abs(cross(old_direction, (tip.position - from).normalized())) < 1e-9;
    if (straight) (at_end ? line.points.back() : line.points.front()) = tip.position;
    else line.points.insert(at_end ? line.points.end() : line.points.begin(), tip.position);

    new_fields_.clear();
    moves.clear();
    sort_points(crack, window(from, to));
    if (cuts_domains_) cut_domains(window(from, to));
    renew_sides(crack);
    renew_ties(crack);
    return new_fields_;
}

bool CrackFields::slide(int crack, bool at_end, double distance) {
    CrackLine& line = lines[crack];
    CrackTip& tip = line.tip(at_end);
    const Vec2 from = tip.position;
    const Vec2 to = from + distance * tip.direction;
    if (!is_inside(to)) return false;
    bool frees_further = false;
    body_->for_cells_in(window(from, to), [&](int c) {
        for (const int node : body_->layout.cell_nodes(c)) {
            tip.position = from;
            const bool was_free = freed(crack, node) >= least_freed_;
            tip.position = to;
            frees_further |= !was_free && freed(crack, node) >= least_freed_;
        }
    });
    tip.position = frees_further ? from : to;
    if (frees_further) return false;
    (at_end ? line.points.back() : line.points.front()) = to;
    line.length += distance;
    renew_ties(crack);
    return true;
}

Box CrackFields::window(const Vec2& from, const Vec2& to) const {
    constexpr double of_points = 3.0, of_domains = 6.0;  // cells; what another crack cuts off ends where this one comes near
    const Vec2 reach = (cuts_domains_ && lines.size() > 1 ? of_domains : of_points) * body_->layout.cell;
    return {from.cwiseMin(to) - reach, from.cwiseMax(to) + reach};
}

std::array<int, most_nodes> CrackFields::fields_at(int cell, const Vec2& x) const {
    std::array<int, most_nodes> fields = body_->layout.cell_nodes(cell);
    for (int n = 0; n < body_->layout.nodes_per_cell(); ++n) {
        int& field = fields[n];
        const int node = field;
        unsigned mask = 0;
        for (int k = 0; k < static_cast<int>(lines.size()); ++k)
            if (is_left(k, x) != is_left(k, body_->layout.node_position(node)) && freed(k, node) >= least_freed_) mask |= 1u << k;
        const auto known = field_of_.find({node, mask});
        if (known != field_of_.end()) field = known->second;
    }
    return fields;
}

Vec2 CrackFields::displacement_at(const Vec2& x, const std::vector<Vec2>& displacement) const {
    const Layout& layout = body_->layout;
    const int c = layout.cell_at(x);
    const auto values = body_->values_at(c, x);
    const auto fields = fields_at(c, x);
    Vec2 sum = Vec2::Zero();
    for (int k = 0; k < layout.nodes_per_cell(); ++k) sum += values[k] * displacement[fields[k]];
    return sum;
}

Vec2 CrackFields::opening(int crack, const Vec2& x, const std::vector<Vec2>& displacement) const {
    const Layout& layout = body_->layout;
    const int c = layout.cell_at(x);
    const auto nodes = layout.cell_nodes(c);
    const auto values = body_->values_at(c, x);
    Vec2 jump = Vec2::Zero();
    for (const FieldPair& pair : pairs) {
        if (pair.crack != crack) continue;
        for (int k = 0; k < layout.nodes_per_cell(); ++k)
            if (pair.node == nodes[k]) jump += values[k] * (displacement[pair.left] - displacement[pair.right]);
    }
    return jump;
}

}  // namespace crampfit

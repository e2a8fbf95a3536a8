#include "forward/contact.hpp"

#include "forward/deformation.hpp"
#include "forward/local_yield.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace crampfit {

namespace {

constexpr int most_steps_between_searches = 50;
constexpr double search_margin = 2.0;    // in cells
constexpr double part_of_margin = 0.25;  // that anything may go between two searches

// Stiffness of a facet over that of one cell of its wood, where the time step allows it: in earlywood it does, as latewood sets
// the time step. Contact then gives way by a tenth of a cell's yield and hardly depends on the grid.
constexpr double stiffness_in_cells = 10.0;

// Width of the surface with whose mean a facet goes under a round body, and the most of it in radii: the mean of a wheel's own
// bend lies width^2 / (24 radius) within it, which stiffens the contact. Forces on the wheels of a wedge test through rings, ten
// cells across, are within 3.7 % of those on cells half as wide all the way; with facets that go alone 5.4 %, with one and a half
// cells 4.6 %. Chosen by that, as is where the mean ends.
constexpr double width_in_cells = 1.0;
constexpr double width_in_radii = 0.2;
// Beyond it the grid's bends are small, and contact so wide that its tangent is dear.
constexpr double most_radius_in_cells = 16.0;

// Over twice this depth, in cells, contact sets in: the force grows mostly with its square there, so that Newton's method sees a
// touch coming; from there on it grows evenly.
constexpr double onset_in_cells = 0.0003;
// Part of the stiffness that is there from the first touch, so that a body at rest on it is held.
constexpr double at_touch = 0.1;

// Faces of cracks feel sides of bodies whose normals lie so near to the wood's own, where these are not much farther than the
// nearest side of all: the blunt end of a wedge does not open a crack that it only presses on.
constexpr double sees_sides_within = std::numbers::pi / 3.0;
constexpr double most_in_nearest = 3.0;

// A corner pushes on so much of the surface on either side, evenly less away from it, where the wood lies by so much, the sine of
// an angle, off both of its sides' normals (15 degrees).
constexpr double corner_width_in_cells = 1.0;
constexpr double least_to_sides = 0.26;

// Of a facet with its full stiffness k, so deep in a body.
struct Press {
    double force = 0.0, stiffness = 0.0, energy = 0.0;  // [N], [N/m], [J]
};

Press press(double k, double depth, double onset) {
    if (depth <= 0.0) return {};
    const double grows = 1.0 - at_touch;
    if (depth < 2.0 * onset)
        return {k * depth * (at_touch + grows * depth / (4.0 * onset)), k * (at_touch + grows * depth / (2.0 * onset)),
                k * depth * depth * (at_touch / 2.0 + grows * depth / (12.0 * onset))};
    const double d = depth - grows * onset;
    const double at_end = 2.0 * at_touch + grows * 2.0 / 3.0 - 0.5 * (1.0 + at_touch) * (1.0 + at_touch);
    return {k * d, k, 0.5 * k * d * d + at_end * k * onset * onset};
}

// How deep a place lies in the shape; below 0: that far outside [m].
double signed_depth(const Shape& shape, const Vec2& x) {
    if (const auto* circle = std::get_if<Circle>(&shape)) return circle->radius - (x - circle->centre).norm();
    const double distance = nearest_on_outline(shape, x).distance;
    return inside(shape, x) ? distance : -distance;
}

// A circle grown by what the middle of the facet nearest to it lies farther off than the facet itself, where this lies along it:
// it touches when it would.
Shape reached_by_middles(const Shape& shape, const std::vector<Facet>& facets) {
    const auto* circle = std::get_if<Circle>(&shape);
    if (!circle || facets.empty()) return shape;
    const auto beyond = [&](const Vec2& x) { return std::max((x - circle->centre).norm(), circle->radius); };  // else cut off
    double nearest = INFINITY, nearest_middle = INFINITY, along = 0.0;
    for (const Facet& facet : facets) {
        nearest_middle = std::min(nearest_middle, beyond(facet.position));
        const Vec2 half = 0.5 * facet.length * left_of(facet.normal), a = facet.position - half, b = facet.position + half;
        const double here = beyond(a + nearest_on_segment(a, b, circle->centre) * (b - a));
        if (here >= nearest) continue;
        nearest = here;
        along = std::hypot(circle->radius, 0.5 * facet.length) - circle->radius;
    }
    return Circle{circle->centre, circle->radius + std::min(nearest_middle - nearest, along)};
}

}  // namespace

bool is_small_circle(const Shape& shape, const Layout& layout) {
    constexpr double hair = 1e-6;  // of the most: last digits of the specimen's size decide nothing
    const auto* circle = std::get_if<Circle>(&shape);
    return circle && circle->radius <= (1.0 + hair) * most_radius_in_cells * layout.cell.maxCoeff();
}

// How deep x lies in the shape; nothing outside it.
std::optional<SlidingBody::Meeting> SlidingBody::depth_in(const Shape& shape, const Vec2& x) {
    if (const auto* circle = std::get_if<Circle>(&shape)) {
        const Vec2 arm = x - circle->centre;
        const double reach = arm.norm();
        if (reach >= circle->radius || reach == 0.0) return std::nullopt;
        return Meeting{circle->radius - reach, arm / reach, 1.0 / reach};
    }
    if (!inside(shape, x)) return std::nullopt;
    const OutlinePoint on = nearest_on_outline(shape, x);
    return Meeting{on.distance, on.normal};
}

// The same of a face of a crack, with `toward` into its wood: under a circle less the more the way out lies aside of that.
std::optional<SlidingBody::Meeting> SlidingBody::depth_in_crack(const Shape& shape, const Vec2& x, const Vec2& toward) {
    const auto met = depth_in(shape, x);
    if (!met) return std::nullopt;
    const double least = std::cos(sees_sides_within);
    const double toward_it = met->out.dot(toward);
    if (const auto* polygon = std::get_if<Polygon>(&shape)) {
        if (toward_it >= least) return met;
        const auto side = nearest_facing(*polygon, x, toward, sees_sides_within);
        if (!side || side->distance > most_in_nearest * met->depth) return std::nullopt;
        return Meeting{side->distance, side->normal};
    }
    const double share = (toward_it - least) / (1.0 - least);
    if (share <= 0.0) return std::nullopt;
    const Vec2 turns = met->depth * met->curvature / (1.0 - least) * (toward - toward_it * met->out);
    return Meeting{share * met->depth, share * met->out - turns, met->curvature};
}

std::vector<SlidingBody::Corner> SlidingBody::corners_of(const Shape& shape) {
    const auto* polygon = std::get_if<Polygon>(&shape);
    if (!polygon) return {};
    std::vector<Vec2> points = polygon->points;
    if (signed_area(points) > 0.0) std::ranges::reverse(points);  // clockwise: the left of a side is outside
    std::vector<Corner> corners;
    for (std::size_t n = points.size(), k = 0; k < n; ++k) {
        const Vec2 first = left_of(points[k] - points[(k + n - 1) % n]).normalized();
        const Vec2 second = left_of(points[(k + 1) % n] - points[k]).normalized();
        if (cross(second, first) > 0.0) corners.push_back({points[k], first, second});
    }
    return corners;
}

// The corner that pushes on a place near it whose wood lies in direction `toward`; null: none does.
const SlidingBody::Corner* SlidingBody::corner_on(const Vec2& place, const Vec2& toward) const {
    const auto pushes = [&](const Corner& corner) {
        return toward.dot(corner.first + corner.second) > 0.0 &&
               std::min(cross(toward, corner.first), cross(corner.second, toward)) > least_to_sides &&
               std::abs(cross(corner.at - place, toward)) < corner_width();
    };
    const auto found = std::ranges::find_if(corners_, pushes);
    return found == corners_.end() ? nullptr : &*found;
}

// Whether the surface goes on from a facet to the left of the way into its wood by so much, or for numbers below 0 to the right,
// and a facet more [m].
bool SlidingBody::surface_reaches(int facet, double along) const {
    const Vec2 way = std::copysign(1.0, along) * left_of(-this->facet(facet).normal);
    const int after = next(facet, true);
    const bool forth = after >= 0 && (this->facet(after).position - this->facet(facet).position).dot(way) > 0.0;
    double gone = 0.0;
    for (int i = facet; gone < std::abs(along) + this->facet(facet).length;) {
        const int on = next(i, forth);
        if (on < 0 || !goes_on_[forth ? i : on]) return false;
        gone += (this->facet(on).position - this->facet(i).position).norm();
        i = on;
    }
    return true;
}

// How far along the surface a corner pushes on both sides [m].
double SlidingBody::corner_width() const { return corner_width_in_cells * body_.layout.cell.minCoeff(); }

SlidingBody::SlidingBody(const Shape& shape, const Discretisation& body, double friction, const FaceFacets* faces)
    : shape_(reached_by_middles(shape, body.facets)), body_(body), faces_(faces), corners_(corners_of(shape)),
      friction_(friction) {
    if (is_small_circle(shape, body.layout))
        width_ = std::min(width_in_cells * body.layout.cell.maxCoeff(), width_in_radii * std::get<Circle>(shape).radius);
    add_facets();
    for (int i = 0; i < outline(); ++i) find_joint(i);
    for (int i = 0; i < outline(); ++i) find_holds(i);
}

std::vector<const Facet*> SlidingBody::nearest_facets(double beyond) const {
    double most = -INFINITY;
    for (const Facet& f : body_.facets) most = std::max(most, signed_depth(shape_, f.position));
    std::vector<const Facet*> nearest;
    for (const Facet& f : body_.facets)
        if (const double depth = signed_depth(shape_, f.position); depth >= most - beyond)
            nearest.insert(depth == most ? nearest.begin() : nearest.end(), &f);
    return nearest;
}

void SlidingBody::add_facets() {
    for (int i = static_cast<int>(stiffness_.size()); i < facets(); ++i) {
        cut_off_.push_back(std::max(0.0, signed_depth(shape_, facet(i).position)));
        stiffness_.push_back(full_stiffness(i));
        goes_on_.push_back(false);
        holds_.push_back({{facet(i).point, facet(i).weight}});
        is_stale_.push_back(i >= outline());
        if (friction_ > 0.0) place_.push_back(facet(i).position);
    }
}

double SlidingBody::full_stiffness(int i) const {
    const double h = body_.layout.cell.minCoeff();
    return stiffness_in_cells * body_.points.stiffest(facet(i).point) / h * facet(i).length * body_.layout.thickness;
}

void SlidingBody::take_in_faces(const Box& changed, const std::vector<double>& mass) {
    add_facets();
    std::vector<int> there;
    for (int i = 0; i < facets(); ++i)
        if (changed.contains(facet(i).position)) there.push_back(i);
    for (const int i : there) {
        if (i < outline()) continue;
        holds_[i] = {{facet(i).point, facet(i).weight}};
        is_stale_[i] = true;
    }
    if (most_frequency_squared_ == 0.0) return;
    for (const int i : there) stiffness_[i] = full_stiffness(i);
    soften(there, mass);
}

// The facet that goes on from one, along the outline or a face; -1: none.
int SlidingBody::next(int facet, bool forth) const {
    if (facet < outline()) return forth ? (facet + 1 < outline() ? facet + 1 : -1) : facet - 1;
    const int on_face = faces_->next(facet - outline(), forth);
    return on_face < 0 ? -1 : on_face + outline();
}

// Whether the next facet goes on smoothly. True where that is not what it was.
bool SlidingBody::find_joint(int facet) {
    constexpr double touching = 1e-3, smooth = 0.9;  // of a facet's length; cosine
    const int after = next(facet, true);
    if (after < 0) return false;
    const Points& points = body_.points;
    const auto is_torn = [&](int p, int q) {  // a crack is between them where they see two fields of a node
        const auto nodes_p = body_.layout.cell_nodes(points.cell[p]), nodes_q = body_.layout.cell_nodes(points.cell[q]);
        for (int k = 0; k < body_.layout.nodes_per_cell(); ++k)
            for (int l = 0; l < body_.layout.nodes_per_cell(); ++l)
                if (nodes_p[k] == nodes_q[l] && points.node[p][k] != points.node[q][l]) return true;
        return false;
    };
    const Facet &a = this->facet(facet), &b = this->facet(after);
    const bool goes_on = std::abs((b.position - a.position).norm() - 0.5 * (a.length + b.length)) < touching * a.length &&
                         a.normal.dot(b.normal) > smooth && (a.point == b.point || !is_torn(a.point, b.point));
    return std::exchange(goes_on_[facet], goes_on) != goes_on;
}

// The mean is over as much both ways as the outline goes on, so that what is linear along it stays.
void SlidingBody::find_holds(int facet) {
    constexpr double hair = 1e-6;  // of the width, which is a whole number of facets but for last digits of the specimen's size
    const int most = static_cast<int>((1.0 + hair) * 0.5 * width_ / this->facet(facet).length);
    int low = facet, high = facet, each = 0;
    for (; each < most; ++each) {
        const int before = next(low, false), after = next(high, true);
        if (before < 0 || after < 0 || !goes_on_[before] || !goes_on_[high]) break;
        low = before;
        high = after;
    }
    std::vector<Hold>& held = holds_[facet];
    held.clear();
    for (int j = low, left = 2 * each + 1; left > 0; --left, j = next(j, true)) {
        const Facet& f = this->facet(j);
        if (held.empty() || held.back().point != f.point) held.push_back({f.point, {}});
        for (int k = 0; k < body_.layout.nodes_per_cell(); ++k) held.back().weight[k] += f.weight[k] / (2 * each + 1);
    }
}

void SlidingBody::limit_frequency(const std::vector<double>& mass, double most_frequency_squared) {
    search_ = SearchInterval(most_steps_between_searches);
    in_steps_ = true;
    most_frequency_squared_ = most_frequency_squared;
    std::vector<int> all(facets());
    std::iota(all.begin(), all.end(), 0);
    soften(all, mass);
}

// So that they together add no more.
void SlidingBody::soften(const std::vector<int>& facets, const std::vector<double>& mass) {
    const Points& points = body_.points;
    const int nodes = body_.layout.nodes_per_cell();
    // What a facet adds to the stiffness of a node, at most: its row of the facet's tangent, signs aside.
    const auto for_added = [&](int i, const auto& visit) {
        double sum = 0.0;
        for (const Hold& hold : holds(i))
            for (int k = 0; k < nodes; ++k) sum += std::abs(hold.weight[k]);
        for (const Hold& hold : holds(i))
            for (int k = 0; k < nodes; ++k)
                if (hold.weight[k] != 0.0) visit(points.node[hold.point][k], stiffness_[i] * std::abs(hold.weight[k]) * sum);
    };
    std::vector<double> added(mass.size(), 0.0);
    for (const int i : facets) for_added(i, [&](int n, double more) { added[n] += more; });
    // A facet on a node with hardly any mass must not shorten the time step.
    for (const int i : facets) {
        double least = 1.0;
        for_added(i, [&](int n, double) {
            const double most = most_frequency_squared_ * mass[n];
            if (added[n] > most) least = std::min(least, most / added[n]);
        });
        stiffness_[i] *= least;
    }
}

Vec2 SlidingBody::current(int facet, const std::vector<Vec2>& displacement) const {
    Vec2 x = this->facet(facet).position;
    for (const Hold& hold : holds(facet))
        for (int k = 0; k < body_.layout.nodes_per_cell(); ++k)
            x += hold.weight[k] * displacement[body_.points.node[hold.point][k]];
    return x;
}

// Between two searches [m].
double SlidingBody::may_go() const { return part_of_margin * search_margin * body_.layout.cell.minCoeff(); }

void SlidingBody::find_near(const Vec2& moved, const std::vector<Vec2>& displacement) {
    constexpr double hair = 1e-9;
    const Box box = bounds(shape_);
    const Vec2 margin = search_margin * body_.layout.cell;
    const Box wide{box.low + moved - margin, box.high + moved + margin};
    double farthest = 0.0;  // that anything has gone: what lies farther from there than that is not asked
    for (const Vec2& u : displacement) farthest = std::max(farthest, u.squaredNorm());
    const Vec2 reach = Vec2::Constant((1.0 + hair) * std::sqrt(farthest));
    const Box at_rest{wide.low - reach, wide.high + reach};
    const std::vector<int> before = std::exchange(near_, {});
    bool torn_anew = false;
    const bool some_only = !search_.searches_each_step();  // then friction has not followed the others
    farthest = std::sqrt(farthest);
    search_.has_searched((moved - searched_at_).norm() + std::abs(farthest - farthest_at_search_), may_go());
    searched_at_ = moved;
    farthest_at_search_ = farthest;
    for (int i = 0; i < facets(); ++i) {
        if (!at_rest.contains(facet(i).position)) continue;
        const Vec2 x = current(i, displacement);
        if (!wide.contains(x)) continue;
        if (width_ > 0.0 && i < outline() && !near_.empty() && near_.back() == i - 1) torn_anew |= find_joint(i - 1);
        near_.push_back(i);
        if (friction_ > 0.0 && some_only && !std::binary_search(before.begin(), before.end(), i)) place_[i] = x - moved;
    }
    for (int i = 0; i < outline() && torn_anew; ++i) find_holds(i);
    if (width_ == 0.0) return;
    for (const int i : near_)
        if (is_stale_[i]) find_joint(i);
    for (const int i : near_)
        if (std::exchange(is_stale_[i], false)) find_holds(i);
}

Drag SlidingBody::drag_on(const Touch& touch, const Vec2& place, double depth) const {
    const auto kept =
        std::lower_bound(grips_.begin(), grips_.end(), touch.facet, [](const Grip& g, int facet) { return g.place < facet; });
    const bool is_kept = kept != grips_.end() && kept->place == touch.facet;
    const Vec2& before = place_[touch.facet];
    const double depth_before = is_kept ? 0.0 : std::min(0.0, depth_of(touch.facet, before));
    return drag({touch.normal, touch.curvature, touch.force, touch.stiffness, depth, depth_before, place - before, in_steps_},
                friction_, stiffness_[touch.facet], is_kept ? *kept : Grip{});
}

// What friction takes on facets that touched and have come off since: their springs' energy, and their slip until then under a
// force that falls evenly [J].
double SlidingBody::taken_off(const Vec2& moved, const std::vector<Vec2>& displacement) const {
    double energy = 0.0;
    auto touch = pushed_.begin();
    for (const Grip& grip : grips_) {
        while (touch != pushed_.end() && touch->facet < grip.place) ++touch;
        if (touch != pushed_.end() && touch->facet == grip.place) continue;
        const double held = stiffness_[grip.place] * grip.stretch;
        energy += 0.5 * held * grip.stretch;
        const Vec2 place = current(grip.place, displacement) - moved;
        const auto met = meeting_at(grip.place, place_[grip.place], displacement);
        const double depth = met ? met->depth - cut_off_[grip.place] : 0.0;
        if (depth <= 0.0) continue;
        // Share of the way.
        const double touched = in_steps_ ? 1.0 : depth / (depth - std::min(0.0, depth_of(grip.place, place)));
        energy += 0.5 * held * touched * (place - place_[grip.place]).dot(left_of(met->out));
    }
    return energy;
}

void SlidingBody::settle(const Vec2& moved, const std::vector<Vec2>& displacement) {
    if (friction_ == 0.0) return;
    dissipated_ += std::exchange(sliding_now_, 0.0);
    grips_.clear();
    for (const Touch& touch : pushed_) grips_.push_back({touch.facet, touch.drag.stretch});
    const auto keep = [&](int i) { place_[i] = current(i, displacement) - moved; };
    if (!search_.searches_each_step()) std::for_each(near_.begin(), near_.end(), keep);
    else
        for (int i = 0; i < static_cast<int>(place_.size()); ++i) keep(i);
}

void SlidingBody::restore(const std::vector<Grip>& grips, double dissipated, const Vec2& moved,
                          const std::vector<Vec2>& displacement) {
    if (friction_ == 0.0) return;
    grips_ = grips;
    dissipated_ = dissipated;
    sliding_now_ = 0.0;
    for (int i = 0; i < static_cast<int>(place_.size()); ++i) place_[i] = current(i, displacement) - moved;
}

void SlidingBody::let_yield(std::shared_ptr<LocalYield> yield) {
    if (!yield) return;
    yield_ = std::move(yield);
    for (int i = 0; i < outline(); ++i) stiffness_[i] *= LocalYield::finer;
}

double SlidingBody::sunk_at(int facet) const {
    const LocalYield::Place& place = yield_->place(facet);
    return (1.0 - place.share) * sunk_[place.station] + place.share * sunk_[place.station + 1];
}

// Of a facet that has gone there.
std::optional<SlidingBody::Meeting> SlidingBody::meeting_at(int facet, const Vec2& place,
                                                            const std::vector<Vec2>& displacement) const {
    const Facet& f = this->facet(facet);
    if (facet >= outline()) {
        if (!inside(shape_, place)) return std::nullopt;
        return depth_in_crack(shape_, place, -(Polar(gradient_at(body_, f.point, displacement)).turn * f.normal));
    }
    const auto is_near = [&](const Corner& corner) { return (corner.at - place).norm() < std::numbers::sqrt2 * corner_width(); };
    if (std::ranges::any_of(corners_, is_near)) {
        // As at rest: about a corner the wood turns by as much as it gives way, and a normal that turned with it would need the
        // moment that goes with that.
        const Vec2 into_wood = -f.normal;
        if (const Corner* corner = corner_on(place, into_wood)) {
            const Vec2 ahead = corner->at - place;
            const double aside = cross(ahead, into_wood), share = 1.0 - std::abs(aside) / corner_width();
            const Vec2 along = left_of(into_wood);
            if (surface_reaches(facet, -aside))
                return Meeting{ahead.dot(into_wood), into_wood, 0.0, share,
                               std::copysign(1.0 / (share * corner_width()), aside) * along};
        }
    }
    return depth_in(shape_, place);
}

// Of a facet that has gone there, against the body; below 0: so far outside [m].
double SlidingBody::depth_of(int facet, const Vec2& place) const { return signed_depth(shape_, place) - cut_off_[facet]; }

// Finds how far s the wood yields beyond the grid: s = A P^T N(d - P s), with the depths d of the facets against the grid, their
// forces N and their shares P of the stations. By Newton's method, with a part of its step where the whole one does no good.
void SlidingBody::sink(const Vec2& moved, const std::vector<Vec2>& displacement) {
    constexpr int most_iterations = 60, most_halvings = 8;
    constexpr double tolerance_in_cells = 1e-12;
    constexpr double reach_in_cells = 0.25;  // of facets that may touch: wood rises by far less beside what is pressed
    const double cell = body_.layout.cell.minCoeff();
    struct Met {
        int station;
        double share, stiffness, depth;
    };
    std::vector<Met> met;
    std::vector<int> stations;
    for (const int i : near_) {
        if (!yield_->holds(i)) continue;
        const double depth = depth_of(i, current(i, displacement) - moved);
        if (depth < -reach_in_cells * cell) continue;
        const LocalYield::Place& place = yield_->place(i);
        met.push_back({place.station, place.share, stiffness_[i], depth});
        stations.insert(stations.end(), {place.station, place.station + 1});
    }
    std::ranges::sort(stations);
    stations.erase(std::ranges::unique(stations).begin(), stations.end());
    for (Met& m : met) m.station = static_cast<int>(std::ranges::lower_bound(stations, m.station) - stations.begin());
    const auto count = static_cast<Eigen::Index>(stations.size());
    const Eigen::MatrixXd yield = yield_->yield()(stations, stations);
    Eigen::VectorXd sunk = Eigen::VectorXd::Zero(count), force(count);
    Eigen::MatrixXd springs(count, count);
    const auto residual = [&](const Eigen::VectorXd& s) -> Eigen::VectorXd {
        force.setZero();
        springs.setZero();
        for (const Met& m : met) {
            const int at = m.station;
            const Eigen::Vector2d share(1.0 - m.share, m.share);
            const Press pressed = press(m.stiffness, m.depth - share.dot(s.segment<2>(at)), onset_in_cells * cell);
            force.segment<2>(at) += pressed.force * share;
            springs.block<2, 2>(at, at) += pressed.stiffness * share * share.transpose();
        }
        return s - yield * force;
    };
    Eigen::VectorXd off = residual(sunk);
    const auto is_off = [&] { return count > 0 && off.cwiseAbs().maxCoeff() > tolerance_in_cells * cell; };
    for (int iteration = 0; iteration < most_iterations && is_off(); ++iteration) {
        const Eigen::VectorXd step = -(Eigen::MatrixXd::Identity(count, count) + yield * springs).partialPivLu().solve(off);
        const double before = off.norm();
        double share = 1.0;
        off = residual(sunk + step);
        for (int k = 0; k < most_halvings && off.norm() >= before; ++k) off = residual(sunk + (share *= 0.5) * step);
        sunk += share * step;
    }
    yield_energy_ = 0.5 * force.dot(sunk);
    sunk_ = Eigen::VectorXd::Zero(yield_->stations());
    sunk_(stations) = sunk;
}

std::vector<SlidingBody::Touch> SlidingBody::touches(const Vec2& moved, const std::vector<Vec2>& displacement) {
    if (search_.is_due() || (moved - searched_at_).norm() > may_go()) find_near(moved, displacement);
    const double onset = onset_in_cells * body_.layout.cell.minCoeff();
    if (yield_) sink(moved, displacement);
    std::vector<Touch> found;
    for (const int i : near_) {
        Touch touch{i, Vec2::Zero(), 0.0, 0.0, 0.0, 0.0, {}};
        Meeting met{0.0, Vec2::Zero()};
        const Vec2 x = current(i, displacement) - moved;
        if (yield_ && yield_->holds(i)) {
            const Vec2 arm = x - std::get<Circle>(shape_).centre;
            met = {std::get<Circle>(shape_).radius - arm.norm() - sunk_at(i), arm.normalized(), 1.0 / arm.norm()};
        } else if (const auto found_here = meeting_at(i, x, displacement)) {
            met = *found_here;
        } else {
            continue;
        }
        const double depth = met.depth - cut_off_[i];
        touch.normal = met.out;
        touch.curvature = met.curvature;
        Press pressed = press(met.share * stiffness_[i], depth, onset);
        if (pressed.force <= 0.0) continue;
        if (i >= outline() || met.share < 1.0) {  // the slope of its energy
            const Vec2 push = pressed.force * met.out + pressed.energy * met.aside;
            pressed.stiffness *= push.squaredNorm() / (pressed.force * pressed.force);
            pressed.force = push.norm();
            touch.normal = push.normalized();
        }
        touch.force = pressed.force;
        touch.stiffness = pressed.stiffness;
        touch.energy = pressed.energy;
        if (friction_ > 0.0) touch.drag = drag_on(touch, x, depth);
        found.push_back(touch);
    }
    return found;
}

void SlidingBody::meet(const Vec2& moved, const std::vector<Vec2>& displacement) {
    sliding_now_ = 0.0;
    pushed_ = touches(moved, displacement);
    stored_energy_ = yield_energy_;
    for (const Touch& touch : pushed_) {
        stored_energy_ += touch.energy + touch.drag.energy;
        sliding_now_ += touch.drag.dissipated;
    }
    if (friction_ > 0.0) sliding_now_ += taken_off(moved, displacement);
}

Vec2 SlidingBody::push(std::vector<Vec2>& force) const {
    Vec2 total = Vec2::Zero();
    for (const Touch& touch : pushed_) {
        const Vec2 push = touch.force * touch.normal + touch.drag.force;
        for (const Hold& hold : holds(touch.facet))
            for (int k = 0; k < body_.layout.nodes_per_cell(); ++k)
                force[body_.points.node[hold.point][k]] += hold.weight[k] * push;
        total += push;
    }
    return total;
}

}  // namespace crampfit

// Of equilibrium, what contact adds to it: crack faces that press, bodies that follow a force, friction.
#include "datasets/error.hpp"
#include "forward/equilibrium.hpp"
#include "forward/local_yield.hpp"

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

namespace crampfit {

namespace {

// A body that follows a force is looked for a place on the specimen in steps of this part of a cell.
constexpr double seating_step = 0.25;
constexpr int bisections = 50;

// Motions of free bodies that meet less stiffness than this part of the largest meet none: no force goes with them.
constexpr double no_stiffness = 1e-9;

// Stiffness of closed crack faces over that of the pair's wood, E' B: they overlap by as much less than the wood yields.
constexpr double face_stiffness_factor = 100.0;

// So often may faces that stick go between apart and pressed, from iteration to iteration, before they slide.
constexpr int most_changes = 3;

// Slopes of the angle by which wood has turned, by the displacement of a field: theta's own, and rho with d^2 theta = - (rho
// dtheta + dtheta rho) [1/m].
struct TurnSlope {
    Vec2 angle, rho;
    TurnSlope(const Polar& polar, const Vec2& slope) : rho(polar.turn * slope / polar.trace) { angle = left_of(rho); }
};

}  // namespace

// Crack faces press and rub in a frame that turns with the wood about their pair of fields, by theta: there the left one stands
// at j = R^T (u_left - u_right), so that dj = R^T d(u_left - u_right) - J j dtheta, J a quarter turn. What holds them so is a
// force p by j; it joins the pair with all fields that turn the wood.

// From the frame of a pair's faces.
Mat2 Equilibrium::turn_of(std::size_t k) const {
    return normals_.can_turn() ? normals_.polar(k, displacement_).turn : Mat2(Mat2::Identity());
}

// How far the left face stands from the right one, in the frame of the faces [m].
Vec2 Equilibrium::apart(std::size_t k, const std::vector<Vec2>& displacement) const {
    const FieldPair& pair = cracks_.pairs[k];
    const Vec2 jump = displacement[pair.left] - displacement[pair.right];
    return normals_.can_turn() ? Vec2(normals_.polar(k, displacement).turn.transpose() * jump) : jump;
}

// What a force on the left face, in the frame of the faces, puts on fields.
template <class Add>
void Equilibrium::push_faces(std::size_t k, const Vec2& push, const Add& add) const {
    if (push.isZero(0.0)) return;
    const FieldPair& pair = cracks_.pairs[k];
    const Polar polar = normals_.polar(k, displacement_);
    add(pair.left, polar.turn * push);
    add(pair.right, -(polar.turn * push));
    if (!normals_.can_turn()) return;
    const double moment = -push.dot(left_of(apart(k, displacement_)));
    for (const FaceNormals::Share& share : normals_.shares(k)) add(share.field, moment * TurnSlope(polar, share.slope).angle);
}
template void Equilibrium::push_faces(std::size_t, const Vec2&, const std::function<void(int, const Vec2&)>&) const;

// What holds the faces of a pair in their frame, `held`, and what more friction does there, joins the fields that turn the wood
// about it; that between its own fields along the turned normal is with the factor already.
void Equilibrium::add_turning(std::size_t k, const Mat2& held, const Mat2& remainder, bool geometric) {
    const FieldPair& pair = cracks_.pairs[k];
    const auto shares = normals_.shares(k);
    const bool alike = held == held(0, 0) * Mat2::Identity();  // such springs are the same in every frame
    if (remainder.isZero(0.0) && (shares.empty() || alike)) return;
    std::vector<int> fields{pair.left, pair.right};
    for (const FaceNormals::Share& share : shares)
        if (share.field != pair.left && share.field != pair.right) fields.push_back(share.field);
    const auto size = static_cast<Eigen::Index>(2 * fields.size());
    const Polar polar = normals_.polar(k, displacement_);
    const Mat2& turn = polar.turn;
    const Vec2 place = apart(k, displacement_);
    Eigen::VectorXd angle = Eigen::VectorXd::Zero(size), rho = angle;
    for (const FaceNormals::Share& share : shares) {
        const auto at = 2 * (std::ranges::find(fields, share.field) - fields.begin());
        const TurnSlope slope(polar, share.slope);
        angle.segment<2>(at) = slope.angle;
        rho.segment<2>(at) = slope.rho;
    }
    std::vector<int> rows(size), of_grid(size);
    std::vector<double> steps(size);
    for (Eigen::Index a = 0; a < size; ++a) {
        const int dof = 2 * fields[a / 2] + static_cast<int>(a % 2);
        rows[a] = row_of(dof);
        of_grid[a] = equation_[dof];
        steps[a] = prescribed_step_[dof];
    }
    if (!remainder.isZero(0.0)) {
        Eigen::MatrixXd apart_slope = -left_of(place) * angle.transpose();
        apart_slope.leftCols<2>() += turn.transpose();
        apart_slope.middleCols<2>(2) -= turn.transpose();
        add_rubbing(rows, steps, apart_slope.transpose() * remainder * apart_slope);
    }
    if (shares.empty()) return;
    const Vec2 across = left_of(place);
    Vec2 push = -held * across;
    Eigen::VectorXd aside = 0.5 * across.dot(held * across) * angle;
    if (geometric && !joins_faces_) {
        const Vec2 p = face_stiffness(k) * place - face_drag(k).force;
        push += left_of(p);
        aside += p.dot(across) * rho - 0.5 * p.dot(place) * angle;
    }
    aside.head<2>() += turn * push;
    aside.segment<2>(2) -= turn * push;
    Eigen::MatrixXd columns(size, 2);
    columns << aside, angle;
    const Mat2 stiffness = (Mat2() << 0.0, 1.0, 1.0, 0.0).finished();
    couple(rows, steps, columns * stiffness * columns.transpose());
    spread_.push_back({std::move(of_grid), stiffness, std::move(columns)});
}

bool Equilibrium::is_closed(std::size_t k) const { return apart(k, displacement_).dot(cracks_.pairs[k].normal) < 0.0; }

// In the frame of the faces.
Mat2 Equilibrium::face_stiffness(std::size_t k) const {
    const FieldPair& pair = cracks_.pairs[k];
    if (!is_closed(k) || pieces_.is_loose(pair.left) || pieces_.is_loose(pair.right)) return Mat2::Zero();
    const double stiffness = closed_stiffness(pair);
    if (scene_.cracks[pair.crack].faces.kind == CrackFaces::Kind::stick && !slips(k)) return stiffness * Mat2::Identity();
    return stiffness * pair.normal * pair.normal.transpose();
}

// Faces that stick and have slid past each other before they met may overlap while they are free and part as soon as they are
// pulled back: they have met where they are, and press without holding. Whether some are found that do, among pairs that were
// closed or not one iteration ago.
bool Equilibrium::let_slip(std::vector<char>& closed, std::vector<int>& changes) {
    bool some = false;
    for (std::size_t k = 0; k < closed.size(); ++k) {
        if (scene_.cracks[cracks_.pairs[k].crack].faces.kind != CrackFaces::Kind::stick || slips_[k]) continue;
        if (std::exchange(closed[k], is_closed(k)) != closed[k] && ++changes[k] > most_changes) slips_[k] = some = true;
    }
    return some;
}

double Equilibrium::closed_stiffness(const FieldPair& pair) const {
    return face_stiffness_factor * pair.plane_modulus * body_.layout.thickness;
}

void Equilibrium::find_free_bodies() {
    moved_.assign(boundary_.drivers(), Vec2::Zero());
    for (int b = 0; b < static_cast<int>(scene_.bodies.size()); ++b)
        for (int axis = 0; axis < 2; ++axis)
            if (scene_.bodies[b].free[axis]) free_.push_back({boundary_.first_body() + b, axis, scene_.bodies[b].force[axis]});
    for (std::size_t i = 0; i < sliding_.size(); ++i) seat(static_cast<int>(i));
    seat_ = moved_;
    const auto rubs = [](const Crack& crack) { return crack.faces.coefficient > 0.0; };
    if (std::any_of(scene_.cracks.begin(), scene_.cracks.end(), rubs)) settled_ = displacement_;
}

// Moves a body along its force until its springs, on the specimen as it stands, carry that: Newton's method needs a touch to
// begin with.
void Equilibrium::seat(int sliding) {
    const int driver = sliding_driver_[sliding];
    const Body& rigid = scene_.bodies[driver - boundary_.first_body()];
    const double load = rigid.force.norm();
    if (load == 0.0) return;
    const Vec2 way = rigid.force / load;
    const auto carries = [&](double gone) {
        double force = 0.0;
        for (const SlidingBody::Touch& touch : sliding_[sliding].touches(gone * way, displacement_))
            force += touch.force * touch.normal.dot(way);
        return force >= load;
    };
    const Box box = bounds(rigid.shape);
    const Vec2 farthest = box.low.cwiseAbs() + box.high.cwiseAbs() + body_.layout.size();
    const double step = seating_step * body_.layout.cell.minCoeff();
    double high = 0.0;
    while (!carries(high)) {
        high += step;
        if (high > farthest.norm())
            throw InputError(scene_.file.string(), "bodies." + rigid.name + ".force",
                             fmt::format("{:g} N, {:g} N", rigid.force.x(), rigid.force.y()),
                             "the body meets nothing on this way that could carry the force");
    }
    double low = std::max(0.0, high - step);
    for (int k = 0; k < bisections; ++k) (carries(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
    moved_[driver] = high * way;
    sliding_[sliding].restore({}, 0.0, moved_[driver], displacement_);  // friction counts from there
}

int Equilibrium::row_of_body(int driver, int axis) const {
    for (std::size_t k = 0; k < free_.size(); ++k)
        if (free_[k].driver == driver && free_[k].axis == axis) return equations_ + static_cast<int>(k);
    return -1;
}

// Forces on the equations' unknowns, those on free bodies last [N].
Eigen::VectorXd Equilibrium::out_of_balance() const {
    Eigen::VectorXd forces(equations_ + static_cast<int>(free_.size()));
    for (std::size_t dof = 0; dof < equation_.size(); ++dof)
        if (equation_[dof] >= 0) forces[equation_[dof]] = force_[dof / 2][dof % 2];
    for (std::size_t k = 0; k < free_.size(); ++k)
        forces[equations_ + static_cast<int>(k)] = free_[k].force - reaction_[free_[k].driver][free_[k].axis];
    return forces;
}

// With unknowns v of the free bodies K u - B v = r, S v - B^T u = q, so that (S - B^T K^-1 B) v = q + B^T K^-1 r and
// u = K^-1 (r + B v).
bool Equilibrium::border_tangent() {
    if (free_.empty()) return true;
    free_motion_ = free_load_;
    factor_.solve(free_motion_);
    const Eigen::MatrixXd schur = free_stiffness_ - free_load_.transpose() * free_motion_;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(0.5 * (schur + schur.transpose()));
    const double none =
        no_stiffness * std::max(free_stiffness_.diagonal().maxCoeff(), least_force_ / body_.layout.cell.maxCoeff());
    Eigen::VectorXd yields = Eigen::VectorXd::Zero(schur.rows());
    for (int k = 0; k < yields.size(); ++k) {
        if (modes.eigenvalues()[k] < -none) return false;
        if (modes.eigenvalues()[k] > none) yields[k] = 1.0 / modes.eigenvalues()[k];
    }
    free_yield_ = modes.eigenvectors() * yields.asDiagonal() * modes.eigenvectors().transpose();
    return true;
}

Eigen::MatrixXd Equilibrium::bordered_step(const Eigen::MatrixXd& right) const {
    Eigen::MatrixXd grid = right.topRows(equations_);
    factor_.solve(grid);
    if (free_.empty()) return grid;
    Eigen::MatrixXd step(right.rows(), right.cols());
    const Eigen::MatrixXd bodies = free_yield_ * (right.bottomRows(free_yield_.rows()) + free_load_.transpose() * grid);
    step << grid + free_motion_ * bodies, bodies;
    return step;
}

// What the tangent has beyond its factored part, times a step.
Eigen::VectorXd Equilibrium::remainder_of(const Eigen::VectorXd& step) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(step.size());
    for (const Rubbing& r : rubbing_) {
        Eigen::VectorXd moved(r.rows.size());
        for (std::size_t a = 0; a < r.rows.size(); ++a) moved[a] = r.rows[a] < 0 ? 0.0 : step[r.rows[a]];
        const Eigen::VectorXd force = r.remainder * moved;
        for (std::size_t a = 0; a < r.rows.size(); ++a)
            if (r.rows[a] >= 0) sum[r.rows[a]] += force[a];
    }
    return sum;
}

Eigen::VectorXd Equilibrium::tangent_step(const Eigen::VectorXd& right) const {
    if (rubbing_.empty()) return bordered_step(right);
    return solve_with_remainder(
        right, [&](const Eigen::VectorXd& x) { return bordered_step(x); },
        [&](const Eigen::VectorXd& x) { return remainder_of(x); });
}

// What friction at a place adds beyond the symmetric part that the factor holds.
void Equilibrium::add_rubbing(std::span<const int> rows, std::span<const double> steps, Eigen::MatrixXd remainder) {
    // What is prescribed loads the others here too.
    const Eigen::VectorXd force = remainder * Eigen::Map<const Eigen::VectorXd>(steps.data(), remainder.cols());
    for (std::size_t a = 0; a < rows.size(); ++a)
        if (rows[a] >= 0) step_load_[rows[a]] -= force[a];
    rubbing_.push_back({{rows.begin(), rows.end()}, std::move(remainder)});
}

// A spring between a body and what holds a facet.
void Equilibrium::add_touch(const SlidingBody& rigid, int driver, const SlidingBody::Touch& touch, bool geometric) {
    std::vector<int> fields;
    std::vector<double> weight;  // [fields]
    const auto place = [&](int field) {
        const auto at = std::find(fields.begin(), fields.end(), field) - fields.begin();
        if (at == static_cast<std::ptrdiff_t>(fields.size())) {
            fields.push_back(field);
            weight.push_back(0.0);
        }
        return static_cast<std::size_t>(at);
    };
    const Points& points = body_.points;
    const auto holds = rigid.holds(touch.facet);
    for (const SlidingBody::Hold& hold : holds)
        for (int k = 0; k < 4; ++k) weight[place(points.node[hold.point][k])] += hold.weight[k];
    const Mat2 normal = touch.normal * touch.normal.transpose();
    const Mat2 along = Mat2::Identity() - normal;
    const double turning = geometric ? touch.force * touch.curvature : 0.0;
    const Mat2 stiffness = touch.stiffness * normal + (touch.drag.stiffness - turning) * along;

    // The other end of the spring is the body.
    const std::size_t size = 2 * fields.size();
    std::vector<int> rows(size + 2);
    std::vector<double> steps(size + 2);
    const auto spread = [&](const Mat2& by_place) {
        Eigen::MatrixXd all(size + 2, size + 2);
        for (std::size_t a = 0; a < weight.size(); ++a)
            for (std::size_t b = 0; b < weight.size(); ++b) all.block<2, 2>(2 * a, 2 * b) = weight[a] * weight[b] * by_place;
        return all;
    };
    weight.push_back(-1.0);
    for (std::size_t a = 0; a < weight.size(); ++a)
        for (std::size_t axis = 0; axis < 2; ++axis) {
            const int dof = a < fields.size() ? 2 * fields[a] + static_cast<int>(axis) : -1;
            rows[2 * a + axis] = dof < 0 ? row_of_body(driver, static_cast<int>(axis)) : row_of(dof);
            steps[2 * a + axis] = dof < 0 ? still_to_go_[driver][axis] : prescribed_step_[dof];
        }
    Eigen::MatrixXd tangent = spread(stiffness);
    couple(rows, steps, tangent);
    if (const Mat2 remainder = touch.drag.tangent - touch.drag.stiffness * along;
        touch.drag.limit > 0.0 && !remainder.isZero(0.0))
        add_rubbing(rows, steps, spread(remainder));

    // The factor takes up what joins the fields of one cell: all, or the same spring on the facet's own.
    const Facet& facet = rigid.facet(touch.facet);
    const auto own = points.node[facet.point];
    const bool is_all = holds.size() == 1;
    const auto& own_weight = is_all ? holds[0].weight : facet.weight;
    const Mat2 held = is_all ? stiffness : Mat2(touch.stiffness * normal + touch.drag.stiffness * along);
    Eigen::Matrix<double, 8, 8> own_tangent;
    for (int a = 0; a < 4; ++a)
        for (int b = 0; b < 4; ++b) own_tangent.block<2, 2>(2 * a, 2 * b) = own_weight[a] * own_weight[b] * held;
    const int cell = points.cell[facet.point];
    extra_.emplace(cell, element(own, own_tangent));
    touched_cells_.push_back(cell);
    if (is_all) return;
    for (int a = 0; a < 8; ++a)
        for (int b = 0; b < 8; ++b) tangent(2 * place(own[a / 2]) + a % 2, 2 * place(own[b / 2]) + b % 2) -= own_tangent(a, b);
    for (std::size_t a = 0; a < size; ++a) rows[a] = equation_[2 * fields[a / 2] + a % 2];
    rows.resize(size);
    spread_.push_back({std::move(rows), tangent.topLeftCorner(size, size), {}});
}

// Wheels that a few cells go round feel what the grid misses of the wood's yield, where it is known before what they may touch.
void Equilibrium::let_yield(SlidingBody& rigid, const Vec2& travel) {
    constexpr double margin = 3.0;  // of the way [cells]
    if (!plan_.finer_at_wheels || !is_small_circle(rigid.shape(), body_.layout)) return;
    const Box at_start = bounds(rigid.shape());
    const Vec2 more = margin * body_.layout.cell;
    const Box way{at_start.low.cwiseMin(at_start.low + travel) - more, at_start.high.cwiseMax(at_start.high + travel) + more};
    rigid.let_yield(LocalYield::about(way, rigid, scene_, plan_, materials_, body_));
}

void Equilibrium::forget_yield_slopes() {
    for (const SlidingBody& rigid : sliding_)
        if (rigid.yield()) rigid.yield()->forget_slopes();
}

// What the yield of stations beyond the grid's takes off the springs' stiffness K: K P gives P^T K (LocalYield::pressed).
void Equilibrium::add_yield(const SlidingBody& rigid, int driver, const std::vector<SlidingBody::Touch>& touches) {
    const LocalYield::Pressed pressed = rigid.yield()->pressed(touches);
    if (pressed.stations.empty()) return;
    const Points& points = body_.points;
    std::vector<int> fields;
    for (const SlidingBody::Touch& touch : touches)
        for (const SlidingBody::Hold& hold : rigid.holds(touch.facet))
            fields.insert(fields.end(), points.node[hold.point].begin(), points.node[hold.point].end());
    std::ranges::sort(fields);
    fields.erase(std::ranges::unique(fields).begin(), fields.end());
    const auto size = static_cast<Eigen::Index>(2 * fields.size());
    Eigen::MatrixXd push = Eigen::MatrixXd::Zero(size + 2, touches.size());  // on fields and the body, of a unit force
    for (std::size_t i = 0; i < touches.size(); ++i) {
        for (const SlidingBody::Hold& hold : rigid.holds(touches[i].facet))
            for (int k = 0; k < 4; ++k) {
                const auto at = std::ranges::lower_bound(fields, points.node[hold.point][k]) - fields.begin();
                push.col(i).segment<2>(2 * at) += hold.weight[k] * touches[i].normal;
            }
        push.col(i).tail<2>() -= touches[i].normal;
    }
    const Eigen::MatrixXd pull = push * pressed.stiffness.asDiagonal() * pressed.share;
    std::vector<int> rows(size + 2);
    std::vector<double> steps(size + 2);
    for (Eigen::Index a = 0; a < size + 2; ++a) {
        const int axis = static_cast<int>(a % 2), dof = a < size ? 2 * fields[a / 2] + axis : -1;
        rows[a] = dof < 0 ? row_of_body(driver, axis) : row_of(dof);
        steps[a] = dof < 0 ? still_to_go_[driver][axis] : prescribed_step_[dof];
    }
    couple(rows, steps, -pull * pressed.gives * pull.transpose());
    for (Eigen::Index a = 0; a < size; ++a) rows[a] = equation_[2 * fields[a / 2] + a % 2];
    rows.resize(size);
    spread_.push_back({std::move(rows), -pull.topRows(size) * pressed.gives * pull.topRows(size).transpose(), {}});
}

// Into the factor. Touches share rows and have one column for each of these together.
bool Equilibrium::take_in_spread() {
    std::vector<int> units;  // equations
    for (const Spread& spread : spread_)
        if (spread.columns.size() == 0)
            std::ranges::copy_if(spread.rows, std::back_inserter(units), [](int row) { return row >= 0; });
    std::ranges::sort(units);
    units.erase(std::ranges::unique(units).begin(), units.end());
    auto count = static_cast<Eigen::Index>(units.size());
    std::vector<Eigen::Triplet<double>> columns;
    for (Eigen::Index k = 0; k < count; ++k) columns.emplace_back(units[k], k, 1.0);
    std::vector<Eigen::Triplet<double>> stiffness;
    for (const Spread& spread : std::exchange(spread_, {})) {
        std::vector<Eigen::Index> at;  // its columns among all, or -1
        for (Eigen::Index k = 0; k < spread.columns.cols(); ++k) {
            for (std::size_t a = 0; a < spread.rows.size(); ++a)
                if (spread.rows[a] >= 0) columns.emplace_back(spread.rows[a], count, spread.columns(a, k));
            at.push_back(count++);
        }
        if (at.empty())
            for (const int row : spread.rows) at.push_back(row < 0 ? -1 : std::ranges::lower_bound(units, row) - units.begin());
        for (std::size_t b = 0; b < at.size(); ++b)
            for (std::size_t a = 0; a < at.size(); ++a)
                if (at[a] >= 0 && at[b] >= 0) stiffness.emplace_back(at[a], at[b], spread.stiffness(a, b));
    }
    if (count == 0) return true;
    GridFactor::Sparse all(equations_, count), between(count, count);
    all.setFromTriplets(columns.begin(), columns.end());
    between.setFromTriplets(stiffness.begin(), stiffness.end());
    return factor_.add_wide(all, between);
}

bool Equilibrium::rubs(const FieldPair& pair) const {
    return scene_.cracks[pair.crack].faces.coefficient > 0.0 && mass_[pair.left] > 0.0 && mass_[pair.right] > 0.0;
}

// Friction between the faces of a pair, on the left one, in their frame.
Drag Equilibrium::face_drag(std::size_t k) const {
    const FieldPair& pair = cracks_.pairs[k];
    if (!rubs(pair)) return {};
    const double friction = scene_.cracks[pair.crack].faces.coefficient;
    const Vec2 place = apart(k, displacement_);
    const Vec2 before = apart(k, settled_);
    const double stiffness = pair.normal.dot(face_stiffness(k) * pair.normal);
    if (stiffness == 0.0) return {};
    const double depth = -place.dot(pair.normal);
    const double depth_before = std::min(0.0, -before.dot(pair.normal));
    const Pressing pressing{pair.normal, 0.0, stiffness * depth, stiffness, depth, depth_before, place - before};
    return drag(pressing, friction, stiffness, k < face_grips_.size() ? face_grips_[k] : Grip{});
}

// A step to where, the wood taken for linear, each pair of faces that rub is open, grips or slides as its own law says: with
// springs between all of them in place of what they are, so that the rest has a compliance, and by going from pair to pair
// (friction.hpp). Newton's method alone goes round in circles where many of them change at a time.
bool Equilibrium::sort_out_faces() {
    std::vector<RubbingPlace> places;
    std::vector<int> pairs;
    for (std::size_t k = 0; k < cracks_.pairs.size(); ++k) {
        const FieldPair& pair = cracks_.pairs[k];
        if (!rubs(pair) || pieces_.is_loose(pair.left) || pieces_.is_loose(pair.right)) continue;
        const double stretch = k < face_grips_.size() ? face_grips_[k].stretch : 0.0;
        pairs.push_back(static_cast<int>(k));
        const double stiffness = closed_stiffness(pair);
        places.push_back({normals_[k], stiffness, scene_.cracks[pair.crack].faces.coefficient,
                          displacement_[pair.left] - displacement_[pair.right], turn_of(k) * apart(k, settled_), stretch,
                          joint * stiffness});
    }
    joins_faces_ = true;
    const bool made = factor_tangent(true) || factor_tangent(false);
    joins_faces_ = false;
    if (!made || pairs.empty()) return false;
    const auto count = static_cast<Eigen::Index>(places.size());
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(out_of_balance().size(), 2 * count);  // forces that part the pairs
    Eigen::VectorXd load = out_of_balance();
    for (Eigen::Index i = 0; i < count; ++i)
        for (int axis = 0; axis < 2; ++axis) {
            const FieldPair& pair = cracks_.pairs[pairs[i]];
            if (const int row = row_of(2 * pair.left + axis); row >= 0) unit(row, 2 * i + axis) += 1.0;
            if (const int row = row_of(2 * pair.right + axis); row >= 0) unit(row, 2 * i + axis) -= 1.0;
        }
    for (Eigen::Index i = 0; i < count; ++i) load -= unit.middleCols<2>(2 * i) * places[i].force(Vec2::Zero());
    const Eigen::MatrixXd yields = bordered_step(unit);
    const Eigen::VectorXd without = bordered_step(load);
    const Eigen::VectorXd forces = balance_of_rubbing(places, unit.transpose() * yields, unit.transpose() * without);
    move(without + yields * forces, 1.0);
    find_forces();
    return true;
}

// What pressed faces put on the left one of each pair [N].
std::vector<Vec2> Equilibrium::face_forces() const {
    std::vector<Vec2> forces;
    for (std::size_t k = 0; k < cracks_.pairs.size(); ++k) {
        const bool both = is_whole(cracks_.pairs[k]);
        const Vec2 place = apart(k, displacement_);
        forces.push_back(both ? Vec2(turn_of(k) * (face_drag(k).force - face_stiffness(k) * place)) : Vec2(Vec2::Zero()));
    }
    return forces;
}

// Friction counts from here on.
void Equilibrium::settle() {
    if (history_) history_->settle();
    for (std::size_t i = 0; i < sliding_.size(); ++i) sliding_[i].settle(place_of(sliding_driver_[i]), displacement_);
    if (settled_.empty()) return;
    std::vector<Grip> grips(cracks_.pairs.size());
    for (std::size_t k = 0; k < grips.size(); ++k) {
        const Drag drag = face_drag(k);
        grips[k] = {static_cast<int>(k), drag.stretch};
        face_dissipated_ += drag.dissipated;
    }
    face_grips_ = std::move(grips);
    settled_ = displacement_;
}

double Equilibrium::dissipated() const {
    double sum = face_dissipated_;
    for (const SlidingBody& body : sliding_) sum += body.dissipated();
    if (history_) sum += history_->dissipated() + lost_by_ties_;
    return sum;
}

Equilibrium::Contacts Equilibrium::contacts() const {
    Contacts contacts{moved_, {}, face_grips_, {}, {}, {}, 0.0, slips_};
    for (const SlidingBody& body : sliding_) {
        contacts.bodies.push_back(body.grips());
        contacts.dissipated.push_back(body.dissipated());
    }
    contacts.dissipated.push_back(face_dissipated_);
    if (history_) contacts.history = history_->save();
    contacts.kept = kept_;
    contacts.lost_by_ties = lost_by_ties_;
    return contacts;
}

void Equilibrium::set_contacts(const Contacts& contacts) {
    if (history_) history_->restore(contacts.history);
    kept_ = contacts.kept;
    lost_by_ties_ = contacts.lost_by_ties;
    slips_ = contacts.slips;
    const bool at_start = contacts.moved.empty();
    moved_ = at_start ? seat_ : contacts.moved;
    for (std::size_t i = 0; i < sliding_.size(); ++i)
        sliding_[i].restore(at_start ? std::vector<Grip>{} : contacts.bodies[i], at_start ? 0.0 : contacts.dissipated[i],
                            place_of(sliding_driver_[i]), displacement_);
    if (settled_.empty()) return;
    settled_ = displacement_;
    face_grips_ = contacts.faces;
    face_dissipated_ = at_start ? 0.0 : contacts.dissipated.back();
}

}  // namespace crampfit

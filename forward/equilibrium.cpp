#include "forward/equilibrium.hpp"

#include "forward/deformation.hpp"
#include "forward/local_yield.hpp"
#include "forward/seen_strain.hpp"
#include "forward/side_by_side.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

namespace crampfit {

namespace {

// Newton's method ends when no force out of balance exceeds this part of the largest force on a node. A wheel on a sharp corner
// does not always come below 1e-9.
constexpr double balance = 1e-8;
// What is less than this part of the largest force out of balance is left over from the solution before: where all else is
// nothing, as away from a tip that has grown, the factor's parts need not be asked.
constexpr double rounding = 1e-11;
constexpr int most_iterations = 60;
// Rounding can leave a small positive pivot where the specimen can move as a whole: the condition is then 1e-12 and below,
// against 1e-3 of a held one.
constexpr double least_reciprocal_condition = 1e-10;

// An old tangent goes on as long as so many more steps with it, as quick as the last one, bring the forces into balance: that
// many cost as much as a new one.
constexpr double worth_keeping = 2.0;
// With friction steps do not mend it: it goes on as long as a step makes the forces out of balance smaller by this.
constexpr double worth_keeping_with_friction = 0.25;
// A cell keeps its part of the factor until its displacement gradient has changed by this much, and for so many iterations of a
// solution. Forces are exact all the same, and the steps hardly more (measured: 0.003 to 0.03 take the same time). For the many
// equilibria, much alike, of a growing crack: else the tangent is exact, which keeps mirror images what they are where
// equilibrium is unstable.
constexpr double slack_of_tangent = 0.005;
constexpr int quick_iterations = 10;
constexpr int sorting = 6;       // iterations without an end after which faces that rub are sorted into those that grip and slide
constexpr int most_trials = 12;  // of a part of a Newton step

// Stiffness, of the wood's times the thickness, with which a specimen that bodies do not hold yet is kept from going far.
// Equilibrium does not hang on it: it is in no force.
constexpr double loose_stiffness = 0.01;

// Of the load, what a guide may take: less than any friction would hold.
constexpr double most_on_guide = 0.01;

// No smaller force counts in that than one that strains a cell of the stiffest wood by this much.
constexpr double least_strain = 1e-5;

// Ties keep so much of their stiffness at least.
constexpr double least_kept = 1e-3;

}  // namespace

Equilibrium::Equilibrium(const Scene& scene, const Plan& plan, const MaterialMap& materials, Discretisation& body, int threads,
                         const Equilibrium* same)
    : scene_(scene), plan_(plan), body_(body), materials_(materials),
      cracks_(scene, body, materials, least_freed_at_rest, plan.cuts_domains), boundary_(scene, body, cracks_, &materials),
      gauges_(scene), history_(plan.remembers ? std::make_unique<History>(materials, body, scene.model.plane) : nullptr),
      internal_force_(body, materials, plan.rotates, history_.get()), side_by_side_(have_threads(threads)),
      factor_(body.layout.cells_x, body.layout.cells_y, threads) {
    if (slides_on_faces(scene)) face_facets_.emplace(scene, body, cracks_);
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        if (scene.bodies[b].contact.kind == Contact::Kind::bonded) continue;
        sliding_.emplace_back(scene.bodies[b].shape, body, scene.bodies[b].contact.coefficient,
                              face_facets_ ? &*face_facets_ : nullptr);
        sliding_driver_.push_back(boundary_.first_body() + static_cast<int>(b));
    }
    do_side_by_side(side_by_side_, sliding_.size(), [&](std::size_t s) {
        if (same) sliding_[s].let_yield(same->sliding_[s].yield());
        else let_yield(sliding_[s], boundary_.travel(sliding_driver_[s], std::min(plan.end_time, plan.still_from)));
    });
    displacement_.assign(cracks_.fields(), Vec2::Zero());
    double stiffest = 0.0;
    for (int p = 0; p < body.points.count(); ++p) stiffest = std::max(stiffest, body.points.stiffest(p));
    least_force_ = least_strain * stiffest * body.layout.cell.maxCoeff() * body.layout.thickness;
    find_free_bodies();
    const auto goes_through = [](const CrackLine& line) { return !line.start.inside && !line.end.inside; };
    if (!cracks_.lines.empty()) find_pieces(std::ranges::any_of(cracks_.lines, goes_through));
    mass_ = field_masses(body_, cracks_.fields());
    find_guides();
    renumber();
    find_forces();
}

void Equilibrium::renumber() {
    const int fields = cracks_.fields();
    mass_ = field_masses(body_, fields);
    normals_.take_in(body_, cracks_, plan_.rotates);
    equation_.assign(2 * fields, 0);
    free_of_dof_.assign(2 * fields, -1);
    for (const Boundary::Held& held : boundary_.held) {
        const int dof = 2 * held.field + held.axis;
        equation_[dof] = -1;
        for (std::size_t k = 0; k < free_.size(); ++k)
            if (free_[k].driver == held.driver && free_[k].axis == held.axis) free_of_dof_[dof] = static_cast<int>(k);
    }
    for (const int dof : pieces_.holds) equation_[dof] = -1;
    for (const int dof : guides_) equation_[dof] = -1;
    std::vector<int> count(body_.layout.nodes(), 0);
    for (int dof = 0; dof < 2 * fields; ++dof) {
        if (mass_[dof / 2] == 0.0) equation_[dof] = -1;
        if (equation_[dof] == 0) equation_[dof] = count[cracks_.node_of_field[dof / 2]]++;  // its place at the node
    }
    std::vector<int> first(count.size());
    std::vector<int> node_at(count.size());
    for (std::size_t n = 0; n < count.size(); ++n) node_at[factor_.places()[n]] = static_cast<int>(n);
    equations_ = 0;
    for (const int node : node_at) {
        first[node] = equations_;
        equations_ += count[node];
    }
    for (int dof = 0; dof < 2 * fields; ++dof)
        if (equation_[dof] >= 0) equation_[dof] += first[cracks_.node_of_field[dof / 2]];
    factor_.set_equations(first, count);
}

std::vector<CrackFields::NewField> Equilibrium::grow(int crack, bool at_end, const Vec2& to) {
    const Box changed = cracks_.window(cracks_.lines[crack].tip(at_end).position, to);
    const auto fields = cracks_.grow(crack, at_end, to);
    for (const auto& [added, from] : fields) displacement_.push_back(displacement_[from]);
    for (const auto& [added, from] : fields)
        if (!settled_.empty()) settled_.push_back(settled_[from]);
    boundary_.follow(cracks_);
    internal_force_.sort_cells();
    // A tip that ends, or comes near another crack, may cut a piece free.
    if (!cracks_.lines[crack].tip(at_end).inside || cracks_.lines.size() > 1) find_pieces(false);
    renumber();
    if (face_facets_) face_facets_->take_in(changed);
    for (SlidingBody& rigid : sliding_) rigid.take_in_faces(changed, mass_);
    body_.for_cells_in(changed, [&](int c) { factor_.mark(c); });
    return fields;
}

// Where bodies slide, contact decides what can move. What a crack drawn through has cut loose is an error in the scene, but for
// crumbs, lighter than a cell, between cracks that cross; what the grid alone sees as loose, between cracks that nearly meet, is
// not.
void Equilibrium::find_pieces(bool crumbs_only) {
    if (!sliding_.empty()) return;
    const std::vector<double> mass = field_masses(body_, cracks_.fields());
    const double heaviest = crumbs_only ? *std::ranges::max_element(mass) : std::numeric_limits<double>::infinity();
    pieces_ = find_loose_pieces(body_, cracks_, boundary_, mass, heaviest);
}

// Ties stand for wood about a tip, or about the end of a held stretch, that no cell resolves. Where that has relaxed or flows,
// they do: by the secant stiffness, stress times strain over the same if the wood were elastic.
void Equilibrium::see_what_is_kept() {
    if (cracks_.pairs.empty() && boundary_.tied.empty()) return;
    std::vector<double> is(displacement_.size(), 0.0), elastic(displacement_.size(), 0.0);
    for (int c = 0; c < body_.layout.cells(); ++c) {
        if (!history_->is_in(c)) continue;
        for_groups(body_.points, c, [&](const PointGroup& group) {
            const SeenStrains seen(body_, *history_, group, displacement_, plan_.rotates);
            for (int i = 0; i < group.count; ++i) {
                const int p = group.point[i];
                const Eigen::Vector3d& strain = seen.strain[i];
                const Tensor stress = history_->stress(p, strain);
                const double work = stress[0] * strain[0] + stress[1] * strain[1] + stress[3] * strain[2];
                for (const int f : body_.points.node[p]) {
                    is[f] += body_.points.volume[p] * work;
                    elastic[f] += body_.points.volume[p] * strain.dot(body_.points.stiffness_of(p) * strain);
                }
            }
        });
    }
    lost_by_ties_ += ties_energy();
    kept_.assign(displacement_.size(), 1.0);
    for (std::size_t f = 0; f < kept_.size(); ++f)
        if (elastic[f] > 0.0) kept_[f] = std::clamp(is[f] / elastic[f], least_kept, 1.0);
    lost_by_ties_ -= ties_energy();
}

double Equilibrium::tie_of(const FieldPair& pair) const {
    return 0.5 * (kept(pair.left) + kept(pair.right)) * shared_tie(pair, mass_);
}

// Forces out of balance, reactions, and the energies that are not the points'.
void Equilibrium::find_forces() {
    potential_.reset();
    normals_.turn(displacement_);
    force_.assign(displacement_.size(), Vec2::Zero());
    reaction_.assign(boundary_.drivers(), Vec2::Zero());
    do_side_by_side(side_by_side_, sliding_.size() + 1, [&](std::size_t k) {
        if (k > 0) sliding_[k - 1].meet(place_of(sliding_driver_[k - 1]), displacement_);
        else points_energy_ = internal_force_.add_with_energy(displacement_, force_, side_by_side_);
    });
    face_energy_ = face_dissipated_;
    for (std::size_t k = 0; k < cracks_.pairs.size(); ++k) {
        const FieldPair& pair = cracks_.pairs[k];
        if (!is_whole(pair)) continue;
        const Vec2 pull = tie_of(pair) * (displacement_[pair.left] - displacement_[pair.right]);
        force_[pair.left] -= pull;
        force_[pair.right] += pull;
        const Drag drag = face_drag(k);
        const Vec2 place = apart(k, displacement_);
        push_faces(k, drag.force - face_stiffness(k) * place,
                   std::function([&](int field, const Vec2& push) { force_[field] += push; }));
        face_energy_ += 0.5 * place.dot(face_stiffness(k) * place) + drag.energy + drag.dissipated;
    }
    add_external_forces(force_, reaction_);
    contact_energy_ = 0.0;
    for (const SlidingBody& body : sliding_) contact_energy_ += body.stored_energy() + body.dissipated();
    for (const Boundary::Held& held : boundary_.held)
        if (mass_[held.field] > 0.0) reaction_[held.driver][held.axis] -= force_[held.field][held.axis];
}

// By tractions, bodies, and edges where these do not hold fields.
void Equilibrium::add_external_forces(std::vector<Vec2>& force, std::vector<Vec2>& reaction) const {
    for (const Boundary::Traction& t : boundary_.tractions) {
        for (int k = 0; k < 4; ++k) force[t.field[k]] += t.facet.weight[k] * t.force;
        reaction[t.driver] += t.force;
    }
    for (std::size_t i = 0; i < sliding_.size(); ++i) reaction[sliding_driver_[i]] = sliding_[i].push(force);
    for (const Boundary::Tied& tie : boundary_.tied) {
        if (mass_[tie.field] == 0.0) continue;
        const double pull = tie_of(tie) * lag(tie);
        force[tie.field][tie.axis] += pull;
        reaction[tie.driver][tie.axis] += pull;
    }
}

Equilibrium::FreeBody Equilibrium::free_body() const {
    FreeBody free{potential() - contact_energy_ + traction_work() - edge_ties_energy(),
                  std::vector<Vec2>(displacement_.size(), Vec2::Zero())};
    std::vector<Vec2> reaction(reaction_.size(), Vec2::Zero());
    add_external_forces(free.external_forces, reaction);
    for (const Boundary::Held& held : boundary_.held)
        if (mass_[held.field] > 0.0) free.external_forces[held.field][held.axis] -= force_[held.field][held.axis];
    return free;
}

GridFactor::Element Equilibrium::element(std::span<const int> fields, const Eigen::Matrix<double, 8, 8>& stiffness) const {
    GridFactor::Element made{{}, stiffness};
    for (int a = 0; a < 8; ++a) made.equation[a] = fields[a / 2] < 0 ? -1 : equation_[2 * fields[a / 2] + a % 2];
    return made;
}

// Of a stiffness, what prescribed components put on the equations as they go on, and what free bodies do.
void Equilibrium::couple(std::span<const int> rows, std::span<const double> steps,
                         const Eigen::Ref<const Eigen::MatrixXd>& stiffness) {
    for (std::size_t b = 0; b < rows.size(); ++b) {
        const int free = rows[b] - equations_;
        if (rows[b] >= 0 ? free < 0 : steps[b] == 0.0) continue;
        for (std::size_t a = 0; a < rows.size(); ++a) {
            if (rows[a] < 0) continue;
            if (rows[b] < 0) step_load_[rows[a]] -= stiffness(a, b) * steps[b];
            else if (rows[a] < equations_) free_load_(rows[a], free) -= stiffness(a, b);
            else free_stiffness_(rows[a] - equations_, free) += stiffness(a, b);
        }
    }
}

// The same of what joins up to four fields.
void Equilibrium::couple_fields(std::span<const int> fields, const Eigen::Matrix<double, 8, 8>& stiffness) {
    std::array<int, 8> rows;
    std::array<double, 8> steps;
    for (int a = 0; a < 8; ++a) {
        const int dof = 2 * fields[a / 2] + a % 2;
        rows[a] = fields[a / 2] < 0 ? -1 : row_of(dof);
        steps[a] = fields[a / 2] < 0 ? 0.0 : prescribed_step_[dof];
    }
    couple(rows, steps, stiffness);
}

void Equilibrium::add_extra(int cell, std::span<const int> fields, const Eigen::Matrix<double, 8, 8>& stiffness) {
    extra_.emplace(cell, element(fields, stiffness));
    couple_fields(fields, stiffness);
}

// Points of a cell that are on the same fields go together.
template <class Visit>
void Equilibrium::for_groups_of(int c, const Visit& visit) const {
    for_groups(body_.points, c, [&](const PointGroup& group) { visit(std::as_const(body_.points).node[group.point[0]], group); });
}

// The same of the points.
void Equilibrium::couple_points(bool geometric) {
    if (free_.empty() && std::all_of(prescribed_step_.begin(), prescribed_step_.end(), [](double step) { return step == 0.0; }))
        return;
    const auto goes = [&](int f) {
        return prescribed_step_[2 * f] != 0.0 || prescribed_step_[2 * f + 1] != 0.0 || free_of_dof_[2 * f] >= 0 ||
               free_of_dof_[2 * f + 1] >= 0;
    };
    for (int c = 0; c < body_.layout.cells(); ++c)
        for_groups_of(c, [&](std::span<const int> fields, const PointGroup& group) {
            if (std::any_of(fields.begin(), fields.end(), goes))
                couple_fields(fields, internal_force_.tangent(group, displacement_, geometric));
        });
}

// One of the cells that a node is a corner of.
int Equilibrium::cell_at(int node) const {
    const Layout& layout = body_.layout;
    return layout.cell_index(std::min(node % (layout.cells_x + 1), layout.cells_x - 1),
                             std::min(node / (layout.cells_x + 1), layout.cells_y - 1));
}

void Equilibrium::add_pairs(bool geometric) {
    pair_stiffness_.resize(cracks_.pairs.size(), Mat2::Zero());
    for (std::size_t k = 0; k < cracks_.pairs.size(); ++k) {
        const FieldPair& pair = cracks_.pairs[k];
        const int cell = cell_at(pair.node);
        Mat2 held = Mat2::Zero(), remainder = Mat2::Zero();  // in the frame of the faces
        if (is_whole(pair)) held = face_stiffness(k);
        if (joins_faces_ && rubs(pair)) {
            held = joint * closed_stiffness(pair) * Mat2::Identity();
        } else if (const Drag drag = face_drag(k); drag.limit > 0.0) {
            const Vec2 along = left_of(pair.normal);
            remainder = drag.tangent - drag.stiffness * along * along.transpose();
            held += drag.stiffness * along * along.transpose();
        }
        const Mat2 turn = turn_of(k);
        Mat2 stiffness = turn * held * turn.transpose();
        if (is_whole(pair)) stiffness += tie_of(pair) * Mat2::Identity();
        if (std::exchange(pair_stiffness_[k], stiffness) != stiffness) factor_.mark(cell);
        if (stiffness.isZero(0.0)) continue;
        Eigen::Matrix<double, 8, 8> both = Eigen::Matrix<double, 8, 8>::Zero();
        both.topLeftCorner<4, 4>() << stiffness, -stiffness, -stiffness, stiffness;
        add_extra(cell, std::array{pair.left, pair.right, -1, -1}, both);
        if (!held.isZero(0.0)) add_turning(k, held, remainder, geometric);
    }
}

void Equilibrium::add_edge_ties() {
    for (const Boundary::Tied& tie : boundary_.tied) {
        if (mass_[tie.field] == 0.0) continue;
        Eigen::Matrix<double, 8, 8> stiffness = Eigen::Matrix<double, 8, 8>::Zero();
        stiffness(tie.axis, tie.axis) = tie_of(tie);
        add_extra(cell_at(cracks_.node_of_field[tie.field]), std::array{tie.field, -1, -1, -1}, stiffness);
        step_load_[equation_[2 * tie.field + tie.axis]] += tie_of(tie) * still_to_go_[tie.driver][tie.axis];
    }
}

void Equilibrium::add_lone_points() {
    for (const InternalForce::Alone& alone : internal_force_.alone()) {
        const auto& sign = crosswise_sign;
        Eigen::Matrix<double, 8, 8> tangent;
        for (int a = 0; a < 4; ++a)
            for (int b = 0; b < 4; ++b)
                tangent.block<2, 2>(2 * a, 2 * b) = alone.stiffness * sign[a] * sign[b] * Mat2::Identity();
        add_extra(alone.cell, alone.node, tangent);
    }
}

void Equilibrium::add_slivers(bool geometric) {
    for (const Sliver& sliver : body_.slivers) {
        const auto [own, less] = internal_force_.tangents(sliver, displacement_, geometric);
        const int cell = body_.points.cell[sliver.point];
        add_extra(cell, sliver.node, own);
        add_extra(cell, body_.points.node[sliver.point], less);
    }
}

void Equilibrium::add_touches(bool geometric) {
    for (std::size_t i = 0; i < sliding_.size(); ++i) {
        const int driver = sliding_driver_[i];
        const std::vector<SlidingBody::Touch> touches = sliding_[i].touches(place_of(driver), displacement_);
        for (const SlidingBody::Touch& touch : touches) add_touch(sliding_[i], driver, touch, geometric);
        if (sliding_[i].yield()) add_yield(sliding_[i], driver, touches);
    }
}

// Marks where the tangent is not, to within `slack`, what it was when it was factored. What a growing crack changes is marked
// already, and in a linear scene that is all.
void Equilibrium::mark_changes(bool geometric, double slack) {
    const bool other_kind = std::exchange(factored_geometric_, geometric) != geometric;
    if (!free_.empty() || plan_.friction || history_ || other_kind) factor_.mark_all();
    if (plan_.linear) return;
    factored_at_.resize(body_.points.count(), Mat2::Constant(INFINITY));
    for (int c = 0; c < body_.layout.cells(); ++c)
        for_groups_of(c, [&](std::span<const int>, const PointGroup& group) {
            const int first = group.point[0];
            const Mat2 change = gradient_at(body_, first, displacement_) - factored_at_[first];
            if (!(change.cwiseAbs().maxCoeff() <= slack)) factor_.mark(c);
        });
}

// The tangent where it stands; with `slack`, of gradients that differ from these by so much at most.
bool Equilibrium::factor_tangent(bool geometric, double slack) {
    mark_changes(geometric, slack);
    for (const int c : std::exchange(touched_cells_, {})) factor_.mark(c);  // bodies may have left them
    const int free = static_cast<int>(free_.size());
    step_load_.setZero(equations_ + free);
    free_load_.setZero(equations_, free);
    free_stiffness_.setZero(free, free);
    rubbing_.clear();
    spread_.clear();
    extra_.clear();
    lessons_.clear();
    add_lone_points();
    add_slivers(geometric);
    add_pairs(geometric);
    add_edge_ties();
    add_hinges();
    add_touches(geometric);
    couple_points(geometric);
    for (const int c : touched_cells_) factor_.mark(c);
    ++factorisations_;
    const auto assemble = [&](int cell, std::vector<GridFactor::Element>& elements) {
        for_groups_of(cell, [&](std::span<const int> fields, const PointGroup& group) {
            const int first_point = group.point[0];
            elements.push_back(element(fields, internal_force_.tangent(group, displacement_, geometric)));
            if (!plan_.linear) factored_at_[first_point] = gradient_at(body_, first_point, displacement_);
            if (loose_) {
                const double spring =
                    loose_stiffness * body_.points.stiffest(first_point) * body_.layout.thickness / body_.layout.cells();
                elements.push_back(element(fields, spring * Eigen::Matrix<double, 8, 8>::Identity()));
            }
        });
        const auto [first, last] = extra_.equal_range(cell);
        for (auto other = first; other != last; ++other) elements.push_back(other->second);
    };
    return factor_.factor(assemble) && factor_.reciprocal_condition() > least_reciprocal_condition && take_in_spread() &&
           border_tangent();
}

double Equilibrium::largest_residual() const { return out_of_balance().lpNorm<Eigen::Infinity>(); }

void Equilibrium::prescribe(double time) {
    prescribed_step_.assign(equation_.size(), 0.0);
    for (const Boundary::Held& held : boundary_.held)
        prescribed_step_[2 * held.field + held.axis] =
            (boundary_.travel(held.driver, time) + moved_[held.driver])[held.axis] - displacement_[held.field][held.axis];
    still_to_go_.resize(boundary_.drivers());
    for (int d = 0; d < boundary_.drivers(); ++d) still_to_go_[d] = boundary_.travel(d, time) - boundary_.travel(d, time_);
    next_time_ = time;
    if (plan_.linear) move_prescribed();
}

void Equilibrium::move_prescribed() {
    time_ = next_time_;
    for (std::size_t dof = 0; dof < equation_.size(); ++dof) displacement_[dof / 2][dof % 2] += prescribed_step_[dof];
    std::fill(prescribed_step_.begin(), prescribed_step_.end(), 0.0);
    std::fill(still_to_go_.begin(), still_to_go_.end(), Vec2::Zero());
}

// Slope of the potential along a step of the equations' unknowns [J].
double Equilibrium::slope_along(const Eigen::VectorXd& step) const { return -out_of_balance().dot(step); }

void Equilibrium::move(const Eigen::VectorXd& step, double share) {
    for (std::size_t k = 0; k < free_.size(); ++k)
        moved_[free_[k].driver][free_[k].axis] += share * step[equations_ + static_cast<int>(k)];
    for (std::size_t dof = 0; dof < equation_.size(); ++dof)
        if (const int row = row_of(static_cast<int>(dof)); row >= 0) displacement_[dof / 2][dof % 2] += share * step[row];
}

// A full Newton step, or less of it where contact changes so much on the way that the potential has long been rising again.
double Equilibrium::take_step(const Eigen::VectorXd& step) {
    const double at_start = slope_along(step);
    double low = 0.0, high = 1.0, at_low = at_start, gone = 1.0;
    move(step, 1.0);
    find_forces();
    double here = slope_along(step);
    for (int trial = 0; trial < most_trials && std::abs(here) > 0.5 * std::abs(at_start) && (here > 0.0 || gone < 1.0); ++trial) {
        double at_high = here;
        (here > 0.0 ? high : low) = gone;
        if (here <= 0.0) at_low = here;
        // Between the secant's zero and the middle: safe, and quick where the slope is nearly straight.
        const double secant = here > 0.0 ? low - at_low * (high - low) / (at_high - at_low) : 0.5 * (low + high);
        const double next = std::clamp(secant, low + 0.1 * (high - low), high - 0.1 * (high - low));
        move(step, next - gone);
        gone = next;
        find_forces();
        here = slope_along(step);
    }
    return gone;
}

// The tangent as factored, mended by what steps since then have shown of it (limited-memory BFGS, Nocedal 1980): contact changes
// few directions, which a few steps tell.
Eigen::VectorXd Equilibrium::newton_step(Eigen::VectorXd load) const {
    std::vector<double> share(lessons_.size());
    for (std::size_t k = lessons_.size(); k-- > 0;) {
        share[k] = lessons_[k].step.dot(load) / lessons_[k].work;
        load -= share[k] * lessons_[k].force;
    }
    Eigen::VectorXd step = tangent_step(load);
    for (std::size_t k = 0; k < lessons_.size(); ++k)
        step += (share[k] - lessons_[k].force.dot(step) / lessons_[k].work) * lessons_[k].step;
    return step;
}

void Equilibrium::learn(Eigen::VectorXd step, Eigen::VectorXd force) {
    if (!rubbing_.empty()) return;  // the tangent is not symmetric
    const double work = step.dot(force);
    if (work > 1e-8 * step.norm() * force.norm()) lessons_.push_back({std::move(step), std::move(force), work});
}

Equilibrium::Outcome Equilibrium::solve(double time) {
    if (history_) see_what_is_kept();
    prescribe(time);
    if (history_) history_->go_to(time);
    bool renew = true;
    double slack = plan_.grows ? slack_of_tangent : 0.0;
    // Away from equilibrium the tangent need not be positive; without its geometric part it is, unless something is loose.
    const auto factor = [&] {
        constexpr int most_hinges = 6;
        drop_hinges();
        set_loose(false);
        while (!(slack > 0.0 && factor_tangent(true, slack)) && !factor_tangent(true, 0.0) && !factor_tangent(false, 0.0))
            if (hinges_.size() == most_hinges || !hold_hinge()) return false;
        return std::ranges::none_of(hinges_, [&](int hinge) { return moves_most(hinge); });
    };
    const bool sticks =
        std::ranges::any_of(scene_.cracks, [](const Crack& crack) { return crack.faces.kind == CrackFaces::Kind::stick; });
    slips_.assign(sticks ? cracks_.pairs.size() : 0, false);
    std::vector<char> closed(slips_.size(), false);
    std::vector<int> changes(slips_.size(), 0);
    find_forces();
    double residual = largest_residual();
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
        if (renew && !factor()) {
            if (sliding_.empty()) return Outcome::mechanism;
            const bool is_there = time_ == time;
            time_ = time;  // held by bodies that do not touch yet, perhaps: try with these where they are going
            std::fill(still_to_go_.begin(), still_to_go_.end(), Vec2::Zero());
            find_forces();
            if (is_there || !factor()) {  // then let it go to them
                set_loose(true);
                if (!factor_tangent(false)) return Outcome::mechanism;
            }
        }
        const Eigen::VectorXd start = out_of_balance();
        Eigen::VectorXd load = start + step_load_;
        if (plan_.linear) load = (load.array().abs() > rounding * load.lpNorm<Eigen::Infinity>()).select(load, 0.0);
        const Eigen::VectorXd step = newton_step(std::move(load));
        step_load_.setZero();
        const bool moves_boundary =
            time_ != time || std::any_of(prescribed_step_.begin(), prescribed_step_.end(), [](double d) { return d != 0.0; });
        if (moves_boundary) {  // along the tangent where it stands, all that is prescribed included
            move_prescribed();
            move(step, 1.0);
            find_forces();
        } else {
            const double share = take_step(step);
            learn(share * step, start - out_of_balance());
        }
        double scale = least_force_;
        for (const Vec2& r : reaction_) scale = std::max(scale, r.norm());
        if (!(scale < INFINITY)) return Outcome::not_converged;
        const double before = std::exchange(residual, largest_residual());
        if (residual <= balance * scale) {
            const bool is_at_rest = residual == 0.0;  // no body has come to press
            if (loose_ && !is_at_rest && !factor()) return Outcome::mechanism;
            const auto is_pulled = [&](int guide) { return std::abs(force_[guide / 2][guide % 2]) > most_on_guide * scale; };
            if (std::ranges::any_of(guides_, is_pulled)) return Outcome::mechanism;
            settle();
            return Outcome::solved;
        }
        if (iteration >= quick_iterations) slack = 0.0;
        if (iteration >= sorting && let_slip(closed, changes)) {
            find_forces();
            residual = largest_residual();
            renew = true;
            continue;
        }
        if (!settled_.empty() && iteration % sorting == sorting - 1 && sort_out_faces()) {
            residual = largest_residual();
            renew = true;
            continue;
        }
        renew = plan_.friction
                    ? residual > worth_keeping_with_friction * before
                    : residual >= before || std::log(residual / (balance * scale)) > worth_keeping * std::log(before / residual);
    }
    return hinges_.empty() && !loose_ ? Outcome::not_converged : Outcome::mechanism;
}

void Equilibrium::refine() {
    if (!plan_.friction && !plan_.remembers) take_step(newton_step(out_of_balance()));
}

double Equilibrium::strain_energy() const {
    return (history_ ? internal_force_.energy(displacement_) : points_energy_) + ties_energy();  // settled since then
}

double Equilibrium::ties_energy() const {
    double energy = 0.0;
    for (const FieldPair& pair : cracks_.pairs)
        energy += 0.5 * tie_of(pair) * (displacement_[pair.left] - displacement_[pair.right]).squaredNorm();
    return energy + edge_ties_energy();
}

double Equilibrium::edge_ties_energy() const {
    double energy = 0.0;
    for (const Boundary::Tied& tie : boundary_.tied)
        if (mass_[tie.field] > 0.0) energy += 0.5 * tie_of(tie) * lag(tie) * lag(tie);
    return energy;
}

double Equilibrium::traction_work() const {
    double work = 0.0;
    for (const Boundary::Traction& t : boundary_.tractions)
        for (int k = 0; k < 4; ++k) work += t.facet.weight[k] * t.force.dot(displacement_[t.field[k]]);
    for (const Free& free : free_) work += free.force * moved_[free.driver][free.axis];
    return work;
}

double Equilibrium::potential() const {
    if (!potential_)
        potential_ = strain_energy() + contact_energy_ + face_energy_ +
                     (history_ ? history_->dissipated() + lost_by_ties_ : 0.0) - traction_work();
    return *potential_;
}

double Equilibrium::measured_displacement(double time) const {
    const Vec2 moved = boundary_.moved(gauges_.displacement, time, displacement_) + moved_[gauges_.displacement];
    return moved.dot(gauges_.displacement_direction);
}

double Equilibrium::negligible_work() const {
    double way = 0.0;
    for (int driver = 0; driver < boundary_.drivers(); ++driver) way = std::max(way, place_of(driver).norm());
    return balance * least_force_ * way;
}

double Equilibrium::negligible_power() const {
    double speed = 0.0;
    for (int driver = 0; driver < boundary_.drivers(); ++driver) speed = std::max(speed, boundary_.velocity_of(driver).norm());
    return least_force_ * speed;
}

double Equilibrium::power() const {
    double power = 0.0;
    for (int driver = 0; driver < boundary_.drivers(); ++driver)
        if (time_ <= boundary_.travel_time(driver)) power += reaction_[driver].dot(boundary_.velocity_of(driver));
    return power;
}

TipLoad Equilibrium::load_at(int crack, bool at_end, const std::vector<Vec2>& displacement, const MaterialMap& materials) const {
    EnergyReleaseOptions options;
    options.rotates = options.sizes_K_by_J = plan_.rotates;
    const std::vector<Vec2> still(displacement.size(), Vec2::Zero());
    std::vector<double> ties;
    for (const FieldPair& pair : cracks_.pairs)
        ties.push_back(0.5 * tie_of(pair) * (displacement[pair.left] - displacement[pair.right]).squaredNorm());
    TipLoad load = tip_load(body_, cracks_, materials, crack, at_end, {displacement, still, still, ties, face_forces()}, options);
    if (history_) history_->forget_unknown(load, cracks_.lines[crack].tip(at_end).position, options);
    return load;
}

// Where points have come to other fields the factor is to be made anew, and where they share a node with such points.
void Equilibrium::mark_moved_points(const PointTable<int>& before, const std::vector<Sliver>& slivers_before) {
    const auto mark_about = [&](int c) {
        const Vec2 corner = body_.layout.cell_corner(c);
        const Vec2& cell = body_.layout.cell;
        body_.for_cells_in({corner - 0.5 * cell, corner + 1.5 * cell}, [&](int near) { factor_.mark(near); });
    };
    int last = -1;
    for (int p = 0; p < body_.points.count(); ++p) {
        const int c = body_.points.cell[p];
        if (c == last || std::ranges::equal(before[p], std::as_const(body_.points).node[p])) continue;
        last = c;
        mark_about(c);
    }
    const auto mark_new = [&](const std::vector<Sliver>& slivers, const std::vector<Sliver>& others) {
        for (const Sliver& sliver : slivers) {
            const auto same = std::ranges::lower_bound(others, sliver.point, {}, &Sliver::point);
            if (same == others.end() || *same != sliver) mark_about(body_.points.cell[sliver.point]);
        }
    };
    mark_new(body_.slivers, slivers_before);
    mark_new(slivers_before, body_.slivers);
}

Equilibrium::Snapshot Equilibrium::save() const {
    return {cracks_, body_.points.node, body_.slivers, boundary_.holds(), pieces_, displacement_, time_, contacts()};
}

void Equilibrium::restore(const Snapshot& snapshot) {
    cracks_ = snapshot.cracks;
    const PointTable<int> before = std::exchange(body_.points.node, snapshot.node);
    const std::vector<Sliver> slivers_before = std::exchange(body_.slivers, snapshot.slivers);
    boundary_.go_back(snapshot.holds, cracks_);
    pieces_ = snapshot.pieces;
    drop_hinges();
    displacement_ = snapshot.displacement;
    time_ = next_time_ = snapshot.time;
    set_contacts(snapshot.contacts);
    internal_force_.sort_cells();
    renumber();
    mark_moved_points(before, slivers_before);
    find_forces();
}

void Equilibrium::set_displacements(const std::vector<Vec2>& displacement, double time, const Contacts& contacts) {
    displacement_ = displacement;
    time_ = next_time_ = time;
    set_contacts(contacts);
    find_forces();
}

bool Equilibrium::relax(const std::vector<Vec2>& displacement) {
    displacement_ = displacement;
    prescribed_step_.assign(equation_.size(), 0.0);
    still_to_go_.assign(boundary_.drivers(), Vec2::Zero());
    find_forces();
    // All is linear but which faces touch.
    std::vector<char> closed(cracks_.pairs.size());
    const auto look_at_faces = [&] {
        bool same = true;
        for (std::size_t k = 0; k < closed.size(); ++k) {
            const char now = is_closed(k);
            same = std::exchange(closed[k], now) == now && same;
        }
        return same;
    };
    look_at_faces();
    for (int k = 0; k < most_iterations; ++k) {
        if (!factor_tangent(false)) return false;
        move(tangent_step(out_of_balance()), 1.0);
        find_forces();
        if (look_at_faces()) return true;
    }
    return false;
}

}  // namespace crampfit

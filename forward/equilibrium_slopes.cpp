#include "forward/deformation.hpp"
#include "forward/equilibrium.hpp"
#include "forward/local_yield.hpp"
#include "forward/side_by_side.hpp"

#include <algorithm>
#include <functional>

namespace crampfit {

// At equilibrium the potential's slope along any displacement is nil, so that its derivative by a number p of the materials is
// the explicit one: dPi/dp = sum of V W_p(grad u) and so on, W_p the energy of the strain with the slope of the stiffness. What a
// driver feels is the slope of the potential along a motion m that it brings about, R = dPi/ds; the derivative of that is again
// explicit, dR/dp = sum of V dW_p/d(grad u) : grad m, whatever u does, as long as m is an equilibrium's own motion (symmetry of
// the second derivatives).

// What motions of the drivers put on the equations, by the tangent where it stands.
Eigen::VectorXd Equilibrium::load_of(const std::vector<Vec2>& drivers) {
    prescribed_step_.assign(equation_.size(), 0.0);
    for (const Boundary::Held& held : boundary_.held)
        prescribed_step_[2 * held.field + held.axis] = drivers[held.driver][held.axis];
    still_to_go_ = drivers;
    step_load_.setZero(equations_);
    extra_.clear();
    couple_points(true);
    add_lone_points();
    add_pairs(true);
    add_edge_ties();
    add_touches(true);
    spread_.clear();
    std::fill(prescribed_step_.begin(), prescribed_step_.end(), 0.0);
    std::fill(still_to_go_.begin(), still_to_go_.end(), Vec2::Zero());
    return step_load_;
}

Equilibrium::Motion Equilibrium::motion_of(const std::vector<Vec2>& drivers, const Eigen::VectorXd& step) const {
    Motion motion{drivers, std::vector<Vec2>(displacement_.size(), Vec2::Zero())};
    for (const Boundary::Held& held : boundary_.held) motion.fields[held.field][held.axis] = drivers[held.driver][held.axis];
    for (std::size_t dof = 0; dof < equation_.size(); ++dof)
        if (equation_[dof] >= 0) motion.fields[dof / 2][dof % 2] = step[equation_[dof]];
    return motion;
}

std::vector<Equilibrium::Motion> Equilibrium::motions(const std::vector<std::vector<Vec2>>& drivers) {
    prescribed_step_.assign(equation_.size(), 0.0);
    still_to_go_.assign(boundary_.drivers(), Vec2::Zero());
    if (!factor_tangent(true)) return {};
    Eigen::MatrixXd steps(equations_, drivers.size());
    for (std::size_t i = 0; i < drivers.size(); ++i) steps.col(i) = load_of(drivers[i]);
    if (!drivers.empty()) factor_.solve(steps);
    std::vector<Motion> found;
    for (std::size_t i = 0; i < drivers.size(); ++i) found.push_back(motion_of(drivers[i], steps.col(i)));
    return found;
}

Eigen::MatrixXd Equilibrium::yields_to(const Eigen::MatrixXd& loads) const {
    Eigen::MatrixXd step(equations_, loads.cols());
    Eigen::MatrixXd yields(loads.rows(), loads.cols());
    for (Eigen::Index k = 0; k < loads.cols(); ++k)
        for (std::size_t dof = 0; dof < equation_.size(); ++dof)
            if (equation_[dof] >= 0) step(equation_[dof], k) = loads(dof, k);
    factor_.solve(step);
    for (Eigen::Index k = 0; k < loads.cols(); ++k)
        for (std::size_t dof = 0; dof < equation_.size(); ++dof)
            yields(dof, k) = equation_[dof] >= 0 ? step(equation_[dof], k) : 0.0;
    return yields;
}

Eigen::MatrixXd Equilibrium::compliance(const Eigen::SparseMatrix<double>& loads) const {
    std::vector<Eigen::Triplet<double>> entries;
    for (int k = 0; k < loads.outerSize(); ++k)
        for (Eigen::SparseMatrix<double>::InnerIterator entry(loads, k); entry; ++entry)
            if (equation_[entry.row()] >= 0) entries.emplace_back(equation_[entry.row()], k, entry.value());
    GridFactor::Sparse right(equations_, loads.cols());
    right.setFromTriplets(entries.begin(), entries.end());
    return factor_.compliance(right);
}

Equilibrium::Motion Equilibrium::yield_to(const std::vector<Vec2>& load) const {
    Motion motion{std::vector<Vec2>(boundary_.drivers(), Vec2::Zero()), load};
    const auto components = static_cast<Eigen::Index>(2 * load.size());
    const Eigen::VectorXd fields = yields_to(Eigen::Map<const Eigen::VectorXd>(load.data()->data(), components));
    Eigen::Map<Eigen::VectorXd>(motion.fields.data()->data(), components) = fields;
    return motion;
}

double Equilibrium::Slopes::along(const Motion& motion, int number) const {
    double sum = 0.0;
    for (std::size_t f = 0; f < motion.fields.size(); ++f) sum += fields.col(number).segment<2>(2 * f).dot(motion.fields[f]);
    for (std::size_t d = 0; d < motion.drivers.size(); ++d) sum += drivers.col(number).segment<2>(2 * d).dot(motion.drivers[d]);
    return sum;
}

Equilibrium::Slopes Equilibrium::slopes(const std::vector<MaterialSlope>& numbers) {
    const Points& points = body_.points;
    Slopes slope;
    slope.potential = Eigen::VectorXd::Zero(numbers.size());
    slope.fields = Eigen::MatrixXd::Zero(2 * displacement_.size(), numbers.size());
    slope.drivers = Eigen::MatrixXd::Zero(2 * boundary_.drivers(), numbers.size());
    const auto add = [&](std::size_t n, int field, const Vec2& force) { slope.fields.col(n).segment<2>(2 * field) += force; };
    std::vector<Vec2> of_points;
    for (std::size_t n = 0; n < numbers.size(); ++n) {
        of_points.assign(displacement_.size(), Vec2::Zero());
        slope.potential[n] = internal_force_.add_slope(numbers[n], displacement_, of_points);
        slope.fields.col(n) = -Eigen::Map<const Eigen::VectorXd>(of_points.data()->data(), slope.fields.rows());
    }
    // Ties and closed faces are as stiff as their wood.
    for (std::size_t k = 0; k < cracks_.pairs.size(); ++k) {
        const FieldPair& pair = cracks_.pairs[k];
        if (!is_whole(pair)) continue;
        const double tie = tie_of(pair);
        const Mat2 held = face_stiffness(k);
        if (tie == 0.0 && held.isZero(0.0)) continue;
        const Vec2 jump = displacement_[pair.left] - displacement_[pair.right];
        const Vec2 place = apart(k, displacement_);
        for (std::size_t n = 0; n < numbers.size(); ++n) {
            const double stiffer =
                numbers[n].opening_modulus(pair.freed_at, 0.5 * body_.layout.cell, pair.along) / pair.plane_modulus;
            slope.potential[n] += 0.5 * stiffer * (tie * jump.squaredNorm() + place.dot(held * place));
            add(n, pair.left, stiffer * tie * jump);
            add(n, pair.right, -stiffer * tie * jump);
            push_faces(k, stiffer * held * place, std::function([&](int field, const Vec2& push) { add(n, field, push); }));
        }
    }
    for (const Boundary::Tied& tie : boundary_.tied) {
        if (mass_[tie.field] == 0.0) continue;
        for (std::size_t n = 0; n < numbers.size(); ++n) {
            const double stiffer = numbers[n].opening_modulus(tie.place, 0.5 * body_.layout.cell, tie.along) / tie.plane_modulus;
            const double pull = stiffer * tie_of(tie) * lag(tie);
            slope.potential[n] += 0.5 * pull * lag(tie);
            slope.fields(2 * tie.field + tie.axis, n) -= pull;
            slope.drivers(2 * tie.driver + tie.axis, n) += pull;
        }
    }
    // So are bodies' springs.
    do_side_by_side(side_by_side_, sliding_.size(), [&](std::size_t s) {
        if (sliding_[s].yield()) sliding_[s].yield()->know_slopes(numbers);
    });
    for (std::size_t s = 0; s < sliding_.size(); ++s) {
        const std::vector<SlidingBody::Touch> touches = sliding_[s].touches(place_of(sliding_driver_[s]), displacement_);
        for (std::size_t n = 0; n < numbers.size(); ++n) {
            Eigen::VectorXd forces(touches.size());
            for (std::size_t k = 0; k < touches.size(); ++k) {
                const Facet& facet = sliding_[s].facet(touches[k].facet);
                const auto& constants = points.stiffness[points.cell[facet.point]];
                const int stiffest = constants[0] >= constants[2] ? 0 : 1;
                const double stiffer =
                    numbers[n].stiffness(points.cell[facet.point])(stiffest, stiffest) / points.stiffest(facet.point);
                slope.potential[n] += stiffer * touches[k].energy;
                forces[k] = stiffer * touches[k].force;
            }
            if (const auto& yield = sliding_[s].yield()) {
                LocalYield::Slope more = yield->slope(touches, std::move(forces), numbers, n);
                slope.potential[n] += more.energy;
                forces = std::move(more.forces);
            }
            for (std::size_t k = 0; k < touches.size(); ++k) {
                const Vec2 push = forces[k] * touches[k].normal;
                for (const SlidingBody::Hold& hold : sliding_[s].holds(touches[k].facet))
                    for (int m = 0; m < 4; ++m) add(n, points.node[hold.point][m], -hold.weight[m] * push);
                slope.drivers.col(n).segment<2>(2 * sliding_driver_[s]) += push;
            }
        }
    }
    return slope;
}

std::vector<std::vector<Vec2>> Equilibrium::displacement_slopes(const Slopes& slopes) const {
    const Eigen::MatrixXd yields = yields_to(-slopes.fields);
    std::vector<std::vector<Vec2>> found(yields.cols(), std::vector<Vec2>(displacement_.size()));
    for (Eigen::Index n = 0; n < yields.cols(); ++n)
        for (std::size_t f = 0; f < displacement_.size(); ++f) found[n][f] = yields.col(n).segment<2>(2 * f);
    return found;
}

// By a central difference of G, displacements and wood moving with the number. Of the wood only that around the tip counts.
double Equilibrium::release_slope(int crack, bool at_end, const MaterialSlope& number,
                                  const std::vector<Vec2>& displacement_slope) {
    constexpr double reach = 7.0;  // [cells] farther than the virtual extension
    Points& points = body_.points;
    const Vec2 tip = cracks_.lines[crack].tip(at_end).position;
    const auto stiffness = points.stiffness;
    const auto layers = points.layers;
    const auto uneven_cells = body_.uneven_cells;
    const auto with_wood_of = [&](const MaterialMap& materials, double step) {
        body_.for_cells_near(tip, reach * body_.layout.cell.maxCoeff(), [&](int c) {
            WoodArea area = body_.area_of_cell(c);
            const LocalWood wood = materials.average(area);
            const Eigen::Matrix3d C = wood.elasticity.stiffness();
            points.stiffness[c] = {C(0, 0), C(0, 1), C(1, 1), C(2, 2), C(0, 2), C(1, 2)};
            for (int p = points.first_of_cell[c]; p < points.first_of_cell[c + 1] && !layers.empty(); ++p)
                points.layers[p] = wood.elasticity.coefficients.head<4>();
            const auto cell = std::ranges::lower_bound(body_.uneven_cells, c, {}, &Discretisation::UnevenCell::cell);
            if (cell != body_.uneven_cells.end() && cell->cell == c) cell->wood = body_.unevenness_of(materials, area, wood);
        });
        std::vector<Vec2> displacement = displacement_;
        for (std::size_t f = 0; f < displacement.size(); ++f) displacement[f] += step * displacement_slope[f];
        return load_at(crack, at_end, displacement, materials).G;
    };
    const double more = with_wood_of(number.materials(true), number.step());
    const double less = with_wood_of(number.materials(false), -number.step());
    points.stiffness = stiffness;
    points.layers = layers;
    std::ranges::copy(uneven_cells, body_.uneven_cells.begin());
    return (more - less) / (2.0 * number.step());
}

}  // namespace crampfit

#include "forward/deformation.hpp"
#include "forward/equilibrium.hpp"

#include <set>

namespace crampfit {

// At equilibrium the potential's slope along any displacement is nil, so that its derivative by a number p of the materials is the
// explicit one: dPi/dp = sum of V W_p(grad u) and so on, W_p the energy of the strain with the slope of the stiffness. What a driver
// feels is the slope of the potential along a motion m that it brings about, R = dPi/ds; the derivative of that is again explicit,
// dR/dp = sum of V dW_p/d(grad u) : grad m, whatever u does, as long as m is an equilibrium's own motion (symmetry of the
// second derivatives).

namespace {

Eigen::Vector4d in_turned_frame(const Polar& polar, const Mat2& gradient) {
    const Mat2 local = polar.turn.transpose() * gradient;
    return {local(0, 0), local(0, 1), local(1, 0), local(1, 1)};
}

} // namespace

// What motions of the drivers put on the equations, by the tangent where it stands.
Eigen::VectorXd Equilibrium::load_of(const std::vector<Vec2>& drivers) {
    prescribed_step_.assign(equation_.size(), 0.0);
    std::set<int> cells;  // that hold a component that moves
    for (const Boundary::Held& held : boundary_.held) {
        const double step = drivers[held.driver][held.axis];
        if (step == 0.0) continue;
        prescribed_step_[2 * held.field + held.axis] = step;
        const Vec2 x = body_.layout.node_position(cracks_.node_of_field[held.field]);
        body_.for_cells_near(x, 0.5 * body_.layout.cell.minCoeff(), [&](int c) { cells.insert(c); });
    }
    still_to_go_ = drivers;
    step_load_.setZero(equations_);
    extra_.clear();
    std::vector<GridFactor::Element> elements;
    for (const int c : cells) add_points(c, true, elements);
    add_lone_points();
    add_pairs();
    add_touches(true);
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

Equilibrium::Motion Equilibrium::yield_to(const std::vector<Vec2>& load) const {
    Eigen::MatrixXd step = Eigen::VectorXd::Zero(equations_);
    for (std::size_t dof = 0; dof < equation_.size(); ++dof)
        if (equation_[dof] >= 0) step(equation_[dof]) = load[dof / 2][dof % 2];
    factor_.solve(step);
    return motion_of(std::vector<Vec2>(boundary_.drivers(), Vec2::Zero()), step);
}

Eigen::MatrixXd Equilibrium::slopes(const std::vector<MaterialSlope>& numbers, const std::vector<Motion>& motions) {
    const Points& points = body_.points;
    const std::size_t rows = 1 + motions.size();
    Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(rows, numbers.size());
    // The points: strain, and its rate along each motion.
    Eigen::Matrix<double, 3, Eigen::Dynamic> strain(3, rows);
    for (int p = 0; p < points.count(); ++p) {
        const Mat2 gradient = gradient_at(body_, p, displacement_);
        if (plan_.rotates) {
            const Polar polar(gradient);
            const Eigen::Matrix<double, 3, 4> B = polar.strain_slope();
            strain.col(0) << polar.stretch(0, 0) - 1.0, polar.stretch(1, 1) - 1.0, 2.0 * polar.stretch(0, 1);
            for (std::size_t i = 0; i < motions.size(); ++i)
                strain.col(1 + i) = B * in_turned_frame(polar, gradient_at(body_, p, motions[i].fields));
        } else {
            for (std::size_t i = 0; i < rows; ++i) {
                const Mat2 g = i == 0 ? gradient : gradient_at(body_, p, motions[i - 1].fields);
                strain.col(i) << g(0, 0), g(1, 1), g(0, 1) + g(1, 0);
            }
        }
        for (std::size_t n = 0; n < numbers.size(); ++n) {
            const Eigen::Matrix3d& C = numbers[n].stiffness(points.cell[p]);
            if (C.isZero(0.0)) continue;
            const Eigen::Vector3d stress = points.volume[p] * (C * strain.col(0));
            slope(0, n) += 0.5 * stress.dot(strain.col(0));
            for (std::size_t i = 1; i < rows; ++i) slope(i, n) += stress.dot(strain.col(i));
        }
    }
    for (const InternalForce::Alone& alone : internal_force_.alone()) {
        const Vec2 cross = internal_force_.crosswise(alone.point, displacement_);
        for (std::size_t n = 0; n < numbers.size(); ++n) {
            const double k = internal_force_.crosswise_stiffness(alone.point, numbers[n].stiffness(points.cell[alone.point]));
            slope(0, n) += 0.5 * k * cross.squaredNorm();
            for (std::size_t i = 1; i < rows; ++i) slope(i, n) += k * cross.dot(internal_force_.crosswise(alone.point, motions[i - 1].fields));
        }
    }
    // Ties and closed faces are as stiff as their wood.
    for (const FieldPair& pair : cracks_.pairs) {
        const Mat2 stiffness = mass_[pair.left] > 0.0 && mass_[pair.right] > 0.0 ? pair_stiffness(pair) : Mat2::Zero();
        if (stiffness.isZero(0.0)) continue;
        const Vec2 jump = displacement_[pair.left] - displacement_[pair.right];
        for (std::size_t n = 0; n < numbers.size(); ++n) {
            const double stiffer = numbers[n].opening_modulus(pair.freed_at, 0.5 * body_.layout.cell, pair.along) / pair.plane_modulus;
            const Vec2 pull = stiffer * stiffness * jump;
            slope(0, n) += 0.5 * pull.dot(jump);
            for (std::size_t i = 1; i < rows; ++i)
                slope(i, n) += pull.dot(motions[i - 1].fields[pair.left] - motions[i - 1].fields[pair.right]);
        }
    }
    // So are bodies' springs.
    for (std::size_t s = 0; s < sliding_.size(); ++s) {
        for (const SlidingBody::Touch& touch : sliding_[s].touches(boundary_.travel(sliding_driver_[s], time_), displacement_)) {
            const Facet& facet = body_.facets[touch.facet];
            const auto& constants = points.stiffness[points.cell[facet.point]];
            const int stiffest = constants[0] >= constants[2] ? 0 : 1;
            for (std::size_t n = 0; n < numbers.size(); ++n) {
                const double stiffer = numbers[n].stiffness(points.cell[facet.point])(stiffest, stiffest) / points.stiffest(facet.point);
                slope(0, n) += stiffer * touch.energy;
                for (std::size_t i = 1; i < rows; ++i) {
                    Vec2 apart = -motions[i - 1].drivers[sliding_driver_[s]];
                    for (int k = 0; k < 4; ++k) apart += facet.weight[k] * motions[i - 1].fields[points.node[facet.point][k]];
                    slope(i, n) -= stiffer * touch.force * touch.normal.dot(apart);
                }
            }
        }
    }
    return slope;
}

} // namespace crampfit

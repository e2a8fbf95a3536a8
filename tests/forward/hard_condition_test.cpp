// Condition of the stiffness as a crack sweeps across a cell: what small cuts and ties do to it.
#include "tests/forward/cracked_plates.hpp"
#include "tests/forward/hard_cases.hpp"

#include <Eigen/SparseCholesky>
#include <fmt/format.h>

namespace crampfit::test {
namespace {

using Matrix = Eigen::SparseMatrix<double>;

// Stiffness of what is free to move, put together anew from points, ties and what is held [N/m].
Matrix stiffness(const AtRest& run) {
    const Points& points = run.body.points;
    const CrackFields& cracks = run.equilibrium.cracks();
    const std::vector<double> mass = field_masses(run.body, cracks.fields());
    std::vector<int> equation(2 * cracks.fields(), 0);
    for (const Boundary::Held& held : run.equilibrium.boundary().held) equation[2 * held.field + held.axis] = -1;
    int count = 0;
    for (std::size_t dof = 0; dof < equation.size(); ++dof)
        if (mass[dof / 2] == 0.0) equation[dof] = -1;
        else if (equation[dof] == 0) equation[dof] = count++;
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&](int row, int column, double value) {
        if (equation[row] >= 0 && equation[column] >= 0) entries.emplace_back(equation[row], equation[column], value);
    };
    const auto add_element = [&](std::span<const int> node, const Eigen::Matrix<double, 8, 8>& K) {
        for (int a = 0; a < 8; ++a)
            for (int b = 0; b < 8; ++b) add(2 * node[a / 2] + a % 2, 2 * node[b / 2] + b % 2, K(a, b));
    };
    const InternalForce internal(run.body, run.materials, false);
    const std::vector<Vec2> still(cracks.fields(), Vec2::Zero());
    for (int c = 0; c < run.body.layout.cells(); ++c)
        for_groups(points, c, [&](const PointGroup& group) {
            add_element(points.node[group.point[0]], internal.tangent(group, still, false));
        });
    for (const Sliver& sliver : run.body.slivers) {
        const auto [own, less] = internal.tangents(sliver, still, false);
        add_element(sliver.node, own);
        add_element(points.node[sliver.point], less);
    }
    for (const auto& alone : internal.alone()) {
        const auto& node = alone.node;
        const auto& sign = crosswise_sign;
        for (int axis = 0; axis < 2; ++axis)
            for (int a = 0; a < 4; ++a)
                for (int b = 0; b < 4; ++b) add(2 * node[a] + axis, 2 * node[b] + axis, alone.stiffness * sign[a] * sign[b]);
    }
    for (const FieldPair& pair : cracks.pairs)
        for (int axis = 0; axis < 2; ++axis)
            for (const int row : {pair.left, pair.right})
                for (const int column : {pair.left, pair.right})
                    add(2 * row + axis, 2 * column + axis, (row == column ? 1.0 : -1.0) * shared_tie(pair, mass));
    Matrix matrix(count, count);
    matrix.setFromTriplets(entries.begin(), entries.end());
    return matrix;
}

// Largest over smallest eigenvalue, by power iteration on the matrix and on its inverse: each from below, to a few percent.
double condition(const Matrix& matrix) {
    const Eigen::SimplicialLLT<Matrix> factor(matrix);
    const auto largest = [&](auto apply) {
        Eigen::VectorXd v = Eigen::VectorXd::Random(matrix.rows()).normalized();
        double value = 0.0;
        for (int k = 0; k < 60; ++k) {
            const Eigen::VectorXd next = apply(v);
            value = v.dot(next);
            v = next.normalized();
        }
        return value;
    };
    return largest([&](const Eigen::VectorXd& v) -> Eigen::VectorXd { return matrix * v; }) *
           largest([&](const Eigen::VectorXd& v) -> Eigen::VectorXd { return factor.solve(v); });
}

// A square of 20 x 20 cells, held at the top and at the bottom, with a crack from the left to this tip.
Scene cracked(const Vec2& start, const Vec2& tip) {
    Scene scene = at_rest({20e-3, 20e-3}, 1e-3);
    scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.measure = {"top", "top"};
    Crack crack;
    crack.points = {start, tip};
    scene.cracks = {crack};
    return scene;
}

TEST(HardCondition, TheTangentHereIsTheSolvers) {
    // Its quadratic form is twice the energy that the solver knows of, less that of the held sides: moved by the solver's own
    // step.
    const AtRest run(cracked({0.0, 10.3e-3}, {10.4e-3, 9.7e-3}));
    ASSERT_TRUE(run.solved());
    Scene still = run.scene;
    still.edges[0] = without(still.edges[0], 1);  // the top may now move up and down: one more way for energy to go
    still.edges[0].velocity = {0.0, std::nullopt};
    const AtRest other(still);
    const Matrix K = stiffness(other);
    const std::vector<double> mass = field_masses(other.body, other.equilibrium.cracks().fields());
    Eigen::VectorXd u(K.rows());
    int count = 0;
    std::vector<std::array<bool, 2>> held(mass.size(), {false, false});
    for (const Boundary::Held& h : other.equilibrium.boundary().held) held[h.field][h.axis] = true;
    for (std::size_t f = 0; f < mass.size(); ++f)
        for (int axis = 0; axis < 2; ++axis)
            if (mass[f] > 0.0 && !held[f][axis]) u[count++] = run.equilibrium.displacements()[f][axis];
    ASSERT_EQ(count, K.rows());
    hard_case("tangent put together here", "quadratic form is twice the solver's energy",
              0.5 * u.dot(K * u) / run.equilibrium.strain_energy() - 1, 1e-9);
}

TEST(HardCondition, AsACrackSweepsAcrossACell) {
    // Asked: within a factor of 10 of the uncut grid's.
    Scene whole = cracked({0, 0}, {1e-3, 0});
    whole.cracks.clear();
    const double uncut = condition(stiffness(AtRest(whole)));
    const auto sweep = [&](const std::string& name, auto scene_at) {
        double worst = 0.0;
        double where = 0.0;
        for (const double s : {0.0, 1e-9, 1e-4, 1e-3, 2e-3, 5e-3,  0.01,  0.05, 0.1, 0.2, 0.25,  0.3,
                               0.4, 0.5,  0.6,  0.7,  0.75, 0.751, 0.755, 0.77, 0.8, 0.9, 0.999, 1.0}) {
            const double factor = condition(stiffness(AtRest(scene_at(s)))) / uncut;
            if (factor > worst) where = s;
            worst = std::max(worst, factor);
        }
        std::printf("   %s: worst at %.4f of a cell\n", name.c_str(), where);
        hard_case(name, "condition over that of the uncut grid, at most", worst, 10.0);
    };
    const double h = 1e-3;
    sweep("tip sweeps along the crack, level", [&](double s) { return cracked({0.0, 10.3 * h}, {(10 + s) * h, 10.3 * h}); });
    sweep("tip sweeps along a grid line", [&](double s) { return cracked({0.0, 10 * h}, {(10 + s) * h, 10 * h}); });
    sweep("level crack sweeps up", [&](double s) { return cracked({0.0, (10 + s) * h}, {10.4 * h, (10 + s) * h}); });
    sweep("slanted crack sweeps up", [&](double s) { return cracked({0.0, (6 + s) * h}, {10.4 * h, (12.1 + s) * h}); });
    sweep("tip sweeps along a slanted crack", [&](double s) {
        return cracked({0.0, 6.2 * h}, {(10 + s) * h, (12.2 + 0.62 * s) * h});
    });
}

}  // namespace
}  // namespace crampfit::test

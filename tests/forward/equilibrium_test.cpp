// The static solver in its parts: derivatives, elimination, ties, and equilibria that are known.
#include "datasets/error.hpp"
#include "tests/forward/scenes.hpp"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <random>
#include <tuple>
#include <utility>

namespace crampfit::test {
namespace {

Mat2 turn(double angle) {
    Mat2 R;
    R << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
    return R;
}

Mat2 random_gradient(std::mt19937& random, double largest) {
    std::uniform_real_distribution<double> in(-largest, largest);
    Mat2 gradient;
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) gradient(i, j) = in(random);
    return gradient;
}

// No symmetry but that of a stiffness; positive definite [Pa].
Eigen::Matrix3d oblique_stiffness() {
    Eigen::Matrix3d C;
    C << 5.0, 2.0, 0.3, 2.0, 9.0, 0.4, 0.3, 0.4, 3.0;
    return C;
}

Eigen::Matrix4d tangent_at(const Mat2& G, const Eigen::Matrix3d& C, bool rotates, bool geometric = true) {
    const auto A = elastic_tangent<double>({G(0, 0), G(0, 1), G(1, 0), G(1, 1)},
                                           {C(0, 0), C(0, 1), C(1, 1), C(2, 2), C(0, 2), C(1, 2)}, rotates, geometric);
    Eigen::Matrix4d tangent;
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) tangent(i, j) = A[i][j];
    return tangent;
}

TEST(UnitElasticity, StressIsTheSlopeOfTheEnergyAndTheTangentThatOfTheStress) {
    // Central differences: truncation is of the order of the step squared, 1e-12, rounding of 1e-16 / step: 1e-10, times 10 Pa.
    const Eigen::Matrix3d C = oblique_stiffness();
    const double step = 1e-6;
    std::mt19937 random(1);
    for (const bool rotates : {false, true}) {
        double worst_stress = 0, worst_tangent = 0;
        for (const double angle : {0.0, 0.3, 1.5, -2.5}) {
            const Mat2 strained = Mat2::Identity() + random_gradient(random, 0.2);
            const Mat2 gradient = turn(angle) * strained - Mat2::Identity();
            const PointState state = elastic_state(gradient, C, rotates);
            const Eigen::Matrix4d tangent = tangent_at(gradient, C, rotates);
            for (int i = 0; i < 2; ++i) {
                for (int j = 0; j < 2; ++j) {
                    Mat2 more = gradient, less = gradient;
                    more(i, j) += step;
                    less(i, j) -= step;
                    const PointState a = elastic_state(more, C, rotates), b = elastic_state(less, C, rotates);
                    worst_stress = std::max(worst_stress, std::abs((a.energy - b.energy) / (2 * step) - state.stress(i, j)));
                    const Mat2 slope = (a.stress - b.stress) / (2 * step);
                    const Eigen::Vector4d counted(slope(0, 0), slope(0, 1), slope(1, 0), slope(1, 1));
                    worst_tangent = std::max(worst_tangent, (counted - tangent.col(2 * i + j)).norm());
                }
            }
            EXPECT_LT((tangent - tangent.transpose()).norm(), 1e-12 * tangent.norm());
        }
        std::printf("%s: stress off by %.1e, tangent by %.1e of some 10 Pa\n", rotates ? "finite rotation" : "small strain",
                    worst_stress, worst_tangent);
        EXPECT_LT(worst_stress, 1e-8);
        EXPECT_LT(worst_tangent, 1e-8);
    }
}

TEST(UnitElasticity, StressTurnsWithThePoint) {
    // P(R F) = R P(F), to rounding.
    const Eigen::Matrix3d C = oblique_stiffness();
    std::mt19937 random(2);
    for (const double angle : {0.5, 3.0}) {
        const Mat2 strained = Mat2::Identity() + random_gradient(random, 0.3);
        const Mat2 still = elastic_state(strained - Mat2::Identity(), C, true).stress;
        const Mat2 turned = elastic_state(turn(angle) * strained - Mat2::Identity(), C, true).stress;
        EXPECT_LT((turned - turn(angle) * still).norm(), 1e-13 * still.norm());
    }
}

TEST(UnitElasticity, WithoutItsGeometricPartTheTangentIsNeverNegative) {
    const Eigen::Matrix3d C = oblique_stiffness();
    std::mt19937 random(3);
    bool whole_was_negative = false;
    for (int trial = 0; trial < 50; ++trial) {
        const Mat2 gradient = random_gradient(random, 0.6);
        const auto least = [&](bool geometric) {
            const Eigen::MatrixXd tangent = tangent_at(gradient, C, true, geometric);
            return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(tangent).eigenvalues()[0];
        };
        EXPECT_GT(least(false), -1e-13 * C.norm());
        whole_was_negative |= least(true) < 0.0;
    }
    EXPECT_TRUE(whole_was_negative) << "this test says nothing";
    // Without stress there is no such part.
    EXPECT_LT(
        (tangent_at(turn(1.0) - Mat2::Identity(), C, true, false) - tangent_at(turn(1.0) - Mat2::Identity(), C, true)).norm(),
        1e-13 * C.norm());
}

// A cracked block of earlywood, or of rings whose boundaries cross many cells.
Scene cracked_block(bool rings) {
    Scene scene = rings ? ring_specimen(3e-3, 1e-3) : block({6e-3, 6e-3}, 1e-3);
    if (rings) scene.specimen.rings->pith = {-6e-3, -3e-3};
    Crack crack;
    crack.points = {Vec2(0, 3.3e-3), Vec2(2.6e-3, 3.1e-3)};
    scene.cracks = {crack};
    return scene;
}

std::vector<Vec2> random_displacement(int fields) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> in(-0.2e-3, 0.2e-3);
    std::vector<Vec2> displacement(fields);
    for (Vec2& u : displacement) u = Vec2(in(random), in(random));
    return displacement;
}

TEST(UnitInternalForce, IsTheSlopeOfItsEnergy) {
    // Cells far from a crack go side by side, cells next to it point by point, and what uneven cells add: all must agree with one
    // energy. The step is 1e-6 of a cell: truncation 1e-12, rounding 1e-9 of the force.
    for (const bool rings : {false, true}) {
        const Scene scene = cracked_block(rings);
        const MaterialMap materials(scene);
        Discretisation body(scene, materials);
        const CrackFields cracks(scene, body, materials, 1e-3);
        ASSERT_GT(cracks.fields(), body.layout.nodes());
        const std::vector<Vec2> displacement = random_displacement(cracks.fields());
        for (const bool rotates : {false, true}) {
            const InternalForce internal(body, materials, rotates);
            ASSERT_EQ(internal.uneven().pieces().empty(), !rings);
            std::vector<Vec2> force(cracks.fields(), Vec2::Zero());
            internal.add_with_energy(displacement, force);
            double largest = 0, worst = 0;
            for (const Vec2& f : force) largest = std::max(largest, f.norm());
            for (int f = 0; f < cracks.fields(); ++f) {
                for (int axis = 0; axis < 2; ++axis) {
                    std::vector<Vec2> more = displacement, less = displacement;
                    more[f][axis] += 1e-9;
                    less[f][axis] -= 1e-9;
                    const double slope = (internal.energy(more) - internal.energy(less)) / 2e-9;
                    worst = std::max(worst, std::abs(slope + force[f][axis]));
                }
            }
            std::printf("internal force, %s, %s: off by %.1e of the largest\n", rings ? "rings" : "one wood",
                        rotates ? "finite rotation" : "small strain", worst / largest);
            EXPECT_LT(worst, 1e-7 * largest);
        }
    }
}

TEST(UnitInternalForce, UnevenCellsHaveTheTangentOfTheirForce) {
    const Scene scene = cracked_block(true);
    const MaterialMap materials(scene);
    Discretisation body(scene, materials);
    const CrackFields cracks(scene, body, materials, 1e-3);
    const std::vector<Vec2> displacement = random_displacement(cracks.fields());
    for (const bool rotates : {false, true}) {
        const InternalForce internal(body, materials, rotates);
        double worst = 0;
        const UnevenCells& uneven = internal.uneven();
        ASSERT_GT(uneven.pieces().size(), body.uneven_cells.size()) << "the crack cuts none";
        for (const UnevenCells::Piece& piece : uneven.pieces()) {
            const auto node = body.points.node[piece.point];
            Eigen::Matrix<double, 8, 8> slope;
            for (int i = 0; i < 8; ++i) {
                std::vector<Vec2> more = displacement, less = displacement;
                more[node[i / 2]][i % 2] += 1e-9;
                less[node[i / 2]][i % 2] -= 1e-9;
                slope.col(i) =
                    (uneven.state(piece, *piece.wood, more).force - uneven.state(piece, *piece.wood, less).force) / 2e-9;
            }
            worst = std::max(worst, (uneven.tangent(piece, displacement, true) - slope).norm() / std::max(slope.norm(), 1e3));
        }
        std::printf("tangent of uneven cells, %s: off by %.1e\n", rotates ? "finite rotation" : "small strain", worst);
        EXPECT_LT(worst, 1e-6);
    }
}

TEST(UnitInternalForce, UnevenCellsFeelNoRotation) {
    const Scene scene = cracked_block(true);
    const MaterialMap materials(scene);
    const Discretisation body(scene, materials);
    const InternalForce internal(body, materials, true);
    std::vector<Vec2> displacement = random_displacement(body.layout.nodes());
    const double energy = internal.energy(displacement);
    for (int n = 0; n < body.layout.nodes(); ++n) {
        const Vec2 x = body.layout.node_position(n);
        displacement[n] = turn(1.2) * (x + displacement[n]) - x;
    }
    EXPECT_NEAR(internal.energy(displacement), energy, 1e-10 * energy);
}

TEST(UnitInternalForce, ARowOfCellsBendsAsABeam) {
    // Pure bending by the curvature k, exact in a row of single cells: u_x = k x (y - h/2), u_y = -k x^2 / 2 at the nodes, whose
    // energy is that of the bending moment, E' (h^3 / 12) k^2 / 2 a length, whatever Poisson's ratio and the cells' shape.
    for (const double poisson_ratio : {0.0, 0.33, 0.499})
        for (const double length : {6e-3, 15e-3})
            for (const int points : {1, 4, 9}) {
                Scene scene = block({length, 1e-3}, 1e-3);
                scene.materials["EW"].poisson_ratio = poisson_ratio;
                scene.model.points_per_cell = points;
                const MaterialMap materials(scene);
                const Discretisation body(scene, materials, Layout::of(scene, {length / 6, 1e-3}));
                const double curvature = 1e-2, h = 1e-3;
                std::vector<Vec2> displacement;
                for (int n = 0; n < body.layout.nodes(); ++n) {
                    const Vec2 x = body.layout.node_position(n);
                    displacement.emplace_back(curvature * x.x() * (x.y() - h / 2), -curvature * x.x() * x.x() / 2);
                }
                const double modulus = 40e6 / (1 - poisson_ratio * poisson_ratio);
                const double exact = modulus * h * h * h / 12 * curvature * curvature / 2 * length * scene.model.thickness;
                EXPECT_NEAR(InternalForce(body, materials, false).energy(displacement), exact, 1e-9 * exact);
            }
}

// A grid whose nodes have so many equations each, every cell with a random element that is positive definite.
struct RandomGrid {
    int cells_x, cells_y;
    GridFactor factor{cells_x, cells_y};
    std::vector<int> first, count;
    std::vector<GridFactor::Element> element;  // [cells]
    std::mt19937 random{5};

    RandomGrid(int x, int y) : cells_x(x), cells_y(y) {
        count.resize((x + 1) * (y + 1));
        for (int& c : count) c = std::uniform_int_distribution<int>(0, 2)(random);
        number();
        element.resize(x * y);
        for (int c = 0; c < x * y; ++c) change(c);
    }
    void number() {
        std::vector<int> node_at(count.size());
        for (std::size_t n = 0; n < count.size(); ++n) node_at[factor.places()[n]] = static_cast<int>(n);
        first.resize(count.size());
        int next = 0;
        for (const int n : node_at) {
            first[n] = next;
            next += count[n];
        }
        factor.set_equations(first, count);
    }
    int equations() const { return std::accumulate(count.begin(), count.end(), 0); }
    void change(int c) {
        const int corner = c / cells_x * (cells_x + 1) + c % cells_x;
        const std::array<int, 4> nodes{corner, corner + 1, corner + cells_x + 1, corner + cells_x + 2};
        std::uniform_real_distribution<double> in(-1.0, 1.0);
        Eigen::Matrix<double, 8, 8> spread = Eigen::Matrix<double, 8, 8>::NullaryExpr([&]() { return in(random); });
        element[c].stiffness = spread * spread.transpose() + 0.1 * Eigen::Matrix<double, 8, 8>::Identity();
        for (int a = 0; a < 8; ++a) element[c].equation[a] = a % 2 < count[nodes[a / 2]] ? first[nodes[a / 2]] + a % 2 : -1;
    }
    bool make() {
        return factor.factor([&](int c, auto& elements) { elements.push_back(element[c]); });
    }
    Eigen::MatrixXd dense() const {
        Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(equations(), equations());
        for (const auto& e : element)
            for (int a = 0; a < 8; ++a)
                for (int b = 0; b < 8; ++b)
                    if (e.equation[a] >= 0 && e.equation[b] >= 0) matrix(e.equation[a], e.equation[b]) += e.stiffness(a, b);
        return matrix;
    }
    // Error of the solution for some right sides, of its size and the condition number.
    double error() {
        const Eigen::MatrixXd matrix = dense();
        const Eigen::MatrixXd exact = Eigen::MatrixXd::Random(equations(), 3);
        Eigen::MatrixXd found = matrix * exact;
        const Eigen::MatrixXd one = found.col(1);
        factor.solve(found);
        Eigen::MatrixXd alone = one;
        factor.solve(alone);
        const Eigen::VectorXd pivots = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix).eigenvalues();
        const double condition = pivots.tail(1)[0] / pivots[0];
        return std::max((found - exact).norm() / exact.norm(), (alone - exact.col(1)).norm() / exact.col(1).norm()) / condition;
    }
};

TEST(UnitGridFactor, EliminatesEveryNodeOnce) {
    for (const auto& [x, y] : {std::pair{1, 1}, {2, 7}, {4, 4}, {13, 5}, {40, 41}}) {
        std::vector<int> places = GridFactor(x, y).places();
        std::sort(places.begin(), places.end());
        ASSERT_EQ(places.size(), static_cast<std::size_t>((x + 1) * (y + 1)));
        for (std::size_t k = 0; k < places.size(); ++k) ASSERT_EQ(places[k], static_cast<int>(k)) << x << " x " << y;
    }
}

TEST(UnitGridFactor, SolvesAsADenseFactorDoes) {
    for (const auto& [x, y] : {std::pair{1, 1}, {3, 2}, {9, 4}, {11, 13}}) {
        RandomGrid grid(x, y);
        ASSERT_TRUE(grid.make());
        EXPECT_LT(grid.error(), 1e-14) << x << " x " << y;
    }
}

TEST(UnitGridFactor, FollowsWhatChanges) {
    RandomGrid grid(13, 11);
    ASSERT_TRUE(grid.make());
    for (const int cell : {0, 71, 72, 142}) {
        grid.change(cell);
        grid.factor.mark(cell);
        ASSERT_TRUE(grid.make());
        EXPECT_LT(grid.error(), 1e-14) << "cell " << cell;
    }
    // A node gets more equations, as one does that a crack passes; all numbers after it shift.
    const int node = 75;
    grid.count[node] = grid.count[node] == 2 ? 1 : 2;
    grid.number();
    for (int c = 0; c < 13 * 11; ++c) {
        const auto stiffness = grid.element[c].stiffness;
        grid.change(c);
        grid.element[c].stiffness = stiffness;
    }
    ASSERT_TRUE(grid.make());
    EXPECT_LT(grid.error(), 1e-14);
    grid.change(30);  // without a word: what is kept must not be made anew
    ASSERT_TRUE(grid.make());
    EXPECT_GT(grid.error(), 1e-6);
}

TEST(UnitGridFactor, RefusesWhatIsNotPositiveDefinite) {
    RandomGrid grid(9, 9);
    const auto good = grid.element[40];
    grid.element[40].stiffness *= -50.0;
    EXPECT_FALSE(grid.make());
    grid.element[40] = good;
    EXPECT_TRUE(grid.make()) << "a refusal must not spoil the next matrix";
    EXPECT_LT(grid.error(), 1e-14);
}

TEST(UnitGridFactor, ConditionOfADiagonal) {
    GridFactor factor(1, 1);
    std::vector<int> first(4, 0), count(4, 0);
    for (int n = 0; n < 2; ++n) {
        count[n] = 1;
        first[n] = factor.places()[n];
    }
    const int shift = std::min(first[0], first[1]);
    for (int n = 0; n < 2; ++n) first[n] -= shift;
    factor.set_equations(first, count);
    GridFactor::Element element{{0, 1, -1, -1, -1, -1, -1, -1}, Eigen::Matrix<double, 8, 8>::Identity()};
    element.stiffness(1, 1) = 100.0;
    ASSERT_TRUE(factor.factor([&](int, auto& elements) { elements.push_back(element); }));
    EXPECT_NEAR(factor.reciprocal_condition(), 0.01, 1e-14);
}

// Shares of a cell's energy release that are given off when the tip has gone a quarter, a half and three quarters of the cell.
std::array<double, 3> shares_of_a_cell(double poisson_ratio, double lift) {
    const double h = 1e-3;
    Scene scene = at_equilibrium(block({40e-3, 30e-3}, h));
    scene.materials["EW"].poisson_ratio = poisson_ratio;
    scene.edges = {moving("top", Side::top, {0.0, 1e-3}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.measure = {"top", "top"};
    scene.stop.time = 1.0;
    const double y = (15.0 + lift) * h;
    const double start = (20.0 - 0.29) * h;  // where the tip starts to free a pair: see `tip_lag` in forward/cracks.cpp
    Crack crack;
    crack.points = {Vec2(0.0, y), Vec2(start, y)};
    scene.cracks = {crack};
    StaticTrial run(scene);
    std::array<double, 5> potential{};
    for (int k = 0; k <= 4; ++k) {
        if (k > 0) run.equilibrium.grow(0, true, Vec2(start + 0.25 * k * h, y));
        EXPECT_TRUE(run.solve(1.0));
        potential[k] = run.equilibrium.potential();
    }
    const double all = potential[0] - potential[4];
    return {(potential[0] - potential[1]) / all, (potential[0] - potential[2]) / all, (potential[0] - potential[3]) / all};
}

TEST(UnitTies, EnergyGoesLinearlyWithTheTip) {
    // A ripple of a few hundredths of what a cell gives off is what one compliance for all woods leaves (forward/cracks.cpp).
    // Asked 0.03; nearly incompressible material misses that, above all with the crack between two rows of nodes.
    for (const auto& [poisson_ratio, bar] : {std::pair{0.0, 0.035}, {0.2, 0.03}, {0.33, 0.03}, {0.45, 0.065}}) {
        for (const double lift : {0.0, 0.25, 0.5}) {
            const auto share = shares_of_a_cell(poisson_ratio, lift);
            std::printf("nu %.2f, crack %.2f of a cell above nodes: share given off %.3f %.3f %.3f\n", poisson_ratio, lift,
                        share[0], share[1], share[2]);
            for (int k = 0; k < 3; ++k) EXPECT_NEAR(share[k], 0.25 * (k + 1), bar) << poisson_ratio << " " << lift;
        }
    }
}

// Edges without friction along them, and one node that keeps the block from sliding away.
Scene guided_block(double cell) {
    Scene scene = at_equilibrium(block({10e-3, 20e-3}, cell));
    Edge corner = moving("corner", Side::bottom, {0.0, 0.0});
    corner.range = {{0.0, 0.0}};
    scene.edges = {without(moving("bottom", Side::bottom, {0.0, 0.0}), 0), corner};
    scene.stop.time = 1.0;
    return scene;
}

TEST(UnitEquilibrium, AUniaxialPullIsExact) {
    // A line is among the shape functions, so that nothing but Newton's tolerance stands between this and the exact line.
    const double E = 40e6, nu = 0.33, stress = 4e5;
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        for (const bool rotates : {false, true}) {  // Biot's strain is the same straight line for stretch
            Scene scene = guided_block(1e-3);
            scene.model.plane = plane;
            scene.edges.push_back(pulled("top", Side::top, {0.0, stress}));
            scene.measure = {"top", "top"};
            StaticTrial run(scene, rotates);
            ASSERT_TRUE(run.solve(1.0));
            const double modulus = plane == PlaneCondition::strain ? E / (1 - nu * nu) : E;
            const double stretch = stress / modulus;
            EXPECT_NEAR(run.equilibrium.measured_displacement(1.0), stretch * 20e-3, 1e-7 * stretch * 20e-3);
            EXPECT_NEAR(run.equilibrium.reactions()[0].y(), -stress * 10e-3, 1e-7 * stress * 10e-3);
            EXPECT_NEAR(run.equilibrium.strain_energy(), 0.5 * stress * stretch * 2e-4, 1e-7 * stress * stretch * 2e-4);
            EXPECT_NEAR(run.equilibrium.potential(), -0.5 * stress * stretch * 2e-4, 1e-7 * stress * stretch * 2e-4);
            for (int p = 0; p < run.body.points.count(); ++p) {
                const Mat2 gradient = gradient_at(run.body, p, run.equilibrium.displacements());
                const PointState state = elastic_state(gradient, run.body.points.stiffness_of(p), rotates);
                EXPECT_NEAR(state.stress(1, 1), stress, 1e-6 * stress);
                EXPECT_NEAR(state.stress(0, 0), 0.0, 1e-6 * stress);
                EXPECT_NEAR(state.stress(0, 1), 0.0, 1e-6 * stress);
            }
        }
    }
}

TEST(UnitEquilibrium, RigidRotationGivesNoStress) {
    // Two corners go straight to where a rotation takes them: strained on the way, free of stress at the end.
    const double angle = 0.5, wide = 10e-3;
    Scene scene = at_equilibrium(block({wide, wide}, 1e-3));
    scene.edges = {moving("hinge", Side::bottom, {0.0, 0.0}),
                   moving("arm", Side::bottom, {wide * (std::cos(angle) - 1.0), wide * std::sin(angle)})};
    scene.edges[0].range = {{0.0, 0.0}};
    scene.edges[1].range = {{wide, wide}};
    scene.measure = {"arm", "arm"};
    scene.stop.time = 1.0;
    StaticTrial run(scene);
    ASSERT_TRUE(run.plan.rotates);
    for (int k = 1; k <= 8; ++k) ASSERT_TRUE(run.solve(k / 8.0)) << k;
    double worst = 0;
    for (int n = 0; n < run.body.layout.nodes(); ++n) {
        const Vec2 x = run.body.layout.node_position(n);
        worst = std::max(worst, (run.equilibrium.displacements()[n] - (turn(angle) * x - x)).norm());
    }
    std::printf("rotation by %.1f: off by %.1e of the width, %d factorisations in 8 steps\n", angle, worst / wide,
                run.equilibrium.factorisations());
    EXPECT_LT(worst, 1e-6 * wide);  // Newton's method ends at a strain of 1e-12: balance times least_strain
    EXPECT_LT(run.equilibrium.strain_energy(), 1e-12 * 40e6 * wide * wide);
    EXPECT_LT(run.equilibrium.factorisations(), 8 * 8) << "Newton's method doubles the digits each time";
}

TEST(UnitEquilibrium, PowerIsTheSlopeOfThePotential) {
    // At equilibrium dPi/dt is the power of what prescribes motion: with a wheel that slides on a flank, and rotation. Steps of
    // 1e-3 of the loading: truncation 1e-6.
    Scene scene = at_equilibrium(block({10e-3, 10e-3}, 0.5e-3));
    scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.specimen.cutouts = {Polygon{{Vec2(3.5e-3, 10e-3), Vec2(6.5e-3, 10e-3), Vec2(5e-3, 7e-3)}}};
    for (const double side : {-1.0, 1.0}) {
        Body wheel;
        wheel.name = side < 0 ? "left" : "right";
        wheel.shape = Circle{Vec2(5e-3 + side * 0.5528e-3, 9.2236e-3), 0.5e-3};
        wheel.velocity = {0.0, -1e-3};
        scene.bodies.push_back(wheel);
    }
    scene.measure = {"left", "left"};
    scene.stop.time = 1.0;
    StaticTrial run(scene, true);
    ASSERT_TRUE(run.solve(0.3));
    double potential[2];
    for (const int side : {0, 1}) {
        ASSERT_TRUE(run.solve(0.3 + (side - 0.5) * 2e-3));
        potential[side] = run.equilibrium.potential();
    }
    ASSERT_TRUE(run.solve(0.3));
    const double slope = (potential[1] - potential[0]) / 2e-3;
    std::printf("power %.6g W, slope of the potential off by %+.1e\n", run.equilibrium.power(),
                slope / run.equilibrium.power() - 1);
    EXPECT_NEAR(slope, run.equilibrium.power(), 1e-3 * std::abs(run.equilibrium.power()));
}

TEST(UnitEquilibrium, ASpecimenThatNothingHoldsIsRefused) {
    const auto refused = [](const char* what, const std::vector<Edge>& edges, int cells) {
        Scene scene = at_equilibrium(block({10e-3, 10e-3}, 10e-3 / cells));
        scene.edges = edges;
        scene.measure = {edges[0].name, edges[0].name};
        scene.stop.time = 1.0;
        try {
            simulate(scene);
            ADD_FAILURE() << "accepted: " << what << ", " << cells << " cells";
        } catch (const InputError& error) {
            EXPECT_EQ(error.key, "edges");
            EXPECT_EQ(error.file, "test.toml");
        }
    };
    const Edge top = pulled("top", Side::top, {0.0, 1e4}), bottom = pulled("bottom", Side::bottom, {0.0, -1e4});
    Edge pin = moving("pin", Side::bottom, {0.0, 0.0});
    pin.range = {{0.0, 0.0}};
    for (const int cells : {4, 10, 33}) {
        refused("two tractions and nothing that holds", {top, bottom}, cells);
        refused("free to slide to the side", {top, without(moving("floor", Side::bottom, {0.0, 0.0}), 0)}, cells);
        refused("free to turn about a corner", {top, bottom, pin}, cells);
    }
}

// Stiffness of a block that a crack goes into from the right, against that of a whole one, when it is moved so [m].
Vec2 stiffness_of_cracked(Vec2 moved, CrackFaces::Kind faces, double y) {
    Vec2 force[2];
    for (const bool cracked : {false, true}) {
        Scene scene = at_equilibrium(block({10e-3, 10e-3}, 1e-3));
        scene.edges = {moving("top", Side::top, moved), moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.measure = {"top", "top"};
        scene.stop.time = 1.0;
        Crack crack;
        crack.points = {Vec2(10e-3, y), Vec2(5e-3, y)};
        crack.faces.kind = faces;
        if (cracked) scene.cracks = {crack};
        StaticTrial run(scene);
        EXPECT_TRUE(run.solve(1.0));
        force[cracked] = run.equilibrium.reactions()[0];
    }
    return force[1].cwiseQuotient(force[0]);
}

TEST(UnitCrackFaces, PressedTogetherCarryAsAWholeBlock) {
    // Faces yield like a hundredth of a cell, 1e-3 of the block's ten cells, and over half its width only.
    for (const double y : {5e-3, 5.3e-3, 5.5e-3}) {
        const double pressed = stiffness_of_cracked({0.0, -1e-4}, CrackFaces::Kind::frictionless, y).y();
        const double opened = stiffness_of_cracked({0.0, 1e-4}, CrackFaces::Kind::frictionless, y).y();
        std::printf("crack at y = %.1f mm: pressed %.5f of a whole block's force, pulled %.3f\n", 1e3 * y, pressed, opened);
        EXPECT_NEAR(pressed, 1.0, 1e-3);
        EXPECT_LT(opened, 0.9);
    }
}

TEST(UnitCrackFaces, ThatStickCarryShearWhilePressed) {
    for (const double y : {5e-3, 5.5e-3}) {
        const Vec2 moved(0.2e-4, -1e-4);
        const double sticks = stiffness_of_cracked(moved, CrackFaces::Kind::stick, y).x();
        const double slides = stiffness_of_cracked(moved, CrackFaces::Kind::frictionless, y).x();
        std::printf("pressed and sheared, y = %.1f mm: shear force of stuck faces %.5f of a whole block's, of free ones %.3f\n",
                    1e3 * y, sticks, slides);
        EXPECT_NEAR(sticks, 1.0, 2e-3);
        EXPECT_LT(slides, 0.95);
    }
}

// A block with a crack whose faces have gone through each other here and past each other everywhere, turned as a whole.
struct TurnedBlock {
    TurnedBlock(CrackFaces::Kind faces, double angle, double far = 0.02e-3, double modulus = 40e6)
        : run(scene_with(faces, modulus), true) {
        for (const Vec2& u : random_displacement(run.equilibrium.cracks().fields())) {
            const Vec2 x = run.body.layout.node_position(run.equilibrium.cracks().node_of_field[displacement.size()]);
            displacement.push_back(turn(angle) * (x + far / 0.2e-3 * u) - x);
        }
        Equilibrium::Contacts contacts = run.equilibrium.contacts();
        for (std::size_t k = 0; k < run.equilibrium.cracks().pairs.size(); ++k)
            contacts.faces.push_back(
                {static_cast<int>(k), 1e-6 * static_cast<double>(k % 3)});  // springs of friction that have stretched
        run.equilibrium.set_displacements(displacement, 0.0, contacts);
    }
    static Scene scene_with(CrackFaces::Kind faces, double modulus) {
        Scene scene = at_equilibrium(cracked_block(false));
        scene.materials["EW"].youngs_modulus = modulus;
        scene.cracks[0].faces.kind = faces;
        if (faces == CrackFaces::Kind::friction) scene.cracks[0].faces.coefficient = 0.4;
        scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
        scene.measure = {"bottom", "bottom"};
        scene.stop.time = 1.0;
        return scene;
    }
    const std::vector<Vec2>& forces_at(const std::vector<Vec2>& places) {
        run.equilibrium.set_displacements(places, 0.0);
        return run.equilibrium.out_of_balance_forces();
    }

    StaticTrial run;
    std::vector<Vec2> displacement;
};

TEST(UnitCrackFaces, PressAndRubAlongNormalsThatTurn) {
    for (const CrackFaces::Kind faces : {CrackFaces::Kind::frictionless, CrackFaces::Kind::stick, CrackFaces::Kind::friction}) {
        const TurnedBlock upright(faces, 0.0);
        for (const double angle : {0.5, 1.6, 3.1}) {
            const TurnedBlock turned(faces, angle);
            double off = 0, largest = 0;
            for (std::size_t f = 0; f < upright.displacement.size(); ++f) {
                const Vec2 force = upright.run.equilibrium.out_of_balance_forces()[f];
                largest = std::max(largest, force.norm());
                off = std::max(off, (turned.run.equilibrium.out_of_balance_forces()[f] - turn(angle) * force).norm());
            }
            const double potential = turned.run.equilibrium.potential() / upright.run.equilibrium.potential() - 1;
            std::printf("faces %d turned by %.1f: forces off by %.1e, potential by %+.1e\n", static_cast<int>(faces), angle,
                        off / largest, potential);
            EXPECT_LT(off, 1e-10 * largest);
            EXPECT_NEAR(potential, 0.0, 1e-10);
        }
    }
}

TEST(UnitCrackFaces, ThatTurnPullAsTheirPotentialAndYieldAsTheirForces) {
    // By central differences of the potential, of the forces, and of both by the modulus.
    const double far = 2e-6;  // farther, they are so pressed that the equilibrium would not be stable
    TurnedBlock block(CrackFaces::Kind::frictionless, 0.7, far);
    Equilibrium& equilibrium = block.run.equilibrium;
    const auto is_held = [&](std::size_t f) {
        return block.run.body.layout.node_position(equilibrium.cracks().node_of_field[f]).y() == 0.0;
    };
    const std::vector<Vec2> forces = equilibrium.out_of_balance_forces();
    const auto numbers = MaterialSlope::of(block.run.scene, {"materials.EW.E"}, block.run.body);
    const Equilibrium::Slopes slopes = equilibrium.slopes(numbers);
    ASSERT_FALSE(equilibrium.motions({std::vector<Vec2>(equilibrium.boundary().drivers(), Vec2::Zero())}).empty());
    Eigen::MatrixXd load = Eigen::VectorXd::Random(2 * static_cast<Eigen::Index>(forces.size()));
    const Eigen::VectorXd yield = equilibrium.yields_to(load);

    double largest = 0, off_potential = 0;
    for (std::size_t f = 0; f < forces.size(); ++f)
        for (int axis = 0; axis < 2; ++axis) {
            if (is_held(f)) continue;
            std::array<double, 2> potential;
            for (const int side : {0, 1}) {
                std::vector<Vec2> moved = block.displacement;
                moved[f][axis] += (side - 0.5) * 2e-9;
                block.forces_at(moved);
                potential[side] = equilibrium.potential();
            }
            largest = std::max(largest, std::abs(forces[f][axis]));
            off_potential = std::max(off_potential, std::abs((potential[1] - potential[0]) / 2e-9 + forces[f][axis]));
        }
    std::array<std::vector<Vec2>, 2> along;
    const double step = 1e-8 / yield.lpNorm<Eigen::Infinity>();
    for (const int side : {0, 1}) {
        std::vector<Vec2> moved = block.displacement;
        for (std::size_t f = 0; f < moved.size(); ++f) moved[f] += (side - 0.5) * 2 * step * yield.segment<2>(2 * f);
        along[side] = block.forces_at(moved);
    }
    double off_tangent = 0;
    for (std::size_t f = 0; f < forces.size(); ++f)
        if (!is_held(f) && forces[f] != Vec2::Zero())
            off_tangent =
                std::max(off_tangent, ((along[1][f] - along[0][f]) / (2 * step) + load.col(0).segment<2>(2 * f)).norm());

    const double less = 40e6 * (1 - 1e-4), more = 40e6 * (1 + 1e-4);
    const TurnedBlock soft(CrackFaces::Kind::frictionless, 0.7, far, less), stiff(CrackFaces::Kind::frictionless, 0.7, far, more);
    const double by_modulus =
        (stiff.run.equilibrium.potential() - soft.run.equilibrium.potential()) / (more - less) / slopes.potential[0] - 1;
    double off_forces = 0, largest_slope = 0;
    for (std::size_t f = 0; f < forces.size(); ++f) {
        const Vec2 slope =
            (stiff.run.equilibrium.out_of_balance_forces()[f] - soft.run.equilibrium.out_of_balance_forces()[f]) / (more - less);
        largest_slope = std::max(largest_slope, slope.norm());
        off_forces = std::max(off_forces, (slope + slopes.fields.col(0).segment<2>(2 * f)).norm());
    }
    std::printf("faces that turn: forces off by %.1e of the potential's slope, tangent by %.1e; by the modulus %+.1e, %.1e\n",
                off_potential / largest, off_tangent, by_modulus, off_forces / largest_slope);
    EXPECT_LT(off_potential, 1e-6 * largest);
    EXPECT_LT(off_tangent, 1e-6);
    EXPECT_NEAR(by_modulus, 0.0, 1e-8);
    EXPECT_LT(off_forces, 1e-8 * largest_slope);
}

TEST(VerificationCrackFaces, HoldATurnedBlockAsTheyHoldItUpright) {
    // Corners go straight to where a block is pressed and sheared, and turned by an angle as well.
    const double wide = 10e-3;
    for (const CrackFaces::Kind faces : {CrackFaces::Kind::frictionless, CrackFaces::Kind::stick}) {
        const auto pressed = [&](double angle) {
            Scene scene = at_equilibrium(block({wide, wide}, 1e-3));
            Crack crack;
            crack.points = {Vec2(0.0, 5.1e-3), Vec2(6.2e-3, 5.4e-3)};
            crack.faces.kind = faces;
            scene.cracks = {crack};
            const Mat2 R = turn(angle);
            for (const auto& [name, side, x, moved] :
                 {std::tuple{"origin", Side::bottom, 0.0, Vec2(0.0, 0.0)},
                  std::tuple{"right", Side::bottom, wide, Vec2(0.0, 0.0)}, std::tuple{"top", Side::top, 0.0, Vec2(0.4e-3, -1e-3)},
                  std::tuple{"end", Side::top, wide, Vec2(0.4e-3, -1e-3)}}) {
                const Vec2 place(x, side == Side::top ? wide : 0.0);
                scene.edges.push_back(moving(name, side, R * (place + moved) - place));
                scene.edges.back().range = {{x, x}};
            }
            scene.measure = {"top", "top"};
            scene.stop.time = 1.0;
            StaticTrial run(scene, true);
            for (int k = 1; k <= 16; ++k) EXPECT_TRUE(run.solve(k / 16.0)) << k;
            return std::pair<Vec2, double>(R.transpose() * run.equilibrium.reactions()[2], run.equilibrium.potential());
        };
        const auto [force, potential] = pressed(0.0);
        for (const double angle : {0.4, 0.9}) {
            const auto [turned, of_turned] = pressed(angle);
            std::printf("faces %d, turned by %.1f: force at a corner off by %.1e, potential by %+.1e\n", static_cast<int>(faces),
                        angle, (turned - force).norm() / force.norm(), of_turned / potential - 1);
            EXPECT_LT((turned - force).norm(), 1e-6 * force.norm());
            EXPECT_NEAR(of_turned, potential, 1e-6 * potential);
        }
    }
}

TEST(VerificationEquilibrium, IsWhereDampedMotionComesToRest) {
    // The one discretisation by two solvers; motion has died out to 1e-5 when the explicit run ends. The tip has gone a quarter
    // of its way past the nodes beside it: ties of less are stiffer than a time step affords, and begin with slack (`TipTies`).
    const Scene scene = ring_specimen(3.02e-3, 0.5e-3);
    Trial moved(scene);
    moved.until(*scene.stop.time);
    StaticTrial rest(at_equilibrium(scene));
    ASSERT_TRUE(rest.solve(*scene.stop.time));
    const double force = moved.solver.reactions()[0].y() / rest.equilibrium.reactions()[0].y() - 1;
    const double energy = moved.solver.energies().strain / rest.equilibrium.strain_energy() - 1;
    const double rate = moved.solver.load_at(0, true).G / rest.equilibrium.load_at(0, true).G - 1;
    std::printf("damped motion against equilibrium: force %+.1e, energy %+.1e, G %+.1e\n", force, energy, rate);
    EXPECT_LT(std::abs(force), 1e-3);
    EXPECT_LT(std::abs(energy), 1e-3);
    EXPECT_LT(std::abs(rate), 1e-3);
}

TEST(UnitEquilibrium, ComesBackToWhatItSaved) {
    Scene scene = at_equilibrium(ring_specimen(3e-3, 0.5e-3));
    StaticTrial run(scene);
    ASSERT_TRUE(run.solve(1e-4));
    const Equilibrium::Snapshot saved = run.equilibrium.save();
    const double force = run.equilibrium.reactions()[0].y(), potential = run.equilibrium.potential();
    run.equilibrium.grow(0, true, Vec2(5.3e-3, 5e-3));
    ASSERT_TRUE(run.solve(0.5e-4));
    EXPECT_NE(run.equilibrium.potential(), potential);
    run.equilibrium.restore(saved);
    EXPECT_EQ(run.equilibrium.potential(), potential);
    EXPECT_EQ(run.equilibrium.time(), 1e-4);
    ASSERT_TRUE(run.solve(1e-4));
    EXPECT_NEAR(run.equilibrium.reactions()[0].y(), force, 1e-9 * force);
}

}  // namespace
}  // namespace crampfit::test

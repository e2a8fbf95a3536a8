// Elimination box by box against dense matrices.
#include "forward/grid_factor.hpp"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

namespace crampfit::test {
namespace {

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
    // Error of the solution for some right sides, of its size and the condition number of these equations.
    double error() { return error(dense()); }
    double error(const Eigen::MatrixXd& matrix) {
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

TEST(UnitGridFactor, TakesInWhatReachesFarAndMayBeNegative) {
    RandomGrid grid(11, 13);
    const int size = grid.equations();
    std::uniform_int_distribution<int> anywhere(0, size - 1);
    std::uniform_real_distribution<double> in(-1.0, 1.0);
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(size, 5);
    for (int k = 0; k < 4; ++k)
        for (int entry = 0; entry < 20; ++entry) columns(anywhere(grid.random), k) = in(grid.random);
    columns.col(4) = columns.col(0) - 2.0 * columns.col(1);
    Eigen::MatrixXd between = Eigen::MatrixXd::Zero(5, 5);  // two pairs whose products count, one both ways negative and positive
    between(0, 1) = between(1, 0) = 0.02;
    between(2, 3) = between(3, 2) = -0.02;
    between(4, 4) = 3.0;
    const auto add = [&](double times) {
        EXPECT_TRUE(grid.make());
        return grid.factor.add_wide(columns.sparseView(), Eigen::MatrixXd(times * between).sparseView());
    };
    const Eigen::MatrixXd sum = grid.dense() + columns * between * columns.transpose();
    ASSERT_TRUE(add(1.0));
    EXPECT_LT(grid.error(sum), 1e-14);
    EXPECT_GT(grid.error(), 1e-6) << "what was added must count";
    ASSERT_TRUE(grid.make());
    EXPECT_LT(grid.error(), 1e-14) << "a new factor is without it";
    // Where the sum has a negative eigenvalue.
    const double least =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(grid.dense() + 1e4 * (sum - grid.dense())).eigenvalues()[0];
    ASSERT_LT(least, 0.0);
    EXPECT_FALSE(add(1e4));
    EXPECT_LT(grid.error(), 1e-14) << "a refusal leaves what was there";
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

}  // namespace
}  // namespace crampfit::test

#include "inverse/minimize.hpp"
#include "inverse/close_look.hpp"
#include "inverse/differences.hpp"
#include "inverse/local_model.hpp"
#include "inverse/pool.hpp"
#include "inverse/search.hpp"
#include "inverse/sobol_points.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <set>

namespace crampfit {
namespace {

using Eigen::Vector2d;
using Eigen::VectorXd;

// Mildly curved residuals with their zero at (0.6, 0.3).
Evaluation curved(const VectorXd& x, int = 1) {
    Evaluation evaluation;
    evaluation.status = "finished";
    evaluation.residuals.resize(3);
    evaluation.residuals << std::exp(x[0]) - std::exp(0.6), std::sin(x[0] + 2 * x[1]) - std::sin(1.2),
        x[1] * x[1] - 0.09 + x[0] - 0.6;
    evaluation.residuals *= 10;
    evaluation.misfit = evaluation.residuals.squaredNorm();
    return evaluation;
}

Eigen::MatrixXd curved_jacobian(const VectorXd& x) {
    Eigen::MatrixXd jacobian(3, 2);
    jacobian << std::exp(x[0]), 0, std::cos(x[0] + 2 * x[1]), 2 * std::cos(x[0] + 2 * x[1]), 1, 2 * x[1];
    return 10 * jacobian;
}

// One in five points fails, always the same ones.
Evaluation often_failing(const VectorXd& x, int) {
    const auto bits = static_cast<std::uint64_t>(std::abs(x.sum()) * 1e12);
    if (bits % 5 == 0) {
        Evaluation failed;
        failed.status = "unstable";
        return failed;
    }
    return curved(x);
}

TEST(UnitPool, RunsEachJobOnceAndThrowsTheFirstException) {
    std::vector<int> calls(100, 0);
    parallel_for(100, 4, [&](int i) { ++calls[static_cast<std::size_t>(i)]; });
    EXPECT_EQ(calls, std::vector<int>(100, 1));
    try {
        parallel_for(10, 3, [](int i) {
            if (i % 4 == 3) {
                throw std::runtime_error(std::to_string(i));
            }
        });
        FAIL() << "nothing thrown";
    } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "3");
    }
    EXPECT_EQ(thread_count(3), 3);
    EXPECT_GE(thread_count(0), 1);
}

TEST(UnitObjective, RunsAPointOnceAndNoMoreThanTheBudget) {
    std::atomic<int> runs{0};
    Objective objective(
        2,
        [&](const VectorXd& x, int) {
            ++runs;
            return curved(x);
        },
        3, 2);
    const std::vector<VectorXd> points{Vector2d(0, 0), Vector2d(1, 0), Vector2d(0, 0)};
    const auto first = objective.at(points);
    EXPECT_EQ(runs, 2);
    EXPECT_EQ(first[0], first[2]);
    const std::vector<VectorXd> more{Vector2d(1, 0), Vector2d(0.5, 0), Vector2d(0.25, 0)};
    const auto second = objective.at(more);
    EXPECT_EQ(runs, 3);
    EXPECT_EQ(second[0], first[1]);
    EXPECT_TRUE(second[1]);
    EXPECT_FALSE(second[2]);
    EXPECT_TRUE(objective.exhausted());
    ASSERT_EQ(objective.runs().size(), 3u);
    EXPECT_EQ(objective.runs()[2].x, more[1]);
    EXPECT_EQ(objective.best()->x, more[1]);
}

TEST(UnitObjective, BranchesShareRunsAndJoinInOrder) {
    std::atomic<int> runs{0};
    Objective objective(
        2,
        [&](const VectorXd& x, int) {
            ++runs;
            return curved(x);
        },
        10, 1);
    objective.at(Vector2d(0.5, 0.5));
    Objective a = objective.branch(2, 1), b = objective.branch(2, 1);
    b.at(Vector2d(0.1, 0.1));
    b.at(Vector2d(0.2, 0.2));
    EXPECT_FALSE(b.at(Vector2d(0.3, 0.3)));
    a.at(Vector2d(0.5, 0.5));
    a.at(Vector2d(0.1, 0.1));
    EXPECT_EQ(runs, 3);
    objective.join(a);
    objective.join(b);
    ASSERT_EQ(objective.runs().size(), 3u);
    EXPECT_EQ(objective.runs()[1].x, Vector2d(0.1, 0.1));
    EXPECT_EQ(objective.budget_left(), 7);
}

TEST(GradientDifferences, JacobianMatchesTheAnalyticOne) {
    Objective objective(2, curved, 100, 2);
    const Vector2d x(0.55, 0.4);
    // Central differences err by h^2 / 6 times the third derivative, here 8 * 10 at most: 0.012.
    EXPECT_LT((*jacobian(objective, x) - curved_jacobian(x)).cwiseAbs().maxCoeff(), 0.0125);
    EXPECT_EQ(objective.runs().size(), 5u);
}

TEST(GradientDifferences, OneSidedAtABoundAndBesideAFailedRun) {
    const Vector2d corner(1, 0);
    Objective at_corner(2, curved, 100, 1);
    const auto derivative = jacobian(at_corner, corner);
    // One-sided ones err by h / 2 times the second derivative, here 4 * 10 at most: 0.6.
    EXPECT_LT((*derivative - curved_jacobian(corner)).cwiseAbs().maxCoeff(), 0.61);
    for (const auto& run : at_corner.runs()) {
        EXPECT_TRUE((run.x.array() >= 0).all() && (run.x.array() <= 1).all());
    }
    const Vector2d x(0.5, 0.5);
    Objective one_side(
        2, [&](const VectorXd& p, int) { return p[0] > 0.51 ? Evaluation{} : curved(p); }, 100, 1);
    EXPECT_LT((*jacobian(one_side, x) - curved_jacobian(x)).cwiseAbs().maxCoeff(), 0.61);
    Objective near_only(
        2, [&](const VectorXd& p, int) { return (p - x).norm() > 0.02 ? Evaluation{} : curved(p); }, 100, 1);
    EXPECT_LT((*jacobian(near_only, x) - curved_jacobian(x)).cwiseAbs().maxCoeff(), 0.0125);  // with half the step
    Objective nowhere(
        2, [&](const VectorXd& p, int) { return p != x ? Evaluation{} : curved(p); }, 100, 1);
    EXPECT_FALSE(jacobian(nowhere, x));
}

TEST(GradientLocalModel, IsExactForQuadraticsAndMeasuresScatter) {
    const Vector2d centre(0.5, 0.5);
    const auto quadratic = [](const VectorXd& x, int) {
        Evaluation evaluation;
        evaluation.residuals = Vector2d(1 + 2 * x[0] - 3 * x[1] + 4 * x[0] * x[1] + x[0] * x[0], x[1] * x[1] - x[0]);
        evaluation.misfit = evaluation.residuals.squaredNorm();
        return evaluation;
    };
    Objective objective(2, quadratic, 100, 1);
    for (double dx : {-0.03, 0.0, 0.03}) {
        for (double dy : {-0.03, 0.0, 0.03}) {
            objective.at(centre + Vector2d(dx, dy));
        }
    }
    objective.at(Vector2d(0.9, 0.9));  // too far to have a say
    const auto model = LocalModel::fit(objective.runs(), centre, difference_reach);
    ASSERT_TRUE(model);
    Eigen::Matrix2d expected;
    expected << 2 + 4 * 0.5 + 2 * 0.5, -3 + 4 * 0.5, -1, 2 * 0.5;
    EXPECT_LT((model->jacobian() - expected).norm(), 1e-10);
    EXPECT_LT(model->scatter().norm(), 1e-12);
    EXPECT_EQ(model->freedom(), 3);
    const Vector2d x(0.52, 0.47);
    EXPECT_LT((model->residuals(x) - quadratic(x, 1).residuals).norm(), 1e-12);
}

TEST(UnitLocalModel, IsAbsentWhereRunsDoNotSpanAllDirections) {
    Objective objective(2, curved, 100, 1);
    for (int i = 0; i < 10; ++i) {
        objective.at(Vector2d(0.5 + 0.004 * i, 0.5));
    }
    EXPECT_FALSE(LocalModel::fit(objective.runs(), Vector2d(0.5, 0.5), difference_reach));
}

TEST(UnitMinimize, CeresFindsAZeroToAMillionth) {
    Objective objective(2, curved, 200, 2);
    EXPECT_TRUE(minimize(objective, Vector2d(0.1, 0.9), {"ceres"}).converged);
    EXPECT_LT((objective.best()->x - Vector2d(0.6, 0.3)).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(UnitMinimize, CeresStopsAtABound) {
    const auto beyond = [](const VectorXd& x, int) {
        Evaluation evaluation;
        evaluation.residuals = Vector2d(x[0] - 1.5, x[1] - 0.25);
        evaluation.misfit = evaluation.residuals.squaredNorm();
        return evaluation;
    };
    Objective objective(2, beyond, 200, 1);
    EXPECT_TRUE(minimize(objective, Vector2d(0.2, 0.9), {"ceres"}).converged);
    EXPECT_EQ(objective.best()->x[0], 1);
    EXPECT_NEAR(objective.best()->x[1], 0.25,
                2e-3);  // at the tolerance of 1e-4 of the misfit, which the bound keeps at 0.25
}

class Methods : public ::testing::TestWithParam<std::string> {};

TEST_P(Methods, FindsTheMinimumWithinTheBox) {
    Objective objective(2, curved, 1500, 1);
    minimize(objective, Vector2d(0.1, 0.9), {GetParam(), 3});
    // Evolution (isres) comes no closer with so many runs, the others by far.
    const double tolerance = GetParam() == "isres" ? 0.03 : 0.002;
    EXPECT_LT((objective.best()->x - Vector2d(0.6, 0.3)).cwiseAbs().maxCoeff(), tolerance) << objective.best()->x.transpose();
    for (const auto& run : objective.runs()) {
        EXPECT_TRUE((run.x.array() >= 0).all() && (run.x.array() <= 1).all());
    }
}

TEST_P(Methods, GoesOnWhenOneRunInFiveFails) {
    Objective objective(2, often_failing, 1500, 1);
    OptimizerChoice choice;
    choice.method = GetParam();
    choice.starts = 2;
    search(
        objective, choice, Vector2d(0.12, 0.88), 5, [](const Evaluation&) { return true; }, [](const std::string&) {});
    int failed = 0;
    for (const auto& run : objective.runs()) {
        failed += run.evaluation->usable() ? 0 : 1;
    }
    EXPECT_GT(failed, 0);
    EXPECT_LT((objective.best()->x - Vector2d(0.6, 0.3)).cwiseAbs().maxCoeff(), 0.03) << objective.best()->x.transpose();
}

TEST_P(Methods, KeepsToTheBudgetAndSaysSo) {
    Objective objective(2, curved, 7, 1);
    EXPECT_FALSE(minimize(objective, Vector2d(0.1, 0.9), {GetParam()}).converged);
    EXPECT_EQ(objective.runs().size(), 7u);
    double least = INFINITY;
    for (const auto& run : objective.runs()) {
        least = std::min(least, run.evaluation->misfit);
    }
    EXPECT_EQ(objective.best()->evaluation->misfit, least);
}

TEST_P(Methods, WorksInOneDimension) {
    const auto line = [](const VectorXd& x, int) {
        Evaluation evaluation;
        evaluation.residuals = Vector2d(std::exp(x[0]) - std::exp(0.3), x[0] - 0.3);
        evaluation.misfit = evaluation.residuals.squaredNorm();
        return evaluation;
    };
    Objective objective(1, line, 300, 1);
    minimize(objective, VectorXd::Constant(1, 0.9), {GetParam(), 2});
    EXPECT_NEAR(objective.best()->x[0], 0.3, 0.01);
}

TEST_P(Methods, PassesOnOurOwnExceptions) {
    Objective objective(
        2, [](const VectorXd&, int) -> Evaluation { throw std::logic_error("ours"); }, 50, 1);
    EXPECT_THROW(minimize(objective, Vector2d(0.1, 0.9), {GetParam()}), std::logic_error);
}

INSTANTIATE_TEST_SUITE_P(UnitMinimize, Methods, ::testing::ValuesIn(method_names()), [](const auto& test) { return test.param; });

// Two hollows: one at 0.2 where the search begins, with a misfit of some 36, and the true one at 0.8.
TEST(UnitSearch, AutoLooksElsewhereWhileTheNoiseDoesNotExplainTheMisfit) {
    const auto two_hollows = [](const VectorXd& x, int) {
        Evaluation evaluation;
        evaluation.residuals = 10 * Eigen::Vector3d(60 * (x[0] - 0.2) * (x[0] - 0.8), x[0] - 0.8, x[1] - 0.5);
        evaluation.misfit = evaluation.residuals.squaredNorm();
        return evaluation;
    };
    for (const int starts : {1, 4}) {
        Objective objective(2, two_hollows, 500, 1);
        OptimizerChoice choice;
        choice.starts = starts;
        search(
            objective, choice, Vector2d(0.2, 0.5), 1, [](const Evaluation&) { return true; }, [](const std::string&) {});
        EXPECT_NEAR(objective.best()->x[0], 0.8, 0.06) << starts;  // 0.2 leaves six sigma, so that one start is too few
    }
}

TEST(UnitSearch, StartsFillTheBoxEvenly) {
    for (const unsigned seed : {1u, 2u}) {
        std::set<int> cells;
        for (int i = 0; i < 16; ++i) {
            const VectorXd x = sobol_point(i, 2, seed);
            cells.insert(static_cast<int>(x[0] * 4) + 4 * static_cast<int>(x[1] * 4));
        }
        EXPECT_EQ(cells.size(), 16u);  // one in each: a (0, 4, 2)-net in base 2 (Sobol 1967)
    }
    EXPECT_NE(sobol_point(1, 2, 1u), sobol_point(1, 2, 2u));
}

// A user's stop may come at any moment, before the first run of a window too.
TEST(UnitCloseLook, GivesWhatIsKnownWhenTheUserStops) {
    const VectorXd lowest = Vector2d(0.6, 0.3);
    int looks = 0;
    for (int runs = 0; runs < 400; runs += 3) {
        std::atomic<bool> stop = false;
        std::atomic<int> left = runs;
        const auto evaluate = [&](const VectorXd& x, int) {
            if (left-- <= 0) stop = true;
            return curved(x);
        };
        Objective objective(2, curved, 100, 1, &stop);
        const auto look = look_close(objective, {evaluate, true, 1}, lowest, {{3}}, {"a", "b"}, 1);
        if (!look) {
            EXPECT_TRUE(stop) << runs;
            continue;
        }
        ++looks;
        EXPECT_TRUE(look->objective.best()) << runs;
        EXPECT_TRUE(look->uncertainty.best.evaluation) << runs;
    }
    EXPECT_GT(looks, 10);
    EXPECT_LT(looks, 130);
}

// A narrow valley at 45 degrees to the parameters whose walls soon go flat, as where a tough wood stands in for a stiff one and a
// crack jumps: misfit (3 tanh(u / 3 s_u))^2 + (v / s_v)^2, whose covariance at the bottom is s_u^2 across and s_v^2 along.
// Windows as wide along the parameters as the intervals are see the walls where they are flat; a polynomial through what goes as
// a tanh up to a standard error either side is 3 % less steep than it.
TEST(UnitCloseLook, GoesAlongAValleyAskewToTheParameters) {
    const double s_u = 1e-3, s_v = 0.05;
    for (const Vector2d& bottom : {Vector2d(0.5, 0.5), Vector2d(0.02, 0.5)}) {  // and beside a bound
        const auto valley = [&](const VectorXd& x, int) {
            const Vector2d d = x - bottom;
            Evaluation evaluation;
            evaluation.residuals = VectorXd::Ones(30);  // noise, by turns above and below
            for (Eigen::Index i = 0; i < 30; i += 2) {
                evaluation.residuals[i] = -1;
            }
            evaluation.residuals.head(2) << 3 * std::tanh((d[0] - d[1]) / std::sqrt(2.0) / (3 * s_u)),
                d.sum() / std::sqrt(2.0) / s_v;
            evaluation.misfit = evaluation.residuals.squaredNorm();
            return evaluation;
        };
        Objective objective(2, valley, 100, 1);
        const auto look = look_close(objective, {valley, true, 1}, bottom, {{30}}, {"a", "b"}, 1);
        ASSERT_TRUE(look);
        const Uncertainty& found = look->uncertainty;
        const auto error_along = [&](const Vector2d& way) { return std::sqrt(0.5 * way.dot(found.covariance * way)); };
        EXPECT_NEAR(error_along({1, -1}) / s_u, 1.0, 0.05);
        EXPECT_NEAR(error_along({1, 1}) / s_v, 1.0, 0.05);
        const double half = found.quantile * std::sqrt(0.5) * s_v;  // of either parameter
        for (int j = 0; j < 2; ++j) {
            EXPECT_NEAR(found.lower_95[j], std::max(0.0, bottom[j] - half), 0.05 * half);
            EXPECT_NEAR(found.upper_95[j], bottom[j] + half, 0.05 * half);
        }
    }
}

// Noise, and what hangs on one combination of the parameters alone.
Evaluation ridge(double across) {
    Evaluation evaluation;
    evaluation.residuals = VectorXd::Ones(30);
    for (Eigen::Index i = 0; i < 30; i += 2) {
        evaluation.residuals[i] = -1;
    }
    evaluation.residuals[0] = across / 1e-3;
    evaluation.misfit = evaluation.residuals.squaredNorm();
    return evaluation;
}

// A ridge from bound to bound: as toughness and modulus go where the length of the crack alone was measured.
TEST(UnitCloseLook, ARidgeThroughTheBoxIsToldAsOne) {
    const auto evaluate = [](const VectorXd& x, int) { return ridge(x[0] - 0.2 - 0.5 * x[1]); };
    Objective objective(2, evaluate, 100, 1);
    const auto look = look_close(objective, {evaluate, true, 1}, Vector2d(0.4, 0.4), {{30}}, {"a", "b"}, 1);
    ASSERT_TRUE(look);
    const Uncertainty& found = look->uncertainty;
    EXPECT_GT(found.covariance(0, 1) / std::sqrt(found.covariance(0, 0) * found.covariance(1, 1)), 0.99);
    EXPECT_NE(found.message.find("'a' and 'b' cannot be told apart"), std::string::npos) << found.message;
    EXPECT_NEAR(found.lower_95[0], 0.2, 0.02);
    EXPECT_NEAR(found.upper_95[0], 0.7, 0.02);
    EXPECT_NEAR(found.lower_95[1], 0.0, 1e-9);
    EXPECT_NEAR(found.upper_95[1], 1.0, 1e-9);
}

// What is cheap nearby goes wrong farther off: a profile that ends by that alone tells nothing.
TEST(UnitCloseLook, AProfileThatNoRunConfirmsEndsNothing) {
    const auto evaluate = [](const VectorXd& x, int) { return ridge(x[0] - x[1]); };
    const auto near = [](const VectorXd& x, int) {
        Evaluation evaluation = ridge(x[0] - x[1]);
        evaluation.residuals[1] += 50 * std::pow(x[0] - 0.5, 2);
        evaluation.misfit = evaluation.residuals.squaredNorm();
        return evaluation;
    };
    Objective objective(2, evaluate, 100, 1);
    const auto believed = look_close(objective, {near, true, 1}, Vector2d(0.5, 0.5), {{30}}, {"a", "b"}, 1);
    ASSERT_TRUE(believed);
    EXPECT_LT(believed->uncertainty.upper_95[0] - believed->uncertainty.lower_95[0], 0.9);
    const auto lowest_held = [&](const VectorXd& start, Eigen::Index held) {
        const VectorXd there = VectorXd::Constant(2, start[held]);
        return std::optional(crampfit::Run{there, objective.at(there)});
    };
    const auto look = look_close(objective, {near, false, 1, lowest_held}, Vector2d(0.5, 0.5), {{30}}, {"a", "b"}, 1);
    ASSERT_TRUE(look);
    EXPECT_NE(look->uncertainty.message.find("'a' and 'b' cannot be told apart"), std::string::npos) << look->uncertainty.message;
    for (int j = 0; j < 2; ++j) {
        EXPECT_EQ(look->uncertainty.lower_95[j], 0.0) << j;
        EXPECT_EQ(look->uncertainty.upper_95[j], 1.0) << j;
    }
}

// Two valleys beside one another, each of noise and (x - x0) / s, the floor of one higher by 20; the lower of both counts.
Evaluation two_valleys(const VectorXd& x) {
    Evaluation evaluation;
    evaluation.residuals = VectorXd::Ones(30);  // noise, by turns above and below
    for (Eigen::Index i = 0; i < 30; i += 2) {
        evaluation.residuals[i] = -1;
    }
    const Vector2d high = (x - Vector2d(0.38, 0.5)) / 0.02, low = (x - Vector2d(0.5, 0.5)) / 0.02;
    const bool is_high = high.squaredNorm() + 20 < low.squaredNorm();
    evaluation.residuals.head(2) = is_high ? high : low;
    evaluation.residuals[2] = is_high ? std::sqrt(21.0) : 1.0;
    evaluation.misfit = evaluation.residuals.squaredNorm();
    return evaluation;
}

TEST(UnitCloseLook, GoesDownToALowerValleyThatItComesUpon) {
    Objective objective(
        2, [](const VectorXd& x, int) { return two_valleys(x); }, 100, 1);
    objective.at(Vector2d(0.38, 0.5));
    int descents = 0;
    const auto look = [&] {
        return look_close(objective, {[](const VectorXd& x, int) { return two_valleys(x); }, true, 1}, objective.best()->x,
                          {{30}}, {"a", "b"}, 1);
    };
    const auto found = look_and_descend(objective, look, [&] {
        ++descents;
        objective.at(Vector2d(0.5, 0.5));
    });
    ASSERT_TRUE(found);
    EXPECT_EQ(descents, 1);
    EXPECT_EQ(objective.best()->x, Vector2d(0.5, 0.5));
    EXPECT_NEAR(found->uncertainty.lower_95[1], 0.5 - found->uncertainty.quantile * 0.02, 0.002);
    EXPECT_NEAR(found->uncertainty.upper_95[0], 0.5 + found->uncertainty.quantile * 0.02, 0.002);
}

// Less than a standard error away, a point that a run confirms is taken as the look has it.
TEST(UnitCloseLook, TakesALowerPointNearByWithoutAnotherLook) {
    const auto bowl = [](const VectorXd& x, int) {
        Evaluation evaluation = two_valleys(x);
        evaluation.residuals.head(3) << (x - Vector2d(0.5, 0.5)) / 0.02, 1.0;
        evaluation.misfit = evaluation.residuals.squaredNorm();
        return evaluation;
    };
    const Vector2d start(0.515, 0.5);
    Objective objective(2, bowl, 100, 1);
    objective.at(start);
    int looks = 0;
    const auto found = look_and_descend(
        objective,
        [&] {
            ++looks;
            return look_close(objective, {bowl, true, 1}, start, {{30}}, {"a", "b"}, 1);
        },
        [] { FAIL() << "it is near by"; });
    ASSERT_TRUE(found);
    EXPECT_EQ(looks, 1);
    EXPECT_EQ(objective.runs().size(), 2u);
    EXPECT_EQ(objective.best()->x, found->uncertainty.best.x);
    EXPECT_NEAR((objective.best()->x - Vector2d(0.5, 0.5)).norm(), 0.0, 0.004);  // a fifth of a standard error
    EXPECT_NEAR(found->uncertainty.lower_95[0], 0.5 - found->uncertainty.quantile * 0.02, 0.005);
}

// The cheap model has its lowest point elsewhere, which no run confirms: the intervals hold both.
TEST(UnitCloseLook, TakesInTheBestRunWhereTheCheapModelPromisesAnother) {
    const auto bowl = [](const Vector2d& bottom) {
        return [bottom](const VectorXd& x, int) {
            Evaluation evaluation = two_valleys(x);
            evaluation.residuals.head(3) << (x - bottom) / 0.02, 1.0;
            evaluation.misfit = evaluation.residuals.squaredNorm();
            return evaluation;
        };
    };
    const Vector2d best(0.5, 0.5), promised(0.53, 0.5);
    Objective objective(2, bowl(best), 100, 1);
    objective.at(best);
    const auto found = look_and_descend(
        objective,
        [&] {
            return look_close(objective, {bowl(promised), true, 1}, best, {{30}}, {"a", "b"}, 1);
        },
        [] { FAIL() << "nothing is confirmed"; });
    ASSERT_TRUE(found);
    const Uncertainty& u = found->uncertainty;
    EXPECT_NEAR((u.best.x - promised).norm(), 0.0, 0.005);
    EXPECT_NEAR(u.covariance(0, 0), 0.02 * 0.02 + 0.03 * 0.03, 0.3e-3);
    EXPECT_NEAR(u.lower_95[0], best[0] - u.quantile * 0.02, 0.005);
    EXPECT_NEAR(u.upper_95[0], promised[0] + u.quantile * 0.02, 0.005);
}

// Equilibria that are known since let the cheap model be lower than the best run at its own place: there is nothing to run,
// wherever rounding puts that place.
TEST(UnitCloseLook, RunsNothingWhereTheCheapModelIsLowerAtTheBestRunItself) {
    for (int place = 0; place < 20; ++place) {
        const Vector2d best(0.3 + 0.013 * place, 0.7 - 0.017 * place);
        const auto bowl = [best](double floor) {
            return [best, floor](const VectorXd& x, int) {
                Evaluation evaluation = two_valleys(x);
                const Vector2d off = x - best;
                evaluation.residuals.head(3) << (off[0] + 2 * off[1]) / 0.02, (2 * off[0] - 3 * off[1]) / 0.07, floor;
                evaluation.misfit = evaluation.residuals.squaredNorm();
                return evaluation;
            };
        };
        Objective objective(2, bowl(1.0), 100, 1);
        objective.at(best);
        const auto found = look_and_descend(
            objective,
            [&] {
                return look_close(objective, {bowl(0.5), true, 1}, best, {{30}}, {"a", "b"}, 1);
            },
            [] { FAIL() << "it is the same point"; });
        ASSERT_TRUE(found) << place;
        EXPECT_LT(found->uncertainty.best.evaluation->misfit, objective.best()->evaluation->misfit - 0.5) << place;
        EXPECT_LT((found->uncertainty.best.x - best).cwiseAbs().maxCoeff(), 1e-9) << place;
        EXPECT_EQ(objective.runs().size(), 1u) << place;
    }
}

}  // namespace
}  // namespace crampfit

// Descent on the models that runs leave behind, against a function whose minimum is known.
#include "inverse/walk_descent.hpp"
#include "tests/inverse/fake_wedge.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace crampfit {
namespace {

// Residuals of Powell's badly placed kind: exact in the first parameter, curved in the second, zero at (0.7, 0.3).
Eigen::VectorXd residuals(const Eigen::VectorXd& x) {
    Eigen::VectorXd r(3);
    r << 10.0 * (x[0] - 0.7) + std::exp(3.0 * x[1]) - std::exp(0.9), 20.0 * (x[1] * x[1] - 0.09),
        std::sin(5.0 * (x[0] - 0.7)) * x[1];
    return r;
}

// To first order in the second parameter about a point.
Eigen::VectorXd residuals_near(const Eigen::VectorXd& point, const Eigen::VectorXd& x) {
    Eigen::VectorXd base = x, more = x, less = x;
    base[1] = point[1];
    more[1] = point[1] + 1e-6;
    less[1] = point[1] - 1e-6;
    return residuals(base) + (residuals(more) - residuals(less)) / 2e-6 * (x[1] - point[1]);
}

Evaluation evaluation(const Eigen::VectorXd& r) { return {"finished", r, r, r.squaredNorm(), 0.0}; }

bool never(const Evaluation&) { return false; }

TEST(UnitWalkDescent, FindsTheLowestPointInFewRuns) {
    for (const auto& [first, second] : {std::pair{0.1, 0.9}, {0.9, 0.1}, {0.5, 0.6}}) {
        Objective objective(
            2, [](const Eigen::VectorXd& x, int) { return evaluation(residuals(x)); }, 100, 1);
        const Near near = [](const Eigen::VectorXd& point) -> Objective::Evaluate {
            return [point](const Eigen::VectorXd& x, int) { return evaluation(residuals_near(point, x)); };
        };
        const SearchResult found = descend_by_walks(objective, {near, near, {true, false}, false}, 1, never,
                                                    Eigen::Vector2d(first, second), 1, [](const std::string&) {});
        ASSERT_NE(objective.best(), nullptr);
        const Eigen::VectorXd best = objective.best()->x;
        std::printf("from (%.1f, %.1f): %zu runs, off by %.1e\n", first, second, objective.runs().size(),
                    (best - Eigen::Vector2d(0.7, 0.3)).norm());
        EXPECT_TRUE(found.converged);
        EXPECT_NEAR(best[0], 0.7, 1e-6);
        EXPECT_NEAR(best[1], 0.3, 1e-6);
        EXPECT_LE(objective.runs().size(), 15u);
    }
}

// One run in five fails and one in twenty hangs until its time is up, which is the same here; so it is with the cheap models.
TEST(UnitWalkDescent, FindsTheSamePointWhereRunsFail) {
    int failed = 0, alone = 0;
    for (unsigned seed = 1; seed <= 40; ++seed) {
        const auto fails = [seed](const Eigen::VectorXd& x) { return testing::scramble(x[0] + seed, x[1]) < 0.25; };
        const auto or_failure = [&](const Eigen::VectorXd& x, const Eigen::VectorXd& r) {
            return fails(x) ? Evaluation{"lost", {}, {}} : evaluation(r);
        };
        Objective objective(
            2, [&](const Eigen::VectorXd& x, int) { return or_failure(x, residuals(x)); }, 100, 1);
        const Near near = [&](const Eigen::VectorXd& point) -> Objective::Evaluate {
            return [&, point](const Eigen::VectorXd& x, int) { return or_failure(x, residuals_near(point, x)); };
        };
        const Eigen::Vector2d start(0.1, 0.9);
        const Nearby nearby{near, near, {true, false}, false};
        const SearchResult found = descend_by_walks(objective, nearby, 1, never, start, seed, [](const std::string&) {});
        const auto is_lost = [](const crampfit::Run& run) { return !run.evaluation->usable(); };
        failed += static_cast<int>(std::count_if(objective.runs().begin(), objective.runs().end(), is_lost));
        alone += fails(start);
        ASSERT_NE(objective.best(), nullptr);
        EXPECT_TRUE(found.converged);
        EXPECT_NEAR(objective.best()->x[0], 0.7, 1e-6);
        EXPECT_NEAR(objective.best()->x[1], 0.3, 1e-6);
    }
    std::printf("%d runs failed, %d of them the first\n", failed, alone);
    EXPECT_GT(alone, 0);
}

TEST(UnitWalkDescent, EndsEarlyWhereItsBestRunIsEnough) {
    const Near near = [](const Eigen::VectorXd& point) -> Objective::Evaluate {
        return [point](const Eigen::VectorXd& x, int) { return evaluation(residuals_near(point, x)); };
    };
    const Nearby nearby{near, near, {true, false}, false};
    std::size_t runs[2];
    for (const bool early : {false, true}) {
        Objective objective(
            2, [](const Eigen::VectorXd& x, int) { return evaluation(residuals(x)); }, 100, 1);
        const Eigen::VectorXd start = Eigen::Vector2d(0.1, 0.9);
        const double at_start = objective.at(start)->misfit;
        const auto enough = [&](const Evaluation& best) { return early && best.misfit < at_start; };
        EXPECT_TRUE(descend_again(objective, nearby, enough, 1));
        EXPECT_LT(objective.best()->evaluation->misfit, at_start);
        runs[early] = objective.runs().size();
    }
    EXPECT_LT(runs[true], runs[false]);
}

// A standard error and less from the lowest point, in noise of one sigma a residual, one run is the last: none is looked about
// but the first.
TEST(UnitWalkDescent, EndsWithAStepOfAStandardError) {
    const auto with_noise = [](const Eigen::VectorXd& r) {
        Eigen::VectorXd all = Eigen::VectorXd::Ones(40);
        all.head(3) = r;
        return evaluation(all);
    };
    Eigen::VectorXd start = Eigen::Vector2d(0.0, 0.31);
    const Near near = [&](const Eigen::VectorXd& point) -> Objective::Evaluate {
        EXPECT_EQ(point, start);
        return [&, point](const Eigen::VectorXd& x, int) { return with_noise(residuals_near(point, x)); };
    };
    for (const auto& [x, runs] : {std::pair{0.72, 2u}, {0.701, 1u}}) {  // a gain of 0.09, of 0.02
        Objective objective(
            2, [&](const Eigen::VectorXd& at, int) { return with_noise(residuals(at)); }, 100, 1);
        start[0] = x;
        const double before = with_noise(residuals(start)).misfit;
        const SearchResult found =
            descend_by_walks(objective, {near, near, {true, false}, false}, 1, never, start, 1, [](const std::string&) {});
        std::printf("gain from %.6f to %.6f in %zu runs\n", before, objective.best()->evaluation->misfit,
                    objective.runs().size());
        EXPECT_TRUE(found.converged);
        EXPECT_EQ(objective.runs().size(), runs);
    }
}

TEST(UnitWalkDescent, StopsWhenRunsAreUsedUp) {
    Objective objective(
        2, [](const Eigen::VectorXd& x, int) { return evaluation(residuals(x)); }, 2, 1);
    const Near near = [](const Eigen::VectorXd& point) -> Objective::Evaluate {
        return [point](const Eigen::VectorXd& x, int) { return evaluation(residuals_near(point, x)); };
    };
    const SearchResult found = descend_by_walks(objective, {near, near, {true, false}, false}, 1, never,
                                                Eigen::Vector2d(0.1, 0.9), 1, [](const std::string&) {});
    EXPECT_FALSE(found.converged);
    EXPECT_EQ(objective.runs().size(), 2u);
}

}  // namespace
}  // namespace crampfit

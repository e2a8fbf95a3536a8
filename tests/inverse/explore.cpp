#include "inverse/ensemble.hpp"
#include "inverse/fit.hpp"
#include "inverse/lack_of_fit.hpp"
#include "inverse/profile.hpp"
#include "inverse/uncertainty.hpp"
#include "tests/inverse/fake_wedge.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include <cmath>
#include <cstdio>

namespace crampfit::testing {
namespace {

// Residuals whose sum of squares is that of a normal distribution in the cube.
struct Normal {
    Eigen::Vector2d mean{0.5, 0.4};
    Eigen::Matrix2d covariance{{0.05 * 0.05, 0.9 * 0.05 * 0.02}, {0.9 * 0.05 * 0.02, 0.02 * 0.02}};

    Objective objective(int budget) const {
        const Eigen::Matrix2d root = covariance.llt().matrixL();
        return Objective(
            2,
            [root, centre = mean](const Eigen::VectorXd& x, int) {
                Evaluation evaluation;
                evaluation.residuals = root.triangularView<Eigen::Lower>().solve(x - centre);
                evaluation.misfit = evaluation.residuals.squaredNorm();
                return evaluation;
            },
            budget, 1);
    }
};

double half_misfit(const Evaluation& evaluation) { return -0.5 * evaluation.misfit; }

TEST(VerificationPosterior, EnsembleHasTheMomentsOfANormalDistribution) {
    const Normal normal;
    Objective objective = normal.objective(100000);
    // It begins far too narrow and off the middle: the burn-in must see to that.
    const Ensemble ensemble =
        draw_ensemble(objective, half_misfit, Eigen::Vector2d(0.45, 0.42), Eigen::Matrix2d::Identity() * 1e-6, 20000, 5);
    ASSERT_EQ(ensemble.samples.size(), 20000u);
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const crampfit::Run& sample : ensemble.samples) {
        mean += sample.x / 20000;
    }
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
    for (const crampfit::Run& sample : ensemble.samples) {
        covariance += (sample.x - mean) * (sample.x - mean).transpose() / 20000;
    }
    const double independent = 20000 / ensemble.correlation_time.maxCoeff();
    std::printf("posterior: mean %.4f %.4f (exact 0.5 0.4), sd %.4f %.4f (0.05 0.02), correlation %.3f (0.9), %.0f independent, "
                "%.0f %% moved\n",
                mean[0], mean[1], std::sqrt(covariance(0, 0)), std::sqrt(covariance(1, 1)),
                covariance(0, 1) / std::sqrt(covariance(0, 0) * covariance(1, 1)), independent, 100 * ensemble.acceptance);
    EXPECT_GT(independent, 200);
    for (int j = 0; j < 2; ++j) {  // within four standard errors; a standard deviation's is sd / sqrt(2 n)
        const double sd = std::sqrt(normal.covariance(j, j));
        EXPECT_NEAR(mean[j], normal.mean[j], 4 * sd / std::sqrt(independent));
        EXPECT_NEAR(std::sqrt(covariance(j, j)), sd, 4 * sd / std::sqrt(2 * independent));
    }
    EXPECT_NEAR(covariance(0, 1) / std::sqrt(covariance(0, 0) * covariance(1, 1)), 0.9, 4 * (1 - 0.81) / std::sqrt(independent));
}

TEST(VerificationPosterior, AShortChainIsWorthWhatItsMeansScatter) {
    const Normal normal;
    constexpr int chains = 60;
    double squares = 0, worth = 0;
    for (int k = 0; k < chains; ++k) {
        Objective objective = normal.objective(10000);
        const Ensemble ensemble =
            draw_ensemble(objective, half_misfit, normal.mean, normal.covariance, 1000, static_cast<unsigned>(100 + k));
        const double independent = 1000 / ensemble.correlation_time.maxCoeff();
        worth += independent / chains;
        for (int j = 0; j < 2; ++j) {
            double mean = 0;
            for (const crampfit::Run& sample : ensemble.samples) {
                mean += sample.x[j] / 1000;
            }
            squares += std::pow(mean - normal.mean[j], 2) / (normal.covariance(j, j) / independent) / (2 * chains);
        }
    }
    std::printf("chains of 1000 samples, worth %.0f: their means scatter by %.2f of what so many would\n", worth,
                std::sqrt(squares));
    EXPECT_LT(std::sqrt(squares), 1.3);
    EXPECT_GT(std::sqrt(squares), 0.7);
}

TEST(VerificationPosterior, KeepsToTheCubeAndCutsADistributionOffThere) {
    Normal normal;
    normal.mean = {0.0, 0.5};
    normal.covariance = Eigen::Vector2d(0.01, 0.01).asDiagonal();  // sd 0.1
    Objective objective = normal.objective(100000);
    const Ensemble ensemble = draw_ensemble(objective, half_misfit, Eigen::Vector2d(0.1, 0.5), normal.covariance, 20000, 5);
    double mean = 0;
    for (const crampfit::Run& sample : ensemble.samples) {
        EXPECT_GE(sample.x.minCoeff(), 0);
        mean += sample.x[0] / 20000;
    }
    const double exact = 0.1 * std::sqrt(2 / std::numbers::pi);  // of half a normal distribution
    EXPECT_NEAR(mean, exact, 4 * 0.06 / std::sqrt(20000 / ensemble.correlation_time.maxCoeff()));
}

// Jumps of the curves leave a ring about the best point that is worse the nearer to it: a walker that begins beyond stays there.
TEST(VerificationPosterior, NoWalkerBeginsWhereNothingLeadsBack) {
    constexpr double sd = 0.01;
    const Eigen::Vector2d centre(0.5, 0.5);
    Objective objective(
        2,
        [&](const Eigen::VectorXd& x, int) {
            const double off = (x - centre).norm();
            Evaluation evaluation;
            evaluation.residuals = off < 5 * sd ? Eigen::Vector2d((x - centre) / sd) : Eigen::Vector2d(100 * (1 - off), 0);
            evaluation.misfit = evaluation.residuals.squaredNorm();
            return evaluation;
        },
        100000, 1);
    const Ensemble ensemble = draw_ensemble(objective, half_misfit, centre, Eigen::Matrix2d::Identity() * 0.01, 8000, 5);
    double highest = 0, squares = 0;
    for (const crampfit::Run& sample : ensemble.samples) {
        highest = std::max(highest, sample.evaluation->misfit);
        squares += (sample.x - centre).squaredNorm() / (2 * 8000);
    }
    EXPECT_LT(highest, 25);  // the ring
    EXPECT_NEAR(std::sqrt(squares), sd, 4 * sd / std::sqrt(4 * 8000 / ensemble.correlation_time.maxCoeff()));
}

// In a linear problem the profile is a parabola, and its interval that of the covariance.
TEST(VerificationProfile, IntervalsOfALinearProblemAreExact) {
    const Normal normal;
    Objective objective = normal.objective(10000);
    const crampfit::Run best{normal.mean, objective.at(normal.mean)};
    for (Eigen::Index j = 0; j < 2; ++j) {
        const double sd = std::sqrt(normal.covariance(j, j));
        const Profile profile = profile_likelihood(objective, best, j, 1.96 * sd, 1.96 * 1.96);
        const auto [lower, upper] = interval(profile, 0, 1.96 * 1.96);
        EXPECT_NEAR(lower, normal.mean[j] - 1.96 * sd, 1e-4 * sd);
        EXPECT_NEAR(upper, normal.mean[j] + 1.96 * sd, 1e-4 * sd);
        for (std::size_t i = 0; i < profile.x.size(); ++i) {
            EXPECT_NEAR(profile.misfit[i], std::pow((profile.x[i] - normal.mean[j]) / sd, 2), 1e-4);
        }
    }
    std::printf("profile: %zu runs for both\n", objective.runs().size());
}

// From the parabola's end, and from one that is too near, the same end; the cube has none beyond it.
TEST(VerificationProfile, EndsOfALinearProblemAreFoundFromAGuess) {
    const Normal normal;
    Objective objective = normal.objective(10000);
    const crampfit::Run best{normal.mean, objective.at(normal.mean)};
    for (Eigen::Index j = 0; j < 2; ++j) {
        const double sd = std::sqrt(normal.covariance(j, j));
        const Eigen::VectorXd valley = normal.covariance.col(j) / normal.covariance(j, j);
        const Eigen::VectorXd other = Eigen::Vector2d::Unit(j);
        for (const int side : {-1, 1}) {
            const auto from_end = profile_end(objective, best, j, side, 1.96 * sd, valley, 0, 1.96 * 1.96);
            const auto from_nearer = profile_end(objective, best, j, side, 0.5 * sd, other, 0, 1.96 * 1.96);
            ASSERT_TRUE(from_end && from_nearer);
            EXPECT_NEAR(*from_end, 1.96 * sd, 1e-4 * sd);
            EXPECT_NEAR(*from_nearer, 1.96 * sd, 1e-4 * sd);
            EXPECT_FALSE(profile_end(objective, best, j, side, 1.96 * sd, valley, 0, std::pow(1.1 / sd, 2)));
        }
    }
}

// Beyond a cliff, as where a crack that stood in the test would have run, and flat before it: the end is at the cliff, wherever
// it lies between two steps.
TEST(VerificationProfile, EndsAtACliffAreThere) {
    for (const double cliff : {0.2337, 0.31, 0.4449}) {
        Objective objective(
            2,
            [&](const Eigen::VectorXd& x, int) {
                Evaluation evaluation;
                evaluation.residuals = Eigen::Vector2d(20 * (x[1] - 0.5), x[0] < cliff ? 100.0 : 0.0);
                evaluation.misfit = evaluation.residuals.squaredNorm();
                return evaluation;
            },
            100000, 1);
        const Eigen::Vector2d centre(0.6, 0.5);
        const crampfit::Run best{centre, objective.at(centre)};
        const Profile profile = profile_likelihood(objective, best, 0, 0.2, 1.96 * 1.96);
        EXPECT_TRUE(std::ranges::is_sorted(profile.x));
        EXPECT_NEAR(interval(profile, 0, 1.96 * 1.96).first, cliff, 0.001);
        EXPECT_EQ(interval(profile, 0, 1.96 * 1.96).second, 1);
        const auto end = profile_end(objective, best, 0, -1, 0.1, Eigen::Vector2d::Unit(0), 0, 1.96 * 1.96);
        ASSERT_TRUE(end);
        EXPECT_NEAR(0.6 - *end, cliff, 0.003);
    }
}

FitOptions cheap(const FakeWedge& wedge, int threads) {
    FitOptions options = with(wedge, threads);
    options.cheap_runs = true;
    return options;
}

// A valley that goes on into a cliff, beyond which misfits fall away from it: a profile is nowhere above what the others have
// where they stand at the best point.
TEST(UnitProfile, IsNoHigherThanASlice) {
    const auto evaluate = [](const Eigen::VectorXd& x, int) {
        Evaluation evaluation;
        evaluation.status = "finished";
        evaluation.residuals = Eigen::Vector3d((x[0] - 0.5) / 0.2, x[1] - x[0], x[1] > 0.6 ? 12 - 10 * x[1] : 0.0);
        evaluation.misfit = evaluation.residuals.squaredNorm();
        return evaluation;
    };
    Objective objective(2, evaluate, 100000, 1);
    const Eigen::Vector2d middle(0.5, 0.5);
    const auto best = objective.at(middle);
    const Profile profile = profile_likelihood(objective, {middle, best}, 0, 0.4, 4.0);
    EXPECT_GT(profile.x.back(), 0.8);
    for (std::size_t i = 0; i < profile.x.size(); ++i) {
        EXPECT_LE(profile.misfit[i], evaluate(Eigen::Vector2d(profile.x[i], 0.5), 1).misfit * (1 + 1e-12)) << profile.x[i];
    }
}

TEST(SystemExplore, ProfileAndPosteriorOfAWedgeTest) {
    FakeWedge wedge;
    wedge.sharpness = 1;
    Study study = wedge_study(wedge, 0.02, 1e-4, 7);
    study.uncertainty = {true, 1500};
    const Fit fit = fit_study(study, cheap(wedge, 1));
    EXPECT_EQ(fit.status, FitStatus::converged);
    ASSERT_EQ(fit.posterior.size(), 1500u);
    for (std::size_t j = 0; j < 2; ++j) {
        const FittedParameter& parameter = fit.parameters[j];
        EXPECT_LT(parameter.lower_95, parameter.value);
        EXPECT_GT(parameter.upper_95, parameter.value);
        // Nearly linear so near: profile, posterior and covariance agree.
        const double width = 2 * student_975(70) * parameter.standard_error;  // some 75 residuals less two parameters
        EXPECT_NEAR((parameter.upper_95 - parameter.lower_95) / width, 1, 0.25);
        double mean = 0, square = 0;
        for (const PosteriorSample& sample : fit.posterior) {
            mean += sample.parameters[j] / 1500;
            square += sample.parameters[j] * sample.parameters[j] / 1500;
        }
        const double sd = std::sqrt(square - mean * mean);
        std::printf("%s: best %.2f, profile %.2f .. %.2f, posterior %.2f +- %.2f, covariance +- %.2f\n", parameter.name.c_str(),
                    parameter.value, parameter.lower_95, parameter.upper_95, mean, sd, parameter.standard_error);
        EXPECT_NEAR(mean, parameter.value, parameter.standard_error);
        EXPECT_NEAR(sd / parameter.standard_error, 1, 0.35);
    }
    for (const FitRun& run : fit.runs) {
        EXPECT_GE(run.misfit, fit.misfit);  // the best ever seen is the one that is given
    }
    const Fit four = fit_study(study, cheap(wedge, 4));
    EXPECT_EQ(four.parameters[0].lower_95, fit.parameters[0].lower_95);
    EXPECT_EQ(four.posterior.back().parameters, fit.posterior.back().parameters);
    EXPECT_EQ(four.message, fit.message);
}

TEST(SystemExplore, DearRunsAreNotSpentOnProfileAndPosterior) {
    FakeWedge wedge;
    wedge.sharpness = 1;
    Study study = wedge_study(wedge, 0.02, 1e-4, 7);
    study.uncertainty = {true, 400};
    const Fit real = fit_study(study, cheap(wedge, 2));
    const Fit fit = fit_study(study, with(wedge, 2));
    EXPECT_LT(fit.runs.size(), 80u);
    EXPECT_NE(fit.message.find("rest on polynomials"), std::string::npos) << fit.message;
    ASSERT_EQ(fit.posterior.size(), 400u);
    for (std::size_t j = 0; j < 2; ++j) {
        EXPECT_NEAR(fit.parameters[j].lower_95, real.parameters[j].lower_95, real.parameters[j].standard_error);
        EXPECT_NEAR(fit.parameters[j].upper_95, real.parameters[j].upper_95, real.parameters[j].standard_error);
    }
}

// Force goes with the product of two parameters, and nothing else depends on them.
TEST(SystemExplore, AProfileThatNeverRisesIsTheWholeBox) {
    const auto product = [](const Scene& scene, const std::atomic<bool>*) {
        Record record;
        for (int i = 0; i <= 100; ++i) {
            Instant row;
            row.displacement = 1e-5 * i;
            row.force = scene.materials.at("EW").toughness * scene.materials.at("LW").toughness * row.displacement;
            record.series.push_back(row);
        }
        return record;
    };
    Study study = wedge_study(FakeWedge{});
    // With EW 100 their product is that of opposite corners of the box.
    study.experiments[0].scene.materials["LW"].toughness = 80;
    study.experiments[0].data = measure(product(study.experiments[0].scene, nullptr), 0.05, 0, 2);
    study.experiments[0].data.crack_length.clear();
    study.experiments[0].noise.force = 0.05;
    study.uncertainty = {true, 1000};
    FitOptions options;
    options.forward = product;
    options.cheap_runs = true;
    const Fit fit = fit_study(study, options);
    EXPECT_NE(fit.message.find("'EW toughness' and 'LW toughness' cannot be told apart"), std::string::npos) << fit.message;
    EXPECT_NE(fit.message.find("The data do not bound 'EW toughness' above or below"), std::string::npos) << fit.message;
    double smallest = 400, largest = 20;
    for (const PosteriorSample& sample : fit.posterior) {
        smallest = std::min(smallest, sample.parameters[0]);
        largest = std::max(largest, sample.parameters[0]);
        EXPECT_NEAR(sample.parameters[0] * sample.parameters[1], 8000, 200);
    }
    std::printf("product: EW from %.0f to %.0f in the posterior, box 20 .. 400\n", smallest, largest);
    EXPECT_LT(smallest, 40);
    EXPECT_GT(largest, 200);
}

std::vector<FitResidual> residuals(int count, double scale, double memory, unsigned seed) {
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<FitResidual> rows;
    double value = 0;
    for (int i = 0; i < count; ++i) {
        value = memory * value + std::sqrt(1 - memory * memory) * normal(generator);
        rows.push_back({"test", i < count / 2 ? "force" : "arrival", 0, 0, 0, 1, scale * value});
    }
    return rows;
}

TEST(VerificationLackOfFit, IsSeenWhereItIsAndSeldomWhereItIsNot) {
    int alarms = 0, large = 0, correlated = 0;
    for (unsigned seed = 0; seed < 500; ++seed) {
        alarms += lack_of_fit(check_fit(residuals(100, 1, 0, seed), 0)).empty() ? 0 : 1;
        large += lack_of_fit(check_fit(residuals(100, 1.6, 0, seed), 0)).find("chi-square") != std::string::npos ? 1 : 0;
        correlated += lack_of_fit(check_fit(residuals(100, 0.5, 0.7, seed), 0)).find("go together") != std::string::npos ? 1 : 0;
    }
    std::printf("lack of fit of 500: %d where there is none, %d of 1.6 sigma, %d of correlation 0.7\n", alarms, large,
                correlated);
    EXPECT_LE(alarms, 14);  // of 500 at 1 %, more happen once in two thousand times (binomial)
    EXPECT_GE(large, 480);
    EXPECT_GE(correlated, 480);
}

TEST(UnitLackOfFit, NamesForcesOfTheOtherSign) {
    const auto rows = [](const std::string& experiment, double sign) {
        std::vector<FitResidual> found;
        for (int i = 1; i <= 10; ++i) found.push_back({experiment, "force", 0, sign * i, 0.2 * i + 0.1, 1, 0});
        found.push_back({experiment, "arrival", 0, -1, 1, 1, 0});
        return found;
    };
    std::vector<FitResidual> both = rows("right", 1.0);
    EXPECT_EQ(opposite_forces(both), "");
    const std::vector<FitResidual> wrong = rows("wrong", -1.0);
    both.insert(both.end(), wrong.begin(), wrong.end());
    EXPECT_NE(opposite_forces(both).find("'wrong'"), std::string::npos);
    EXPECT_EQ(opposite_forces(both).find("'right'"), std::string::npos);
}

// Toughness falls along the crack in truth, and is two-valued in the fit.
TEST(SystemLackOfFit, AWrongModelIsReportedAndARightOneIsNot) {
    struct Graded : FakeWedge {
        Record measured() const {
            Record record = (*this)(true_earlywood, true_latewood);
            for (Instant& row : record.series) {  // as if the toughness were a third less at the end: force goes with its root
                const double along = (row.crack_length - first_length) / (last_length - first_length);
                row.force *= std::sqrt(1 - along / 3);
            }
            return record;
        }
    };
    FakeWedge wedge;
    wedge.sharpness = 1;
    int right = 0, wrong = 0;
    for (unsigned seed = 1; seed <= 20; ++seed) {
        Study study = wedge_study(wedge, 0.02, 1e-4, seed);
        right += fit_study(study, with(wedge)).message.find("Lack of fit") == std::string::npos ? 1 : 0;
        Graded graded;
        graded.sharpness = 1;
        study.experiments[0].data = measure(graded.measured(), 0.02, 1e-4, seed);
        wrong += fit_study(study, with(wedge)).message.find("Lack of fit") != std::string::npos ? 1 : 0;
    }
    std::printf("of 20 right models %d pass, of 20 wrong ones %d are reported\n", right, wrong);
    EXPECT_GE(right, 18);
    EXPECT_EQ(wrong, 20);
}

// As the same test of the covariance's intervals.
TEST(SlowProfile, IntervalsCoverTheTruthAsOftenAsTheySay) {
    FakeWedge wedge;
    wedge.sharpness = 1;
    int covered[2] = {0, 0};
    for (unsigned seed = 0; seed < 100; ++seed) {
        Study study = wedge_study(wedge, 0.02, 1e-4, 500 + seed);
        study.uncertainty.profile = true;
        const Fit fit = fit_study(study, cheap(wedge, 1));
        covered[0] += fit.parameters[0].lower_95 <= true_earlywood && true_earlywood <= fit.parameters[0].upper_95 ? 1 : 0;
        covered[1] += fit.parameters[1].lower_95 <= true_latewood && true_latewood <= fit.parameters[1].upper_95 ? 1 : 0;
    }
    std::printf("profile intervals cover %d and %d of 100\n", covered[0], covered[1]);
    for (const int count : covered) {
        EXPECT_GE(count, 88);
    }
}

}  // namespace
}  // namespace crampfit::testing

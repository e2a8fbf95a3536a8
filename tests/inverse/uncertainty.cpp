#include "inverse/uncertainty.hpp"
#include "inverse/differences.hpp"
#include "inverse/directions.hpp"
#include "inverse/fit.hpp"
#include "tests/inverse/bar_scene.hpp"
#include "tests/inverse/fake_wedge.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>

namespace crampfit::testing {
namespace {

// A model of two parameters whose sum does much and whose difference, over one step of the differences, changes the residuals by
// `lengths` times the scatter of one run to another. All residuals scatter each by itself, or all together.
class ScatteringModel {
  public:
    ScatteringModel(double lengths, bool together, int draw) : lengths_(lengths), together_(together), draw_(draw) {}

    Evaluation operator()(const Eigen::VectorXd& x, int) const {
        constexpr int count = 80;
        Eigen::VectorXd sum(count), difference(count), noise(count);
        std::mt19937_64 random(seed(x));
        std::normal_distribution<double> normal;
        const double common = normal(random);
        for (int i = 0; i < count; ++i) {
            sum[i] = 0.3 + std::sin(3.0 * i / count);
            difference[i] = std::cos(5.0 * i / count);
            noise[i] = together_ ? common * std::sin(7.0 * i / count) : normal(random);
        }
        difference *= std::sqrt(together_ ? 0.5 * count : count) / difference.norm();
        Evaluation evaluation;
        evaluation.residuals = 100 * (x[0] + x[1] - 1) * sum + lengths_ / difference_step * (x[0] - x[1]) * difference + noise;
        evaluation.misfit = evaluation.residuals.squaredNorm();
        return evaluation;
    }

  private:
    std::uint64_t seed(const Eigen::VectorXd& x) const {
        std::uint64_t mixed = static_cast<std::uint64_t>(draw_) + 1;
        for (const double value : x) {
            std::uint64_t bits = 0;
            std::memcpy(&bits, &value, sizeof bits);
            mixed = (mixed ^ bits) * 0x9e3779b97f4a7c15;
            mixed ^= mixed >> 29;
        }
        return mixed;
    }

    double lengths_;
    bool together_;
    int draw_;
};

// In how many of a hundred draws the direction across the sum is told from none.
int times_told(double lengths, bool together) {
    int told = 0;
    for (int draw = 0; draw < 100; ++draw) {
        Objective objective(2, ScatteringModel(lengths, together, draw), 500, 1);
        std::mt19937_64 random(static_cast<std::uint64_t>(draw));
        std::normal_distribution<double> normal(0.5, 0.02);
        for (int run = 0; run < 12; ++run) {  // those of a descent
            const double first = normal(random), second = normal(random);
            objective.at(Eigen::Vector2d(first, second));
        }
        const auto directions = directions_about_best(objective, difference_step);
        told += directions && directions->resolved(1);
    }
    return told;
}

TEST(UnitDirections, ScatterOfManyResidualsHidesLessThanThatOfFew) {
    for (const bool together : {false, true}) {
        const int none = times_told(0, together), small = times_told(0.3, together), clear = times_told(1.0, together);
        fmt::print("residuals that scatter {}: told of no slope {} of 100, of 0.3 {}, of 1 {}\n",
                   together ? "together" : "each by itself", none, small, clear);
        EXPECT_LE(none, 5);
        EXPECT_GE(clear, 99);
        if (!together) {
            EXPECT_GE(small, 95);
        }
    }
}

// Force rises with the product of two parameters, and nothing else depends on them.
TEST(SystemUncertainty, NamesParametersThatCannotBeToldApart) {
    const auto product = [](const Scene& scene, const std::atomic<bool>*) {
        Record record;
        for (int i = 0; i <= 100; ++i) {
            Instant instant;
            instant.displacement = 1e-5 * i;
            instant.force =
                1e-3 * scene.materials.at("EW").toughness * scene.materials.at("LW").toughness * instant.displacement / 1e-3;
            record.series.push_back(instant);
        }
        return record;
    };
    for (const Scale scale : {Scale::linear, Scale::logarithmic}) {
        Study study = wedge_study(FakeWedge{});
        study.parameters[0].scale = study.parameters[1].scale = scale;
        study.experiments[0].scene.materials["EW"].toughness = 100;
        study.experiments[0].scene.materials["LW"].toughness = 200;
        study.experiments[0].data = measure(product(study.experiments[0].scene, nullptr), 0.05, 0, 2);
        study.experiments[0].data.crack_length.clear();
        study.experiments[0].noise.force = 0.05;
        FitOptions options;
        options.forward = product;
        const Fit fit = fit_study(study, options);
        EXPECT_NEAR(fit.parameters[0].value * fit.parameters[1].value, 20000, 100);
        EXPECT_NE(fit.message.find("'EW toughness' and 'LW toughness' cannot be told apart"), std::string::npos) << fit.message;
        for (const FittedParameter& parameter : fit.parameters) {
            EXPECT_NEAR(parameter.lower_95, 20, 1e-9);
            EXPECT_NEAR(parameter.upper_95, 400, 1e-9);
            EXPECT_TRUE(std::isfinite(parameter.standard_error));
        }
        EXPECT_LT(fit.correlation(0, 1), -0.99);
    }
}

// Layers of a bar in series: all that can be measured is 0.7 / E_EW + 0.3 / E_LW. LW is so stiff that its modulus does little;
// yet from one of its bounds to the other that of EW goes from 54 to 70 MPa.
TEST(SystemUncertainty, WhatFollowsAParameterThatCannotBeToldIsNoSurerThanThat) {
    constexpr double share = 0.3, compliance = (1 - share) / 55e6 + share / 900e6;
    const auto follows = [](double latewood) { return (1 - share) / (compliance - share / latewood) / 1e6; };
    Experiment bar;
    bar.name = "bar";
    bar.scene = bar_scene();
    bar.scene.model.cell = 1e-3;
    bar.scene.specimen.material.clear();
    bar.scene.specimen.rings = Rings{{5e-3, -200.0}, 10e-3, share, 0.0};
    bar.scene.materials["LW"] = {900e6, 0.0, 900, 100};
    std::mt19937 generator(1);
    std::normal_distribution<double> normal(0.0, 0.1);
    for (int i = 1; i <= 100; ++i) {
        const double u = 0.1e-3 * i / 100;
        bar.data.displacement.push_back(u);
        bar.data.force.push_back(5e-3 / compliance * u + normal(generator));
    }
    bar.noise.force = 0.1;
    Study study;
    study.experiments = {bar};
    study.uncertainty = {.profile = true, .posterior = 0};
    for (const char* wood : {"EW", "LW"}) {
        Parameter& parameter = study.parameters.emplace_back(bar_modulus());
        parameter.name = wood;
        parameter.keys = {std::string("materials.") + wood + ".E"};
        parameter.scale = Scale::logarithmic;
    }
    study.parameters[0].initial = 30e6, study.parameters[0].lower = 10e6, study.parameters[0].upper = 200e6;
    study.parameters[1].initial = 600e6, study.parameters[1].lower = 100e6, study.parameters[1].upper = 5000e6;
    for (const char* method : {"auto", "ceres"}) {
        study.optimizer.method = method;
        const Fit fit = fit_study(study);
        EXPECT_NE(fit.message.find("'LW' cannot be told from this data"), std::string::npos) << fit.message;
        EXPECT_NE(fit.message.find("'EW' must follow"), std::string::npos) << fit.message;
        EXPECT_NEAR(fit.parameters[0].lower_95, follows(5000e6), 0.5) << method;
        EXPECT_NEAR(fit.parameters[0].upper_95, follows(100e6), 0.5) << method;
        EXPECT_NEAR(fit.parameters[1].lower_95, 100, 1e-9) << method;
        EXPECT_NEAR(fit.parameters[1].upper_95, 5000, 1e-9) << method;
        EXPECT_TRUE(fit.profile.empty());  // what derivatives at the best point tell does not reach so far
    }
}

TEST(SystemUncertainty, NamesAParameterWithoutEffect) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.parameters[1].keys = {"materials.LW.E"};
    study.parameters[1].name = "LW modulus";
    study.experiments[0].scene.materials["LW"].toughness = true_latewood;
    const Fit fit = fit_study(study, with(wedge));
    EXPECT_NE(fit.message.find("'LW modulus' cannot be told from this data"), std::string::npos) << fit.message;
    EXPECT_NEAR(fit.parameters[0].value, true_earlywood, 3);
    EXPECT_LT(fit.parameters[0].upper_95, 120);
    EXPECT_NEAR(fit.parameters[1].upper_95, 400, 1e-9);
}

// One station stands beside a jump, on whose one side or other a run comes out as chance has it, by hundreds of sigmas. By itself
// that hides what a parameter does to all others; slopes and intervals keep it. A parameter that does nothing has none.
TEST(UnitUncertainty, AJumpAtOneStationHidesNoSlopeAtTheOthers) {
    constexpr int count = 50;
    const auto slope = [](int i) { return 12.0 * i / count; };
    const auto evaluate = [&](const Eigen::VectorXd& x, int) {
        Evaluation evaluation;
        evaluation.residuals = Eigen::VectorXd::Zero(count + 1);
        for (int i = 0; i < count; ++i) {
            evaluation.residuals[i] = slope(i) * (x[0] - 0.5) + 1e-10 * scramble(x[1], i);
        }
        evaluation.residuals[count] = x.isConstant(0.5) ? 0.0 : 300 * scramble(x[0], x[1]);
        evaluation.misfit = evaluation.residuals.squaredNorm();
        return evaluation;
    };
    Objective objective(2, evaluate, 1000, 1);
    objective.at(Eigen::VectorXd(Eigen::Vector2d(0.5, 0.5)));
    const Uncertainty found = estimate_uncertainty(objective, {{count, 1}}, {"a", "b"}, difference_step, Window(2));
    for (int i = 0; i < count; ++i) {
        EXPECT_NEAR(found.slope(i, 0), slope(i), 1e-6) << i;
    }
    EXPECT_TRUE(found.slope.col(1).isZero(0.0));
    ASSERT_EQ(found.untold.size(), 1u);
    EXPECT_EQ(found.untold[0].parameters, std::vector<Eigen::Index>{1});
    EXPECT_NEAR(std::sqrt(found.covariance(0, 0) - found.model_variance[0]) * found.slope.col(0).head(count).norm(), 1, 0.05);
}

// Nor does a prior that says nothing make what stands beside a jump pass for lack of fit.
TEST(UnitUncertainty, APriorThatSaysNothingWidensNothingBesideAJump) {
    constexpr int count = 50;
    const auto found = [](double prior) {
        const auto evaluate = [prior](const Eigen::VectorXd& x, int) {
            Evaluation evaluation;
            evaluation.residuals = Eigen::VectorXd::Zero(count + 2);
            for (int i = 0; i < count; ++i) {
                evaluation.residuals[i] = 12.0 * i / count * (x[0] - 0.5) + std::cos(2.0 * i);
            }
            evaluation.residuals[count] = x.isConstant(0.5) ? 0.0 : 300 * scramble(x[0], x[1]);
            evaluation.residuals[count + 1] = prior * (x[0] - 0.3);
            evaluation.misfit = evaluation.residuals.squaredNorm();
            return evaluation;
        };
        Objective objective(2, evaluate, 1000, 1);
        objective.at(Eigen::VectorXd(Eigen::Vector2d(0.5, 0.5)));
        return estimate_uncertainty(objective, {{count, 1}}, {"a", "b"}, difference_step, Window(2));
    };
    const Uncertainty without = found(0.0);
    for (const double prior : {1e-9, 1e-6, 1e-3}) {
        const Uncertainty with_it = found(prior);
        EXPECT_NEAR(with_it.widening / without.widening, 1.0, 1e-3) << prior;
        EXPECT_NEAR(with_it.covariance(0, 0) / without.covariance(0, 0), 1.0, 1e-3) << prior;
    }
    EXPECT_LT(without.widening, 1.5);
}

// Force rises with the toughness of earlywood and with the displacement. What rounding leaves of no effect, 1e-12 of the force,
// must not be taken for one: the other errors are what they are without that parameter, but for one degree of freedom of 49,
// which makes the misfit that widens them 2 % larger.
TEST(SystemUncertainty, AParameterWithoutEffectLeavesTheOthersTheirErrors) {
    FitOptions options;
    options.forward = [](const Scene& scene, const std::atomic<bool>*) {
        Record record;
        for (int i = 0; i <= 50; ++i) {
            Instant instant;
            instant.displacement = 1e-5 * i;
            const double rounding = 1e-12 * scramble(scene.materials.at("LW").toughness, instant.displacement);
            instant.force = 1e3 * scene.materials.at("EW").toughness * instant.displacement * (1 + rounding);
            record.series.push_back(instant);
        }
        return record;
    };
    Study alone = wedge_study(FakeWedge{});
    alone.experiments[0].data = measure(options.forward(alone.experiments[0].scene, nullptr), 0.5, 0, 2);
    alone.experiments[0].data.crack_length.clear();
    alone.experiments[0].noise.force = 0.5;
    alone.parameters[0].scale = Scale::linear;
    Study both = alone;
    alone.parameters.pop_back();
    for (const char* method : {"auto", "ceres", "sbplx"}) {
        alone.optimizer.method = both.optimizer.method = method;
        const FittedParameter one = fit_study(alone, options).parameters[0];
        for (const int at : {0, 1}) {
            const Fit fit = fit_study(both, options);
            const FittedParameter &told = fit.parameters[at], &untold = fit.parameters[1 - at];
            EXPECT_NEAR(told.standard_error / one.standard_error, 1, 0.015) << method;
            EXPECT_NEAR((told.upper_95 - told.lower_95) / (one.upper_95 - one.lower_95), 1, 0.015) << method;
            EXPECT_LE(untold.standard_error, 1.001 * untold.value * std::log(400.0 / 20.0) / std::sqrt(12.0)) << method;
            EXPECT_NEAR(untold.lower_95, 20, 1e-9) << method;
            EXPECT_NEAR(untold.upper_95, 400, 1e-9) << method;
            const auto said = fit.message.find("'LW toughness' cannot be told from this data");
            ASSERT_NE(said, std::string::npos) << method << fit.message;
            EXPECT_EQ(fit.message.find("cannot be told", said + 20), std::string::npos) << fit.message;
            std::swap(both.parameters[0], both.parameters[1]);
        }
    }
}

// Force is `slope` times the toughness of earlywood times the displacement; data with errors of `error` to either side in turn,
// so that no neighbours go together.
struct LinearTest {
    static constexpr double slope = 1e3;

    static Record run(const Scene& scene) {
        Record record;
        for (int i = 1; i <= 40; ++i) {
            Instant instant;
            instant.displacement = 1e-5 * i;
            instant.force = slope * scene.materials.at("EW").toughness * instant.displacement;
            record.series.push_back(instant);
        }
        return record;
    }

    static Experiment experiment(const std::string& name, double toughness, double error, double noise) {
        Experiment experiment;
        experiment.name = name;
        experiment.scene.materials["EW"].toughness = toughness;
        experiment.data = measure(run(experiment.scene), 0, 0, 1);
        experiment.data.crack_length.clear();
        for (std::size_t i = 0; i < experiment.data.force.size(); ++i) {
            experiment.data.force[i] += i % 2 == 0 ? error : -error;
        }
        experiment.noise.force = noise;
        return experiment;
    }

    static FitOptions options() {
        FitOptions options;
        options.forward = [](const Scene& scene, const std::atomic<bool>*) { return run(scene); };
        options.cheap_runs = true;
        return options;
    }

    // J^T J / sigma^2
    static double information(double noise) {
        double sum = 0;
        for (int i = 1; i <= 40; ++i) {
            sum += std::pow(slope * 1e-5 * i / noise, 2);
        }
        return sum;
    }
};

Parameter linear_toughness() {
    Parameter parameter = toughness_parameter("EW", 80);
    parameter.scale = Scale::linear;
    return parameter;
}

// What the noise does not explain widens what the data say, not the prior, and the fit weighs both as the study says: the error
// of that is (s J^T J + P)^1/2 / (J^T J + P), in the table and the profile. The posterior, (J^T J / s + P)^-1, is good to 1 /
// sqrt(2 x 800 independent samples), here three times that.
TEST(VerificationUncertainty, PriorsAreNotWidened) {
    for (const double sd : {0.5, 5.0}) {
        for (const double error : {0.8, 4.0}) {
            Study study;
            study.experiments = {LinearTest::experiment("a", 110, error, 1.0)};
            study.parameters = {linear_toughness()};
            study.parameters[0].prior = Prior{110, sd};
            study.uncertainty.posterior = 16000;
            const Fit fit = fit_study(study, LinearTest::options());
            double chi_square = 0;
            for (const FitResidual& residual : fit.residuals) {
                chi_square += residual.residual * residual.residual / 39;
            }
            EXPECT_NEAR(fit.reduced_chi_square / chi_square, 1, 1e-5);  // samples come upon runs as good as the same
            const double s = std::max(1.0, chi_square), a = LinearTest::information(1.0), p = 1 / (sd * sd);
            const double expected = std::sqrt(s * a + p) / (a + p), of_posterior = 1 / std::sqrt(a / s + p);
            EXPECT_NEAR(fit.parameters[0].standard_error / expected, 1, 1e-3) << sd << " " << error;
            double variance = 0;
            for (const PosteriorSample& sample : fit.posterior) {
                variance += std::pow(sample.parameters[0] - fit.parameters[0].value, 2) / 16000;
            }
            EXPECT_NEAR(std::sqrt(variance) / of_posterior, 1, 0.075) << sd << " " << error;
            study.uncertainty = {.profile = true, .posterior = 0};
            const FittedParameter profiled = fit_study(study, LinearTest::options()).parameters[0];
            EXPECT_NEAR((profiled.upper_95 - profiled.lower_95) / (2 * student_975(39) * expected), 1, 0.01);
        }
    }
}

// A factor on all weights changes nothing beside a prior either. And errors are those of what the fit does: over many tests whose
// noise was stated too small, with priors that are right.
TEST(VerificationUncertainty, ErrorsBesidePriorsAreThoseOfTheFit) {
    const double sd = 1 / std::sqrt(LinearTest::information(1.0));
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    double squares = 0;
    constexpr int tests = 60;
    for (int k = 0; k < tests; ++k) {
        Study study;
        study.experiments = {LinearTest::experiment("a", 110, 0, 1.0)};
        for (double& force : study.experiments[0].data.force) {
            force += 5 * normal(generator);
        }
        study.parameters = {linear_toughness()};
        study.parameters[0].prior = Prior{110 + sd * normal(generator), sd};
        const FittedParameter found = fit_study(study, LinearTest::options()).parameters[0];
        squares += std::pow((found.value - 110) / found.standard_error, 2) / tests;
        if (k == 0) {
            for (const double factor : {0.02, 50.0}) {
                study.experiments[0].weight = factor;
                const FittedParameter weighted = fit_study(study, LinearTest::options()).parameters[0];
                EXPECT_NEAR((weighted.value - found.value) / sd, 0, 1e-3) << factor;
                EXPECT_NEAR(weighted.standard_error / found.standard_error, 1, 1e-3) << factor;
            }
        }
    }
    EXPECT_NEAR(std::sqrt(squares), 1, 3 / std::sqrt(2.0 * tests));
}

// Weights say how much each test has to say: with J^T J = A of each, the errors of two are those of the weighted mean of what
// each says by itself.
TEST(VerificationUncertainty, WeightsAreNoNoise) {
    const auto fitted = [](double first, double second, bool profile) {
        Study study;
        study.experiments = {LinearTest::experiment("a", 110, 0.8, 1.0), LinearTest::experiment("b", 110, 1.6, 2.0)};
        study.experiments[0].weight = first;
        study.experiments[1].weight = second;
        study.parameters = {linear_toughness()};
        study.uncertainty.profile = profile;
        return fit_study(study, LinearTest::options());
    };
    const double a = LinearTest::information(1.0), b = LinearTest::information(2.0);
    for (const double factor : {0.01, 1.0, 100.0}) {
        const Fit fit = fitted(factor, 4 * factor, false);
        const double expected = std::sqrt(a + 16 * b) / (a + 4 * b);
        EXPECT_NEAR(fit.parameters[0].standard_error / expected, 1, 1e-3) << factor;
        EXPECT_NEAR(fit.reduced_chi_square, 0.64 * 80 / 79, 1e-3) << factor;
        EXPECT_NE(fit.message.find(fmt::format("b: noise (one sigma): force 2 N; weight {:g}.", 4 * factor)), std::string::npos)
            << fit.message;
        const FittedParameter profiled = fitted(factor, 4 * factor, true).parameters[0];
        EXPECT_NEAR((profiled.upper_95 - profiled.lower_95) / (2 * student_975(79) * expected), 1, 0.01) << factor;
    }
}

// 100 tests of the same wood, each with its own noise. For intervals that cover 95 % of the time, fewer than 88 or more
// than 100 happen once in a thousand such hundreds (binomial).
TEST(VerificationUncertainty, IntervalsCoverTheTruthAsOftenAsTheySay) {
    FakeWedge wedge;
    wedge.sharpness = 1;
    int covered[2] = {0, 0};
    std::vector<double> errors[2];
    for (unsigned seed = 0; seed < 100; ++seed) {
        const Study study = wedge_study(wedge, 0.02, 1e-4, 500 + seed);
        const Fit fit = fit_study(study, with(wedge, 2));
        ASSERT_EQ(fit.status, FitStatus::converged);
        for (std::size_t j = 0; j < 2; ++j) {
            const double truth = j == 0 ? true_earlywood : true_latewood;
            const FittedParameter& parameter = fit.parameters[j];
            covered[j] += parameter.lower_95 <= truth && truth <= parameter.upper_95 ? 1 : 0;
            errors[j].push_back(std::abs(parameter.value - truth) / parameter.standard_error);
        }
    }
    for (std::size_t j = 0; j < 2; ++j) {
        EXPECT_GE(covered[j], 88);
        std::nth_element(errors[j].begin(), errors[j].begin() + 50, errors[j].end());
        // Half of all normal errors are below 0.67 standard errors; the median of 100 is good to 0.08, here three times
        // that.
        EXPECT_GT(errors[j][50], 0.43);
        EXPECT_LT(errors[j][50], 0.91);
    }
}

// A block drawn up with a traction p on its side, by which no run has a derivative: F = A (E u / L + nu p), a straight line of
// two unknown coefficients. A dozen tests, each with its own noise.
TEST(VerificationUncertainty, WithoutDerivativesErrorsAreThoseOfTheNoise) {
    constexpr double area = 1e-4, length = 10e-3, nu = 0.33, modulus = 40e6, traction = 0.5e6, noise = 0.3;
    constexpr int tests = 12, rows = 30;
    Study study;
    study.experiments.resize(1);
    Scene& scene = study.experiments[0].scene = bar_scene();
    scene.specimen.size = {length, length};
    scene.model.cell = length / 4;
    scene.materials.at("EW").poisson_ratio = nu;
    Edge& top = scene.edges[0];
    Edge& bottom = scene.edges[1];
    top.velocity[0] = bottom.velocity[0] = std::nullopt;
    scene.edges.push_back({.name = "left", .side = Side::left, .range = {}, .velocity = {0.0, {}}, .traction = {}, .until = {}});
    scene.edges.push_back(
        {.name = "right", .side = Side::right, .range = {}, .velocity = {}, .traction = Vec2(0.2e6, 0), .until = {}});
    study.experiments[0].noise.force = noise;
    Parameter pressure = bar_modulus();
    pressure.name = "p";
    pressure.keys = {"edges.right.traction.0"};
    pressure.initial = 0.2e6;
    pressure.lower = -1e6;
    pressure.upper = 2e6;
    Parameter young = bar_modulus();
    young.initial = 50e6;
    young.lower = 20e6;
    young.upper = 80e6;
    study.parameters = {pressure, young};
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    std::vector<double> exact;
    for (int i = 0; i < rows; ++i) {
        const double u = 0.1e-3 * (i + 0.5) / rows;
        const Eigen::Vector2d slope(area * nu, area * u / length);
        information += slope * slope.transpose() / (noise * noise);
        study.experiments[0].data.displacement.push_back(u);
        exact.push_back(slope.dot(Eigen::Vector2d(traction, modulus)));
    }
    const Eigen::Matrix2d covariance = information.inverse();
    std::mt19937 random(7);
    std::normal_distribution<double> error(0, noise);
    Eigen::Vector2d stated = Eigen::Vector2d::Zero(), scatter = Eigen::Vector2d::Zero();  // mean squares, over the exact variance
    for (int test = 0; test < tests; ++test) {
        study.experiments[0].data.force = exact;
        for (double& force : study.experiments[0].data.force) {
            force += error(random);
        }
        const Fit fit = fit_study(study, {});
        ASSERT_EQ(fit.status, FitStatus::converged) << fit.message;
        for (Eigen::Index j = 0; j < 2; ++j) {
            const FittedParameter& fitted = fit.parameters[static_cast<std::size_t>(j)];
            stated[j] += std::pow(1e6 * fitted.standard_error, 2) / covariance(j, j) / tests;
            scatter[j] += std::pow(1e6 * fitted.value - (j == 0 ? traction : modulus), 2) / covariance(j, j) / tests;
        }
    }
    std::printf("standard errors of p, E over the exact ones: stated %.2f, %.2f; seen %.2f, %.2f\n", std::sqrt(stated[0]),
                std::sqrt(stated[1]), std::sqrt(scatter[0]), std::sqrt(scatter[1]));
    for (Eigen::Index j = 0; j < 2; ++j) {
        EXPECT_GT(std::sqrt(stated[j]), 0.95);
        EXPECT_LT(std::sqrt(stated[j]), 1.25);  // where residuals go together by chance they are somewhat wider
        EXPECT_LT(scatter[j], 2.53);            // once in a hundred such dozens: chi-square of twelve
    }
}

TEST(VerificationUncertainty, IntervalsWidenWithTheNoiseOfTheModel) {
    const FakeWedge wedge;
    const Study study = wedge_study(wedge, 0.02, 1e-4, 3);
    FitOptions options = with(wedge, 2);
    const Fit calm = fit_study(study, options);
    int covered = 0;
    double error = 0;
    for (unsigned seed = 1; seed <= 30; ++seed) {
        options.forward = noisy(wedge, 0.15);
        options.seed = seed;  // other starts, other runs, other noise
        const Fit fit = fit_study(study, options);
        covered += fit.parameters[0].lower_95 <= true_earlywood && true_earlywood <= fit.parameters[0].upper_95 ? 1 : 0;
        error += fit.parameters[0].standard_error / 30;
    }
    EXPECT_GT(error, 2 * calm.parameters[0].standard_error);
    EXPECT_GE(covered, 24);  // of 30 at 95 %, fewer happen once in a thousand times (binomial)
}

TEST(VerificationUncertainty, StudentQuantilesMatchTheTable) {
    // Abramowitz and Stegun (1964), table 26.10.
    EXPECT_NEAR(student_975(1), 12.706, 5e-4);
    EXPECT_NEAR(student_975(2), 4.303, 5e-4);
    EXPECT_NEAR(student_975(3), 3.182, 5e-4);
    EXPECT_NEAR(student_975(10), 2.228, 5e-4);
    EXPECT_NEAR(student_975(25), 2.060, 5e-4);
    EXPECT_NEAR(student_975(120), 1.980, 5e-4);
}

}  // namespace
}  // namespace crampfit::testing

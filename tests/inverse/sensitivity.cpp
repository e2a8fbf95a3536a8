#include "inverse/sensitivity.hpp"
#include "datasets/error.hpp"
#include "datasets/keys.hpp"
#include "forward/simulate.hpp"
#include "inverse/local_design.hpp"
#include "inverse/morris.hpp"
#include "inverse/outputs.hpp"
#include "inverse/saltelli.hpp"
#include "inverse/sobol_points.hpp"
#include "tests/inverse/bar_scene.hpp"
#include "tests/inverse/fake_wedge.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

namespace crampfit::testing {
namespace {

template <class Design, class Function>
std::vector<double> values_at(const Design& design, const Function& f) {
    std::vector<double> values;
    for (const Eigen::VectorXd& x : design.points()) {
        values.push_back(f(x));
    }
    return values;
}

bool inside(const Estimate& estimate, double truth) { return estimate.lower_95 <= truth && truth <= estimate.upper_95; }

// Ishigami and Homma (1990) with a = 7, b = 0.1: y = sin u1 + a sin^2 u2 + b u3^4 sin u1, u uniform over (-pi, pi).
double ishigami(const Eigen::VectorXd& x) {
    const Eigen::Vector3d u = std::numbers::pi * (2 * x.array() - 1);
    return std::sin(u[0]) + 7 * std::pow(std::sin(u[1]), 2) + 0.1 * std::pow(u[2], 4) * std::sin(u[0]);
}

struct Truth {
    std::vector<double> first, total;
};

Truth ishigami_indices() {
    const double a = 7, b = 0.1, pi4 = std::pow(std::numbers::pi, 4);
    const double v1 = 0.5 * std::pow(1 + b * pi4 / 5, 2), v2 = a * a / 8;
    const double v13 = b * b * pi4 * pi4 * (1.0 / 18 - 1.0 / 50);
    const double v = v1 + v2 + v13;
    return {{v1 / v, v2 / v, 0}, {(v1 + v13) / v, v2 / v, v13 / v}};
}

// Saltelli and Sobol (1995): y = product of (|4 x_j - 2| + a_j) / (1 + a_j).
constexpr std::array<double, 8> g_weights{0, 1, 4.5, 9, 99, 99, 99, 99};

double g_function(const Eigen::VectorXd& x) {
    double y = 1;
    for (Eigen::Index j = 0; j < x.size(); ++j) {
        const double a = g_weights[static_cast<std::size_t>(j)];
        y *= (std::abs(4 * x[j] - 2) + a) / (1 + a);
    }
    return y;
}

Truth g_indices() {
    const auto part = [](double a) { return 1 / (3 * (1 + a) * (1 + a)); };
    double all = 1;
    for (const double a : g_weights) {
        all *= 1 + part(a);
    }
    Truth truth;
    for (const double a : g_weights) {
        truth.first.push_back(part(a) / (all - 1));
        truth.total.push_back(part(a) * all / (1 + part(a)) / (all - 1));
    }
    return truth;
}

void expect_all_inside(double (*f)(const Eigen::VectorXd&), const Truth& truth, const char* what) {
    const auto p = static_cast<Eigen::Index>(truth.first.size());
    int missed = 0, of = 0;
    for (const int rows : {512, 1024, 4096}) {
        for (unsigned seed = 1; seed <= (rows > 1024 ? 1 : 10); ++seed) {
            const SaltelliDesign design(p, rows, seed);
            const auto indices = design.indices(values_at(design, f));
            for (std::size_t j = 0; j < truth.first.size(); ++j) {
                const bool both = inside(indices.first[j], truth.first[j]) && inside(indices.total[j], truth.total[j]);
                if (seed == 1) {
                    std::printf(
                        "%s, %d rows, x%zu: first %.4f (%.4f .. %.4f), exact %.4f; total %.4f (%.4f .. %.4f), exact %.4f\n", what,
                        rows, j + 1, indices.first[j].value, indices.first[j].lower_95, indices.first[j].upper_95, truth.first[j],
                        indices.total[j].value, indices.total[j].lower_95, indices.total[j].upper_95, truth.total[j]);
                    EXPECT_TRUE(both) << what << ' ' << rows << " rows, x" << j + 1;
                }
                missed += both ? 0 : 1;
                ++of;
            }
        }
    }
    // Sobol points err less than the drawn points whose scatter the bootstrap estimates.
    std::printf("%s: %d of %d pairs of indices outside their 95 %% intervals\n", what, missed, of);
    EXPECT_LE(missed, of / 20);
}

TEST(VerificationSensitivity, IshigamisIndicesLieInTheirIntervals) {
    const Truth truth = ishigami_indices();
    EXPECT_NEAR(truth.first[0], 0.3139, 5e-5);
    EXPECT_NEAR(truth.first[1], 0.4424, 5e-5);
    EXPECT_NEAR(truth.total[0], 0.5576, 5e-5);
    expect_all_inside(ishigami, truth, "Ishigami");
}

TEST(VerificationSensitivity, SobolsGIndicesLieInTheirIntervals) { expect_all_inside(g_function, g_indices(), "Sobol G"); }

// Error of the indices of Sobol points against rows: order 1 for a smooth function, where drawn points have 1/2.
TEST(VerificationSensitivity, IndicesConvergeFasterThanDrawnPointsWould) {
    const Truth truth = ishigami_indices();
    const auto error = [&](int rows) {
        double sum = 0;
        for (unsigned seed = 1; seed <= 8; ++seed) {
            const SaltelliDesign design(3, rows, seed);
            const auto indices = design.indices(values_at(design, ishigami));
            for (std::size_t j = 0; j < 3; ++j) {
                sum +=
                    std::pow(indices.first[j].value - truth.first[j], 2) + std::pow(indices.total[j].value - truth.total[j], 2);
            }
        }
        return std::sqrt(sum / 48);
    };
    const double coarse = error(256), fine = error(4096);
    std::printf("Ishigami: error %.4f at 256 rows, %.5f at 4096\n", coarse, fine);
    EXPECT_LT(fine, coarse / 8);  // 4 for drawn points, 16 at order 1
}

TEST(UnitSensitivity, FailedRowsAreLeftOut) {
    const SaltelliDesign design(3, 2048, 1);
    std::vector<double> values = values_at(design, ishigami);
    std::mt19937 generator(3);
    for (double& value : values) {
        value = generator() % 5 == 0 ? std::numeric_limits<double>::quiet_NaN() : value;
    }
    const auto indices = design.indices(values);
    const Truth truth = ishigami_indices();
    for (std::size_t j = 0; j < 3; ++j) {
        EXPECT_TRUE(inside(indices.first[j], truth.first[j]));
        EXPECT_TRUE(inside(indices.total[j], truth.total[j]));
    }
    const SaltelliDesign lost(3, 16, 1);
    const auto none = lost.indices(std::vector<double>(lost.points().size(), std::numeric_limits<double>::quiet_NaN()));
    EXPECT_TRUE(std::isnan(none.first[0].value));
}

TEST(UnitSensitivity, AFunctionThatDoesNotVaryHasNoIndices) {
    const SaltelliDesign design(2, 64, 1);
    std::vector<double> values(design.points().size(), 3.7e5);
    values[5] *= 1 + 1e-15;
    const auto indices = design.indices(values);
    EXPECT_EQ(indices.first[0].value, 0);
    EXPECT_EQ(indices.total[1].upper_95, 0);
}

TEST(UnitSensitivity, SobolPointsAreEvenAndInsideTheCube) {
    const int count = 256;
    const auto points = sobol_points(count, 6, 7);
    for (Eigen::Index j = 0; j < 6; ++j) {
        std::set<int> cells;  // a net: each coordinate has one point in each of `count` equal parts
        for (const Eigen::VectorXd& point : points) {
            EXPECT_GT(point[j], 0);
            EXPECT_LT(point[j], 1);
            cells.insert(static_cast<int>(point[j] * count));
        }
        EXPECT_EQ(cells.size(), static_cast<std::size_t>(count));
    }
    EXPECT_NE(points[0], sobol_points(1, 6, 8)[0]);
}

// y = 3 x1 - 2 x2 + x3 x4: effects of x1 and x2 are constant, those of x3 are x4, which lies on four even levels.
TEST(VerificationSensitivity, MorrisMeasuresOfAKnownFunction) {
    const auto f = [](const Eigen::VectorXd& x) { return 3 * x[0] - 2 * x[1] + x[2] * x[3]; };
    const MorrisDesign design(5, 2000, 1);
    const auto measures = design.measures(values_at(design, f));
    EXPECT_NEAR(measures.mu_star[0].value, 3, 1e-12);
    EXPECT_NEAR(measures.mu_star[1].value, 2, 1e-12);
    EXPECT_NEAR(measures.sigma[0].value, 0, 1e-10);
    // Of 0, 1/3, 2/3, 1, within four standard errors at 2000 trajectories.
    const double sigma = std::sqrt(5.0 / 36), fourth_moment = 41.0 / 1296;
    EXPECT_NEAR(measures.mu_star[2].value, 0.5, 4 * sigma / std::sqrt(2000));
    EXPECT_NEAR(measures.sigma[2].value, sigma, 4 * std::sqrt((fourth_moment - std::pow(sigma, 4)) / 8000) / sigma);
    std::printf("Morris: mu* %.4f, exact 0.5; sigma %.4f, exact %.4f\n", measures.mu_star[2].value, measures.sigma[2].value,
                sigma);
    EXPECT_EQ(measures.mu_star[4].value, 0);
    for (const Eigen::VectorXd& x : design.points()) {
        EXPECT_TRUE((x.array() >= 0).all() && (x.array() <= 1).all());
    }
}

TEST(GradientSensitivity, LocalDerivativesAgreeWithCalculus) {
    const auto f = [](const Eigen::VectorXd& x) { return std::exp(2 * x[0]) * std::cos(x[1]); };
    for (const double x1 : {0.4, 0.0, 1.0}) {
        const Eigen::Vector2d x(0.3, x1);
        const LocalDesign design(x);
        std::vector<double> values = values_at(design, f);
        const auto derivatives = design.derivatives(values);
        const double exact[] = {2 * f(x), -std::exp(0.6) * std::sin(x1)};
        for (std::size_t j = 0; j < 2; ++j) {
            EXPECT_NEAR(derivatives[j].value, exact[j],
                        1e-5);  // h^4 / 30 f''''' with h = 0.015, or four times as wide on one side
            EXPECT_TRUE(inside(derivatives[j], exact[j]));
        }
        values[1] = std::numeric_limits<double>::quiet_NaN();
        EXPECT_NEAR(design.derivatives(values)[0].value, exact[0], 1e-3);
        values[2] = values[3] = values[1];
        EXPECT_TRUE(std::isnan(design.derivatives(values)[0].value));
    }
}

// A jump between two of the points: the slope is that of the side where x is, and it is told.
TEST(GradientSensitivity, LocalDerivativesDoNotReachAcrossAJump) {
    const Eigen::VectorXd x = Eigen::VectorXd::Constant(1, 0.5);
    const LocalDesign design(x);
    for (const double at : {0.495, 0.505, 0.49, 0.51}) {  // the points lie 0.0075 or 0.015 off, or twice as far
        const auto f = [&](const Eigen::VectorXd& y) { return 3.0 + 2.0 * y[0] + 0.1 * y[0] * y[0] + (y[0] > at ? 5.0 : 0.0); };
        bool jumps = false;
        const auto slope = design.derivatives(values_at(design, f), &jumps);
        EXPECT_TRUE(jumps) << at;
        EXPECT_NEAR(slope[0].value, 2.1, 1e-6) << at;
    }
    const auto stands_before = [](const Eigen::VectorXd& y) { return y[0] < 0.495 ? 2.5 : 2.0 + 2.0 * y[0]; };
    EXPECT_NEAR(design.derivatives(values_at(design, stands_before))[0].value, 2.0, 1e-6);
    bool jumps = false;
    design.derivatives(values_at(design, [](const Eigen::VectorXd& y) { return std::exp(3 * y[0]); }), &jumps);
    design.derivatives(values_at(design, [](const Eigen::VectorXd& y) { return std::tanh(4 * (y[0] - 0.5)); }), &jumps);
    design.derivatives(values_at(design, [](const Eigen::VectorXd& y) { return std::pow(y[0] - 0.5, 2); }), &jumps);
    EXPECT_FALSE(jumps);
}

// A kink at x or near it: the interval holds the slopes of both sides.
TEST(GradientSensitivity, LocalDerivativesSeeAKink) {
    const LocalDesign design(Eigen::VectorXd::Constant(1, 0.5));
    for (const double at : {0.5, 0.497, 0.503, 0.4935, 0.505}) {
        const auto f = [&](const Eigen::VectorXd& y) {
            return 3.0 + 2.0 * y[0] + 0.05 * y[0] * y[0] + 0.7 * std::max(0.0, y[0] - at);
        };
        bool jumps = false;
        const Estimate slope = design.derivatives(values_at(design, f), &jumps)[0];
        EXPECT_FALSE(jumps) << at;
        constexpr double rounding = 1e-9;
        EXPECT_LT(slope.lower_95, (at > 0.5 ? 2.05 : 2.75) + rounding) << at;
        EXPECT_GT(slope.upper_95, (at > 0.5 ? 2.05 : 2.75) - rounding) << at;
        if (at == 0.5) {
            EXPECT_NEAR(slope.value, 2.4, 1e-9);
            EXPECT_NEAR(slope.upper_95 - slope.lower_95, 0.7, 0.25);
            EXPECT_LT(slope.lower_95, 2.05 + rounding);
        }
    }
}

// Stands at 2 mm, jumps at 0.4 mm to 4 mm, stands to 0.8 mm, jumps to 6 mm and grows from there.
Record staircase() {
    Record record;
    const auto add = [&](double u, double a) {
        Instant row;
        row.displacement = 1e-3 * u;
        row.time = u + (record.series.empty() ? 0 : 1e-9);
        row.crack_length = 1e-3 * a;
        row.force = 40 * u / a;
        record.series.push_back(row);
    };
    for (int i = 0; i <= 40; ++i) add(0.01 * i, 2);
    for (int i = 40; i <= 80; ++i) add(0.01 * i, 4);
    for (int i = 80; i <= 100; ++i) add(0.01 * i, 6 + 0.1 * (i - 80));
    return record;
}

TEST(UnitOutputs, AreReadFromTheRecord) {
    using Kind = StudyOutput::Kind;
    const Record record = staircase();
    const auto value = [&](Kind kind, double at = 0, int number = 0) { return output_of(record, {"", kind, at, number}); };
    EXPECT_DOUBLE_EQ(value(Kind::peak_force), 8);
    EXPECT_NEAR(value(Kind::initial_stiffness), 20e3, 1e-6);
    EXPECT_DOUBLE_EQ(value(Kind::crack_length_at, 0.605e-3), 4e-3);
    EXPECT_DOUBLE_EQ(value(Kind::force_at, 0.2e-3), 4);
    EXPECT_TRUE(std::isnan(value(Kind::force_at, 2e-3)));
    EXPECT_DOUBLE_EQ(value(Kind::arrest_length, 0, 1), 4e-3);
    EXPECT_DOUBLE_EQ(value(Kind::arrest_displacement, 0, 1), 0.8e-3);
    EXPECT_TRUE(std::isnan(value(Kind::arrest_length, 0, 2)));
    double work = 0.5 * 8 * 0.4e-3 + 0.5 * (4 + 8) * 0.4e-3;
    for (int i = 80; i < 100; ++i) {
        work += 0.5 * (0.4 * i / (6 + 0.1 * (i - 80)) + 0.4 * (i + 1) / (6 + 0.1 * (i - 79))) * 0.01e-3;
    }
    EXPECT_NEAR(value(Kind::work_of_fracture), work, 1e-12);
    Record whole = record;
    whole.status = RunStatus::split;
    EXPECT_EQ(output_of(whole, {"", Kind::force_at, 2e-3, 0}), 0);
    EXPECT_DOUBLE_EQ(output_of(whole, {"", Kind::crack_length_at, 2e-3, 0}), 8e-3);
}

TEST(UnitOutputs, InitialStiffnessIsThatOfTheStart) {
    Record record;
    for (int i = 0; i <= 200; ++i) {
        Instant row;
        row.displacement = 1e-3 * i / 200.0;
        const double beyond_gap = std::max(0.0, row.displacement - 0.1e-3);
        row.force = 1e4 * beyond_gap + 1e12 * std::pow(beyond_gap, 3);  // it begins late, and stiffens by far
        record.series.push_back(row);
    }
    const double told = output_of(record, {"", StudyOutput::Kind::initial_stiffness, 0, 0});
    EXPECT_NEAR(told, 1e4, 0.1e4);  // at the end it is 2.4e6
}

Study output_study(SensitivityMethod method, int samples) {
    Study study = wedge_study(FakeWedge{});
    study.scene = study.experiments[0].scene;
    study.experiments.clear();
    study.outputs = {{"peak force", StudyOutput::Kind::peak_force, 0, 0},
                     {"initial stiffness", StudyOutput::Kind::initial_stiffness, 0, 0}};
    study.sensitivity = {method, samples};
    return study;
}

SensitivityOptions wedge_options(int threads) {
    SensitivityOptions options;
    options.threads = threads;
    options.forward = [](const Scene& scene, const std::atomic<bool>*) {
        if (scramble(scene.materials.at("EW").toughness, 1) < 0.2) {
            throw std::runtime_error("lost");
        }
        return FakeWedge{}(scene);
    };
    return options;
}

TEST(SystemSensitivity, GivesTheSameBitsForAnyNumberOfThreadsAndCountsFailedRuns) {
    for (const auto method : {SensitivityMethod::local, SensitivityMethod::morris, SensitivityMethod::sobol}) {
        const Study study = output_study(method, 16);
        const Sensitivity one = study_sensitivity(study, wedge_options(1));
        const Sensitivity four = study_sensitivity(study, wedge_options(4));
        ASSERT_EQ(one.indices.size(), 8u);
        for (std::size_t i = 0; i < one.indices.size(); ++i) {
            const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x); };
            EXPECT_EQ(bits(one.indices[i].value), bits(four.indices[i].value));
            EXPECT_EQ(bits(one.indices[i].lower_95), bits(four.indices[i].lower_95));
        }
        std::set<std::vector<double>> distinct;
        for (const SensitivityRun& run : one.runs) {
            EXPECT_TRUE(distinct.insert(run.parameters).second) << "run twice";
            EXPECT_EQ(std::isnan(run.outputs[0]), run.status != "finished");
        }
        if (method == SensitivityMethod::sobol) {
            EXPECT_NE(one.message.find("runs failed and are left out; the first: lost"), std::string::npos) << one.message;
        }
    }
}

// What is left of a box without one of its corners says less of one parameter than of both.
TEST(SystemSensitivity, NoSobolIndicesWhereTheParametersMadeRunsFail) {
    Study study = output_study(SensitivityMethod::sobol, 64);
    const Parameter &first = study.parameters[0], &second = study.parameters[1];
    SensitivityOptions options;
    options.forward = [&](const Scene& scene, const std::atomic<bool>*) {
        const auto share = [&](const Parameter& parameter) {
            return (get_number(scene, parameter.keys[0]) - parameter.lower) / (parameter.upper - parameter.lower);
        };
        if (share(first) > 0.6 && share(second) > 0.6) {
            throw std::runtime_error("lost");
        }
        return FakeWedge{}(scene);
    };
    const Sensitivity result = study_sensitivity(study, options);
    EXPECT_NE(result.message.find("not independent any more: no Sobol indices"), std::string::npos) << result.message;
    ASSERT_FALSE(result.indices.empty());
    for (const SensitivityIndex& index : result.indices) {
        EXPECT_TRUE(std::isnan(index.value)) << index.output;
    }
}

// Where a rest ends lies between rows of the record, which stand at the same displacements whatever the wood.
TEST(GradientSensitivity, EndsOfRestsMoveAsRunsSay) {
    Study study;
    study.scene = parse_scene(R"(
[model]
plane = "strain"
thickness = "10 mm"
cell = "0.4 mm"
[specimen]
size = ["12 mm", "10 mm"]
rings = { pith = ["-200.5 mm", "5 mm"], period = "4 mm", latewood_fraction = 0.3 }
[materials]
EW = { kind = "isotropic", E = "40 MPa", nu = 0.33, density = "300 kg/m^3", toughness = "110 J/m^2" }
LW = { kind = "isotropic", E = "800 MPa", nu = 0.33, density = "750 kg/m^3", toughness = "180 J/m^2" }
[[edges]]
name = "up"
side = "top"
range = ["0.4 mm", "1.6 mm"]
velocity = ["0 m/s", "1 mm/min"]
[[edges]]
side = "bottom"
range = ["0.4 mm", "1.6 mm"]
velocity = ["0 m/s", "0 m/s"]
[[cracks]]
points = [["0 mm", "5 mm"], ["2.5 mm", "5 mm"]]
grows = "end"
advance = "0.4 mm"
direction = "straight"
[measure]
force = "up"
displacement = "up"
[solver]
strain = "small"
[stop]
displacement = "1.2 mm"
)",
                              "pull.toml");
    for (const char* key : {"EW.E", "LW.E", "EW.toughness", "LW.toughness"}) {
        Parameter& parameter = study.parameters.emplace_back();
        parameter.name = key;
        parameter.keys = {std::string("materials.") + key};
        parameter.initial = get_number(*study.scene, parameter.keys[0]);
        parameter.lower = parameter.initial / 2;
        parameter.upper = parameter.initial * 2;
        parameter.scale = Scale::logarithmic;
    }
    study.outputs = {{"arrest length 1", StudyOutput::Kind::arrest_length, 0, 1},
                     {"arrest displacement 1", StudyOutput::Kind::arrest_displacement, 0, 1}};
    study.sensitivity = {SensitivityMethod::local, 0};
    const Sensitivity result = study_sensitivity(study, {});
    constexpr double step = 1e-3;
    const Record here = simulate(*study.scene);
    for (const Parameter& parameter : study.parameters) {
        const auto with = [&](double factor) {
            Scene scene = *study.scene;
            set_number(scene, parameter.keys[0], factor * parameter.initial);
            return simulate(scene);
        };
        const Record less = with(1 - step), more = with(1 + step);
        for (const SensitivityIndex& index : result.indices) {
            if (index.kind != "elasticity" || index.parameter != parameter.name) continue;
            const auto& output = *std::ranges::find(study.outputs, index.output, &StudyOutput::name);
            const double seen = (output_of(more, output) - output_of(less, output)) / (2 * step * output_of(here, output));
            std::printf("%s by %s: elasticity %.5f, by runs %.5f\n", index.output.c_str(), parameter.name.c_str(), index.value,
                        seen);
            EXPECT_NEAR(index.value, seen, 1e-4 + 1e-2 * std::abs(seen));
            EXPECT_NE(index.value, 0.0);
        }
    }
}

// A parameter without exact derivatives leaves the others theirs.
TEST(GradientSensitivity, ExactDerivativesStayBesideOthers) {
    Study study;
    study.scene = bar_scene();
    study.parameters = {bar_modulus()};
    study.outputs = {{"peak force", StudyOutput::Kind::peak_force, 0, 0}};
    study.sensitivity = {SensitivityMethod::local, 0};
    const Sensitivity alone = study_sensitivity(study, {});
    Parameter thickness = bar_modulus();
    thickness.name = "thickness";
    thickness.keys = {"model.thickness"};
    thickness.initial = 10e-3;
    thickness.lower = 5e-3;
    thickness.upper = 20e-3;
    study.parameters.insert(study.parameters.begin(), thickness);
    const Sensitivity both = study_sensitivity(study, {});
    EXPECT_NE(both.message.find("derivatives by 'E' are exact"), std::string::npos) << both.message;
    const auto of = [](const Sensitivity& result, const char* parameter) {
        return *std::ranges::find_if(result.indices, [&](const SensitivityIndex& index) {
            return index.parameter == parameter && index.kind == "elasticity";
        });
    };
    EXPECT_EQ(both.runs.size(), 5U);  // four for the thickness
    EXPECT_EQ(of(both, "E").value, of(alone, "E").value);
    EXPECT_EQ(of(both, "E").upper_95, of(alone, "E").upper_95);
    EXPECT_NEAR(of(both, "E").value, 1, 1e-6);
    EXPECT_NEAR(of(both, "thickness").value, 1, 1e-6);
}

// A run that the user ends is none that failed.
TEST(SystemSensitivity, RunsThatTheUserStoppedHaveNotFailed) {
    const Study study = output_study(SensitivityMethod::sobol, 64);
    std::atomic<bool> stop = false;
    int runs = 0;
    SensitivityOptions options;
    options.threads = 1;  // else another may end well meanwhile
    options.stop_requested = &stop;
    options.forward = [&](const Scene& scene, const std::atomic<bool>*) {
        Record record = FakeWedge{}(scene);
        if (++runs == 3) {
            stop = true;
            record.status = RunStatus::interrupted;
            record.message = "stopped by the user";
        }
        return record;
    };
    const Sensitivity result = study_sensitivity(study, options);
    EXPECT_EQ(result.status, SensitivityStatus::interrupted);
    EXPECT_NE(result.message.find("2 runs ended well"), std::string::npos) << result.message;
    EXPECT_EQ(result.message.find("failed"), std::string::npos) << result.message;
}

TEST(SystemSensitivity, NoSobolIndicesOfAnOutputThatRunsLack) {
    // Runs of tough latewood end early.
    Study study = output_study(SensitivityMethod::sobol, 64);
    study.outputs.push_back({"force at 0.5 mm", StudyOutput::Kind::force_at, 0.5e-3, 0});
    SensitivityOptions options;
    options.forward = [](const Scene& scene, const std::atomic<bool>*) {
        Record record = FakeWedge{}(scene);
        if (scene.materials.at("LW").toughness > 300) {
            record.series.resize(record.series.size() / 2);
        }
        return record;
    };
    const Sensitivity result = study_sensitivity(study, options);
    for (const SensitivityIndex& index : result.indices) {
        EXPECT_EQ(std::isnan(index.value), index.output == "force at 0.5 mm") << index.output;
    }
    EXPECT_NE(result.message.find("runs have no 'force at 0.5 mm' and without them"), std::string::npos) << result.message;
}

TEST(SystemSensitivity, SaysSoWhenEveryRunFails) {
    SensitivityOptions options;
    options.forward = [](const Scene&, const std::atomic<bool>*) -> Record { throw std::runtime_error("no luck"); };
    const Sensitivity result = study_sensitivity(output_study(SensitivityMethod::sobol, 4), options);
    EXPECT_EQ(result.status, SensitivityStatus::failed);
    EXPECT_NE(result.message.find("no luck"), std::string::npos);
    EXPECT_TRUE(std::isnan(result.indices.front().value));
}

TEST(UnitSensitivity, RefusesStudiesWithNothingToLookAt) {
    const auto expect_refused = [](const Study& study, const std::string& key) {
        try {
            study_sensitivity(study, wedge_options(1));
            FAIL() << key << " accepted";
        } catch (const InputError& error) {
            EXPECT_EQ(error.key, key);
        }
    };
    Study study = output_study(SensitivityMethod::local, 0);
    study.outputs.clear();
    expect_refused(study, "outputs");
    study = output_study(SensitivityMethod::local, 0);
    study.parameters.clear();
    expect_refused(study, "parameters");
    study = output_study(SensitivityMethod::local, 0);
    study.scene.reset();
    expect_refused(study, "scene");
    study = output_study(SensitivityMethod::local, 0);
    study.scene->stop.displacement = 0.4e-3;
    study.outputs = {{"force at 0.5 mm", StudyOutput::Kind::force_at, 0.5e-3}};
    expect_refused(study, "outputs");
    study = output_study(SensitivityMethod::local, 0);
    study.parameters[0].name = "misfit";
    expect_refused(study, "parameters.0.name");
}

TEST(SystemSensitivity, SaysWhatItsNumbersRestOnAndRefusesWhatDoesNotCount) {
    Study study;
    study.scene = bar_scene();
    study.outputs = {{"peak force", StudyOutput::Kind::peak_force}, {"crack", StudyOutput::Kind::crack_length_at, 0.05e-3}};
    study.parameters = {bar_modulus()};
    SensitivityOptions options;
    options.threads = 1;
    const Sensitivity local = study_sensitivity(study, options);
    EXPECT_NE(local.message.find("derivatives are exact"), std::string::npos) << local.message;
    EXPECT_EQ(local.message.find("priors"), std::string::npos) << local.message;
    int undefined = 0;
    for (const SensitivityIndex& index : local.indices) {
        if (std::isnan(index.value)) {  // the elasticity of no crack at all: 0 / 0
            ++undefined;
            EXPECT_FALSE(std::signbit(index.value));
        }
    }
    EXPECT_EQ(undefined, 1);
    study.sensitivity = {SensitivityMethod::sobol, 4};
    study.parameters[0].prior = Prior{400e6, 1e6};
    const Sensitivity sobol = study_sensitivity(study, options);
    EXPECT_EQ(sobol.message.find("derivatives"), std::string::npos) << sobol.message;
    EXPECT_NE(sobol.message.find("priors do not count"), std::string::npos) << sobol.message;
    study.compared_key = "model.plane";
    study.models.resize(2);
    EXPECT_THROW(study_sensitivity(study, options), InputError);
    EXPECT_THROW(fit_function(study), InputError);
}

}  // namespace
}  // namespace crampfit::testing

#include "datasets/error.hpp"
#include "forward/simulate.hpp"
#include "inverse/field_comparison.hpp"
#include "inverse/fit.hpp"
#include "inverse/machine.hpp"
#include "inverse/run_end.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <random>

namespace crampfit::testing {
namespace {

constexpr double pixel = 20e-6;                                        // [m]
constexpr double earlywood_modulus = 60e6, latewood_modulus = 1000e6;  // E [Pa]

// A strip of 20 x 10 mm between grips, its growth rings across the pull.
Scene strip(double cell) {
    Scene scene;
    scene.model = {.plane = PlaneCondition::stress, .thickness = 10e-3, .cell = cell};
    scene.specimen.size = {20e-3, 10e-3};
    scene.specimen.rings = Rings{Vec2(-30e-3, 5e-3), 3e-3, 0.3, 0.0};
    scene.materials["EW"] = {earlywood_modulus, 0.33, 300, 100};
    scene.materials["LW"] = {latewood_modulus, 0.33, 800, 100};
    scene.edges = {{"left", Side::left, {}, {0.0, 0.0}, {}, {}}, {"right", Side::right, {}, {1e-5, 0.0}, {}, {}}};
    scene.measure = {"right", "right"};
    scene.solver.kind = SolverKind::quasistatic;
    scene.stop.displacement = 0.15e-3;
    return scene;
}

MeasuredFields lattice_of_subsets() {
    MeasuredFields fields;
    fields.subset = 31 * pixel;
    fields.by_displacement = true;
    fields.instants = {0.075e-3, 0.15e-3};
    for (double y = 0.5e-3; y < 9.5e-3; y += fields.subset)
        for (double x = 0.5e-3; x < 19.5e-3; x += fields.subset) fields.places.emplace_back(x, y);
    return fields;
}

// What a camera sees of a scene, and what the load cell reads.
Experiment measure(Scene scene, MeasuredFields fields, double noise_px, unsigned seed) {
    Experiment experiment;
    experiment.name = "strip";
    scene.output.probes = probes_for(fields);
    const Record record = simulate(scene);
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    const auto noise_of_picture = [&]() -> Vec2 {
        return noise_px * pixel / std::sqrt(2.0) * Vec2(normal(generator), normal(generator));
    };
    std::vector<Vec2> of_reference;  // against which each picture is correlated
    std::generate_n(std::back_inserter(of_reference), fields.places.size(), noise_of_picture);
    for (const ProbeReading& reading : record.probes) {
        std::vector<Vec2>& moved = fields.moved.emplace_back();
        for (std::size_t i = 0; i < fields.places.size(); ++i)
            moved.push_back(reading.moved[i] + noise_of_picture() - of_reference[i]);
        fields.sigma.emplace_back(fields.places.size(), noise_px * pixel);
    }
    double peak = 0;
    for (const Instant& row : record.series) peak = std::max(peak, std::abs(row.force));
    for (const Instant& row : record.series) {
        experiment.data.displacement.push_back(row.displacement);
        experiment.data.force.push_back(row.force + 0.005 * peak * normal(generator));
    }
    experiment.noise.force = 0.005 * peak;
    experiment.fields = fields;
    return experiment;
}

Parameter modulus(const char* wood, double initial) {
    Parameter parameter;
    parameter.name = std::string("E of ") + wood;
    parameter.keys = {std::string("materials.") + wood + ".E"};
    parameter.initial = initial;
    parameter.lower = 0.2 * initial;
    parameter.upper = 5 * initial;
    parameter.unit = "MPa";
    parameter.unit_factor = 1e6;
    parameter.scale = Scale::logarithmic;
    return parameter;
}

Study study_of(const Experiment& measured, double cell) {
    Study study;
    study.experiments = {measured};
    Scene& scene = study.experiments[0].scene;
    scene = strip(cell);
    scene.output.probes = probes_for(*measured.fields);
    study.parameters = {modulus("EW", 120e6), modulus("LW", 500e6)};
    study.optimizer.max_runs = 80;
    return study;
}

Fit fit(const Study& study) {
    FitOptions options;
    options.threads = 1;
    return fit_study(study, options);
}

void expect_moduli(const Fit& found, const char* what) {
    ASSERT_EQ(found.parameters.size(), 2u) << found.message;
    const double truth[] = {earlywood_modulus / 1e6, latewood_modulus / 1e6};
    for (int j = 0; j < 2; ++j) {
        const FittedParameter& p = found.parameters[j];
        std::printf("%s, %s: %.2f MPa (%+.2f %% of %.0f), 95 %% within %.2f .. %.2f; %zu runs, reduced chi-square %.3g, %.1f s\n",
                    what, p.name.c_str(), p.value, 100 * (p.value / truth[j] - 1), truth[j], p.lower_95, p.upper_95,
                    found.runs.size(), found.reduced_chi_square, found.seconds);
        EXPECT_NEAR(p.value, truth[j], 0.03 * truth[j]);
        EXPECT_LE(p.lower_95, truth[j]);
        EXPECT_GE(p.upper_95, truth[j]);
    }
    std::printf("%s\n%s\n", found.method.c_str(), found.message.c_str());
}

// The bar of the issue: both moduli within 3 %, the truth within the 95 % intervals. The test is made on a grid of half the cell,
// so that the model's own error takes part.
TEST(VerificationFields, ModuliOfBothWoodsComeOutOfOneTensileField) {
    const Experiment measured = measure(strip(0.1e-3), lattice_of_subsets(), 0.01, 1);
    expect_moduli(fit(study_of(measured, 0.2e-3)), "fixed to the picture, camera free");
}

// A picture that has slid and turned as a whole gives the same moduli.
TEST(VerificationFields, MotionOfTheCameraSaysNothing) {
    Experiment measured = measure(strip(0.1e-3), lattice_of_subsets(), 0.01, 2);
    for (std::vector<Vec2>& moved : measured.fields->moved)
        for (std::size_t i = 0; i < moved.size(); ++i)
            moved[i] += Vec2(60e-6, -25e-6) + 2e-3 * Vec2(-measured.fields->places[i].y(), measured.fields->places[i].x());
    expect_moduli(fit(study_of(measured, 0.2e-3)), "camera moved");
}

// Sum of squares of what is left, and the experiment's own record.
double misfit(const FieldComparison& comparison, const Record& record) {
    const std::vector<double> modelled = comparison.modelled(record);
    double sum = 0;
    for (std::size_t i = 0; i < modelled.size(); ++i)
        sum += std::pow((modelled[i] - comparison.stations()[i].measured) / comparison.stations()[i].sigma, 2);
    return sum;
}

TEST(UnitFields, AStillCameraSeesTheWholeMotion) {
    Experiment measured = measure(strip(0.25e-3), lattice_of_subsets(), 0.0, 1);
    measured.noise.displacement_field = 0.01 * pixel;
    Scene scene = strip(0.25e-3);
    scene.output.probes = probes_for(*measured.fields);
    const Record record = simulate(scene);
    measured.fields->camera_moves = false;
    EXPECT_LT(misfit(FieldComparison(measured), record), 1e-9);
    const double shift = 0.1 * pixel;
    for (std::vector<Vec2>& moved : measured.fields->moved)
        for (Vec2& m : moved) m.x() += shift;
    // Ten sigma of the first picture; of the second half of that, which the reference's noise does not explain, in what is left
    // of the variance, three quarters.
    const double expected = (100 + 25 / 0.75) * static_cast<double>(measured.fields->places.size());
    EXPECT_NEAR(misfit(FieldComparison(measured), record), expected, 1e-3 * expected);
    measured.fields->camera_moves = true;
    EXPECT_LT(misfit(FieldComparison(measured), record), 1e-9);
}

// Twelve pictures of a motion a x instant, each correlated with one reference: what a fit of a says of its error is what it
// makes.
TEST(UnitFields, NoiseOfTheReferenceIsCommonToAllPictures) {
    constexpr double sigma = 1e-6, truth = 1e-5;
    constexpr int pictures = 12, places = 8, draws = 300;
    std::mt19937 generator(1);
    std::normal_distribution<double> normal;
    Experiment test;
    MeasuredFields& fields = test.fields.emplace();
    fields.camera_moves = false;
    fields.subset = 0.1e-3;
    for (int i = 0; i < places; ++i) fields.places.emplace_back(1e-3 * i, 0.0);
    for (int k = 1; k <= pictures; ++k) fields.instants.push_back(k);
    fields.sigma.assign(pictures, std::vector<double>(places, sigma));
    const auto moved_by = [&](double a) {
        Record record;
        for (const double instant : fields.instants)
            record.probes.push_back({std::vector<Vec2>(places, Vec2(a * instant, 0.5 * a * instant)), {}});
        return record;
    };
    double squares = 0, chi_square = 0, neighbours = 0;
    for (int draw = 0; draw < draws; ++draw) {
        const auto of_picture = [&]() -> Vec2 { return sigma / std::sqrt(2.0) * Vec2(normal(generator), normal(generator)); };
        std::vector<Vec2> of_reference;
        std::generate_n(std::back_inserter(of_reference), places, of_picture);
        const Record record = moved_by(truth);
        fields.moved.clear();
        for (const ProbeReading& reading : record.probes) {
            std::vector<Vec2>& moved = fields.moved.emplace_back();
            for (int i = 0; i < places; ++i) moved.push_back(reading.moved[i] + of_picture() - of_reference[i]);
        }
        const FieldComparison comparison(test);
        const auto residuals = [&](double a) {
            const std::vector<double> modelled = comparison.modelled(moved_by(a));
            Eigen::VectorXd r(static_cast<Eigen::Index>(modelled.size()));
            for (Eigen::Index k = 0; k < r.size(); ++k) {
                const FitResidual& station = comparison.stations()[static_cast<std::size_t>(k)];
                r[k] = (modelled[static_cast<std::size_t>(k)] - station.measured) / station.sigma;
            }
            return r;
        };
        const Eigen::VectorXd r = residuals(truth), slope = (residuals(1.1 * truth) - r) / (0.1 * truth);
        squares += std::pow(slope.dot(r) / slope.norm(), 2) / draws;  // the error of a over its standard error
        chi_square += r.squaredNorm() / static_cast<double>(r.size()) / draws;
        neighbours += r.head(r.size() - places).dot(r.tail(r.size() - places)) / static_cast<double>(r.size()) / draws;
    }
    std::printf("twelve pictures of one reference: error of a slope over its standard error %.3f rms\n", std::sqrt(squares));
    EXPECT_NEAR(std::sqrt(squares), 1, 3 / std::sqrt(2.0 * draws));
    EXPECT_NEAR(chi_square, 1, 0.02);
    EXPECT_NEAR(neighbours, 0, 0.02);
}

TEST(UnitFields, PointsAtTheSimulatedCrackAreLeftOut) {
    Experiment measured = measure(strip(0.25e-3), lattice_of_subsets(), 0.0, 1);
    measured.noise.displacement_field = 0.01 * pixel;
    measured.fields->camera_moves = false;
    Scene scene = strip(0.25e-3);
    scene.output.probes = probes_for(*measured.fields);
    Record record = simulate(scene);
    std::size_t near = 0;
    for (ProbeReading& reading : record.probes) {
        reading.cracks = {{Vec2(20e-3, 5e-3), Vec2(10e-3, 5e-3)}};
        for (std::size_t i = 0; i < measured.fields->places.size(); ++i) {
            const Vec2& x = measured.fields->places[i];
            const Vec2 off(std::max(0.0, 10e-3 - x.x()), x.y() - 5e-3);
            if (off.norm() < measured.fields->subset / std::sqrt(2.0) - 1e-12) {
                ++near;
                reading.moved[i] += Vec2(1e-3, 1e-3);
            }
        }
    }
    ASSERT_GT(near, 20u);
    EXPECT_LT(misfit(FieldComparison(measured), record), 1e-9);
}

// Of pictures at 0.075 and 0.15 mm, 7.5 and 15 s, those that runs come to. The crack, where there is a table of its length, is
// 4 mm long until `grown` and 6 mm then.
CoveredData covered_pictures(bool by_displacement, double stop, double grown = 0) {
    Study study;
    Experiment& test = study.experiments.emplace_back();
    test.name = "strip";
    test.scene = strip(0.5e-3);
    test.scene.stop.displacement = stop;
    test.fields = lattice_of_subsets();
    test.fields->by_displacement = by_displacement;
    if (!by_displacement) test.fields->instants = {7.5, 15.0};
    test.fields->moved.assign(2, std::vector<Vec2>(test.fields->places.size(), Vec2::Zero()));
    test.fields->sigma.assign(2, std::vector<double>(test.fields->places.size(), 1e-6));
    for (int i = 0; grown > 0 && i <= 20; ++i) {
        test.data.displacement.push_back(0.01e-3 * i);
        test.data.time.push_back(test.data.displacement.back() / 1e-5);
        test.data.crack_length.push_back(test.data.displacement.back() < grown ? 4e-3 : 6e-3);
        test.scene.stop.crack_length = 5e-3;
    }
    if (grown > 0) {
        Crack crack;
        crack.grows = Growth::end;
        test.scene.cracks = {crack};
    }
    return covered_data(study, 0);
}

TEST(UnitFields, PicturesBeyondTheEndOfTheRunsAreLeftOut) {
    for (const bool by_displacement : {false, true}) {
        const auto are_left = [&](const CoveredData& covered) {
            return std::pair(covered.fields->moved[0][0].allFinite(), covered.fields->moved[1][0].allFinite());
        };
        const CoveredData all = covered_pictures(by_displacement, 0.15e-3);
        EXPECT_EQ(are_left(all), std::pair(true, true));
        EXPECT_EQ(all.remark, "");
        const CoveredData one = covered_pictures(by_displacement, 0.149e-3);
        EXPECT_EQ(are_left(one), std::pair(true, false));
        EXPECT_NE(one.remark.find("stop.displacement = 0.149 mm ends the runs before 1 of 2 pictures"), std::string::npos)
            << one.remark;
        try {
            covered_pictures(by_displacement, 0.07e-3);
            ADD_FAILURE() << "no error";
        } catch (const InputError& error) {
            EXPECT_EQ(error.key, "stop.displacement");
        }
        const CoveredData longer = covered_pictures(by_displacement, 1e-3, 0.1e-3);  // than the crack at which runs end
        EXPECT_EQ(are_left(longer), std::pair(true, false));
        EXPECT_NE(longer.remark.find("stop.crack_length = 5 mm ends the runs before 1 of 2 pictures"), std::string::npos)
            << longer.remark;
    }
    // Its stations are those of the one that is left.
    Experiment test;
    test.fields = covered_pictures(true, 0.149e-3).fields;
    const FieldComparison comparison(test);
    EXPECT_EQ(comparison.stations().size(), 2 * test.fields->places.size());
    EXPECT_NE(comparison.remark().find("in 1 pictures"), std::string::npos) << comparison.remark();
}

// The model sees the pictures where u + compliance F + displacement_offset comes to the recorded displacement: with data of its
// own nothing is left, and the derivatives are those of differences.
TEST(GradientFields, PicturesByRecordedDisplacementAreSeenThroughTheMachine) {
    constexpr double cell = 0.5e-3;
    Experiment measured = measure(strip(cell), lattice_of_subsets(), 0.0, 1);
    measured.noise.displacement_field = 0.01 * pixel;
    const Record record = simulate(strip(cell));
    const double stiffness = record.series.back().force / record.series.back().displacement;
    measured.machine = {0.3 / stiffness, 0.5, 4e-6};
    const Record seen = as_recorded(record, measured.machine);
    measured.data = {};
    for (const Instant& row : seen.series) {
        measured.data.displacement.push_back(row.displacement);
        measured.data.force.push_back(row.force);
    }
    for (double& at : measured.fields->instants) at = 1.3 * at + 4e-6;  // without the machine 0.075 and 0.15 mm
    Study study = study_of(measured, cell);
    study.experiments[0].scene.stop.displacement = 0.16e-3;
    const StudyFunction function = fit_function(study, nullptr);
    const Eigen::Vector2d truth(earlywood_modulus, latewood_modulus);
    const Evaluation there = function(truth, 1);
    ASSERT_TRUE(there.usable()) << there.status;
    EXPECT_LT(there.residuals.cwiseAbs().maxCoeff(), 1e-4);
    const Eigen::Vector2d aside(1.1 * earlywood_modulus, 0.9 * latewood_modulus);
    const auto slopes = fit_slopes(study, aside, nullptr);
    ASSERT_TRUE(slopes);
    for (int j = 0; j < 2; ++j) {
        Eigen::Vector2d step = Eigen::Vector2d::Zero();
        step[j] = 1e-3 * aside[j];
        const Eigen::VectorXd difference =
            (function(aside + step, 1).residuals - function(aside - step, 1).residuals) / (2 * step[j]);
        EXPECT_LT((slopes->col(j) - difference).norm(), 1e-4 * difference.norm());
    }
}

TEST(UnitFields, ASubsetIsAveragedAsItsWarpIsFitted) {
    // A first-order warp gives the mean of what it covers, a second-order one follows a parabola.
    for (const int order : {1, 2}) {
        const std::vector<double> weights = subset_weights(order);
        double sum = 0, linear = 0, squares = 0;
        for (int k = 0; k < samples_a_subset; ++k) {
            const double x = (k % samples_a_side + 0.5) / samples_a_side - 0.5;
            sum += weights[k];
            linear += weights[k] * x;
            squares += weights[k] * x * x;
        }
        EXPECT_NEAR(sum, 1, 1e-12);
        EXPECT_NEAR(linear, 0, 1e-12);
        EXPECT_NEAR(squares, order == 1 ? (1 - 1.0 / (samples_a_side * samples_a_side)) / 12 : 0,
                    1e-12);  // midpoint rule for 1/12
    }
}

// Probes read what the material points move by: at equilibrium, in motion, and on either side of a crack.
TEST(UnitFields, ProbesReadTheMotionOfThePoints) {
    for (const SolverKind kind : {SolverKind::quasistatic, SolverKind::explicit_dynamics}) {
        Scene scene = strip(0.5e-3);
        scene.solver.kind = kind;
        if (kind == SolverKind::explicit_dynamics) scene.edges[1].velocity = {1.0, 0.0};
        Crack crack;
        crack.points = {Vec2(10.1e-3, 10e-3), Vec2(10.1e-3, 4.1e-3)};
        scene.cracks = {crack};
        scene.output.frames = 2;
        const Record frames = simulate(scene);
        scene.output.frames = 0;
        scene.output.probes = {frames.point_position, {frames.frames.back().time}, false};
        const Record record = simulate(scene);
        ASSERT_EQ(record.probes.size(), 1u);
        double worst = 0, largest = 0;
        for (std::size_t p = 0; p < frames.point_position.size(); ++p) {
            const Vec2 moved = frames.frames.back().moved[p].cast<double>();
            worst = std::max(worst, (record.probes[0].moved[p] - moved).norm());
            largest = std::max(largest, moved.norm());
        }
        std::printf("probes against points, %s: worst difference %.2g of the largest displacement\n",
                    kind == SolverKind::quasistatic ? "equilibrium" : "explicit", worst / largest);
        EXPECT_LT(worst, 2e-6 * largest);  // frames are in single precision
        EXPECT_EQ(record.probes[0].cracks.at(0), crack.points);
    }
}

}  // namespace
}  // namespace crampfit::testing

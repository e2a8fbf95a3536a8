// A test seen through the machine that it was made on.
#include "inverse/machine.hpp"
#include "datasets/error.hpp"
#include "inverse/curve.hpp"
#include "inverse/fit.hpp"
#include "inverse/run_end.hpp"
#include "tests/inverse/bar_scene.hpp"
#include "tests/inverse/fake_wedge.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <set>

namespace crampfit::testing {
namespace {

// The fake wedge test pulled through a spring: F = k u and u_m = u + C F, so that F = k u_m / (1 + C k). The crack stands at the
// largest length that u_c + C F_c has allowed so far, its own bookkeeping and not that of `as_recorded`.
Instant on_soft_machine(const FakeWedge& wedge, const Machine& machine, double displacement) {
    constexpr int lengths = 20000;
    double length = wedge.first_length, reached = 0;
    for (int i = 0; i <= lengths && reached <= displacement; ++i) {
        const double a = std::lerp(wedge.first_length, wedge.last_length, static_cast<double>(i) / lengths);
        const double critical =
            wedge.critical_displacement(a, true_earlywood, true_latewood) * (1 + machine.compliance * wedge.stiffness(a)) +
            machine.displacement_offset;
        reached = std::max(reached, critical);
        length = reached <= displacement || i == 0 ? a : length;
    }
    const double k = wedge.stiffness(length);
    Instant row;
    row.displacement = displacement;
    row.crack_length = length;
    row.force = k * (displacement - machine.displacement_offset) / (1 + machine.compliance * k) + machine.force_offset;
    return row;
}

TEST(VerificationMachine, SoftMachineFeedsJumps) {
    const FakeWedge wedge;
    const double k = wedge.stiffness(wedge.first_length);
    const Machine machine{0.5 / k, 0.3, -5e-6};  // at first half as soft as the specimen
    const Record seen = as_recorded(wedge(true_earlywood, true_latewood, 20000), machine);
    std::vector<double> u, force, length;
    for (const Instant& row : seen.series) {
        if (!u.empty()) {
            EXPECT_GE(row.displacement, u.back());
        }
        u.push_back(row.displacement);
        force.push_back(row.force);
        length.push_back(row.crack_length);
    }
    const Curve force_curve(u, force), length_curve(u, length);
    double worst_force = 0, worst_length = 0;
    int far_off = 0;
    for (int i = 0; i < 1000; ++i) {
        const Instant exact = on_soft_machine(wedge, machine, std::lerp(u.front(), 0.6e-3, i / 1000.0));
        const double off = std::abs(length_curve.at(exact.displacement) - exact.crack_length);
        if (off > 0.1e-3) {
            ++far_off;  // a jump passes within a row
            continue;
        }
        worst_length = std::max(worst_length, off);
        worst_force = std::max(worst_force, std::abs(force_curve.at(exact.displacement) - exact.force));
    }
    std::printf("soft machine: force within %.1e N of 1 N, crack length within %.1e m, %d of 1000 next to a jump\n", worst_force,
                worst_length, far_off);
    EXPECT_LE(far_off, 4);            // as many as there are jumps
    EXPECT_LT(worst_length, 2.4e-6);  // the lengths stand 2 um and 0.4 um apart
    EXPECT_LT(worst_force, 1e-3);
}

Parameter of_machine(const char* key, double lower, double upper) {
    Parameter parameter;
    parameter.name = std::string(key).substr(std::string(key).rfind('.') + 1);
    parameter.keys = {key};
    parameter.initial = 0;
    parameter.lower = lower;
    parameter.upper = upper;
    return parameter;
}

// Toughnesses and everything about the machine from one test without noise, and a run of the scene for each pair of toughnesses
// only.
TEST(SystemMachine, FoundBesideToughnessWithoutFurtherRuns) {
    FakeWedge wedge;
    wedge.sharpness = 1;
    const Machine machine{0.2 / wedge.stiffness(wedge.first_length), 0.2, 4e-6};
    Study study = wedge_study(wedge);
    study.experiments[0].data = measure(as_recorded(wedge(true_earlywood, true_latewood), machine), 0, 0, 1);
    study.experiments[0].noise.force = 0.02;
    study.parameters.push_back(of_machine("experiments.wedge.compliance", 0, 3 * machine.compliance));
    study.parameters.push_back(of_machine("experiments.0.force_offset", -1, 1));
    study.parameters.push_back(of_machine("experiments.wedge.displacement_offset", -20e-6, 20e-6));
    study.optimizer.method = "ceres";
    study.optimizer.max_runs = 2000;
    FitOptions options = with(wedge);
    int calls = 0;
    options.forward = [&, plain = options.forward](const Scene& scene, const std::atomic<bool>* stop) {
        ++calls;
        return plain(scene, stop);
    };
    const Fit fit = fit_study(study, options);
    const double truth[] = {true_earlywood, true_latewood, machine.compliance, machine.force_offset, machine.displacement_offset};
    for (std::size_t j = 0; j < 5; ++j) {
        std::printf("%s: %.9g, truth %.9g\n", fit.parameters[j].name.c_str(), fit.parameters[j].value, truth[j]);
        EXPECT_NEAR(fit.parameters[j].value / truth[j], 1, 1e-5);
    }
    std::printf("%zu evaluations, %d runs of the scene\n", fit.runs.size(), calls);
    EXPECT_LT(calls,
              0.6 * static_cast<double>(fit.runs.size()));  // of 1 + 2 x 5 points of a difference stencil 5 change a toughness
}

TEST(UnitMachine, AComplianceLeavesTheSpecimenSomeOfTheDisplacement) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.experiments[0].scene.stop = {};
    study.experiments[0].scene.stop.crack_length = 1.0;
    const double stiffness = wedge.stiffness(wedge.first_length);
    study.experiments[0].machine.compliance = 0.2 / stiffness;
    EXPECT_NO_THROW(covered_data(study, 0));
    study.experiments[0].machine.compliance = 20 / stiffness;
    EXPECT_THROW(covered_data(study, 0), InputError);
    study.parameters.push_back(of_machine("experiments.wedge.compliance", 0, 30 / stiffness));  // it may be less
    EXPECT_NO_THROW(covered_data(study, 0));
}

TEST(SystemMachine, FixedValuesMoveTheModelToo) {
    const FakeWedge wedge;
    const Machine machine{0.2 / wedge.stiffness(wedge.first_length), 0.2, 4e-6};
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.experiments[0].data = measure(as_recorded(wedge(true_earlywood, true_latewood), machine), 0.02, 1e-4, 1);
    const Fit wrong = fit_study(study, with(wedge));
    study.experiments[0].machine = machine;
    const Fit right = fit_study(study, with(wedge));
    EXPECT_GT(wrong.reduced_chi_square, 3);
    EXPECT_LT(right.reduced_chi_square, 1.5);
}

// Before a crack moves a test knows of the sum of two compliances only.
TEST(SystemMachine, CannotBeToldFromAModulusBeforeTheCrackMoves) {
    const auto spring = [](const Scene& scene, const std::atomic<bool>*) {
        Record record;
        for (int i = 0; i <= 100; ++i) {
            Instant instant;
            instant.displacement = 1e-5 * i;
            instant.force = 1e-3 * scene.materials.at("EW").youngs_modulus * instant.displacement;
            record.series.push_back(instant);
        }
        return record;
    };
    Study study = wedge_study(FakeWedge{});
    study.experiments[0].data = measure(as_recorded(spring(study.experiments[0].scene, nullptr), {10e-6, 0, 0}), 0.05, 0, 2);
    study.experiments[0].data.crack_length.clear();
    study.experiments[0].noise.force = 0.05;
    Parameter modulus = study.parameters[0];
    modulus.name = "EW modulus";
    modulus.keys = {"materials.EW.E"};
    modulus.lower = 20e6;
    modulus.initial = 60e6;
    modulus.upper = 200e6;
    Parameter compliance = of_machine("experiments.wedge.compliance", 0, 40e-6);
    compliance.name = "machine compliance";
    study.parameters = {modulus, compliance};
    FitOptions options;
    options.forward = spring;
    const Fit fit = fit_study(study, options);
    EXPECT_NE(fit.message.find("'EW modulus' and 'machine compliance' cannot be told apart"), std::string::npos) << fit.message;
}

// LW is twice as tough as EW, whatever EW is.
TEST(SystemMachine, FixedRatio) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.parameters.pop_back();
    study.parameters[0].keys.push_back("materials.LW.toughness");
    study.parameters[0].factors = {1, true_latewood / true_earlywood};
    study.parameters[0].upper = 200;
    const Fit fit = fit_study(study, with(wedge));
    EXPECT_NEAR(fit.parameters[0].value, true_earlywood, 2 * fit.parameters[0].standard_error);
    EXPECT_LT(fit.reduced_chi_square, 1.5);
}

// Of a bar the force over time tells the speed times the modulus. At another speed the scene's stop would end a run before the
// data or long after them, and its last force would stand for what is not known.
TEST(SystemMachine, RunsComeToTheDataAtAnySpeed) {
    Study study;
    Experiment& bar = study.experiments.emplace_back();
    bar.name = "bar";
    bar.scene = bar_scene();  // goes 0.1 mm at 1 mm/min, in 6 s
    bar.noise.force = 1.0;
    std::mt19937 random(3);
    std::normal_distribution<double> noise(0.0, 1.0);
    for (int i = 1; i <= 60; ++i) {
        bar.data.time.push_back(0.2 * i);
        bar.data.force.push_back(400e6 * 10e-3 * 10e-3 / 20e-3 * (0.5e-3 / 60) * 0.2 * i + noise(random));
    }
    bar.data.displacement.resize(bar.data.time.size(), std::nan(""));
    bar.data.crack_length = bar.data.displacement;
    Parameter speed;
    speed.name = "speed";
    speed.keys = {"edges.top.velocity.1"};
    speed.lower = 0.2e-3 / 60;
    speed.upper = 5e-3 / 60;
    speed.unit_factor = 1e-3 / 60;
    study.parameters = {speed};
    FitOptions options;
    options.threads = 1;
    for (const double start : {0.3, 0.8, 3.0}) {
        study.parameters = {speed};
        study.parameters[0].initial = start * speed.unit_factor;
        const Fit alone = fit_study(study, options);
        EXPECT_EQ(alone.message.find("are left out"), std::string::npos) << alone.message;
        EXPECT_NE(alone.message.find("its speed is fitted"), std::string::npos) << alone.message;
        EXPECT_NEAR(alone.parameters[0].value, 0.5, 3 * alone.parameters[0].standard_error);
        EXPECT_LT(alone.parameters[0].standard_error, 0.03);
        study.parameters.push_back(bar_modulus());
        const Fit both = fit_study(study, options);
        EXPECT_NE(both.message.find("cannot be told apart"), std::string::npos) << both.message;
        EXPECT_NEAR(both.parameters[0].value * both.parameters[1].value, 0.5 * 400, 5);
        EXPECT_LT(both.parameters[1].lower_95, 110) << "E may be 100 MPa, at 2 mm/min";
        EXPECT_GT(both.parameters[1].upper_95, 890) << "and 900 MPa, at 0.22 mm/min";
    }
}

}  // namespace
}  // namespace crampfit::testing

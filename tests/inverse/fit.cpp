#include "inverse/fit.hpp"
#include "datasets/error.hpp"
#include "forward/simulate.hpp"
#include "inverse/run_end.hpp"
#include "tests/inverse/bar_scene.hpp"
#include "tests/inverse/fake_wedge.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

namespace crampfit::testing {
namespace {

TEST(SystemFit, CeresRecoversParametersFromNoiseFreeData) {
    FakeWedge smooth;
    smooth.sharpness = 1;
    Study study = wedge_study(smooth);
    study.optimizer.method = "ceres";
    const Fit fit = fit_study(study, with(smooth, 2));
    EXPECT_EQ(fit.status, FitStatus::converged);
    EXPECT_NEAR(fit.parameters[0].value / true_earlywood, 1, 1e-6);
    EXPECT_NEAR(fit.parameters[1].value / true_latewood, 1, 1e-6);
    EXPECT_LT(fit.misfit, 1e-6);
}

TEST(SystemFit, AutoIsEconomicalWithAndWithoutNoiseOfTheModel) {
    const FakeWedge wedge;
    for (const double noise : {0.0, 0.05}) {
        Study study = wedge_study(wedge, 0.02, 1e-4, 3);
        FitOptions options = with(wedge, 2);
        options.forward = noisy(wedge, noise);
        const Fit fit = fit_study(study, options);
        EXPECT_EQ(fit.status, FitStatus::converged);
        EXPECT_LE(fit.runs.size(), 60u);
        EXPECT_NEAR(fit.parameters[0].value / true_earlywood, 1, 0.03);
        EXPECT_NEAR(fit.parameters[1].value / true_latewood, 1, 0.03);
        EXPECT_LT(fit.reduced_chi_square, 2);
    }
}

TEST(SystemFit, ReportsWhatItDid) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.parameters[0].unit = "kJ/m^2";
    study.parameters[0].unit_factor = 1000;
    study.text = "the study";
    int calls = 0;
    FitProgress last;
    FitOptions options = with(wedge);
    options.progress = [&](const FitProgress& progress) {
        EXPECT_EQ(progress.runs, ++calls);
        last = progress;
    };
    const Fit fit = fit_study(study, options);
    EXPECT_EQ(static_cast<std::size_t>(calls), fit.runs.size());
    EXPECT_EQ(last.best_misfit, fit.misfit);
    EXPECT_EQ(last.best, (std::vector<double>{fit.parameters[0].value, fit.parameters[1].value}));
    EXPECT_NEAR(fit.parameters[0].value, 0.11, 0.005);
    EXPECT_NEAR(fit.parameters[0].initial, 0.08, 1e-12);
    EXPECT_EQ(fit.parameters[0].key, "materials.EW.toughness");
    EXPECT_LT(fit.parameters[0].lower_95, fit.parameters[0].value);
    EXPECT_GT(fit.parameters[0].upper_95, fit.parameters[0].value);
    EXPECT_NEAR(fit.covariance(0, 0), std::pow(fit.parameters[0].standard_error, 2), 1e-12);
    EXPECT_NEAR(fit.correlation(1, 1), 1, 1e-12);
    EXPECT_EQ(fit.runs[0].status, "finished");
    EXPECT_NEAR(fit.runs[0].parameters[1], 250, 1e-9);
    EXPECT_EQ(fit.study_text, "the study");
    double sum = 0;
    for (const FitResidual& residual : fit.residuals) {
        sum += residual.residual * residual.residual;
    }
    EXPECT_NEAR(sum, fit.misfit, 1e-9 * fit.misfit);
}

// A run that its stop has ended says nothing of what the force is beyond.
TEST(SystemFit, DataBeyondTheEndOfTheRunsAreLeftOut) {
    FakeWedge wedge;
    wedge.sharpness = 1;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.experiments[0].scene.file = "wedge.toml";
    study.experiments[0].scene.stop.displacement = 0.4e-3;
    FakeWedge stopped = wedge;
    stopped.last_displacement = 0.4e-3;
    const Fit fit = fit_study(study, with(stopped));
    EXPECT_EQ(fit.status, FitStatus::converged);
    for (const FittedParameter& parameter : fit.parameters) {
        const double truth = &parameter == &fit.parameters[0] ? true_earlywood : true_latewood;
        EXPECT_LT(std::abs(parameter.value - truth), 3 * parameter.standard_error);
        EXPECT_LT(parameter.standard_error, 0.05 * truth);
    }
    for (const FitResidual& residual : fit.residuals) {
        EXPECT_LE(residual.kind == "arrival" ? residual.measured : residual.at, 0.4e-3);
    }
    EXPECT_NE(fit.message.find("wedge: stop.displacement = 0.4 mm ends the runs before the data, which go to 0.6 mm: rows from "
                               "0.4003 mm on are left out; a later stop would take them in."),
              std::string::npos)
        << fit.message;
    // By time, and with what a fixture that may give lets the specimen lag behind.
    study.experiments[0].data.displacement.clear();
    study.experiments[0].scene.stop = {.displacement = {}, .crack_length = {}, .time = 0.2e-3};
    EXPECT_NE(fit_study(study, with(stopped)).message.find("wedge: stop.time = 0.0002 s ends the runs"), std::string::npos);
    study.experiments[0].scene.stop.time = -1.0;
    try {
        fit_study(study, with(stopped));
        FAIL();
    } catch (const InputError& error) {
        EXPECT_EQ(error.file, "wedge.toml");
        EXPECT_EQ(error.key, "stop.time");
        EXPECT_NE(error.rule.find("which go from 0 to 0.0003 s"), std::string::npos) << error.rule;
    }
}

// The data go on beyond the crack length that ends the runs.
TEST(SystemFit, DataOfALongerCrackThanRunsGoToDoNotBias) {
    FakeWedge wedge;
    wedge.sharpness = 1;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    const std::vector<double>& lengths = study.experiments[0].data.crack_length;
    const double longest = std::midpoint(lengths.front(), *std::max_element(lengths.begin(), lengths.end()));
    study.experiments[0].scene.file = "wedge.toml";
    study.experiments[0].scene.stop.crack_length = longest;
    FitOptions options = with(wedge);
    options.forward = [run = options.forward, longest](const Scene& scene, const std::atomic<bool>* stop) {
        Record record = run(scene, stop);
        const auto end = std::ranges::find_if(record.series, [&](const Instant& row) { return row.crack_length >= longest; });
        if (end != record.series.end()) {
            end->crack_length = longest;
            record.series.erase(end + 1, record.series.end());
        }
        return record;
    };
    const Fit fit = fit_study(study, options);
    EXPECT_EQ(fit.status, FitStatus::converged);
    EXPECT_EQ(fit.message.find("Lack of fit"), std::string::npos) << fit.message;
    EXPECT_NE(fit.message.find("wedge: stop.crack_length = "), std::string::npos) << fit.message;
    for (const FittedParameter& parameter : fit.parameters) {
        const double truth = &parameter == &fit.parameters[0] ? true_earlywood : true_latewood;
        EXPECT_LT(std::abs(parameter.value - truth), 3 * parameter.standard_error) << parameter.name;
        EXPECT_LT(parameter.standard_error, 0.05 * truth) << parameter.name;
    }
    study.experiments[0].scene.stop.crack_length = 0.5 * lengths.front();
    EXPECT_THROW(fit_study(study, options), InputError);
}

// The noise explains the data by two valleys of the modulus; the other starts are not spared for the first that is found.
TEST(SystemFit, StartsLookForAnotherExplanation) {
    const auto run = [](const Scene& scene, const std::atomic<bool>*) {
        const double share = scene.materials.at("EW").youngs_modulus / 400e6;
        Record record;
        for (int i = 0; i <= 200; ++i) {
            Instant& row = record.series.emplace_back();
            row.displacement = 5e-7 * i;
            const double part = i / 200.0;
            row.force = 100 * part * (1 + 0.2 * std::cos(2 * M_PI * share) + 0.02 * share * part);
        }
        return record;
    };
    Study study;
    Experiment& experiment = study.experiments.emplace_back();
    experiment.name = "bar";
    experiment.scene = bar_scene();
    Scene truth = experiment.scene;
    truth.materials["EW"].youngs_modulus = 700e6;
    experiment.data = testing::measure(run(truth, nullptr), 0, 0, 1);
    experiment.data.crack_length.clear();
    experiment.noise.force = 0.5;
    study.parameters = {bar_modulus()};
    study.parameters[0].initial = 320e6;
    study.optimizer.starts = 4;
    FitOptions options;
    options.forward = run;
    const Fit fit = fit_study(study, options);
    EXPECT_EQ(fit.status, FitStatus::converged);
    EXPECT_NEAR(fit.parameters[0].value, 700, 3);
    EXPECT_LE(fit.runs.size(), 150u);
}

// How hard it was to drive the crack at each length: in any order, with jumps and without.
TEST(SystemFit, ForceAtCrackLengthsIsEnough) {
    for (const double sharpness : {1.0, 2.0}) {
        for (const unsigned seed : {1u, 2u}) {
            FakeWedge wedge;
            wedge.sharpness = sharpness;
            Study study = wedge_study(wedge, 0.02, 1e-4, seed);
            Curves& data = study.experiments[0].data;
            data.displacement.clear();
            data.time.clear();
            FitOptions options = with(wedge);
            options.forward = [run = options.forward](const Scene& scene, const std::atomic<bool>* stop) {
                Record record = run(scene, stop);
                record.driving.emplace_back();  // at equilibrium nothing is averaged
                return record;
            };
            const Fit fit = fit_study(study, options);
            std::reverse(data.force.begin(), data.force.end());
            std::reverse(data.crack_length.begin(), data.crack_length.end());
            const Fit reversed = fit_study(study, options);
            EXPECT_EQ(fit.status, FitStatus::converged);
            EXPECT_EQ(fit.message.find("Lack of fit"), std::string::npos) << fit.message;
            EXPECT_LE(fit.residuals.size(), 200u);
            for (std::size_t j = 0; j < 2; ++j) {
                const double truth = j == 0 ? true_earlywood : true_latewood;
                EXPECT_LT(std::abs(fit.parameters[j].value - truth), 3 * fit.parameters[j].standard_error);
                EXPECT_LT(fit.parameters[j].standard_error, 0.05 * truth);
                EXPECT_NEAR(reversed.parameters[j].value, fit.parameters[j].value, 0.5 * fit.parameters[j].standard_error);
            }
        }
    }
}

TEST(SystemFit, ForceAtLengthsBeyondTheEndOfTheRunsIsLeftOut) {
    Study study = wedge_study(FakeWedge(), 0.02, 1e-4);
    Experiment& experiment = study.experiments[0];
    experiment.data.displacement.clear();
    experiment.data.time.clear();
    experiment.scene.stop.crack_length = 5e-3;
    const CoveredData covered = covered_data(study, 0);
    EXPECT_NE(covered.remark.find("wedge: stop.crack_length = 5 mm ends the runs before the data"), std::string::npos);
    for (std::size_t i = 0; i < experiment.data.force.size(); ++i) {
        EXPECT_EQ(std::isnan(covered.curves.force[i]), experiment.data.crack_length[i] > 5e-3);
    }
    experiment.scene.stop.crack_length = 1e-3;
    EXPECT_THROW(covered_data(study, 0), InputError);
    experiment.data.force.clear();
    experiment.scene.stop.crack_length = 5e-3;
    EXPECT_THROW(fit_study(study, with(FakeWedge())), InputError);  // lengths alone
}

TEST(SystemFit, WhatTheMachineTakesOfTheDisplacementDoesNotEndTheRunsEarlier) {
    FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    Experiment& experiment = study.experiments[0];
    experiment.machine.compliance = 1e-6;
    experiment.scene.stop.displacement = 0.6e-3;
    for (std::size_t i = 0; i < experiment.data.displacement.size(); ++i) {
        experiment.data.displacement[i] += 1e-6 * experiment.data.force[i];
    }
    EXPECT_EQ(covered_data(study, 0).remark.find("ends the runs"), std::string::npos);
    // An offset that may be negative is taken off the end.
    Parameter offset;
    offset.name = "offset";
    offset.keys = {"experiments.wedge.displacement_offset"};
    offset.lower = -0.1e-3;
    offset.upper = 0.1e-3;
    study.parameters.push_back(offset);
    const CoveredData covered = covered_data(study, 0);
    double last = 0;
    for (const double u : covered.curves.displacement) {
        last = std::isnan(u) ? last : u;
    }
    EXPECT_NEAR(last - 1e-6 * experiment.data.force[666], 0.5e-3, 1e-6);
}

// Data of a crack that grows want one that may.
TEST(UnitFit, ACrackThatGrewNeedsOneThatMay) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.experiments[0].scene.cracks[0].grows = Growth::none;
    EXPECT_THROW(covered_data(study, 0), InputError);
    for (double& length : study.experiments[0].data.crack_length) {
        length = 2e-3;
    }
    EXPECT_NO_THROW(covered_data(study, 0));
    // Nor does its noise, of which many readings have a wide range, make it grow.
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, 1e-4);
    for (double& length : study.experiments[0].data.crack_length) {
        length += noise(random);
    }
    EXPECT_NO_THROW(covered_data(study, 0));
    study.experiments[0].noise.crack_length.reset();
    EXPECT_NO_THROW(covered_data(study, 0));
    study.experiments[0].scene.cracks.clear();  // one that stands is there all the same
    EXPECT_THROW(covered_data(study, 0), InputError);
    std::ranges::fill(study.experiments[0].data.crack_length, 0.0);
    EXPECT_NO_THROW(covered_data(study, 0));
}

class EveryMethod : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryMethod, GivesTheSameBitsForAnyNumberOfThreads) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.optimizer = {.method = GetParam(), .starts = 3, .max_runs = 60};
    FitOptions options;
    options.forward = [noise = noisy(wedge, 0.03)](const Scene& scene, const std::atomic<bool>* stop) {
        if (scramble(scene.materials.at("EW").toughness, 1) < 0.1) {
            throw std::runtime_error("lost");
        }
        return noise(scene, stop);
    };
    options.threads = 1;
    const Fit one = fit_study(study, options);
    for (const int threads : {2, 4}) {
        options.threads = threads;
        const Fit more = fit_study(study, options);
        ASSERT_EQ(more.runs.size(), one.runs.size());
        for (std::size_t i = 0; i < one.runs.size(); ++i) {
            EXPECT_EQ(more.runs[i].parameters, one.runs[i].parameters);
            EXPECT_EQ(more.runs[i].misfit, one.runs[i].misfit);
            EXPECT_EQ(more.runs[i].status, one.runs[i].status);
        }
        EXPECT_EQ(more.covariance, one.covariance);
        EXPECT_EQ(more.parameters[0].lower_95, one.parameters[0].lower_95);
        EXPECT_EQ(more.message, one.message);
        EXPECT_EQ(more.method, one.method);
    }
    EXPECT_LE(one.runs.size(), 60u);
    std::set<std::vector<double>> distinct;
    for (const FitRun& run : one.runs) {
        EXPECT_TRUE(distinct.insert(run.parameters).second) << "run twice";
        EXPECT_GE(run.misfit, one.misfit);  // the best ever seen is the one that is given
    }
}

INSTANTIATE_TEST_SUITE_P(SystemFit, EveryMethod,
                         ::testing::Values("auto", "ceres", "bobyqa", "sbplx", "cobyla", "neldermead", "crs2", "isres", "direct",
                                           "mlsl"),
                         [](const auto& test) { return test.param; });

TEST(SystemFit, GlobalMethodsConverge) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.optimizer.max_runs = 200;
    for (const char* method : {"crs2", "isres", "direct", "mlsl"}) {
        study.optimizer.method = method;
        const Fit fit = fit_study(study, with(wedge, 2));
        EXPECT_EQ(fit.status, FitStatus::converged) << method << ": " << fit.method;
        EXPECT_LE(fit.runs.size(), 200u) << method;
        EXPECT_NEAR(fit.parameters[0].value / true_earlywood, 1, 0.01) << method;
        EXPECT_NEAR(fit.parameters[1].value / true_latewood, 1, 0.01) << method;
    }
}

TEST(SystemFit, FailedRunsOfEveryKindAreRecordedAndTheFitGoesOn) {
    const FakeWedge wedge;
    const Study study = wedge_study(wedge, 0.02, 1e-4);
    FitOptions options = with(wedge, 2);
    options.forward = [wedge](const Scene& scene, const std::atomic<bool>*) {
        Record record = wedge(scene);
        const double draw = scramble(scene.materials.at("EW").toughness, scene.materials.at("LW").toughness);
        if (draw < 0.05) {
            throw InputError("scene", "key", "value", "rule broken");
        }
        if (draw < 0.1) {
            record.status = RunStatus::unstable;
            record.message = "blew up";
        } else if (draw < 0.15) {
            record.series[100].force = std::nan("");
        } else if (draw < 0.2) {
            record.series.clear();
        }
        return record;
    };
    const Fit fit = fit_study(study, options);
    EXPECT_EQ(fit.status, FitStatus::converged);
    EXPECT_NEAR(fit.parameters[0].value / true_earlywood, 1, 0.03);
    EXPECT_NEAR(fit.parameters[1].value / true_latewood, 1, 0.03);
    int failed = 0;
    for (const FitRun& run : fit.runs) {
        EXPECT_EQ(std::isinf(run.misfit), run.status != "finished") << run.status;
        failed += std::isinf(run.misfit) ? 1 : 0;
    }
    EXPECT_GT(failed, 2);
}

TEST(SystemFit, SaysSoWhenNoRunEndsWell) {
    const FakeWedge wedge;
    const Study study = wedge_study(wedge);
    FitOptions options = with(wedge);
    options.forward = [](const Scene&, const std::atomic<bool>*) -> Record { throw std::runtime_error("no luck"); };
    const Fit fit = fit_study(study, options);
    EXPECT_EQ(fit.status, FitStatus::failed);
    EXPECT_NE(fit.message.find("no luck"), std::string::npos);
    EXPECT_GT(fit.runs.size(), 0u);
    EXPECT_TRUE(std::isinf(fit.misfit));
    EXPECT_EQ(fit.parameters[0].lower_95, 20);
    EXPECT_EQ(fit.parameters[0].upper_95, 400);
}

TEST(SystemFit, KeepsToTheRunLimit) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    for (const int limit : {1, 2, 5, 9, 13}) {
        study.optimizer.max_runs = limit;
        const Fit fit = fit_study(study, with(wedge, 3));
        EXPECT_EQ(fit.status, FitStatus::run_limit);
        EXPECT_LE(fit.runs.size(), static_cast<std::size_t>(limit));
        EXPECT_TRUE(std::isfinite(fit.misfit));
        EXPECT_TRUE(fit.covariance.allFinite());
    }
}

// A misfit far above the noise may be a basin: that further starts ended with their runs is no end.
TEST(SystemFit, StartsCutShortAreNoEndWhereNoiseDoesNotExplain) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    FakeWedge other = wedge;
    other.ring *= 1.3;  // no values explain that
    study.optimizer.max_runs = 60;
    const Fit cut = fit_study(study, with(other));
    study.optimizer.max_runs = 2000;
    const Fit whole = fit_study(study, with(other));
    std::printf("wrong rings: reduced chi-square %.0f after %zu runs: %s\n%.0f after %zu: %s\n", cut.reduced_chi_square,
                cut.runs.size(), cut.method.c_str(), whole.reduced_chi_square, whole.runs.size(), whole.method.c_str());
    EXPECT_EQ(cut.status, FitStatus::run_limit);
    EXPECT_EQ(whole.status, FitStatus::converged);
}

TEST(SystemFit, AnInterruptEndsItWithWhatItHas) {
    const FakeWedge wedge;
    for (const char* method : {"auto", "ceres", "bobyqa", "crs2"}) {
        Study study = wedge_study(wedge, 0.02, 1e-4);
        study.optimizer.method = method;
        std::atomic<bool> stop{false};
        std::atomic<int> runs{0};
        FitOptions options = with(wedge, 2);
        options.stop_requested = &stop;
        options.forward = [&](const Scene& scene, const std::atomic<bool>* flag) {
            EXPECT_EQ(flag, &stop);
            Record record = wedge(scene);
            if (++runs >= 8) {
                stop = true;
                record.status = RunStatus::interrupted;
            }
            return record;
        };
        const Fit fit = fit_study(study, options);
        EXPECT_EQ(fit.status, FitStatus::interrupted) << method;
        EXPECT_LE(runs, 9) << method;  // one more may have been under way on the other thread
        EXPECT_TRUE(std::isfinite(fit.misfit)) << method;
    }
}

TEST(SystemFit, PriorsPullAsTheirWidthSays) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    const Fit free = fit_study(study, with(wedge));
    study.parameters[1].prior = Prior{160, 0.05};
    const Fit bound = fit_study(study, with(wedge));
    EXPECT_NEAR(free.parameters[1].value, true_latewood, 3);
    EXPECT_NEAR(bound.parameters[1].value, 160, 1);
    study.parameters[1].prior = Prior{160, 1e6};
    const Fit loose = fit_study(study, with(wedge));
    EXPECT_NEAR(loose.parameters[1].value, free.parameters[1].value, 0.5 * free.parameters[1].standard_error);
}

TEST(SystemFit, FlagsAParameterAtItsBound) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4);
    study.parameters[1].upper = 150;
    study.parameters[1].initial = 100;
    for (const char* method : {"auto", "ceres"}) {
        study.optimizer.method = method;
        const Fit fit = fit_study(study, with(wedge));
        EXPECT_TRUE(fit.parameters[1].at_bound) << method;
        EXPECT_FALSE(fit.parameters[0].at_bound) << method;
        EXPECT_NEAR(fit.parameters[1].value, 150, 0.1) << method;
        EXPECT_LE(fit.parameters[1].upper_95, 150) << method;
        EXPECT_NE(fit.message.find("'LW toughness' stands at its upper bound"), std::string::npos) << fit.message;
    }
}

// A bar under tension, F = E w t u / L, of 350 MPa, whose data are the model's and noise.
struct BarTest {
    double information = 0;    // of the data on E [1/MPa^2]
    double least_squares = 0;  // E by the data alone [MPa]

    Study study() const { return study_; }

    BarTest() {
        Experiment experiment;
        experiment.name = "bar";
        experiment.scene = bar_scene();
        std::mt19937 generator(1);
        std::normal_distribution<double> normal(0.0, 2.0);
        double sum = 0;
        for (int i = 1; i <= 40; ++i) {
            const double u = 0.1e-3 * i / 40, slope = 5e-3 * 1e6 * u;  // N/MPa
            experiment.data.displacement.push_back(u);
            experiment.data.force.push_back(350 * slope + normal(generator));
            information += std::pow(slope / 2.0, 2);
            sum += slope * experiment.data.force.back() / 4.0;
        }
        least_squares = sum / information;
        experiment.noise.force = 2.0;
        study_.experiments = {experiment};
        study_.parameters = {bar_modulus()};
    }

  private:
    Study study_;
};

// Nothing is left for the model not to know, by no
// method, nor for those who drive the study themselves.
TEST(SystemFit, AllMethodsWeighByTheNoiseThatExplainsTheData) {
    const BarTest bar;
    Study study = bar.study();
    const double information = bar.information;
    FitOptions options;
    options.threads = 1;
    FitProgress last_told;
    options.progress = [&](const FitProgress& progress) { last_told = progress; };
    for (const char* method : {"auto", "ceres", "bobyqa", "sbplx"}) {
        study.optimizer.method = method;
        const Fit fit = fit_study(study, options);
        EXPECT_EQ(last_told.best_misfit, fit.misfit) << method;  // not that of another weighing
        EXPECT_EQ(fit.status, FitStatus::converged) << method;
        EXPECT_NEAR(fit.residuals.back().sigma, 2.0, 1e-9) << method;
        const double widened = std::sqrt(std::max(1.0, fit.reduced_chi_square));
        EXPECT_NEAR(fit.parameters[0].standard_error * std::sqrt(information) / widened, 1, 0.02) << method;
        EXPECT_NEAR(fit.parameters[0].value, bar.least_squares, 0.05 / std::sqrt(information)) << method;
    }
    study.optimizer.method = "auto";
    for (const double initial : {110e6, 340e6, 880e6}) {
        study.parameters[0].initial = initial;
        EXPECT_NEAR(fit_study(study, options).parameters[0].value, bar.least_squares, 0.05 / std::sqrt(information));
    }
    const Evaluation there = fit_function(study)(Eigen::VectorXd::Constant(1, 380e6), 1);
    ASSERT_TRUE(there.usable());
    const double last = study.experiments[0].data.force.back();
    EXPECT_NEAR(there.residuals.tail(1)[0], (5e-3 * 380e6 * 0.1e-3 - last) / 2.0, 1e-6);
}

// Where little fits, the model seems to know little, by which that is good enough. A crack that jumps between two rows makes such
// places beside the lowest point: from far off a fit ends where one that starts at the truth does.
TEST(SystemFit, WhereAFitStartsDoesNotTellHowWellTheModelKnows) {
    Scene scene = bar_scene();
    scene.model.plane = PlaneCondition::strain;
    scene.model.cell = 1e-3;
    scene.specimen.size = {10e-3, 10e-3};
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{{-20e-3, 5e-3}, 4e-3, 0.5, 0.0};
    scene.materials["EW"] = {40e6, 0.33, 300, 100};
    scene.materials["LW"] = {400e6, 0.33, 760, 200};
    scene.edges[0].name = "up";
    scene.edges[1].name = "down";
    scene.edges[0].side = scene.edges[1].side = Side::left;
    scene.edges[0].range = {5e-3, 10e-3};
    scene.edges[1].range = {0.0, 5e-3};
    scene.edges[0].velocity[0].reset();
    Crack& crack = scene.cracks.emplace_back();
    crack.points = {{0, 5e-3}, {2.5e-3, 5e-3}};
    crack.grows = Growth::end;
    crack.advance = 1e-3;
    crack.direction = GrowthDirection::straight;
    scene.measure = {"up", "up"};
    scene.stop.displacement = 2e-3;
    scene.stop.crack_length = 7e-3;
    const Record record = simulate(scene);
    Study study;
    Experiment& test = study.experiments.emplace_back();
    test.name = "block";
    test.scene = scene;
    test.noise.force = 0.1;
    test.noise.crack_length = 0.05e-3;
    study.parameters = {toughness_parameter("EW", 80), toughness_parameter("LW", 150)};
    for (const unsigned seed : {1u, 2u, 3u}) {
        std::mt19937 generator(seed);
        std::normal_distribution<double> normal;
        test.data = {};
        for (std::size_t i = 0; i < record.series.size(); i += 3) {
            const Instant& row = record.series[i];
            test.data.displacement.push_back(row.displacement);
            test.data.force.push_back(row.force + 0.1 * normal(generator));
            test.data.crack_length.push_back(row.crack_length + 0.05e-3 * normal(generator));
        }
        std::vector<Fit> fits;
        for (const auto& [earlywood, latewood] : {std::pair{80.0, 150.0}, {100.0, 200.0}}) {
            study.parameters[0].initial = earlywood;
            study.parameters[1].initial = latewood;
            fits.push_back(fit_study(study));
            for (const int k : {0, 1}) {
                const FittedParameter &is = fits.back().parameters[k], &first = fits[0].parameters[k];
                EXPECT_NEAR(is.value, first.value, 0.3 * first.standard_error) << seed << ": " << fits.back().message;
                EXPECT_NEAR(is.standard_error / first.standard_error, 1, 0.2) << seed << ": " << fits.back().message;
            }
        }
    }
}

// Cells twice as wide give a bar the same force: the likelihood that they come to is that of the least squares.
TEST(SystemFit, WideCellsTellHowLikelyTheDataAreWhereModelsAreCompared) {
    const BarTest bar;
    const Study study = bar.study();
    double told = 0.0, told_here = 0.0, squares = 0.0;
    FitOptions options;
    options.threads = 1;
    options.tell_wide_deviance = [&](double wide, double here) {
        told = wide;
        told_here = here;
    };
    fit_study(study, options);
    const Curves& data = study.experiments[0].data;
    for (std::size_t i = 0; i < data.force.size(); ++i) {
        squares += std::pow((data.force[i] - bar.least_squares * 5e3 * data.displacement[i]) / 2.0, 2);
    }
    EXPECT_NEAR(told, squares + 39 * 2 * std::log(2.0), 0.01);  // of 40 rows one is the fit's
    EXPECT_NEAR(told_here, told, 0.01);
}

// The crack parts the specimen between two of the last rows: that tells toughness / E to 3 %, and beyond, to either side, the
// misfit is flat.
TEST(SystemFit, AToughnessThatOneJumpTellsIsFoundFromFarOff) {
    Scene scene = bar_scene();
    scene.model.cell = 0.5e-3;
    scene.specimen.size = {10e-3, 10e-3};
    scene.model.plane = PlaneCondition::strain;
    scene.materials["EW"] = {40e6, 0.33, 300, 100};
    Crack& crack = scene.cracks.emplace_back();
    crack.points = {{10e-3, 5e-3}, {7.5e-3, 5e-3}};
    crack.grows = Growth::end;
    crack.advance = 1e-3;
    crack.direction = GrowthDirection::straight;
    scene.solver.strain = StrainMeasure::small;
    scene.stop.displacement = 2e-3;
    const Record record = simulate(scene);
    const auto peak = std::ranges::max_element(record.series, {}, &Instant::force);
    Study study;
    Experiment& test = study.experiments.emplace_back();
    test.name = "parted";
    test.scene = scene;
    test.noise.force = 1.0;
    std::mt19937 generator(1);
    std::normal_distribution<double> normal;
    for (int i = 1; i <= 30; ++i) {
        const double part = i / 28.15;  // of the displacement at the peak; that at the end is 2 % more
        test.data.displacement.push_back(part * peak->displacement);
        test.data.force.push_back((part < 1 ? part * peak->force : 0.0) + normal(generator));
    }
    EXPECT_GT(29 / 28.15 * peak->displacement, record.series.back().displacement);
    study.parameters = {toughness_parameter("EW", 80), bar_modulus()};
    study.parameters[1].initial = 30e6, study.parameters[1].lower = 10e6, study.parameters[1].upper = 100e6;
    study.parameters[1].scale = Scale::logarithmic;
    for (const double initial : {30.0, 80.0, 250.0}) {
        study.parameters[0].initial = initial;
        const Fit fit = fit_study(study);
        const FittedParameter& toughness = fit.parameters[0];
        EXPECT_EQ(fit.status, FitStatus::converged) << fit.message;
        EXPECT_NEAR(toughness.value, 100, 4) << initial;
        EXPECT_LT(toughness.lower_95, 100) << initial;
        EXPECT_GT(toughness.upper_95, 100) << initial;
        EXPECT_LT(toughness.upper_95 - toughness.lower_95, 15) << initial;
        EXPECT_NEAR(fit.parameters[1].value, 40, 0.6) << initial;
    }
}

// What data and prior say together is their weighted mean, however far apart they are: the prior tells nothing of what the model
// knows, and is no lack of fit, which would weaken the data in the posterior. The interval holds the fit.
TEST(SystemFit, APriorAgainstTheDataIsNoErrorOfTheModel) {
    const BarTest bar;
    const double error = 1 / std::sqrt(bar.information);
    for (const char* method : {"auto", "bobyqa"}) {
        Study study = bar.study();
        study.optimizer.method = method;
        study.uncertainty = {.profile = true, .posterior = 1500};
        study.parameters[0].prior = Prior{(bar.least_squares + 10 * error) * 1e6, 0.5 * error * 1e6};
        FitOptions options;
        options.threads = 1;
        const Fit fit = fit_study(study, options);
        EXPECT_EQ(fit.status, FitStatus::converged) << method;
        const FittedParameter& E = fit.parameters[0];
        EXPECT_NEAR((E.value - bar.least_squares) / error, 8, 0.1) << method;
        EXPECT_NE(fit.message.find("contradict each other"), std::string::npos) << fit.message;
        EXPECT_GT(E.lower_95, E.value - 20 * E.standard_error) << method;
        EXPECT_LT(E.upper_95, E.value + 20 * E.standard_error) << method;
        double mean = 0, squares = 0;
        for (const PosteriorSample& sample : fit.posterior) {
            mean += sample.parameters[0] / 1500;
            squares += std::pow(sample.parameters[0], 2) / 1500;
        }
        // The weights are 1 of the data and 4 of the prior; some 200 of the samples are independent.
        EXPECT_NEAR((mean - bar.least_squares) / error, 8, 0.1) << method;
        EXPECT_NEAR(std::sqrt(squares - mean * mean) / error, 1 / std::sqrt(5.0), 0.05) << method;
    }
}

TEST(SystemFit, WeightsAndSeveralExperimentsAddUp) {
    const FakeWedge wedge;
    Study study = wedge_study(wedge, 0.02, 1e-4, 5);
    const Fit once = fit_study(study, with(wedge));
    study.experiments.push_back(study.experiments[0]);
    const Fit twice = fit_study(study, with(wedge));
    study.experiments.pop_back();
    study.experiments[0].weight = 2;
    const Fit heavy = fit_study(study, with(wedge));
    EXPECT_EQ(twice.residuals.size(), 2 * once.residuals.size());
    EXPECT_NEAR(heavy.misfit / twice.misfit, 1, 1e-3);
    EXPECT_NEAR(heavy.misfit / once.misfit, 2, 1e-2);
    EXPECT_NEAR(heavy.parameters[0].value, twice.parameters[0].value, 1e-3 * heavy.parameters[0].value);
}

void expect_refused(const std::function<void(Study&)>& spoil, const std::string& key) {
    Study study = wedge_study(FakeWedge{});
    study.file = "study.toml";
    spoil(study);
    bool ran = false;
    FitOptions options;
    options.forward = [&](const Scene& scene, const std::atomic<bool>*) {
        ran = true;
        return FakeWedge{}(scene);
    };
    try {
        fit_study(study, options);
        FAIL() << key << " accepted";
    } catch (const InputError& error) {
        EXPECT_EQ(error.key, key);
        EXPECT_EQ(error.file, "study.toml");
    }
    EXPECT_FALSE(ran);
}

TEST(UnitFit, RefusesStudiesThatCannotBeFitted) {
    expect_refused([](Study& s) { s.experiments.clear(); }, "experiments");
    expect_refused([](Study& s) { s.parameters.clear(); }, "parameters");
    expect_refused([](Study& s) { s.parameters[1].keys.clear(); }, "parameters.1.key");
    expect_refused([](Study& s) { s.parameters[1].upper = s.parameters[1].lower; }, "parameters.1.upper");
    expect_refused([](Study& s) { s.parameters[0].initial = 500; }, "parameters.0.initial");
    expect_refused([](Study& s) { s.parameters[0].lower = 0; }, "parameters.0.lower");
    expect_refused([](Study& s) { s.parameters[0].prior = Prior{100, 0}; }, "parameters.0.prior.sd");
    expect_refused([](Study& s) { s.experiments[0].weight = 0; }, "experiments.0.weight");
    expect_refused([](Study& s) { s.experiments[0].noise.force = 0.0; }, "experiments.0.noise.force");
    expect_refused([](Study& s) { s.optimizer.method = "newuoa"; }, "optimizer.method");
    expect_refused([](Study& s) { s.optimizer.starts = 0; }, "optimizer.starts");
    expect_refused([](Study& s) { s.optimizer.max_runs = 0; }, "optimizer.max_runs");
    expect_refused([](Study& s) { s.uncertainty.posterior = -1; }, "uncertainty.posterior");
    expect_refused(
        [](Study& s) {
            s.experiments[0].data.crack_length.clear();
            for (std::size_t i = 1; i + 1 < s.experiments[0].data.force.size(); ++i) {
                s.experiments[0].data.force[i] = std::nan("");
            }
            s.parameters.push_back(s.parameters[0]);
        },
        "parameters");
}

TEST(UnitFit, RefusesAKeyThatNoSceneHas) {
    Study study = wedge_study(FakeWedge{});
    study.parameters[0].keys = {"materials.bark.toughness"};
    EXPECT_THROW(fit_study(study, with(FakeWedge{})), InputError);
}

TEST(UnitFit, RefusesOptionsOutOfRange) {
    FitOptions options = with(FakeWedge{});
    options.threads = -1;
    try {
        fit_study(wedge_study(FakeWedge{}), options);
        FAIL() << "accepted";
    } catch (const InputError& error) {
        EXPECT_EQ(error.key, "threads");
    }
}

}  // namespace
}  // namespace crampfit::testing

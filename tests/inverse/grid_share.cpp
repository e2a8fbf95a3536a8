#include "inverse/grid_share.hpp"
#include "inverse/differences.hpp"
#include "tests/inverse/fake_wedge.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace crampfit::testing {
namespace {

// What the grid is to be told of; curves are those of the fake wedge.
Scene walked(bool extrapolates) {
    Scene scene;
    scene.model = {.plane = PlaneCondition::strain, .thickness = 10e-3, .cell = 0.2e-3};
    scene.specimen.size = {10e-3, 8e-3};
    scene.specimen.material = "EW";
    scene.materials["EW"] = {400e6, 0.33, 300, 100};
    scene.materials["LW"] = {4000e6, 0.33, 750, 100};
    scene.edges = {{"top", Side::top, {}, {0.0, 1e-5}, {}, {}}, {"bottom", Side::bottom, {}, {0.0, 0.0}, {}, {}}};
    Crack crack;
    crack.points = {Vec2(0, 4e-3), Vec2(2e-3, 4e-3)};
    crack.grows = Growth::end;
    crack.advance = 0.4e-3;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.stop.displacement = 0.5e-3;
    scene.solver.extrapolate = extrapolates;
    return scene;
}

// Where cells twice as wide answer at the best point as this grid does so far off, their fit lies as far off on the other side,
// and as much is left on this one: of a plain grid all of it, of two that have been extrapolated three quarters.
TEST(UnitGridShare, IsWhatAFitOnWideCellsIsOffBy) {
    const Eigen::Vector2d off(-0.01, 0.004);
    for (const bool extrapolates : {false, true}) {
        Study study = wedge_study(FakeWedge{.sharpness = 1.0});
        study.experiments[0].scene = walked(extrapolates);
        const StudyModel model(
            study, [](const Scene& scene, const std::atomic<bool>*) { return FakeWedge{.sharpness = 1.0}(scene); }, 0.0, nullptr);
        Objective objective(
            2, [&](const Eigen::VectorXd& x, int threads) { return model.evaluate(x, threads); }, 1000, 1);
        const double width = std::log(400.0 / 20.0);
        objective.at(Eigen::Vector2d(std::log(true_earlywood / 20) / width, std::log(true_latewood / 20) / width));
        const crampfit::Run best = *objective.best();
        const Uncertainty about = estimate_uncertainty(objective, model.curves(), {"EW", "LW"}, difference_step, Window(2));
        ASSERT_EQ(about.best.x, best.x);
        Evaluation wide = *best.evaluation;
        const auto stations = model.residuals(wide);
        const Eigen::VectorXd change = about.slope * off;
        for (Eigen::Index i = 0; i < change.size(); ++i) {
            wide.modelled[i] += stations[static_cast<std::size_t>(i)].sigma * change[i];
        }
        const Eigen::VectorXd left = left_by_grid(study, model, best, wide, about);
        const double share = extrapolates ? 0.75 : 1.0;
        std::printf("left %.6f %.6f of %.6f %.6f\n", left[0], left[1], off[0], off[1]);
        EXPECT_NEAR(left[0], share * off[0], 1e-8);
        EXPECT_NEAR(left[1], share * off[1], 1e-8);
        study.parameters[0].keys = {"materials.EW.E"};  // of a modulus, on one grid, by the first power of the cell
        const StudyModel of_modulus(study, with(FakeWedge{.sharpness = 1.0}).forward, 0.0, nullptr);
        EXPECT_NEAR(left_by_grid(study, of_modulus, best, wide, about)[0], (extrapolates ? 0.75 : 3.0) * off[0], 1e-8);
    }
}

TEST(UnitGridShare, WidensIntervalsToEitherSideAndTheCovariance) {
    const UnitBox box(wedge_study(FakeWedge{}).parameters);
    const Eigen::Vector2d x(0.5, 0.4), left(0.01, -0.02);
    Fit fit;
    for (int j = 0; j < 2; ++j) {
        fit.parameters.push_back({.name = "",
                                  .key = "",
                                  .value = box.value(j, x[j]),
                                  .unit = "",
                                  .lower_95 = box.value(j, x[j] - 0.1),
                                  .upper_95 = box.value(j, x[j] + 0.1)});
    }
    fit.covariance = Eigen::Vector2d(4, 9).asDiagonal();
    take_in_grid(fit, box, x, left);
    EXPECT_NEAR(fit.parameters[0].lower_95, box.value(0, 0.39), 1e-9);
    EXPECT_NEAR(fit.parameters[0].upper_95, box.value(0, 0.61), 1e-9);
    EXPECT_NEAR(fit.parameters[1].lower_95, box.value(1, 0.28), 1e-9);
    EXPECT_NEAR(fit.parameters[1].upper_95, box.value(1, 0.52), 1e-9);
    // Evenly between 0 and d: the mean square is d^2 / 3, and of two that go together d e / 3.
    const double d = 0.01 * box.slope(0, 0.5), e = -0.02 * box.slope(1, 0.4);
    EXPECT_NEAR(fit.covariance(0, 0), 4 + d * d / 3, 1e-9);
    EXPECT_NEAR(fit.covariance(1, 1), 9 + e * e / 3, 1e-9);
    EXPECT_NEAR(fit.covariance(0, 1), d * e / 3, 1e-9);
    EXPECT_NEAR(fit.parameters[1].standard_error, std::sqrt(9 + e * e / 3), 1e-9);
    EXPECT_NEAR(fit.correlation(0, 1), fit.covariance(0, 1) / std::sqrt(fit.covariance(0, 0) * fit.covariance(1, 1)), 1e-12);
    EXPECT_NE(fit.message.find("the grid leaves"), std::string::npos);
    // By more than a tenth of a value: no slope tells that, and a tenth to either side is the least. At twice a tenth so it is
    // for all, d/3 for each as above and none together; as that is passed nothing jumps.
    const Fit before = fit;
    const auto share_of_tenth = [&](int j) { return 0.1 * box.value(j, x[j]) / box.slope(j, x[j]); };
    const auto off_by = [&](double tenths) { return box.share(1, (1.0 - 0.1 * tenths) * box.value(1, x[1])) - x[1]; };
    double last = 0.01;
    for (const double tenths : {0.999, 1.001, 1.5, 1.999, 2.001, 5.0}) {
        fit = before;
        take_in_grid(fit, box, x, Eigen::Vector2d(0.01, off_by(tenths)));
        const double trust = std::clamp(2.0 - tenths, 0.0, 1.0);
        const double shares[2] = {std::lerp(share_of_tenth(0), 0.01, trust),
                                  std::lerp(share_of_tenth(1), std::min(-off_by(tenths), share_of_tenth(1)), trust)};
        for (int j = 0; j < 2; ++j) {
            const FittedParameter &was = before.parameters[j], &is = fit.parameters[j];
            EXPECT_NEAR(is.lower_95, box.value(j, box.share(j, was.lower_95) - shares[j]), 1e-9);
            EXPECT_NEAR(is.upper_95, box.value(j, box.share(j, was.upper_95) + shares[j]), 1e-9);
            const double own = shares[j] * box.slope(j, x[j]);
            EXPECT_NEAR(fit.covariance(j, j), before.covariance(j, j) + own * own / 3, 1e-9);
        }
        const double both = -trust * shares[0] * box.slope(0, x[0]) * shares[1] * box.slope(1, x[1]) / 3;
        EXPECT_NEAR(fit.covariance(0, 1), before.covariance(0, 1) + both, 1e-9);
        EXPECT_EQ(fit.message.find("cannot be told") != std::string::npos, tenths > 1.0);
        EXPECT_GE(shares[0], last);
        last = shares[0];
    }
    // Of one that data tell nothing of no shift is asked: the other's interval goes on by its own.
    fit = before;
    fit.parameters[1].lower_95 = box.value(1, 0);
    fit.parameters[1].upper_95 = box.value(1, 1);
    take_in_grid(fit, box, x, Eigen::Vector2d(0.01, -0.06));
    EXPECT_NEAR(fit.parameters[0].upper_95, box.value(0, 0.62), 1e-9);
    EXPECT_NEAR(fit.parameters[0].lower_95, box.value(0, 0.38), 1e-9);
    EXPECT_EQ(fit.message.find("cannot be told"), std::string::npos);
    // Two grids that agree leave 1 % of a toughness, and of nothing else.
    fit = before;
    take_in_grid(fit, box, x, Eigen::Vector2d::Zero());
    EXPECT_NEAR(fit.parameters[0].upper_95, before.parameters[0].upper_95 * std::exp(0.01), 1e-9);
    Study moduli = wedge_study(FakeWedge{});
    for (Parameter& parameter : moduli.parameters) parameter.keys = {"materials.EW.E"};
    fit = before;
    take_in_grid(fit, UnitBox(moduli.parameters), x, Eigen::Vector2d::Zero());
    EXPECT_NEAR(fit.parameters[0].upper_95, before.parameters[0].upper_95, 1e-9);
}

// A slack of 0 in a box of 100 um: a shift of 4 um is small beside half of that, one of 6 um is not; neither is a part of 0.
TEST(UnitGridShare, TellsShiftsOfParametersNearZeroInTheirUnit) {
    Parameter slack;
    slack.name = "slack";
    slack.lower = -50e-6;
    slack.upper = 50e-6;
    slack.unit = "um";
    slack.unit_factor = 1e-6;
    const UnitBox box({slack});
    const auto fit_after = [&](double shift) {
        Fit fit;
        fit.parameters.push_back({.name = "slack", .key = "", .value = 0, .unit = "um", .lower_95 = -1, .upper_95 = 1});
        fit.covariance = Eigen::MatrixXd::Identity(1, 1);
        take_in_grid(fit, box, Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Constant(1, shift / 100e-6));
        return fit;
    };
    const Fit told = fit_after(4e-6), untold = fit_after(6e-6);
    EXPECT_NEAR(told.parameters[0].lower_95, -5, 1e-9);
    EXPECT_NEAR(told.parameters[0].upper_95, 5, 1e-9);
    EXPECT_NEAR(told.covariance(0, 0), 1 + 16.0 / 3, 1e-9);
    EXPECT_NE(told.message.find("'slack' +4 um."), std::string::npos) << told.message;
    EXPECT_NEAR(untold.parameters[0].lower_95, -6, 1e-9);  // a tenth of half the box to either side
    EXPECT_NEAR(untold.parameters[0].upper_95, 6, 1e-9);
    EXPECT_NE(untold.message.find("cannot be told"), std::string::npos);
}

}  // namespace
}  // namespace crampfit::testing

#include "inverse/residuals.hpp"
#include "datasets/error.hpp"
#include "tests/inverse/fake_wedge.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace crampfit::testing {
namespace {

// A record whose force and crack length are straight in the displacement.
Record straight(double force_slope, double crack_speed, double last, int rows = 400) {
    Record record;
    for (int i = 0; i < rows; ++i) {
        Instant instant;
        instant.displacement = last * i / (rows - 1);
        instant.time = 2 * instant.displacement;
        instant.force = force_slope * instant.displacement;
        instant.crack_length = 2e-3 + crack_speed * instant.displacement;
        record.series.push_back(instant);
    }
    return record;
}

// The record with each row so many times.
Record with_each_row(Record record, int times) {
    std::vector<Instant> series;
    for (const Instant& row : record.series) {
        series.insert(series.end(), static_cast<std::size_t>(times), row);
    }
    record.series = series;
    return record;
}

Experiment straight_experiment() {
    Experiment experiment;
    experiment.name = "test";
    experiment.data = measure(straight(1e5, 8, 1e-3), 0, 0, 1);
    experiment.noise = {.force = 2.0, .crack_length = 0.2e-3, .displacement = {}, .time = {}};
    return experiment;
}

std::vector<FitResidual> of_kind(const Comparison& comparison, const std::string& kind) {
    std::vector<FitResidual> result;
    for (const FitResidual& station : comparison.stations()) {
        if (station.kind == kind) {
            result.push_back(station);
        }
    }
    return result;
}

TEST(UnitResiduals, VanishWhereModelAndDataAreTheSameCurve) {
    const FakeWedge wedge;
    const Study study = wedge_study(wedge);
    const Comparison comparison(study.experiments[0]);
    ASSERT_GT(comparison.stations().size(), 60u);
    const Eigen::VectorXd modelled = comparison.modelled(wedge(true_earlywood, true_latewood));
    for (std::size_t i = 0; i < comparison.stations().size(); ++i) {
        const FitResidual& station = comparison.stations()[i];
        EXPECT_NEAR(modelled[static_cast<Eigen::Index>(i)], station.measured, 1e-12 * std::abs(station.measured));
    }
}

TEST(UnitResiduals, ForceStationsTileTheRangeAndAverageTheirRows) {
    const Comparison comparison(straight_experiment());
    const auto force = of_kind(comparison, "force");
    ASSERT_EQ(force.size(), 50u);
    for (const FitResidual& station : force) {
        EXPECT_NEAR(station.measured, 1e5 * station.at, 1e-9);
        EXPECT_NEAR(station.sigma, 2.0 / std::sqrt(8.0), 0.05);  // 400 rows in 50 windows; a window may have one more
    }
}

TEST(UnitResiduals, ArrivalSigmaIsTheNoiseOverTheSlope) {
    const Comparison comparison(straight_experiment());
    const auto arrivals = of_kind(comparison, "arrival");
    ASSERT_GE(arrivals.size(), 16u);  // 8 mm of growth, a station at least every 0.5 mm
    ASSERT_LE(arrivals.size(), 32u);  // and at most every 0.25 mm
    for (const FitResidual& station : arrivals) {
        EXPECT_NEAR(station.measured, (station.at - 2e-3) / 8, 1e-9);
        EXPECT_NEAR(station.sigma, 0.2e-3 / std::sqrt(8.0) / 8, 0.07 * station.sigma);
    }
}

TEST(UnitResiduals, OneRowAloneIsToldAndSpeaksForItsWindowOnly) {
    Experiment experiment = straight_experiment();
    const Comparison before(experiment);
    experiment.data.force[200] = 9999;
    Comparison with(experiment);
    const auto told = [](const Comparison& comparison) {
        return std::ranges::any_of(comparison.remarks(),
                                   [](const std::string& remark) { return remark.find("one row alone") != std::string::npos; });
    };
    EXPECT_FALSE(told(before));
    EXPECT_TRUE(told(with));
    with.know_to(0.002);
    Comparison without(straight_experiment());
    without.know_to(0.002);
    int others = 0;
    for (std::size_t i = 0; i < without.stations().size(); ++i) {
        others += std::abs(with.stations()[i].sigma / without.stations()[i].sigma - 1) > 1e-9;
    }
    EXPECT_LE(others, 2);
}

TEST(UnitResiduals, AJumpIsTimedToTheRowsAroundIt) {
    Experiment experiment = straight_experiment();
    experiment.noise.crack_length = 1e-9;
    for (std::size_t i = 0; i < experiment.data.crack_length.size(); ++i) {
        experiment.data.crack_length[i] = i < 200 ? 2e-3 : 6e-3;
    }
    const auto arrivals = of_kind(Comparison(experiment), "arrival");
    ASSERT_GT(arrivals.size(), 8u);
    for (const FitResidual& station : arrivals) {
        EXPECT_GE(station.sigma, 0.999 * 1e-3 / 399);
    }
}

TEST(UnitResiduals, AJumpWithinOneDisplacementIsNoBetterTimedByFewRows) {
    // As crampfit's own series have it: the row before the jump and the one behind it stand at the same displacement.
    const auto arrivals = [](int rows, double jump) {
        Experiment experiment = straight_experiment();
        experiment.data = measure(straight(1e5, 0, 1e-3, rows), 0, 0, 1);
        Curves& data = experiment.data;
        const auto middle = static_cast<std::ptrdiff_t>(rows / 2);
        for (std::vector<double>* column : {&data.time, &data.displacement, &data.force, &data.crack_length}) {
            if (!column->empty()) column->insert(column->begin() + middle, (*column)[static_cast<std::size_t>(middle)]);
        }
        for (std::size_t i = 0; i < data.crack_length.size(); ++i) {
            data.crack_length[i] = 2e-3 + (i <= static_cast<std::size_t>(middle) ? 0.0 : jump);
        }
        return of_kind(Comparison(experiment), "arrival");
    };
    for (const double jump : {4e-3, 0.7e-3}) {  // 20 and 3.5 times the noise
        const auto few = arrivals(41, jump), many = arrivals(401, jump);
        ASSERT_GE(few.size(), 1u);
        ASSERT_EQ(few.size(), many.size());
        for (std::size_t i = 0; i < few.size(); ++i) {
            EXPECT_NEAR(few[i].measured, 0.5e-3, 1e-8);
            EXPECT_GE(few[i].sigma, many[i].sigma);
            EXPECT_LT(few[i].sigma, std::sqrt(few.size()) * 0.02e-3);  // a window, for all together
        }
    }
}

// A jump within a gap of the rows was anywhere in it: by noise the rows behind seem to come up to a length there, and to know
// when.
TEST(UnitResiduals, AJumpWithinAGapIsNoBetterTimedByTheRowsBehind) {
    constexpr double noise = 0.1e-3, gap_begin = 0.34e-3, gap_end = 0.465e-3;
    const auto length = [](double u) { return u < gap_begin + 5e-6 ? 2.5e-3 + 3 * u : 6e-3 + 0.5 * u; };
    double worst = 0;
    int stations = 0;
    for (unsigned seed = 0; seed < 50; ++seed) {
        Record record;
        for (int i = 0; i < 61; ++i) {
            Instant row;
            row.displacement = 0.6e-3 * i / 60;
            row.crack_length = length(row.displacement);
            if (row.displacement < gap_begin || row.displacement > gap_end) record.series.push_back(row);
        }
        Experiment experiment = straight_experiment();
        experiment.data = measure(record, 1, noise, seed);
        experiment.data.force.clear();
        experiment.noise.crack_length = noise;
        for (const FitResidual& station : of_kind(Comparison(experiment), "arrival")) {
            if (station.at > 3.8e-3 && station.at < 6e-3 + 0.5 * gap_begin) {  // reached by the jump
                worst = std::max(worst, std::abs(station.measured - gap_begin - 5e-6) / station.sigma);
                ++stations;
            }
        }
    }
    std::printf("a jump within a gap: %d arrivals of 50 draws, at most %.2f sigma off\n", stations, worst);
    EXPECT_GT(stations, 400);
    EXPECT_LT(worst, 3.5);
}

TEST(UnitResiduals, SteadyGrowthOverFewRowsIsTimedByItsNoise) {
    // Arrivals of rows with noise, about those without: about as large as their sigma says, each on its own.
    constexpr int draws = 400;
    Experiment experiment = straight_experiment();
    experiment.noise.crack_length = 0.02e-3;
    for (const int rows_at_one_place : {1, 2, 4}) {
        const Record truth = with_each_row(straight(1e5, 8, 1e-3, 41), rows_at_one_place);
        double squares = 0, neighbours = 0, count = 0, sigmas = 0;
        for (int draw = 0; draw < draws; ++draw) {
            experiment.data = measure(truth, 0, 0.02e-3, static_cast<unsigned>(draw + 1));
            const Comparison comparison(experiment);
            const Eigen::VectorXd modelled = comparison.modelled(truth);
            double before = 0;
            for (std::size_t i = 0; i < comparison.stations().size(); ++i) {
                const FitResidual& station = comparison.stations()[i];
                if (station.kind != "arrival" || station.measured < 0.1e-3 || station.measured > 0.9e-3)
                    continue;  // growth begins and ends there
                const double residual = (modelled[static_cast<Eigen::Index>(i)] - station.measured) / station.sigma;
                squares += residual * residual;
                neighbours += residual * before;
                count += 1;
                sigmas += station.sigma;
                before = residual;
            }
        }
        std::printf("%d rows at one place: %.0f stations a draw, mean square %.2f, autocorrelation %.3f, mean sigma %.2g mm\n",
                    rows_at_one_place, count / draws, squares / count, neighbours / squares, 1e3 * sigmas / count);
        EXPECT_NEAR(squares / count, 1, 0.15);
        EXPECT_NEAR(neighbours / squares, 0, 0.1);
    }
}

TEST(UnitResiduals, StationsInOneJumpCountTogetherAsOne) {
    Experiment experiment = straight_experiment();
    for (std::size_t i = 0; i < experiment.data.crack_length.size(); ++i) {
        experiment.data.crack_length[i] = i < 200 ? 2e-3 : 6e-3;
    }
    const auto arrivals = of_kind(Comparison(experiment), "arrival");
    ASSERT_GT(arrivals.size(), 8u);
    double weight = 0;
    for (const FitResidual& station : arrivals) {
        weight += 1 / (station.sigma * station.sigma);
    }
    EXPECT_LE(1 / std::sqrt(weight), 2 * 1e-3 / 399);
    // One event, timed to about the sampling interval; smoothing puts the jump's ends a window apart, out of each
    // other's reach.
    EXPECT_GE(1 / std::sqrt(weight), 0.8 * 1e-3 / 399);
}

// A crack that grows slower than its noise, then jumps: lengths at displacements that arrivals leave, each row counted once.
Record slow_then_jumping(double jump_at, double slope = 0.4) {
    Record record;
    for (int i = 0; i < 400; ++i) {
        Instant instant;
        instant.displacement = 1e-3 * i / 399;
        instant.crack_length = 2e-3 + slope * instant.displacement + (instant.displacement > jump_at ? 3e-3 : 0.0);
        record.series.push_back(instant);
    }
    return record;
}

Experiment slow_experiment(const Record& truth, unsigned seed) {
    Experiment experiment;
    experiment.name = "test";
    experiment.data = measure(truth, 0, 0.1e-3, seed);
    experiment.data.force.clear();
    experiment.noise.crack_length = 0.1e-3;
    return experiment;
}

TEST(UnitResiduals, LengthsAtDisplacementsUseWhatArrivalsLeave) {
    constexpr int draws = 200;
    const Record truth = slow_then_jumping(0.8e-3);
    double squares = 0, neighbours = 0, count = 0, rows = 0, information = 0;
    for (int draw = 0; draw < draws; ++draw) {
        const Comparison comparison(slow_experiment(truth, static_cast<unsigned>(draw + 1)));
        const Eigen::VectorXd modelled = comparison.modelled(truth);
        const Eigen::VectorXd longer = comparison.modelled(slow_then_jumping(0.8e-3, 0.44));
        double before = 0;
        for (std::size_t i = 0; i < comparison.stations().size(); ++i) {
            const FitResidual& station = comparison.stations()[i];
            const double residual = (modelled[static_cast<Eigen::Index>(i)] - station.measured) / station.sigma;
            if (station.kind == "crack_length") {
                squares += residual * residual;
                neighbours += residual * before;
                count += 1;
                rows += std::pow(0.1e-3 / station.sigma, 2);
                const double change = (longer - modelled)[static_cast<Eigen::Index>(i)] / 0.04;
                information += std::pow(change / station.sigma, 2);
                before = residual;
            }
        }
    }
    std::printf("%.1f stations a draw, worth %.0f rows of 400, mean square %.2f, autocorrelation %.3f\n", count / draws,
                rows / draws, squares / count, neighbours / squares);
    EXPECT_NEAR(squares / count, 1, 0.06);  // three standard errors of some 9000 squares
    EXPECT_NEAR(neighbours / squares, 0, 0.04);
    EXPECT_GT(rows / draws, 0.75 * 400);  // some arrivals have windows of 8 rows
    EXPECT_LT(rows / draws, 400);
    // Of the slope, by all rows: the sum of u^2 over them, in noise.
    EXPECT_GT(information / draws, 0.75 * 400 * 1e-6 / 3 / std::pow(0.1e-3, 2));
}

TEST(UnitResiduals, LengthsAtDisplacementsLeaveAJumpToItsArrival) {
    const Comparison comparison(slow_experiment(slow_then_jumping(0.8e-3), 1));
    for (const FitResidual& station : of_kind(comparison, "crack_length")) {
        EXPECT_GT(std::abs(station.at - 0.8e-3), 0.01e-3);  // half a window
        EXPECT_LT(station.sigma, 0.04e-3);                  // of seven rows or eight, and no jump in it
    }
}

TEST(UnitResiduals, FewRowsOfALengthAreStationsUnlessArrivalsLieBetweenThem) {
    Record truth = slow_then_jumping(0.8e-3, 0.0);
    std::erase_if(truth.series, [](const Instant& instant) { return std::lround(instant.displacement * 399e3) % 20 != 0; });
    Experiment experiment = slow_experiment(truth, 1);
    experiment.data = measure(truth, 0, 0, 1);
    experiment.data.force.clear();
    const auto lengths = of_kind(Comparison(experiment), "crack_length");
    ASSERT_EQ(lengths.size(), truth.series.size() - 2);  // the crack jumps between two of them
    for (const FitResidual& station : lengths) {
        EXPECT_DOUBLE_EQ(station.sigma, 0.1e-3);
    }
}

TEST(UnitResiduals, DisplacementNoiseEntersByTheSlope) {
    Experiment experiment = straight_experiment();
    experiment.noise.displacement = 3e-5;
    const Comparison comparison(experiment);
    for (const FitResidual& station : of_kind(comparison, "force")) {
        EXPECT_NEAR(station.sigma, std::hypot(2.0, 1e5 * 3e-5) / std::sqrt(8.0), 0.09);
    }
    for (const FitResidual& station : of_kind(comparison, "arrival")) {
        EXPECT_NEAR(station.sigma, std::hypot(0.2e-3 / 8, 3e-5) / std::sqrt(8.0), 0.07 * station.sigma);
    }
}

TEST(UnitResiduals, FewRowsAreStationsThemselves) {
    Experiment experiment = straight_experiment();
    experiment.data = measure(straight(1e5, 8, 1e-3, 9), 0, 0, 1);
    const auto force = of_kind(Comparison(experiment), "force");
    ASSERT_EQ(force.size(), 9u);
    EXPECT_DOUBLE_EQ(force[3].at, experiment.data.displacement[3]);
    EXPECT_DOUBLE_EQ(force[3].sigma, 2.0);
}

// Ten rows up to a drop that two at one place have seen, and ten from there on.
TEST(UnitResiduals, TheRowBeforeADropCounts) {
    constexpr double drop_at = 0.5e-3;
    const auto falling = [](double at, int rows) {
        Record record;
        for (int i = 1; i <= 2 * rows; ++i) {
            Instant instant;
            instant.displacement = i <= rows ? at * i / rows : 1e-3 - (1e-3 - at) * (2 * rows - i) / (rows - 1);
            instant.force = i <= rows ? 1e5 * instant.displacement : 20 - 1e4 * (instant.displacement - at);
            record.series.push_back(instant);
        }
        return record;
    };
    Experiment experiment;
    experiment.name = "test";
    const Record rows = falling(drop_at, 10);
    for (const Instant& row : rows.series) {
        experiment.data.displacement.push_back(row.displacement);
        experiment.data.force.push_back(row.force);
    }
    experiment.noise = {.force = 0.1, .crack_length = {}, .displacement = {}, .time = {}};
    const Comparison comparison(experiment);
    const std::vector<FitResidual> force = of_kind(comparison, "force");
    const auto peak = std::ranges::max_element(force, {}, &FitResidual::measured);
    EXPECT_NEAR(peak->measured, 50, 0.5);
    // A drop a hair aside, by the rounding of a table, is the same; one that comes a twentieth sooner is not.
    const auto misfit = [&](double at) {
        const Eigen::VectorXd modelled = comparison.modelled(falling(at, 400));
        double sum = 0;
        for (std::size_t i = 0; i < force.size(); ++i) {
            sum += std::pow((modelled[static_cast<Eigen::Index>(i)] - force[i].measured) / force[i].sigma, 2);
        }
        return sum;
    };
    for (const double hair : {-1e-9, 0.0, 1e-9}) {
        EXPECT_LT(misfit(drop_at + hair), 0.1) << hair;
    }
    EXPECT_GT(misfit(0.95 * drop_at), 1e3);
    EXPECT_GT(misfit(1.05 * drop_at), 1e3);
}

// What an error of a row does is known by moving it: to a station's sigma and, where rows are few, to one station alone.
TEST(UnitResiduals, ErrorsOfStationsAreThoseOfTheirRows) {
    for (const int rows : {30, 50, 51, 65, 80, 100, 101, 150, 400}) {
        Experiment experiment = straight_experiment();
        experiment.data = measure(straight(1e5, 8, 1e-3, rows), 0, 0, 1);
        const auto force = of_kind(Comparison(experiment), "force");
        std::vector<double> variance(force.size(), 0.0);
        for (double& row : experiment.data.force) {
            row += 1.0;
            const auto moved = of_kind(Comparison(experiment), "force");
            ASSERT_EQ(moved.size(), force.size());
            int stations = 0;
            for (std::size_t i = 0; i < force.size(); ++i) {
                const double change = moved[i].measured - force[i].measured;
                variance[i] += change * change;
                stations += std::abs(change) > 1e-9 ? 1 : 0;
            }
            EXPECT_TRUE(stations == 1 || (rows == 400 && stations == 2)) << rows;
            row -= 1.0;
        }
        for (std::size_t i = 0; i < force.size(); ++i) {
            EXPECT_NEAR(force[i].sigma, 2.0 * std::sqrt(variance[i]), 1e-6) << rows << " " << i;
        }
    }
}

TEST(UnitResiduals, GapsAreSkipped) {
    Experiment experiment = straight_experiment();
    for (std::size_t i = 100; i < 200; ++i) {
        experiment.data.force[i] = std::nan("");
    }
    for (const FitResidual& station : of_kind(Comparison(experiment), "force")) {
        EXPECT_NEAR(station.measured, 1e5 * station.at, 1e-9);
        EXPECT_FALSE(station.at > 0.262e-3 && station.at < 0.488e-3) << station.at;
    }
}

TEST(UnitResiduals, RowsWithoutAPlaceAreToldOf) {
    Experiment experiment = straight_experiment();
    const auto told = [&] {
        const Comparison comparison(experiment);
        return std::ranges::any_of(comparison.remarks(), [](const std::string& remark) {
            return remark.starts_with("test: 3 of ") && remark.ends_with(" rows have no displacement and are left out.");
        });
    };
    EXPECT_FALSE(told());
    for (const std::size_t i : {3U, 40U, 41U}) {
        experiment.data.displacement[i] = std::nan("");
    }
    EXPECT_TRUE(told());
}

// The chord across a gap is nobody's measurement. Of a curve of second order it is off by up to a tenth of its range here.
TEST(UnitResiduals, NoChordAcrossAGapIsCompared) {
    Record record = straight(0, 8, 1e-3);
    for (Instant& instant : record.series) {
        instant.force = 1e8 * std::pow(instant.displacement, 2);
        instant.crack_length = 2e-3 + 5e3 * std::pow(instant.displacement, 2);
    }
    Experiment experiment = straight_experiment();
    experiment.data = measure(record, 0, 0, 1);
    for (const auto& [first, last] : {std::pair{103, 297}, std::pair{105, 111}}) {
        for (int i = first; i < last; ++i) {
            experiment.data.force[i] = experiment.data.crack_length[i] = std::nan("");
        }
    }
    const Comparison comparison(experiment);
    const Eigen::VectorXd modelled = comparison.modelled(record);
    for (std::size_t i = 0; i < comparison.stations().size(); ++i) {
        const FitResidual& station = comparison.stations()[i];
        if (station.kind != "arrival") {
            EXPECT_NEAR(modelled[static_cast<Eigen::Index>(i)], station.measured, 1e-9 * station.measured) << station.at;
        }
    }
}

TEST(UnitResiduals, WithoutDisplacementTimeIsUsed) {
    Experiment experiment = straight_experiment();
    experiment.data.displacement.clear();
    const Comparison comparison(experiment);
    for (const FitResidual& station : of_kind(comparison, "force")) {
        EXPECT_NEAR(station.measured, 0.5e5 * station.at, 1e-9);
    }
    const Eigen::VectorXd modelled = comparison.modelled(straight(1e5, 8, 1e-3));
    EXPECT_NEAR(modelled[10], comparison.stations()[10].measured, 1e-9);
}

TEST(UnitResiduals, AVibrationIsAveragedInModelAndDataAlike) {
    const Experiment experiment = straight_experiment();
    const Comparison comparison(experiment);
    Record vibrating = straight(1e5, 8, 1e-3, 4000);
    for (Instant& instant : vibrating.series) {
        instant.force += 10 * std::sin(2 * M_PI * instant.displacement / 0.01e-3);  // two periods in a window
    }
    const Eigen::VectorXd modelled = comparison.modelled(vibrating);
    for (Eigen::Index i = 0; i < 50; ++i) {
        EXPECT_NEAR(modelled[i], comparison.stations()[static_cast<std::size_t>(i)].measured, 0.2);
    }
}

TEST(UnitResiduals, ModelForceAfterASplitIsZeroAndElseTheLast) {
    const Comparison comparison(straight_experiment());
    Record record = straight(1e5, 8, 0.5e-3);
    EXPECT_NEAR(comparison.modelled(record)[49], 50, 1e-9);
    record.status = RunStatus::split;
    EXPECT_NEAR(comparison.modelled(record)[49], 0, 1e-12);
    EXPECT_NEAR(comparison.modelled(record)[10], comparison.stations()[10].measured, 1e-9);
}

// The modelled arrival must go on smoothly when a record ends just before a station instead of just behind it.
TEST(UnitResiduals, AStationThatIsNeverReachedIsFiniteAndContinuous) {
    const Comparison comparison(straight_experiment());
    const auto last = static_cast<Eigen::Index>(50 + of_kind(comparison, "arrival").size()) - 1;  // behind 50 of force
    const double needed = of_kind(comparison, "arrival").back().measured;
    double before = 1e9;
    for (double end = 0.3e-3; end < 1e-3; end += 0.01e-3) {
        const double arrival = comparison.modelled(straight(1e5, 8, end))[last];
        EXPECT_NEAR(arrival, needed, 1e-6);  // the test's own pace continues a model of the same pace
        EXPECT_LE(arrival, before + 1e-6);
        before = arrival;
    }
    Record stuck = straight(1e5, 0, 1e-3);
    EXPECT_GT(comparison.modelled(stuck)[last], 1.5e-3);  // more than the last displacement
    EXPECT_TRUE(comparison.modelled(stuck).allFinite());
}

// A test that ends with a jump, in its last two rows at one displacement or between them, says when that was; a model whose jump
// is earlier or later by a part of a window is off by that, however little it is; within a fifth, as between its nodes, which are
// other ones then, the smoothed curve is taken to be straight.
TEST(UnitResiduals, AJumpAtTheEndIsTimedContinuously) {
    const auto ends_with_jump = [](double at, bool goes_on) {
        Record record = straight(1e5, 1, 1e-3, 201);
        std::erase_if(record.series, [&](const Instant& instant) { return instant.displacement >= at; });
        for (const double crack_length : {2e-3 + at, 6e-3}) {
            Instant& instant = record.series.emplace_back();
            instant.displacement = at;
            instant.time = 2 * at;
            instant.force = 1e5 * at;
            instant.crack_length = crack_length;
        }
        if (goes_on) {
            record.series.push_back(record.series.back());
            record.series.back().displacement = 1.1e-3;
        }
        return record;
    };
    Experiment experiment = straight_experiment();
    const double at = 0.97312e-3;
    for (const bool data_goes_on : {false, true}) {
        experiment.data = measure(ends_with_jump(at, data_goes_on), 0, 0, 1);
        const Comparison comparison(experiment);
        for (const double by : {-1e-6, -1e-8, -1e-12, -2e-19, 0.0, 2e-19, 1e-12, 1e-8, 1e-6}) {
            const Eigen::VectorXd modelled = comparison.modelled(ends_with_jump(at + by, false));
            double most = 0;
            for (std::size_t i = 0; i < comparison.stations().size(); ++i) {
                const FitResidual& station = comparison.stations()[i];
                if (station.kind == "arrival" && station.at > 3.3e-3) {
                    const double off = modelled[static_cast<Eigen::Index>(i)] - station.measured;
                    most = std::max(most, std::abs(off - by));
                }
            }
            EXPECT_LT(most, 0.2 * std::abs(by) + 1e-17) << by << (data_goes_on ? ", and data go on" : "");
        }
    }
}

// A full break that a single row has seen, at the displacement of the row before or behind it.
Record broken_at(double place, double behind, int rows) {
    Record record = straight(1e5, 0, place, rows);
    Instant last = record.series.back();
    last.displacement += behind;
    last.force = 0;
    last.crack_length = 10e-3;
    record.series.push_back(last);
    return record;
}

TEST(UnitResiduals, ABreakThatOneRowHasSeenHasAFiniteWeightAndATime) {
    for (const int rows : {10, 41, 60, 400}) {
        for (const double behind : {0.0, 1e-9, 0.5 / rows * 1e-3}) {
            Experiment experiment = straight_experiment();
            experiment.data = measure(broken_at(1e-3, behind, rows), 0, 0, 1);
            const Record model = broken_at(0.9e-3, 0.0, 2000), same = broken_at(1e-3 + 0.5 * behind, 0.0, 2000);
            const Comparison with_lengths(experiment);
            for (const FitResidual& station : with_lengths.stations()) {
                EXPECT_GT(station.sigma, 0) << station.kind;
            }
            EXPECT_TRUE(of_kind(with_lengths, "break").empty());
            for (double& length : experiment.data.crack_length) {
                length = std::nan("");
            }
            const Comparison comparison(experiment);
            ASSERT_EQ(of_kind(comparison, "break").size(), 1u) << rows << " rows, " << behind;
            const Eigen::VectorXd early = comparison.modelled(model), right = comparison.modelled(same);
            for (std::size_t i = 0; i < comparison.stations().size(); ++i) {
                const FitResidual& station = comparison.stations()[i];
                EXPECT_GT(station.sigma, 0);
                if (station.kind == "break") {
                    EXPECT_NEAR(early[static_cast<Eigen::Index>(i)], 0.9e-3, 1e-9);
                    EXPECT_NEAR(right[static_cast<Eigen::Index>(i)], station.measured, 1e-9);
                } else {
                    EXPECT_NEAR(right[static_cast<Eigen::Index>(i)], station.measured, 2 * station.sigma) << station.at;
                }
            }
        }
    }
    // One that falls row by row has no time of its own.
    Experiment experiment = straight_experiment();
    for (double& length : experiment.data.crack_length) {
        length = std::nan("");
    }
    EXPECT_TRUE(of_kind(Comparison(experiment), "break").empty());
}

TEST(UnitResiduals, NoiseThatIsNotGivenIsEstimatedAndSaidSo) {
    Experiment experiment = straight_experiment();
    experiment.noise = {};
    experiment.data = measure(straight(1e5, 8, 1e-3), 3.0, 0.1e-3, 7);
    const Comparison comparison(experiment);
    const auto force = of_kind(comparison, "force");
    EXPECT_NEAR(force[20].sigma * std::sqrt(8.0), 3.0, 0.75);  // 400 rows: the median is good to some 8 %, three sigma
    ASSERT_EQ(comparison.remarks().size(), 3u);                // with that on all noise
    EXPECT_NE(comparison.remarks()[0].find("noise of force"), std::string::npos);
    EXPECT_NE(comparison.remarks()[1].find("noise of crack_length"), std::string::npos);
}

TEST(UnitResiduals, NoiseThatIsGivenFarTooSmallIsTold) {
    Experiment experiment = straight_experiment();
    experiment.data = measure(straight(1e5, 8, 1e-3), 3.0, 0.1e-3, 7);
    for (const double given : {1.0, 2.5, 6.0}) {
        experiment.noise.force = given;
        const Comparison comparison(experiment);
        const bool told = std::ranges::any_of(comparison.remarks(), [](const std::string& remark) {
            return remark.find("the rows of force scatter by") != std::string::npos;
        });
        EXPECT_EQ(told, given < 1.5) << given;
    }
}

// Noise of the displacement makes forces scatter about their neighbours, and displacements fall back: what the study states of it
// is no contradiction.
TEST(UnitResiduals, StatedNoiseOfTheDisplacementExplainsScatterAndFalls) {
    Experiment experiment = straight_experiment();
    experiment.data = measure(straight(1e5, 8, 1e-3), 2.0, 0, 7);
    experiment.data.crack_length.clear();
    experiment.noise = {.force = 2.0, .crack_length = {}, .displacement = 0.02e-3, .time = {}};
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    for (double& displacement : experiment.data.displacement) {
        displacement += 0.02e-3 * normal(generator);
    }
    const auto is_told = [](const Comparison& comparison) {
        return std::ranges::any_of(comparison.remarks(), [](const std::string& remark) {
            return remark.find("about their neighbours") != std::string::npos;
        });
    };
    EXPECT_FALSE(is_told(Comparison(experiment)));
    experiment.noise.displacement = 0.1e-6;
    EXPECT_THROW(Comparison{experiment}, InputError);  // falls by more than a twentieth
}

// That a crack stands says how tough the wood is at the least.
TEST(UnitResiduals, ACrackThatStandsIsComparedByItsLength) {
    Experiment experiment = straight_experiment();
    experiment.data = measure(straight(1e5, 0, 1e-3), 2.0, 0.2e-3, 7);
    const Comparison comparison(experiment);
    EXPECT_TRUE(of_kind(comparison, "arrival").empty());
    const auto lengths = of_kind(comparison, "crack_length");
    EXPECT_EQ(lengths.size(), 50u);
    const Eigen::VectorXd stands = comparison.modelled(straight(1e5, 0, 1e-3)),
                          grows = comparison.modelled(straight(1e5, 8, 1e-3));
    double misfit[] = {0, 0};
    for (std::size_t i = 0; i < comparison.stations().size(); ++i) {
        const FitResidual& station = comparison.stations()[i];
        if (station.kind == "crack_length") {
            misfit[0] += std::pow((stands[static_cast<Eigen::Index>(i)] - station.measured) / station.sigma, 2);
            misfit[1] += std::pow((grows[static_cast<Eigen::Index>(i)] - station.measured) / station.sigma, 2);
        }
    }
    EXPECT_LT(misfit[0], 50 + 4 * std::sqrt(2 * 50.0));
    EXPECT_GT(misfit[1], 1e3);
}

// 41 displacements with so many rows each, the force with noise of 2 N, the crack, which stands, of 0.2 mm.
Experiment with_rows_at_one_place(int rows, unsigned seed) {
    Experiment experiment = straight_experiment();
    experiment.data = measure(with_each_row(straight(1e5, 0, 1e-3, 41), rows), 2.0, 0.2e-3, seed);
    return experiment;
}

// A coarse gauge of displacement repeats itself: the mean of n rows is known to sigma / sqrt(n), and twice the rows are worth
// twice as much.
TEST(UnitResiduals, EachRowAtOneDisplacementCounts) {
    const Record truth = straight(1e5, 0, 1e-3, 41);
    for (const int rows : {1, 2, 3, 16}) {
        double squares[] = {0, 0}, stations[] = {0, 0}, information = 0;
        constexpr int draws = 20;
        for (unsigned seed = 0; seed < draws; ++seed) {
            const Comparison comparison(with_rows_at_one_place(rows, seed));
            const Eigen::VectorXd modelled = comparison.modelled(truth);
            for (std::size_t i = 0; i < comparison.stations().size(); ++i) {
                const FitResidual& station = comparison.stations()[i];
                const bool force = station.kind == "force";
                squares[force] += std::pow((modelled[static_cast<Eigen::Index>(i)] - station.measured) / station.sigma, 2);
                ++stations[force];
                information += force ? std::pow(2.0 / station.sigma, 2) / draws : 0;
            }
        }
        for (const bool force : {false, true}) {
            EXPECT_NEAR(squares[force] / stations[force], 1, 4 * std::sqrt(2 / stations[force])) << rows;
        }
        EXPECT_NEAR(information / (41 * rows), 1, 0.1) << rows;  // less at steps that noise has made in one of 20 places
        Experiment estimated = with_rows_at_one_place(rows, 7);
        estimated.noise.force.reset();
        const double sigma = of_kind(Comparison(estimated), "force")[20].sigma;  // of 41: the median is good to some 24 %
        EXPECT_NEAR(sigma * std::sqrt(rows), 2.0, 0.75) << rows;
    }
}

// Rows of a hold are worth what they are by time; of wood that remembers they count as those of another displacement do.
TEST(UnitResiduals, AHoldOfWoodThatRemembersCountsAsAnotherPlace) {
    for (const bool remembers : {false, true}) {
        Experiment experiment = with_rows_at_one_place(4, 1);
        for (int i = 0; i < 96; ++i) {
            for (std::vector<double>* column :
                 {&experiment.data.time, &experiment.data.displacement, &experiment.data.force, &experiment.data.crack_length}) {
                column->push_back(column->back());
            }
        }
        if (remembers) {
            experiment.scene.materials["EW"].viscoelastic.emplace();
        }
        const auto force = of_kind(Comparison(experiment), "force");
        EXPECT_NEAR(force[20].sigma, 2.0 / std::sqrt(4.0), 1e-9);
        EXPECT_NEAR(force.back().sigma, 2.0 / std::sqrt(remembers ? 4.0 : 100.0), 1e-9);
    }
}

// While displacement stands, wood that remembers goes on: rows by displacement would hide it, and this is said.
TEST(UnitResiduals, RowsOfAHoldAreToldOf) {
    Experiment experiment = straight_experiment();
    experiment.data = measure(straight(1e5, 8, 1e-3), 2.0, 0.2e-3, 7);
    const auto told = [&] {
        return std::ranges::any_of(Comparison(experiment).remarks(), [](const std::string& remark) {
            return remark.find("count as those of another place do") != std::string::npos;
        });
    };
    const double last = experiment.data.displacement.back();
    for (int i = 0; i < 300; ++i) {
        experiment.data.time.push_back(experiment.data.time.back() + 1);
        experiment.data.displacement.push_back(last);
        experiment.data.force.push_back(experiment.data.force.back());
        experiment.data.crack_length.push_back(experiment.data.crack_length.back());
    }
    EXPECT_FALSE(told());
    experiment.scene.solver.kind = SolverKind::explicit_dynamics;  // where a bar swings on
    EXPECT_TRUE(told());
    experiment.scene.solver.kind = SolverKind::automatic;
    experiment.scene.materials["EW"].viscoelastic.emplace();
    EXPECT_TRUE(told());
}

void expect_refused(const Experiment& experiment, const std::string& key) {
    try {
        const Comparison comparison(experiment);
        FAIL() << "accepted";
    } catch (const InputError& error) {
        EXPECT_EQ(error.key, key);
        EXPECT_EQ(error.file, "bad.csv");
    }
}

TEST(UnitResiduals, ACreepTestIsToldOf) {
    Experiment experiment = straight_experiment();
    experiment.scene.materials["EW"].viscoelastic.emplace();
    const auto told = [&] {
        return std::ranges::any_of(Comparison(experiment).remarks(), [](const std::string& remark) {
            return remark.find("says nothing of how that grows with time") != std::string::npos;
        });
    };
    EXPECT_FALSE(told());
    experiment.data.crack_length.clear();
    for (double& force : experiment.data.force) {
        force = 20;
    }
    EXPECT_TRUE(told());
    experiment.scene.materials["EW"].viscoelastic.reset();
    EXPECT_FALSE(told());
}

TEST(UnitResiduals, RefusesDataThatCannotBeCompared) {
    Experiment experiment = straight_experiment();
    experiment.data_file = "bad.csv";
    Experiment bad = experiment;
    bad.data.displacement.clear();
    bad.data.time.clear();
    bad.data.force.clear();
    expect_refused(bad, "displacement");
    bad = experiment;
    bad.data.force.clear();
    bad.data.crack_length.clear();
    expect_refused(bad, "force");
    bad = experiment;
    bad.data.displacement.assign(400, 1e-3);
    expect_refused(bad, "displacement");
    bad = experiment;
    std::reverse(bad.data.displacement.begin() + 200, bad.data.displacement.end());
    expect_refused(bad, "displacement");
    bad = experiment;
    bad.data.force.clear();
    bad.data.crack_length.assign(400, 2e-3);
    expect_refused(bad, "crack_length");
}

}  // namespace
}  // namespace crampfit::testing

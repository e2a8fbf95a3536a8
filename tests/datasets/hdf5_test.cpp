#include "datasets/hdf5.hpp"
#include "datasets/io.hpp"
#include "tests/datasets/full_results.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

using namespace crampfit;

// A round trip through a file must give back every bit: there is no tolerance in this file.

namespace {

template <class Value>
bool same_bits(const std::vector<Value>& a, const std::vector<Value>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(Value)) == 0);
}
bool same_bits(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    return a.rows() == b.rows() && a.cols() == b.cols() &&
           same_bits(std::vector<double>(a.data(), a.data() + a.size()), std::vector<double>(b.data(), b.data() + b.size()));
}
bool same_bits(double a, double b) { return same_bits(std::vector<double>{a}, std::vector<double>{b}); }

std::vector<double> values_of(std::vector<Instant> series, const SeriesColumn& column) {
    std::vector<double> values;
    for (Instant& instant : series) values.push_back(column.value(instant));
    return values;
}

}  // namespace

TEST(UnitHdf5, RecordComesBackBitForBit) {
    const TemporaryFolder folder;
    const Record before = full_record();
    write(before, folder / "record.h5");
    const Record after = read_record(folder / "record.h5");

    EXPECT_EQ(after.status, before.status);
    EXPECT_EQ(after.message, before.message);
    for (const SeriesColumn& column : series_columns)
        EXPECT_TRUE(same_bits(values_of(after.series, column), values_of(before.series, column))) << column.name;
    EXPECT_EQ(after.tracked_crack, 1);
    ASSERT_EQ(after.paths.size(), 2u);
    EXPECT_TRUE(same_bits(after.paths[0], before.paths[0]));
    EXPECT_TRUE(same_bits(after.paths[1], before.paths[1]));
    ASSERT_EQ(after.cracks.size(), 1u);
    EXPECT_TRUE(same_bits(after.cracks[0].length, before.cracks[0].length));
    EXPECT_TRUE(same_bits(after.cracks[0].tip, before.cracks[0].tip));
    EXPECT_TRUE(same_bits(after.cracks[0].G, before.cracks[0].G));
    EXPECT_TRUE(same_bits(after.cracks[0].K_I, before.cracks[0].K_I));
    EXPECT_TRUE(same_bits(after.cracks[0].K_II, before.cracks[0].K_II));
    ASSERT_EQ(after.reactions.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(after.reactions[i].name, before.reactions[i].name);
        EXPECT_TRUE(same_bits(after.reactions[i].force, before.reactions[i].force));
    }
    ASSERT_EQ(after.driving.size(), awkward_numbers().size());
    for (std::size_t i = 0; i < before.driving.size(); ++i) {
        EXPECT_TRUE(same_bits(std::vector{after.driving[i].tip}, std::vector{before.driving[i].tip}));
        for (const DrivingColumn& column : driving_columns)
            EXPECT_TRUE(same_bits(after.driving[i].*column.value, before.driving[i].*column.value)) << column.name;
    }
    EXPECT_TRUE(same_bits(after.point_position, before.point_position));
    EXPECT_TRUE(same_bits(after.point_latewood, before.point_latewood));
    ASSERT_EQ(after.frames.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_TRUE(same_bits(after.frames[i].time, before.frames[i].time));
        EXPECT_TRUE(same_bits(after.frames[i].displacement, before.frames[i].displacement));
        EXPECT_TRUE(same_bits(after.frames[i].moved, before.frames[i].moved));
        EXPECT_TRUE(same_bits(after.frames[i].stress, before.frames[i].stress));
        EXPECT_TRUE(same_bits(after.frames[i].crack, before.frames[i].crack));
    }
    EXPECT_EQ(after.scene_text, before.scene_text);
    EXPECT_EQ(after.explanation, before.explanation);
    EXPECT_EQ(after.steps, before.steps);
    EXPECT_EQ(after.points, before.points);
    EXPECT_TRUE(same_bits(after.seconds, before.seconds));
    EXPECT_TRUE(same_bits(after.worst_energy_imbalance, before.worst_energy_imbalance));
}

TEST(UnitHdf5, FitComesBackBitForBit) {
    const TemporaryFolder folder;
    const Fit before = full_fit();
    write(before, folder / "fit.h5");
    const Fit after = read_fit(folder / "fit.h5");

    EXPECT_EQ(after.status, before.status);
    EXPECT_EQ(after.message, before.message);
    EXPECT_EQ(after.method, before.method);
    ASSERT_EQ(after.parameters.size(), before.parameters.size());
    for (std::size_t i = 0; i < 2; ++i) {
        const FittedParameter& a = after.parameters[i];
        const FittedParameter& b = before.parameters[i];
        EXPECT_EQ(a.name, b.name);
        EXPECT_EQ(a.key, b.key);
        EXPECT_EQ(a.unit, b.unit);
        EXPECT_EQ(a.at_bound, b.at_bound);
        EXPECT_TRUE(same_bits(std::vector{a.value, a.standard_error, a.lower_95, a.upper_95, a.initial},
                              std::vector{b.value, b.standard_error, b.lower_95, b.upper_95, b.initial}));
    }
    EXPECT_TRUE(same_bits(after.covariance, before.covariance));
    EXPECT_TRUE(same_bits(after.correlation, before.correlation));
    ASSERT_EQ(after.residuals.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        const FitResidual& a = after.residuals[i];
        const FitResidual& b = before.residuals[i];
        EXPECT_EQ(a.experiment, b.experiment);
        EXPECT_EQ(a.kind, b.kind);
        EXPECT_TRUE(same_bits(std::vector{a.at, a.measured, a.modelled, a.sigma, a.residual},
                              std::vector{b.at, b.measured, b.modelled, b.sigma, b.residual}));
    }
    ASSERT_EQ(after.runs.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_TRUE(same_bits(after.runs[i].parameters, before.runs[i].parameters));
        EXPECT_TRUE(same_bits(after.runs[i].misfit, before.runs[i].misfit));
        EXPECT_EQ(after.runs[i].status, before.runs[i].status);
        EXPECT_TRUE(same_bits(after.runs[i].seconds, before.runs[i].seconds));
    }
    ASSERT_EQ(after.checks.size(), before.checks.size());
    EXPECT_EQ(after.checks[0].experiment, before.checks[0].experiment);
    EXPECT_EQ(after.checks[0].kind, before.checks[0].kind);
    EXPECT_EQ(after.checks[0].points, before.checks[0].points);
    const auto numbers = [](const FitCheck& c) {
        return std::vector{c.chi_square, c.p_chi_square, c.autocorrelation, c.p_autocorrelation};
    };
    EXPECT_TRUE(same_bits(numbers(after.checks[0]), numbers(before.checks[0])));
    ASSERT_EQ(after.distances.size(), before.distances.size());
    const auto distance = [](const CurveDistance& d) {
        return std::vector{d.area_measured, d.area_modelled, d.area_between, d.frechet};
    };
    EXPECT_EQ(after.distances[0].kind, "force");
    EXPECT_TRUE(same_bits(distance(after.distances[0]), distance(before.distances[0])));
    ASSERT_EQ(after.models.size(), before.models.size());
    for (std::size_t i = 0; i < 2; ++i) {
        const auto figures = [](const ComparedModel& m) { return std::vector{m.misfit, m.aic, m.bic, m.weight}; };
        EXPECT_EQ(after.models[i].name, before.models[i].name);
        EXPECT_EQ(after.models[i].status, before.models[i].status);
        EXPECT_TRUE(same_bits(figures(after.models[i]), figures(before.models[i])));
        EXPECT_TRUE(same_bits(after.models[i].values, before.models[i].values));
    }
    ASSERT_EQ(after.crack_paths.size(), before.crack_paths.size());
    for (std::size_t i = 0; i < 2; ++i) {
        const CrackPaths &a = after.crack_paths[i], &b = before.crack_paths[i];
        EXPECT_EQ(a.experiment, b.experiment);
        EXPECT_EQ(a.on_photograph, b.on_photograph);
        EXPECT_EQ(a.picture.columns, b.picture.columns);
        EXPECT_EQ(a.picture.rows, b.picture.rows);
        EXPECT_EQ(a.picture.gray, b.picture.gray);
        EXPECT_TRUE(same_bits(std::vector{a.picture.low, a.picture.high}, std::vector{b.picture.low, b.picture.high}));
        EXPECT_TRUE(same_bits(a.photographed, b.photographed));
        ASSERT_EQ(a.simulated.size(), b.simulated.size());
        for (std::size_t k = 0; k < a.simulated.size(); ++k) {
            const auto figures = [](const SimulatedPath& s) {
                return std::vector{s.mean_distance, s.largest_distance, s.compared_length};
            };
            EXPECT_EQ(a.simulated[k].model, b.simulated[k].model);
            EXPECT_EQ(a.simulated[k].status, b.simulated[k].status);
            EXPECT_TRUE(same_bits(figures(a.simulated[k]), figures(b.simulated[k])));
            ASSERT_EQ(a.simulated[k].cracks.size(), b.simulated[k].cracks.size());
            for (std::size_t crack = 0; crack < a.simulated[k].cracks.size(); ++crack)
                EXPECT_TRUE(same_bits(a.simulated[k].cracks[crack], b.simulated[k].cracks[crack]));
        }
    }
    ASSERT_EQ(after.profile.size(), before.profile.size());
    ASSERT_EQ(after.posterior.size(), before.posterior.size());
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(after.profile[i].parameter, before.profile[i].parameter);
        EXPECT_TRUE(same_bits(after.profile[i].value, before.profile[i].value));
        EXPECT_TRUE(same_bits(after.profile[i].misfit, before.profile[i].misfit));
        EXPECT_TRUE(same_bits(after.posterior[i].parameters, before.posterior[i].parameters));
        EXPECT_TRUE(same_bits(after.posterior[i].misfit, before.posterior[i].misfit));
    }
    EXPECT_TRUE(same_bits(std::vector{after.misfit, after.reduced_chi_square, after.seconds},
                          std::vector{before.misfit, before.reduced_chi_square, before.seconds}));
    EXPECT_EQ(after.seed, before.seed);
    EXPECT_EQ(after.study_text, before.study_text);
    EXPECT_EQ(after.scene_settings, before.scene_settings);
}

TEST(UnitHdf5, TrackComesBackBitForBit) {
    const TemporaryFolder folder;
    const CrackTrack before = full_track();
    write(before, folder / "track.h5");
    const CrackTrack after = read_crack_track(folder / "track.h5");
    EXPECT_EQ(after.reference, before.reference);
    EXPECT_EQ(after.images, before.images);
    EXPECT_TRUE(same_bits(*after.pixel, *before.pixel));
    EXPECT_EQ(after.columns, before.columns);
    EXPECT_EQ(after.rows, before.rows);
    ASSERT_EQ(after.tips.size(), before.tips.size());
    for (std::size_t i = 0; i < before.tips.size(); ++i) {
        const CrackTip &a = after.tips[i], &b = before.tips[i];
        EXPECT_EQ(a.status, b.status);
        EXPECT_TRUE(same_bits(std::vector{a.tip.x(), a.tip.y(), a.angle, a.length, a.sigma},
                              std::vector{b.tip.x(), b.tip.y(), b.angle, b.length, b.sigma}));
        EXPECT_TRUE(same_bits(a.way, b.way)) << i;
    }
}

// The last way that was followed; without any, from the mouth of the first tip through all.
TEST(UnitTrack, PathIsTheLastWayOrLeadsThroughTheTips) {
    CrackTrack track = full_track();
    EXPECT_TRUE(same_bits(path_of(track), track.tips[3].way));
    for (CrackTip& tip : track.tips) tip.way.clear();
    track.tips[0].angle = 0;  // to the right
    const std::vector<Vec2> path = path_of(track);
    EXPECT_TRUE(same_bits(path, std::vector<Vec2>{{-20, 20}, {10, 20}, {11, 21}}));
    track.tips.clear();
    EXPECT_TRUE(path_of(track).empty());
}

TEST(UnitHdf5, SensitivityRoundTrip) {
    const TemporaryFolder folder;
    const Sensitivity before = full_sensitivity();
    write(before, folder / "sensitivity.h5");
    const Sensitivity after = read_sensitivity(folder / "sensitivity.h5");
    EXPECT_EQ(after.status, before.status);
    EXPECT_EQ(after.message, before.message);
    EXPECT_EQ(after.study_text, before.study_text);
    EXPECT_EQ(after.scene_settings, before.scene_settings);
    EXPECT_EQ(after.seed, before.seed);
    EXPECT_EQ(after.seconds, before.seconds);
    ASSERT_EQ(after.parameters.size(), before.parameters.size());
    for (std::size_t i = 0; i < before.parameters.size(); ++i) {
        const auto tied = [](const StudiedParameter& p) { return std::tie(p.name, p.key, p.unit, p.initial, p.lower, p.upper); };
        EXPECT_EQ(tied(after.parameters[i]), tied(before.parameters[i]));
    }
    ASSERT_EQ(after.outputs.size(), before.outputs.size());
    EXPECT_EQ(after.outputs[1].name, before.outputs[1].name);
    EXPECT_EQ(after.outputs[1].unit, before.outputs[1].unit);
    ASSERT_EQ(after.indices.size(), before.indices.size());
    for (std::size_t i = 0; i < before.indices.size(); ++i) {
        const auto texts = [](const SensitivityIndex& x) { return std::tie(x.output, x.parameter, x.method, x.kind); };
        EXPECT_EQ(texts(after.indices[i]), texts(before.indices[i]));
        const auto numbers = [](const SensitivityIndex& x) { return std::vector{x.value, x.lower_95, x.upper_95}; };
        EXPECT_TRUE(same_bits(numbers(after.indices[i]), numbers(before.indices[i])));
    }
    ASSERT_EQ(after.runs.size(), before.runs.size());
    for (std::size_t i = 0; i < before.runs.size(); ++i) {
        EXPECT_TRUE(same_bits(after.runs[i].parameters, before.runs[i].parameters));
        EXPECT_TRUE(same_bits(after.runs[i].outputs, before.runs[i].outputs));
        EXPECT_EQ(after.runs[i].status, before.runs[i].status);
        EXPECT_EQ(after.runs[i].seconds, before.runs[i].seconds);
    }
}

TEST(UnitHdf5, SpecimenComesBackBitForBit) {
    const TemporaryFolder folder;
    const Specimen before = full_specimen();
    write(before, folder / "specimen.h5");
    const Specimen after = read_specimen(folder / "specimen.h5");

    EXPECT_EQ(after.columns, 7);
    EXPECT_EQ(after.rows, 3);
    EXPECT_TRUE(same_bits(after.pixel, before.pixel));
    EXPECT_EQ(after.classes, before.classes);
    EXPECT_EQ(after.label, before.label);
    EXPECT_TRUE(same_bits(after.grade, before.grade));
    EXPECT_TRUE(same_bits(after.density, before.density));
    EXPECT_TRUE(after.orientation.empty());
    EXPECT_TRUE(same_bits(after.coherency, before.coherency));
    EXPECT_EQ(after.feature, before.feature);
    ASSERT_EQ(after.borders.size(), before.borders.size());
    for (std::size_t i = 0; i < before.borders.size(); ++i) {
        EXPECT_EQ(after.borders[i].ring, before.borders[i].ring);
        EXPECT_EQ(after.borders[i].points, before.borders[i].points);
    }
    ASSERT_EQ(after.rings.size(), 1u);
    EXPECT_EQ(after.rings[0].ring, 2);
    EXPECT_EQ(after.rings[0].width, 1.0 / 3.0);
    EXPECT_EQ(after.rings[0].latewood_fraction, 0.25);
    EXPECT_EQ(after.source, before.source);
}

TEST(UnitHdf5, WhatIsEmptyComesBackEmpty) {
    const TemporaryFolder folder;
    write(Record{}, folder / "record.h5");
    const Record record = read_record(folder / "record.h5");
    EXPECT_TRUE(record.series.empty() && record.paths.empty() && record.cracks.empty() && record.reactions.empty() &&
                record.driving.empty() && record.point_position.empty() && record.frames.empty() && record.scene_text.empty());

    write(Fit{}, folder / "fit.h5");
    const Fit fit = read_fit(folder / "fit.h5");
    EXPECT_TRUE(fit.parameters.empty() && fit.runs.empty() && fit.residuals.empty() && fit.covariance.size() == 0);

    Fit unrun = full_fit();
    unrun.runs.clear();
    unrun.covariance.resize(0, 0);
    write(unrun, folder / "fit.h5");
    EXPECT_TRUE(read_fit(folder / "fit.h5").runs.empty());
    EXPECT_EQ(read_fit(folder / "fit.h5").covariance.size(), 0);
    write(Sensitivity{}, folder / "sensitivity.h5");
    EXPECT_TRUE(read_sensitivity(folder / "sensitivity.h5").runs.empty());
}

TEST(UnitHdf5, FileSaysWhatItIs) {
    const TemporaryFolder folder;
    write(full_record(), folder / "record.h5");
    const hdf5::Group root = hdf5::open(folder / "record.h5");
    EXPECT_EQ(root.attribute("program"), "crampfit");
    EXPECT_EQ(root.attribute("version"), CRAMPFIT_VERSION);
    EXPECT_EQ(root.attribute("kind"), "record");
    std::string created = root.attribute("created");
    std::replace_if(
        created.begin(), created.end(), [](char c) { return c >= '0' && c <= '9'; }, '9');
    EXPECT_EQ(created, "9999-99-99T99:99:99Z");
    EXPECT_EQ(root.attribute_of("series/force", "units"), "N");
    EXPECT_EQ(root.attribute_of("frames/0001/stress", "units"), "Pa");
    EXPECT_EQ(root.attribute_of("series/K_I", "units"), "Pa sqrt(m)");
    EXPECT_FALSE(root.attribute_of("series/K_I", "description").empty());
}

TEST(UnitHdf5, LargeMapsAreCompressed) {
    const TemporaryFolder folder;
    Specimen specimen = full_specimen();
    specimen.columns = specimen.rows = 2000;
    specimen.label.assign(4000000, 1);
    specimen.grade.clear();
    specimen.density.clear();
    specimen.coherency.clear();
    specimen.feature.clear();
    write(specimen, folder / "specimen.h5");
    // Four million equal bytes; deflate reaches a thousandth.
    EXPECT_LT(std::filesystem::file_size(folder / "specimen.h5"), 100000u);
    EXPECT_EQ(read_specimen(folder / "specimen.h5").label, specimen.label);
}

TEST(UnitHdf5, WritingReplacesTheOldFileAndLeavesNothingElse) {
    const TemporaryFolder folder;
    folder.write("record.h5", "old");
    write(full_record(), folder / "record.h5");
    EXPECT_EQ(read_record(folder / "record.h5").steps, 123456789012);
    EXPECT_EQ(folder.size(), 1);
}

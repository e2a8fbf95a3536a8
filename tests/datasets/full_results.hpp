#pragma once

#include "datasets/crack_track.hpp"
#include "datasets/fit.hpp"
#include "datasets/record.hpp"
#include "datasets/record_file.hpp"
#include "datasets/sensitivity.hpp"
#include "datasets/specimen.hpp"

#include <limits>
#include <random>
#include <vector>

namespace crampfit {

inline constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
inline constexpr double infinite = std::numeric_limits<double>::infinity();

/// Numbers that are easily spoilt: signed zero, the smallest and largest, infinities, not a number, and ones with all
/// digits.
inline std::vector<double> awkward_numbers() {
    return {0.0,
            -0.0,
            1.0 / 3.0,
            std::numeric_limits<double>::denorm_min(),
            std::numeric_limits<double>::max(),
            -infinite,
            infinite,
            not_a_number,
            0.1};
}

inline std::vector<Vec2> some_points(std::size_t count) {
    std::mt19937_64 random(count);
    std::normal_distribution<double> normal;
    std::vector<Vec2> points(count);
    for (Vec2& point : points) point = {normal(random), normal(random)};
    return points;
}

/// Two cracks, of which the second one is tracked, two reactions with names that no HDF5 path could hold, places that it
/// moves on from, two frames.
inline Record full_record() {
    Record record;
    record.status = RunStatus::split;
    record.message = "the crack left the specimen";
    record.tracked_crack = 1;
    record.paths = {some_points(2), some_points(17)};
    CrackHistory crack;
    for (const double number : awkward_numbers()) {
        Instant instant;
        for (const SeriesColumn& column : series_columns) column.value(instant) = number;
        instant.time = 1e-6 * static_cast<double>(record.series.size());
        record.series.push_back(instant);
        crack.length.push_back(number);
        crack.tip.push_back({number, -number});
        crack.G.push_back(number);
        crack.K_I.push_back(number);
        crack.K_II.push_back(number);
    }
    record.cracks = {crack};
    record.reactions = {{"left/right wheel", some_points(record.series.size())}, {"Auflager ä", crack.tip}};
    for (const double number : awkward_numbers()) {
        CriticalLoad place;
        for (const DrivingColumn& column : driving_columns) place.*column.value = number;
        place.tip = {-number, number};
        record.driving.push_back(place);
    }
    record.point_position = some_points(5000);
    record.point_latewood.assign(5000, 0.25f);
    for (int i = 0; i < 2; ++i) {
        Frame frame{.time = 0.1 * i, .displacement = not_a_number, .moved = {}, .stress = {}, .crack = some_points(3)};
        for (const Vec2& point : record.point_position) {
            frame.moved.push_back(point.cast<float>() * static_cast<float>(i));
            frame.stress.push_back({static_cast<float>(point.x()), std::numeric_limits<float>::infinity(), -0.0f, 1e-40f});
        }
        record.frames.push_back(frame);
    }
    record.scene_text = "title = \"TR+ über μm 年輪\"\n[model]\n";
    record.explanation = "explicit dynamics";
    record.steps = 123456789012;
    record.points = 5000;
    record.seconds = 1.5;
    record.worst_energy_imbalance = not_a_number;
    return record;
}

inline Fit full_fit() {
    Fit fit;
    fit.status = FitStatus::run_limit;
    fit.message = "max_runs was used up";
    fit.method = "ceres: few parameters";
    fit.parameters = {{"EW, toughness", "materials.EW.toughness materials.ray.toughness", 103.25, "J/m^2", 1.0 / 3.0, -infinite,
                       infinite, 80.0, false},
                      {"LW \"hard\"", "materials.LW.toughness", not_a_number, "", 0.0, -0.0, 5e-324, 1.0, true}};
    fit.covariance = Eigen::MatrixXd{{1.0, 0.1}, {0.3, infinite}};
    fit.correlation = Eigen::MatrixXd{{1.0, -0.5}, {-0.25, 1.0}};
    fit.misfit = 12.75;
    fit.reduced_chi_square = 0.9;
    fit.residuals = {{"wedge 1", "force", 1e-4, 12.0, 12.5, 0.2, 2.5}, {"wedge 1", "arrival", 2e-3, not_a_number, 0, 1e-4, 0}};
    fit.runs = {{{80.0, 120.0}, infinite, "unstable", 0.5}, {{103.25, not_a_number}, 12.75, "finished", 0.625}};
    fit.distances = {{"wedge 1", "force", 1.0 / 3.0, 0.25, -0.0, not_a_number}};
    fit.models = {{"hoop stress", "converged", 1.0 / 3.0, {0.1, 0.2}, 4.3, 5.4, 0.9},
                  {"straight", "failed", infinite, {0.3, 0.4}, infinite, infinite, 0.0}};
    fit.crack_paths = {
        {"wedge 1",
         true,
         {3, 2, {1, 2, 3, 4, 5, 255}, {-0.0, -1.0 / 3.0}, {0.1, 5e-324}},
         some_points(3),
         {{"hoop stress", "finished", {some_points(2), {}}, 1.0 / 3.0, infinite, -0.0}, {"straight", "no run ended well", {}}}},
        {"block", false, {1, 1, {0}, {0, 0}, {1, 1}}, {}, {}}};
    fit.checks = {{"wedge 1", "force", 50, 12.5, 1.0 / 3.0, -0.0, not_a_number}};
    fit.profile = {{"EW, toughness", 80.5, infinite}, {"LW \"hard\"", -0.0, 1.0 / 3.0}};
    fit.posterior = {{{80.0, 1.0 / 3.0}, 12.75}, {{infinite, -0.0}, 13.0}};
    fit.seconds = 3.25;
    fit.seed = 4000000000u;
    fit.study_text = "title = 'ü'";
    fit.scene_settings = " --set 'model.cell=0.2 mm'";
    return fit;
}

/// Followed, not found, found as the tip of a straight crack, gone through the picture.
inline CrackTrack full_track() {
    CrackTrack track;
    track.reference = "reference.png";
    track.images = {"a.png", "b.png", "c.png", "d.png"};
    track.pixel = 1.0 / 3.0;
    track.columns = 640;
    track.rows = 480;
    track.tips = {{TipStatus::ok, {10, 20}, 0.5, 30, 1.0 / 3.0, some_points(4)},
                  {.status = TipStatus::no_crack},
                  {.status = TipStatus::ok, .tip = {11, 21}, .angle = -0.0, .length = 31, .sigma = 5e-324},
                  {.status = TipStatus::outside, .way = some_points(5)}};
    return track;
}

inline Sensitivity full_sensitivity() {
    Sensitivity sensitivity;
    sensitivity.status = SensitivityStatus::interrupted;
    sensitivity.message = "2 of 3 runs failed";
    sensitivity.parameters = {
        {"EW, toughness", "materials.EW.toughness materials.ray.toughness", "J/m^2", 80.0, 1.0 / 3.0, 400.0},
        {"nu", "materials.EW.nu", "", 0.3, -0.0, 0.4}};
    sensitivity.outputs = {{"peak force", "N"}, {"force at 0.5 mm", "N"}, {"arrest length 1", "m"}};
    sensitivity.indices = {{"peak force", "nu", "sobol", 0.25, -0.5, infinite, "first"},
                           {"peak force", "EW, toughness", "sobol", not_a_number, 5e-324, 1.0 / 3.0, "total"}};
    sensitivity.runs = {{{80.0, 0.3}, {1.5, not_a_number, -0.0}, "finished", 0.5},
                        {{1.0 / 3.0, 0.1}, {not_a_number, not_a_number, not_a_number}, "unstable", 0.25}};
    sensitivity.seconds = 3.25;
    sensitivity.seed = 4000000000u;
    sensitivity.study_text = "title = 'ü'";
    sensitivity.scene_settings = " --set 'model.cell=0.3 mm'";
    return sensitivity;
}

inline Specimen full_specimen() {
    Specimen specimen;
    specimen.columns = 7;
    specimen.rows = 3;
    specimen.pixel = 25e-6;
    specimen.classes = {"EW", "Spätholz"};
    specimen.label.assign(21, 0);
    specimen.label[4] = 1;
    specimen.label[20] = Specimen::void_label;
    specimen.grade.assign(21, 0.0f);
    specimen.grade[1] = 1.0f / 3.0f;
    specimen.density.assign(21, 312.5f);
    specimen.density[3] = std::numeric_limits<float>::quiet_NaN();
    specimen.coherency.assign(21, 0.5f);
    specimen.feature.assign(21, 0);
    specimen.feature[20] = static_cast<std::uint8_t>(Feature::background);
    specimen.borders = {{1, {{0.25, 1}, {6, 1.5}}}, {2, {{0, 2}, {3, 2.125}, {6, 2}}}};
    specimen.rings = {{2, 1.0 / 3.0, 0.25}};
    specimen.source = "block.png";
    return specimen;
}

}  // namespace crampfit

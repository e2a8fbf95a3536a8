#include "inverse/crack_paths.hpp"

#include "forward/geometry.hpp"
#include "forward/material_map.hpp"
#include "forward/simulate.hpp"
#include "inverse/compare.hpp"
#include "inverse/pool.hpp"
#include "inverse/scene_runs.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr int places_along = 1000;        // at which a photographed path is compared
constexpr double same_place = 1e-9;       // [m]
constexpr int picture_side = 600;         // of the model's wood, its longer side [px]
constexpr double light = 235, dark = 90;  // gray of the first and the last material

/// The nearest place of a line to another place.
struct Nearest {
    double distance = std::numeric_limits<double>::infinity();  // [m]
    Vec2 place = Vec2::Zero();
    bool at_end = false;  // of the line
};

Nearest nearest_on(const std::vector<std::vector<Vec2>>& lines, const Vec2& x) {
    Nearest nearest;
    for (const std::vector<Vec2>& line : lines) {
        for (std::size_t i = 1; i < line.size(); ++i) {
            const double part = nearest_on_segment(line[i - 1], line[i], x);
            const Vec2 place = line[i - 1] + part * (line[i] - line[i - 1]);
            if (const double distance = (place - x).norm(); distance < nearest.distance) {
                nearest = {distance, place, (i == 1 && part <= 0.0) || (i + 1 == line.size() && part >= 1.0)};
            }
        }
    }
    return nearest;
}

double length_of(const std::vector<Vec2>& line) {
    double length = 0;
    for (std::size_t i = 1; i < line.size(); ++i) {
        length += (line[i] - line[i - 1]).norm();
    }
    return length;
}

/// The middles of equal stretches of a line.
std::vector<Vec2> evenly(const std::vector<Vec2>& line, double stretch) {
    std::vector<Vec2> places;
    double next = 0.5 * stretch;  // from the segment's start
    for (std::size_t i = 1; i < line.size(); ++i) {
        const double length = (line[i] - line[i - 1]).norm();
        for (; next < length; next += stretch) {
            places.push_back(line[i - 1] + next / length * (line[i] - line[i - 1]));
        }
        next -= length;
    }
    return places;
}

std::vector<std::vector<Vec2>> initial_cracks(const Scene& scene) {
    std::vector<std::vector<Vec2>> cracks;
    for (const Crack& crack : scene.cracks) {
        cracks.push_back(crack.points);
    }
    return cracks;
}

/// The scene's wood, the later the darker.
PlanePicture picture_of_wood(const Scene& scene) {
    const MaterialMap wood(scene);
    const Vec2 size = scene.specimen.size;
    const double pixel = size.maxCoeff() / picture_side;
    const Vec2 count = (size / pixel - Vec2::Constant(1e-6)).array().ceil();  // 1e-6 of a pixel is rounding
    PlanePicture picture{static_cast<int>(count.x()), static_cast<int>(count.y()), {}, Vec2::Zero(), pixel * count};
    for (int row = 0; row < picture.rows; ++row) {
        for (int column = 0; column < picture.columns; ++column) {
            const Vec2 place(pixel * (column + 0.5), picture.high.y() - pixel * (row + 0.5));
            const LocalWood here = wood.at(place);
            const bool there = here.filled > 0 && has_wood(scene.specimen, place);
            picture.gray.push_back(there ? static_cast<std::uint8_t>(std::lround(std::lerp(light, dark, here.latewood))) : 255);
        }
    }
    return picture;
}

/// One of the models that were fitted.
struct FittedModel {
    std::string name;
    Study study;             // with its scenes
    Eigen::VectorXd values;  // best, SI; none where no run ended well
};

Eigen::VectorXd in_si(const std::vector<Parameter>& parameters, const std::vector<double>& values) {
    Eigen::VectorXd result(static_cast<Eigen::Index>(values.size()));
    for (std::size_t j = 0; j < values.size(); ++j) {
        result[static_cast<Eigen::Index>(j)] = values[j] * parameters[j].unit_factor;
    }
    return result;
}

std::vector<FittedModel> models_of(const Study& study, const Fit& fit) {
    std::vector<FittedModel> models;
    for (const ComparedModel& compared : fit.models) {
        const auto choice = std::ranges::find(study.models, compared.name, &ModelChoice::name);
        models.push_back({compared.name, model_of(study, static_cast<std::size_t>(choice - study.models.begin())), {}});
        if (std::isfinite(compared.misfit)) {
            models.back().values = in_si(study.parameters, compared.values);
        }
    }
    if (study.models.empty()) {
        std::vector<double> values;
        for (const FittedParameter& parameter : fit.parameters) {
            values.push_back(parameter.value);
        }
        models.push_back({"", study, {}});
        if (std::isfinite(fit.misfit)) {
            models.back().values = in_si(study.parameters, values);
        }
    }
    for (FittedModel& model : models) {
        for (Experiment& experiment : model.study.experiments) {
            experiment.scene.output.frames = 0;
        }
    }
    return models;
}

}  // namespace

void compare_paths(const std::vector<Vec2>& photographed, const std::vector<std::vector<Vec2>>& initial,
                   SimulatedPath& simulated) {
    const double stretch = length_of(photographed) / places_along;
    if (!(stretch > 0)) {
        return;
    }
    double sum = 0, largest = 0;
    int count = 0;
    for (const Vec2& place : evenly(photographed, stretch)) {
        const Nearest nearest = nearest_on(simulated.cracks, place);
        if (!std::isfinite(nearest.distance) || nearest.at_end || nearest_on(initial, nearest.place).distance < same_place) {
            continue;
        }
        sum += nearest.distance;
        largest = std::max(largest, nearest.distance);
        ++count;
    }
    if (count > 0) {
        simulated.mean_distance = sum / count;
        simulated.largest_distance = largest;
        simulated.compared_length = count * stretch;
    }
}

std::vector<CrackPaths> crack_paths(const Study& study, const Fit& fit, int threads, const std::atomic<bool>* stop) {
    const bool photographed =
        std::ranges::any_of(study.experiments, [](const Experiment& experiment) { return experiment.photograph.has_value(); });
    if (study.models.empty() && !photographed) {
        return {};
    }
    const std::vector<FittedModel> models = models_of(study, fit);
    const int jobs = static_cast<int>(study.experiments.size() * models.size());
    const int threads_a_run = std::max(1, thread_count(threads) / jobs);
    const Forward forward = [threads_a_run](const Scene& scene, const std::atomic<bool>* stop_run) {
        SimulateOptions options;
        options.stop_requested = stop_run;
        options.threads = threads_a_run;
        return simulate(scene, options);
    };
    std::vector<SceneRuns> runs;
    for (const FittedModel& model : models) {
        runs.emplace_back(model.study, forward, stop);
    }
    std::vector<CrackPaths> all(study.experiments.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
        const Experiment& experiment = study.experiments[i];
        all[i].experiment = experiment.name;
        all[i].on_photograph = experiment.photograph && !experiment.photograph->file.empty();
        all[i].picture = all[i].on_photograph ? experiment.photograph->picture : picture_of_wood(experiment.scene);
        all[i].photographed = experiment.photograph ? experiment.photograph->path : std::vector<Vec2>();
        all[i].simulated.resize(models.size());
    }
    parallel_for(jobs, thread_count(threads), [&](int job) {
        const std::size_t i = static_cast<std::size_t>(job) / models.size(), k = static_cast<std::size_t>(job) % models.size();
        SimulatedPath& simulated = all[i].simulated[k];
        simulated.model = models[k].name;
        if (models[k].values.size() == 0) {
            simulated.status = "no run ended well";
            return;
        }
        const SceneRuns::Outcome outcome = runs[k].run(i, models[k].values);
        simulated.status = outcome.status;
        if (outcome.record) {
            simulated.cracks = outcome.record->paths;
            compare_paths(all[i].photographed, initial_cracks(models[k].study.experiments[i].scene), simulated);
        }
    });
    return all;
}

}  // namespace crampfit

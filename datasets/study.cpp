#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "datasets/machine.hpp"
#include "datasets/study_parts.hpp"
#include "datasets/text_file.hpp"
#include "datasets/toml_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

const std::vector<std::string> study_keys{"title",     "experiments", "scene",       "outputs", "parameters",
                                          "optimizer", "uncertainty", "sensitivity", "runs",    "compare"};

/// What --set gives, for the study itself and for all its scenes.
struct SplitOverrides {
    Overrides study;
    Overrides scenes;
};

SplitOverrides split_overrides(const Overrides& overrides) {
    SplitOverrides split;
    for (const auto& [key, value] : overrides) {
        const std::string section = split_key(key, command_line, value).front();
        const bool of_study = std::find(study_keys.begin(), study_keys.end(), section) != study_keys.end();
        (of_study ? split.study : split.scenes).emplace_back(key, value);
    }
    return split;
}

Noise read_noise(const Entry& entry, const Curves& data, bool has_fields) {
    entry.only({"force", "crack_length", "displacement", "time", "displacement_field"});
    const auto sigma = [&](const char* name, const Dimension& dimension, const std::vector<double>& column) {
        const auto found = entry.find(name);
        if (!found) {
            return std::optional<double>();
        }
        if (column.empty()) {
            found->fail("the data have no such column");
        }
        constexpr double last_digit = 1e-12;  // of a reading
        const double noise = found->number(limits::positive(dimension));
        double most = 0;
        for (const double value : column) {
            most = std::isnan(value) ? most : std::max(most, std::abs(value));
        }
        if (most > 0 && noise > most) {
            found->fail("must not be more than the column's largest reading: leave out data that say nothing");
        }
        if (noise < last_digit * most) {
            found->fail("must not be less than the last digit of the column's readings");
        }
        return std::optional(noise);
    };
    const auto field = entry.find("displacement_field");
    if (field && !has_fields) {
        field->fail("the experiment has no fields");
    }
    return {sigma("force", dimension::force, data.force), sigma("crack_length", dimension::length, data.crack_length),
            sigma("displacement", dimension::length, data.displacement), sigma("time", dimension::time, data.time),
            field ? std::optional(field->number(limits::positive(dimension::length))) : std::nullopt};
}

Machine read_machine(const Entry& experiment, const Curves& data) {
    Machine machine;
    for (const MachineNumber& number : machine_numbers()) {
        if (const auto entry = experiment.find(number.name)) {
            machine.*number.value = entry->number(number.rule);
            if ((data.*number.column).empty()) {
                entry->fail("the data have no such column");
            }
        }
    }
    return machine;
}

// A crack as long as some reading must fit into the specimen.
void check_crack_lengths(const Experiment& experiment) {
    constexpr double clearly = 3.0;  // sigmas
    const double noise = clearly * experiment.noise.crack_length.value_or(0.0);
    const double longest = experiment.scene.specimen.size.sum();
    for (std::size_t i = 0; i < experiment.data.crack_length.size(); ++i) {
        const double length = experiment.data.crack_length[i];
        if (length < -noise || length > longest + noise) {
            throw InputError(experiment.data_file.string(), fmt::format("crack_length, reading {}", i + 1),
                             fmt::format("{:g} mm", 1e3 * length),
                             fmt::format("must lie between 0 and the {:g} mm of the specimen's width and height together; leave "
                                         "the field empty for a gap",
                                         1e3 * longest));
        }
    }
}

// Where two instruments share a table, as a camera that knows the time alone, rows without a displacement get that on the line
// over time between the rows that have both; none beyond these.
Curves placed_by_time(Curves curves) {
    std::vector<std::pair<double, double>> known;  // time, displacement
    for (std::size_t i = 0; i < std::min(curves.time.size(), curves.displacement.size()); ++i) {
        if (!std::isnan(curves.time[i]) && !std::isnan(curves.displacement[i])) {
            known.emplace_back(curves.time[i], curves.displacement[i]);
        }
    }
    std::ranges::stable_sort(known, {}, &std::pair<double, double>::first);
    for (std::size_t i = 0; i < curves.displacement.size() && !known.empty(); ++i) {
        const double time = std::isnan(curves.displacement[i]) && !curves.time.empty() ? curves.time[i] : std::nan("");
        if (time >= known.front().first && time <= known.back().first) {
            const auto after = std::ranges::lower_bound(known, time, {}, &std::pair<double, double>::first);
            const auto before = after == known.begin() ? after : std::prev(after);
            const double share = after->first > time ? (time - before->first) / (after->first - before->first) : 1.0;
            curves.displacement[i] = std::lerp(before->second, after->second, share);
        }
    }
    return curves;
}

Experiment read_experiment(const Entry& entry, std::size_t number, const Overrides& scene_overrides) {
    entry.only({"name", "scene", "data", "fields", "photograph", "noise", "weight", "compliance", "force_offset",
                "displacement_offset"});
    Experiment experiment;
    const auto name = entry.find("name");
    experiment.name = name ? name->text() : fmt::format("experiment {}", number);
    experiment.scene = read_scene(entry.at("scene").existing_file(), scene_overrides);
    if (const auto fields = entry.find("fields")) {
        experiment.fields = read_measured_fields(*fields, experiment.scene);
        experiment.scene.output.probes = probes_for(*experiment.fields);
    }
    if (entry.has("data") || !experiment.fields) {
        experiment.data_file = entry.at("data").existing_file();
        experiment.data = placed_by_time(read_curves(experiment.data_file));
    }
    if (const auto photograph = entry.find("photograph")) {
        experiment.photograph = read_photograph(*photograph, experiment.scene);
    }
    if (const auto noise = entry.find("noise")) {
        experiment.noise = read_noise(*noise, experiment.data, experiment.fields.has_value());
    }
    check_crack_lengths(experiment);
    experiment.machine = read_machine(entry, experiment.data);
    if (const auto weight = entry.find("weight")) {
        experiment.weight = weight->number(limits::weight);
    }
    return experiment;
}

std::vector<Experiment> read_experiments(const Entry& list, const Overrides& scene_overrides) {
    std::vector<Experiment> experiments;
    for (const Entry& entry : list.list()) {
        experiments.push_back(read_experiment(entry, experiments.size(), scene_overrides));
        for (std::size_t i = 0; i + 1 < experiments.size(); ++i) {
            if (experiments[i].name == experiments.back().name) {
                entry.fail(fmt::format("the name \"{}\" is taken: each experiment needs a name of its own", experiments[i].name));
            }
        }
    }
    if (experiments.empty()) {
        list.fail("at least one experiment is needed");
    }
    return experiments;
}

OptimizerChoice read_optimizer(const Entry& entry) {
    constexpr int most_starts = 10'000;
    constexpr int most_runs = 100'000'000;
    entry.only({"method", "loss", "starts", "max_runs"});
    OptimizerChoice optimizer;
    if (const auto method = entry.find("method")) {
        Choices<std::string> choices;
        for (const char* known :
             {"auto", "ceres", "bobyqa", "sbplx", "cobyla", "neldermead", "crs2", "isres", "direct", "mlsl"}) {
            choices.emplace_back(known, known);
        }
        optimizer.method = method->choice(choices);
    }
    if (const auto loss = entry.find("loss")) {
        optimizer.loss = loss->choice<Loss>({{"squares", Loss::squares}, {"huber", Loss::huber}, {"cauchy", Loss::cauchy}});
    }
    if (const auto starts = entry.find("starts")) {
        optimizer.starts = starts->integer(1, most_starts);
    }
    if (const auto runs = entry.find("max_runs")) {
        optimizer.max_runs = runs->integer(1, most_runs);
    }
    return optimizer;
}

UncertaintyChoice read_uncertainty(const Entry& entry) {
    constexpr int most_samples = 100'000'000;
    entry.only({"profile", "posterior"});
    UncertaintyChoice uncertainty;
    if (const auto profile = entry.find("profile")) {
        uncertainty.profile = profile->boolean();
    }
    if (const auto posterior = entry.find("posterior")) {
        uncertainty.posterior = posterior->integer(0, most_samples);
    }
    return uncertainty;
}

/// Reads all scenes once more for each value of the key.
void read_models(const Entry& entry, const Overrides& scene_overrides, Study& study) {
    entry.only({"key", "values"});
    if (study.experiments.empty()) {
        entry.fail("only a study of experiments can compare models");
    }
    study.compared_key = entry.at("key").text();
    if (const Parameter* owner = owner_of(numbers_at(study, study.compared_key), study.parameters, study)) {
        entry.at("key").fail(fmt::format("belongs to the parameter \"{}\" already", owner->name));
    }
    for (const Entry& value : entry.at("values").list()) {
        ModelChoice& model = study.models.emplace_back();
        model.name = value.text();
        for (std::size_t i = 0; i + 1 < study.models.size(); ++i) {
            if (study.models[i].name == model.name) {
                value.fail("is given twice");
            }
        }
        Overrides overrides = scene_overrides;
        overrides.emplace_back(study.compared_key, model.name);
        for (const Experiment& experiment : study.experiments) {
            try {
                model.scenes.push_back(read_scene(experiment.scene.file, overrides));
            } catch (const InputError& error) {
                value.fail(
                    fmt::format("does not suit {} of {}: {}", study.compared_key, experiment.scene.file.string(), error.rule));
            }
        }
    }
    if (study.models.size() < 2) {
        entry.at("values").fail("at least two values are needed");
    }
}

/// A number that a parameter sets in every run has no use for a value, unless the parameter begins with it.
void check_overrides(const Overrides& overrides, const Entry& parameters, const Study& study) {
    for (const auto& [key, value] : overrides) {
        const Parameter* owner = owner_of(numbers_at(study, key), study.parameters, study);
        if (owner && parameters.list()[static_cast<std::size_t>(owner - study.parameters.data())].has("initial")) {
            throw InputError(command_line, key, value,
                             fmt::format("belongs to the parameter \"{0}\": give parameters.{1}.initial", owner->name,
                                         join_key("", owner->name)));
        }
    }
}

SensitivityChoice read_sensitivity(const Entry& entry) {
    constexpr int most_samples = 1 << 24;
    entry.only({"method", "samples"});
    SensitivityChoice sensitivity;
    if (const auto method = entry.find("method")) {
        sensitivity.method = method->choice<SensitivityMethod>(
            {{"local", SensitivityMethod::local}, {"morris", SensitivityMethod::morris}, {"sobol", SensitivityMethod::sobol}});
    }
    if (const auto samples = entry.find("samples")) {
        sensitivity.samples = samples->integer(2, most_samples);
    }
    return sensitivity;
}

}  // namespace

std::vector<const Scene*> scenes_of(const Study& study) {
    std::vector<const Scene*> scenes;
    if (study.scene) {
        scenes.push_back(&*study.scene);
    }
    for (const Experiment& experiment : study.experiments) {
        scenes.push_back(&experiment.scene);
    }
    return scenes;
}

Study read_study(const std::filesystem::path& file, const Overrides& overrides) {
    const SplitOverrides split = split_overrides(overrides);
    const Document document(read_text(file), file, split.study);
    const Entry root = document.root();
    if (const auto specimen = root.find("specimen")) {
        specimen->fail("is a key of a scene: a study is needed, which names the scenes of its experiments");
    }
    root.only(study_keys);
    Study study;
    study.file = file;
    study.text = document.text();
    study.scene_settings = split.scenes;
    if (const auto title = root.find("title")) {
        study.title = title->text();
    }
    if (const auto scene = root.find("scene")) {
        if (root.has("experiments")) {
            scene->fail("a study has either a scene or experiments, each with its own scene");
        }
        study.scene = read_scene(scene->existing_file(), split.scenes);
    } else {
        study.experiments = read_experiments(root.at("experiments"), split.scenes);
    }
    study.parameters = read_parameters(root.at("parameters"), study);
    check_overrides(overrides, root.at("parameters"), study);
    if (const auto outputs = root.find("outputs")) {
        study.outputs = read_outputs(*outputs, study);
    }
    if (const auto sensitivity = root.find("sensitivity")) {
        study.sensitivity = read_sensitivity(*sensitivity);
    }
    if (const auto optimizer = root.find("optimizer")) {
        study.optimizer = read_optimizer(*optimizer);
    }
    if (const auto uncertainty = root.find("uncertainty")) {
        study.uncertainty = read_uncertainty(*uncertainty);
    }
    if (const auto compare = root.find("compare")) {
        read_models(*compare, split.scenes, study);
    }
    if (const auto runs = root.find("runs")) {
        runs->only({"time_limit"});
        study.time_limit = runs->at("time_limit").number(limits::positive(dimension::time));
    }
    return study;
}

}  // namespace crampfit

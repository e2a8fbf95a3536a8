#include "inverse/run_store.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "datasets/machine.hpp"
#include "inverse/scene_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <string_view>

namespace crampfit {
namespace {

// Of the journal's entries that hold what a search has found; parameters are its number and, by its bits, what it was asked.
const char* const search_status = "search";

template <class T>
std::string_view bytes_of(const std::vector<T>& values) {
    return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

// All that the result of a run depends on besides the parameters' values; bounds, optimizer and what is made of the runs do not
// count, so that they may change from one call to the next.
std::uint64_t fingerprint(const Study& study) {
    Fingerprint print;
    print.add(CRAMPFIT_VERSION);
    for (const Scene* scene : scenes_of(study)) {
        print.add(scene->text);
        if (const auto& map = scene->specimen.map) {
            print.add(bytes_of(map->label)).add(bytes_of(map->grade)).add(bytes_of(map->density)).add(bytes_of(map->orientation));
            print.add(map->pixel);
        }
    }
    for (const Experiment& experiment : study.experiments) {
        const Curves& data = experiment.data;
        print.add(data.time).add(data.displacement).add(data.force).add(data.crack_length);
        const Noise& noise = experiment.noise;
        for (const auto& sigma : {noise.force, noise.crack_length, noise.displacement, noise.time, noise.displacement_field}) {
            print.add(sigma.value_or(0.0));
        }
        if (const auto& fields = experiment.fields) {
            print.add(fields->instants).add(fields->by_displacement ? 1.0 : 0.0);
            for (const Vec2& place : fields->places) {
                print.add(place.x()).add(place.y());
            }
            for (const std::vector<Vec2>& moved : fields->moved) {
                for (const Vec2& point : moved) {
                    print.add(point.x()).add(point.y());
                }
            }
        }
        print.add(experiment.weight);
        for (const MachineNumber& number : machine_numbers()) {
            print.add(experiment.machine.*number.value);
        }
    }
    for (const StudyOutput& output : study.outputs) {
        print.add(output.name);
    }
    for (const Parameter& parameter : study.parameters) {
        for (std::size_t k = 0; k < parameter.keys.size(); ++k) {
            print.add(parameter.keys[k]).add(parameter.factor(k));
            if (find_machine_number(study, parameter.keys[k], study.file.string(), "(any)")) {
                print.add(parameter.lower).add(parameter.upper);  // which rows are compared (covered_data)
            }
        }
        if (parameter.prior) {
            print.add(parameter.prior->mean).add(parameter.prior->sd);
        }
    }
    return print.value();
}

// As results: the number of residuals, the residuals, what was modelled.
StoredRun stored(const std::vector<double>& values, const Evaluation& evaluation) {
    StoredRun run{values, {}, evaluation.status, evaluation.seconds};
    if (evaluation.usable()) {
        run.results.push_back(static_cast<double>(evaluation.residuals.size()));
        run.results.insert(run.results.end(), evaluation.residuals.begin(), evaluation.residuals.end());
        run.results.insert(run.results.end(), evaluation.modelled.begin(), evaluation.modelled.end());
    }
    return run;
}

Evaluation evaluation_of(const StoredRun& run) {
    Evaluation evaluation;
    evaluation.status = run.status;
    evaluation.seconds = run.seconds;
    if (!run.results.empty()) {
        const auto residuals = static_cast<Eigen::Index>(run.results[0]);
        const auto modelled = static_cast<Eigen::Index>(run.results.size()) - 1 - residuals;
        evaluation.residuals = Eigen::Map<const Eigen::VectorXd>(run.results.data() + 1, residuals);
        evaluation.modelled = Eigen::Map<const Eigen::VectorXd>(run.results.data() + 1 + residuals, modelled);
        evaluation.misfit = evaluation.residuals.squaredNorm();
    }
    return evaluation;
}

// A value as a scene reads it, with the same bits: what is divided by the unit's factor and multiplied again may be one off.
std::string with_unit(double value, const Parameter& parameter) {
    double number = value / parameter.unit_factor;
    for (const double near : {number, std::nextafter(number, INFINITY), std::nextafter(number, -INFINITY)}) {
        if (near * parameter.unit_factor == value) {
            number = near;
            break;
        }
    }
    return parameter.unit.empty() ? fmt::format("{}", number) : fmt::format("\"{} {}\"", number, parameter.unit);
}

bool knows(const Scene& scene, const std::string& key) {
    try {
        get_number(scene, key);
        return true;
    } catch (const InputError&) {
        return false;
    }
}

}  // namespace

std::string quoted_for_shell(const std::string& word) {
    const auto is_plain = [](char letter) {
        return std::isalnum(static_cast<unsigned char>(letter)) != 0 ||
               std::string_view("._/-+=:,").find(letter) != std::string_view::npos;
    };
    if (!word.empty() && word[0] != '-' && std::ranges::all_of(word, is_plain)) {
        return word;
    }
    std::string quoted = "'";
    for (const char letter : word) {
        quoted += letter == '\'' ? "'\\''" : std::string(1, letter);
    }
    return quoted + "'";
}

RunStore::RunStore(const RunKeeping& keeping, const Study& study, const std::atomic<bool>* stop) : stop_(stop) {
    if (keeping.file.empty()) {
        return;
    }
    journal_ = std::make_unique<RunJournal>(keeping.file, fingerprint(study), keeping.resume);
    for (const StoredRun& run : journal_->found()) {
        if (run.status == search_status) {
            const auto n = static_cast<std::size_t>(run.parameters[0]);
            searches_[n] = {std::bit_cast<std::uint64_t>(run.parameters[1]), run.results};
        } else if (!had_less_time(run.status, study.time_limit)) {
            known_.insert_or_assign(run.parameters, evaluation_of(run));
        }
    }
}

std::optional<Evaluation> RunStore::known(const Eigen::VectorXd& values) {
    const std::lock_guard lock(mutex_);
    const auto run = known_.find({values.begin(), values.end()});
    return run == known_.end() ? std::nullopt : std::optional(run->second);
}

Evaluation RunStore::at(const Eigen::VectorXd& values, const std::function<Evaluation()>& run) {
    if (const auto before = known(values)) {
        return *before;
    }
    const Evaluation evaluation = run();
    if (!evaluation.usable() && stop_ && *stop_) {
        return evaluation;
    }
    const std::vector<double> key(values.begin(), values.end());
    if (journal_) {
        journal_->add(stored(key, evaluation));
    }
    const std::lock_guard lock(mutex_);
    return known_.emplace(key, evaluation).first->second;
}

std::optional<std::vector<double>> RunStore::found_by_search(std::size_t n, std::uint64_t asked) const {
    const auto search = searches_.find(n);
    return search == searches_.end() || search->second.first != asked ? std::nullopt : std::optional(search->second.second);
}

void RunStore::keep_search(std::size_t n, std::uint64_t asked, const std::vector<double>& found) {
    if (journal_ && !(stop_ && *stop_)) {
        journal_->add({{static_cast<double>(n), std::bit_cast<double>(asked)}, found, search_status, 0.0});
    }
}

std::string scene_settings_text(const Study& study) {
    std::string text;
    for (const auto& [key, value] : study.scene_settings) {
        text += " --set " + quoted_for_shell(key + "=" + value);
    }
    return text;
}

bool was_stopped(const Evaluation& evaluation) { return evaluation.status.ends_with("stopped by the user"); }

std::string failure_text(const Study& study, const Eigen::VectorXd& values, const Evaluation& evaluation) {
    if (evaluation.usable() || was_stopped(evaluation)) {
        return "";
    }
    std::string text = fmt::format("a run failed: {}; to run it again:", evaluation.status);
    for (const Scene* scene : scenes_of(study)) {
        text += "\n  crampfit simulate " + quoted_for_shell(scene->file.string());
        text += scene_settings_text(study);
        for (std::size_t j = 0; j < study.parameters.size(); ++j) {
            const Parameter& parameter = study.parameters[j];
            for (std::size_t k = 0; k < parameter.keys.size(); ++k) {
                if (knows(*scene, parameter.keys[k])) {
                    const double value = parameter.factor(k) * values[static_cast<Eigen::Index>(j)];
                    text += " --set " + quoted_for_shell(parameter.keys[k] + "=" + with_unit(value, parameter));
                }
            }
        }
        text += " -o again.h5";
    }
    return text;
}

}  // namespace crampfit

#include "inverse/kept_walks.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "datasets/machine.hpp"
#include "forward/kept_walk.hpp"
#include "inverse/stress_unit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <list>
#include <map>
#include <mutex>
#include <set>

namespace crampfit {
namespace {

bool has(const Scene& scene, const std::string& key) {
    try {
        get_number(scene, key);
        return true;
    } catch (const InputError&) {
        return false;  // another scene's key
    }
}

}  // namespace

class KeptWalks::Store {
    struct Setting {
        std::string key;
        std::size_t parameter;
        double factor;   // of its value
        double initial;  // SI
    };

    // By which equilibria have derivatives.
    static bool is_of_wood(const Setting& setting) {
        return setting.key.starts_with("materials.") || setting.key.starts_with("specimen.density_exponents.");
    }

  public:
    Store(const Study& study, int threads) : threads_(threads), parameters_(study.parameters.size()) {
        for (const Scene* scene : scenes_of(study)) {
            scenes_.push_back(scene);
        }
        for (std::size_t j = 0; j < study.parameters.size(); ++j) {
            const Parameter& parameter = study.parameters[j];
            for (std::size_t k = 0; k < parameter.keys.size(); ++k) {
                const std::string& key = parameter.keys[k];
                if (find_machine_number(study, key, study.file.string(), "(any)")) {  // these change no walk
                    walks_tell_all_ = false;
                } else {
                    const double factor = parameter.factor(k);
                    (key.ends_with(".toughness") ? toughness_ : others_).push_back({key, j, factor, factor * parameter.initial});
                }
            }
        }
        for (const Setting& setting : others_) {
            for (const Scene* scene : scenes_) {
                walks_tell_all_ = walks_tell_all_ && has(*scene, setting.key);
            }
        }
    }

    Record run(const Scene& scene, const std::atomic<bool>* stop) { return run(scene, scene, false, stop); }

    // On the walk of the scene with other values.
    Record run_near(const std::vector<double>& values, const Scene& scene, bool rough, const std::atomic<bool>* stop) {
        return run(at_point(scene, values), scene, rough, stop);
    }

    void put_off(const std::vector<double>& values, std::function<void()> work) {
        if (!walks_tell_all_) {
            work();
            return;
        }
        for (const Scene* scene : scenes_) {  // the walks are dropped when they would have been
            const std::lock_guard lock(mutex_);
            entry_of(name_of(of_walk(at_point(*scene, values))));
        }
        put_off_.push_back({name_of(of_walk(at_point(*scenes_.front(), values))), std::move(work)});
    }

    void catch_up(const std::vector<double>& values) {
        if (put_off_.empty()) {
            return;
        }
        const std::string name = name_of(of_walk(at_point(*scenes_.front(), values)));
        for (auto next = put_off_.begin(); next != put_off_.end();) {
            if (next->walk != name) {
                ++next;
                continue;
            }
            const std::function<void()> work = std::move(next->work);
            next = put_off_.erase(next);
            work();
        }
    }

    bool only_toughness() const {
        return others_.empty() && std::all_of(scenes_.begin(), scenes_.end(), [&](const Scene* scene) {
                   return kind_of(*scene).reusable && !turns_with_toughness(*scene);
               });
    }

    bool turn_with_toughness() const {
        return std::any_of(scenes_.begin(), scenes_.end(), [&](const Scene* scene) { return turns_with_toughness(*scene); });
    }

    std::vector<bool> exact_near() const {
        std::vector<bool> exact(parameters_, true);
        const auto make_walks = [&](const std::vector<Setting>& settings) {
            for (const Setting& setting : settings) {
                exact[setting.parameter] = false;
            }
        };
        make_walks(others_);
        if (turn_with_toughness()) {
            make_walks(toughness_);
        }
        return exact;
    }

    bool has_slopes() const {
        return std::all_of(others_.begin(), others_.end(), is_of_wood) &&
               std::all_of(scenes_.begin(), scenes_.end(), [&](const Scene* scene) { return kind_of(*scene).has_slopes; });
    }

    bool depend_on_order() const {
        return std::any_of(scenes_.begin(), scenes_.end(),
                           [&](const Scene* scene) { return kind_of(*scene).reusable && !kind_of(*scene).linear; });
    }

    bool has_exact_slopes() const {
        if (others_.empty() ? !only_toughness() : !has_slopes()) {
            return false;
        }
        return turning().empty();
    }

    std::vector<Eigen::Index> turning() const {
        std::set<Eigen::Index> found;
        for (const Scene* scene : scenes_) {
            const bool turns = std::any_of(scene->cracks.begin(), scene->cracks.end(), [](const Crack& crack) {
                return crack.grows != Growth::none && crack.direction != GrowthDirection::straight;
            });
            const Setting* unit = unit_of(*scene);
            const Setting* scale = scale_of_toughness(*scene);
            const auto turns_nothing = [&](const Setting& setting) {
                return (unit && unit->parameter == setting.parameter) || (scale && scale->parameter == setting.parameter);
            };
            for (const Setting& setting : settings_of_walk(*scene)) {
                if (turns && !turns_nothing(setting)) {
                    found.insert(static_cast<Eigen::Index>(setting.parameter));
                }
            }
        }
        return {found.begin(), found.end()};
    }

    std::string other_strain(const std::vector<double>& values) {
        for (const Scene* scene : scenes_) {
            if (scene->solver.strain != StrainMeasure::automatic) {
                continue;
            }
            Scene alone = at_point(*scene, values);
            const std::shared_ptr<KeptWalk> walk = walk_of(of_walk(alone));
            for (const Setting& setting : toughness_) {
                if (has(alone, setting.key)) {
                    set_number(alone, setting.key, setting.factor * values[setting.parameter]);
                }
            }
            if (walk->reusable() && KeptWalk(alone).rotates() != walk->rotates()) {
                return fmt::format("Runs took {}, as with the initial values; by itself a run of {} with the best ones takes {}, "
                                   "and its force is another: start from these, or set solver.strain. ",
                                   walk->rotates() ? "finite rotation" : "small strain", scene->file.filename().string(),
                                   walk->rotates() ? "small strain" : "finite rotation");
            }
        }
        return "";
    }

  private:
    struct Work {
        std::string walk;  // of the first scene
        std::function<void()> work;
    };

    struct Kind {  // of a scene's walks
        bool reusable, linear, has_slopes;
    };

    struct Entry {
        std::string name;
        std::shared_ptr<KeptWalk> walk;  // null: not needed yet
    };

    const Kind& kind_of(const Scene& scene) const {
        const std::lock_guard lock(mutex_);
        const auto known = kinds_.find(&scene);
        if (known != kinds_.end()) {
            return known->second;
        }
        const KeptWalk walk(scene);
        return kinds_[&scene] = {walk.reusable(), walk.linear(), walk.has_slopes()};
    }

    Record run(const Scene& base, const Scene& scene, bool rough, const std::atomic<bool>* stop) {
        SimulateOptions options;
        options.stop_requested = stop;
        const std::shared_ptr<KeptWalk> walk = walk_of(of_walk(base));
        if (!walk->reusable()) {
            return simulate(scene, options);
        }
        const Setting* unit = unit_of(scene);
        if (!unit) {
            return walk->run(scene, options, rough);
        }
        Record record = walk->run(in_unit(scene, *unit), options, rough);
        record.scene_text = scene.text;
        multiply_stress(record, get_number(scene, unit->key) / unit->initial);
        return record;
    }

    // The stiffness in which all stress of a scene may be measured, where the fit changes every stiffness that it has: then a
    // walk serves all scenes that differ from its own by this unit.
    const Setting* unit_of(const Scene& scene) const {
        const Setting* unit = nullptr;
        for (const std::string& key : stress_keys(scene)) {
            const auto found = std::find_if(others_.begin(), others_.end(), [&](const Setting& s) { return s.key == key; });
            if (found == others_.end()) {
                return nullptr;
            }
            unit = unit ? unit : &*found;
        }
        return unit;
    }

    // One of a scene's toughnesses, where the fit changes all: with all so many times as large a crack goes the same way.
    const Setting* scale_of_toughness(const Scene& scene) const {
        const Setting* scale = nullptr;
        for (const auto& [name, material] : scene.materials) {
            const auto found =
                std::find_if(toughness_.begin(), toughness_.end(),
                             [key = "materials." + name + ".toughness"](const Setting& s) { return s.key == key; });
            if (found == toughness_.end()) {
                return nullptr;
            }
            scale = &*found;
        }
        return scale;
    }

    // The scene with that stiffness at its initial value, and all other stress in proportion.
    Scene in_unit(Scene scene, const Setting& unit) const {
        multiply_stress(scene, unit.initial / get_number(scene, unit.key));
        for (const Setting& setting : others_) {
            if (setting.parameter == unit.parameter && has(scene, setting.key)) {
                set_number(scene, setting.key, setting.initial);  // to the last digit, as it names the walk
            }
        }
        return scene;
    }

    // Whether a crack goes another way through wood that is tougher.
    bool turns_with_toughness(const Scene& scene) const {
        return !toughness_.empty() && std::any_of(scene.cracks.begin(), scene.cracks.end(), [](const Crack& crack) {
            return crack.grows != Growth::none && crack.direction == GrowthDirection::energy_release_rate;
        });
    }

    // The scene's numbers that make another walk.
    std::vector<Setting> settings_of_walk(const Scene& scene) const {
        std::vector<Setting> settings = others_;
        if (turns_with_toughness(scene)) {
            settings.insert(settings.end(), toughness_.begin(), toughness_.end());
        }
        std::erase_if(settings, [&](const Setting& setting) { return !has(scene, setting.key); });
        return settings;
    }

    // A scene with the values of a point, as far as they make another walk.
    Scene at_point(Scene scene, const std::vector<double>& values) const {
        for (const Setting& setting : settings_of_walk(scene)) {
            set_number(scene, setting.key, setting.factor * values[setting.parameter]);
        }
        return scene;
    }

    // The scene whose walk serves this one.
    Scene of_walk(const Scene& scene) const {
        const Setting* unit = unit_of(scene);
        return unit ? in_unit(scene, *unit) : scene;
    }

    // What tells walks apart: the scene as it was read, and what the fit has changed in it.
    std::string name_of(const Scene& scene) const {
        std::string name = scene.file.string() + '\n' + scene.text;
        for (const Setting& setting : settings_of_walk(scene)) {
            name += fmt::format("\n{}={}", setting.key, get_number(scene, setting.key));
        }
        return name;
    }

    std::shared_ptr<KeptWalk> new_walk(Scene scene) const {
        for (const Setting& setting : toughness_) {
            if (has(scene, setting.key) && !turns_with_toughness(scene)) {
                set_number(scene, setting.key, setting.initial);
            }
        }
        const Setting* unit = unit_of(scene);
        std::vector<std::string> numbers;
        for (const Setting& setting : others_) {
            const bool stays = unit && setting.parameter == unit->parameter;
            if (!stays && is_of_wood(setting) && has(scene, setting.key)) {
                numbers.push_back(setting.key);
            }
        }
        return std::make_shared<KeptWalk>(scene, numbers, threads_);
    }

    // Those that are in use at a time. With bodies, where each may take half a gigabyte: of the best point, of the one tried, and
    // of the one that was best before. Else of some ways side by side, or of a point and of those aside of it in each parameter.
    std::size_t walks_of_a_scene() const {
        const bool has_bodies = std::any_of(scenes_.begin(), scenes_.end(), [](const Scene* s) { return !s->bodies.empty(); });
        return has_bodies ? 3 : std::max<std::size_t>(6, others_.size() + (turn_with_toughness() ? toughness_.size() : 0) + 2);
    }

    Entry& entry_of(const std::string& name) {
        const auto known = std::find_if(walks_.begin(), walks_.end(), [&](const Entry& entry) { return entry.name == name; });
        if (known != walks_.end()) {
            std::rotate(known, known + 1, walks_.end());  // to the back, as the one used last
            return walks_.back();
        }
        walks_.push_back({name, nullptr});
        if (walks_.size() > walks_of_a_scene() * scenes_.size()) {
            std::erase_if(put_off_, [&](const Work& work) { return work.walk == walks_.front().name; });
            walks_.pop_front();
        }
        return walks_.back();
    }

    std::shared_ptr<KeptWalk> walk_of(const Scene& scene) {
        const std::string name = name_of(scene);
        const std::lock_guard lock(mutex_);
        Entry& entry = entry_of(name);
        if (!entry.walk) {
            entry.walk = new_walk(scene);
        }
        return entry.walk;
    }

    int threads_;
    std::size_t parameters_;
    std::vector<const Scene*> scenes_;
    std::vector<Setting> toughness_, others_;
    bool walks_tell_all_ = true;  // two points with the same walk of one scene have the same walks, and differ by toughness alone
    mutable std::mutex mutex_;
    mutable std::map<const Scene*, Kind> kinds_;
    std::deque<Entry> walks_;
    std::list<Work> put_off_;
};

KeptWalks::KeptWalks(const Study& study, int threads) : store_(std::make_shared<Store>(study, threads)) {}
KeptWalks::~KeptWalks() = default;

Forward KeptWalks::exact() const {
    return [store = store_](const Scene& scene, const std::atomic<bool>* stop) { return store->run(scene, stop); };
}

Forward KeptWalks::in_any_order() const {
    if (!depend_on_order()) {
        return exact();
    }
    return [](const Scene& scene, const std::atomic<bool>* stop) {
        SimulateOptions options;
        options.stop_requested = stop;
        return simulate(scene, options);
    };
}

bool KeptWalks::depend_on_order() const { return store_->depend_on_order(); }

Forward KeptWalks::near(const std::vector<double>& values) const {
    return [store = store_, values](const Scene& scene, const std::atomic<bool>* stop) {
        return store->run_near(values, scene, false, stop);
    };
}

Forward KeptWalks::rough(const std::vector<double>& values) const {
    return [store = store_, values](const Scene& scene, const std::atomic<bool>* stop) {
        return store->run_near(values, scene, true, stop);
    };
}

void KeptWalks::put_off(const std::vector<double>& values, std::function<void()> work) const {
    store_->put_off(values, std::move(work));
}

void KeptWalks::catch_up(const std::vector<double>& values) const { store_->catch_up(values); }

bool KeptWalks::only_toughness() const { return store_->only_toughness(); }
bool KeptWalks::turn_with_toughness() const { return store_->turn_with_toughness(); }
std::vector<Eigen::Index> KeptWalks::turning() const { return store_->turning(); }
std::vector<bool> KeptWalks::exact_near() const { return store_->exact_near(); }
bool KeptWalks::has_slopes() const { return store_->has_slopes(); }
std::string KeptWalks::other_strain(const std::vector<double>& values) const { return store_->other_strain(values); }
bool KeptWalks::has_exact_slopes() const { return store_->has_exact_slopes(); }

}  // namespace crampfit

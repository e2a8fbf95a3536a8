#include "inverse/kept_walks.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "forward/kept_walk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <mutex>

namespace crampfit {
namespace {

// Walks that are kept at a time: a fit of moduli leaves each one behind after a few runs.
constexpr std::size_t most_walks = 6;

class Walks {
  public:
    explicit Walks(const Study& study) {
        for (const Parameter& parameter : study.parameters) {
            for (const std::string& key : parameter.keys) {
                if (key.ends_with(".toughness")) {
                    toughness_.emplace_back(key, parameter.initial);
                } else {
                    keys_.push_back(key);
                }
            }
        }
    }

    Record run(const Scene& scene, const std::atomic<bool>* stop) {
        SimulateOptions options;
        options.stop_requested = stop;
        const std::shared_ptr<KeptWalk> walk = walk_of(scene);
        return walk->reusable() ? walk->run(scene, options) : simulate(scene, options);
    }

  private:
    // What tells walks apart: the scene as it was read, and what the fit has changed in it.
    std::string name_of(const Scene& scene) const {
        std::string name = scene.file.string() + '\n' + scene.text;
        for (const std::string& key : keys_) {
            try {
                name += fmt::format("\n{}={}", key, get_number(scene, key));
            } catch (const InputError&) {
                name += "\n" + key + " is not here";  // another scene's key
            }
        }
        return name;
    }

    Scene with_initial_toughness(Scene scene) const {
        for (const auto& [key, value] : toughness_) {
            try {
                set_number(scene, key, value);
            } catch (const InputError&) {  // another scene's key
            }
        }
        return scene;
    }

    std::shared_ptr<KeptWalk> walk_of(const Scene& scene) {
        const std::string name = name_of(scene);
        const std::lock_guard lock(mutex_);
        for (const auto& [known, walk] : walks_) {
            if (known == name) {
                return walk;
            }
        }
        walks_.emplace_back(name, std::make_shared<KeptWalk>(with_initial_toughness(scene)));
        if (walks_.size() > most_walks) {
            walks_.pop_front();
        }
        return walks_.back().second;
    }

    std::vector<std::string> keys_;                           // all but toughnesses
    std::vector<std::pair<std::string, double>> toughness_;  // key and initial value [J/m^2]
    std::mutex mutex_;
    std::deque<std::pair<std::string, std::shared_ptr<KeptWalk>>> walks_;
};

}  // namespace

Forward forward_with_kept_walks(const Study& study) {
    auto walks = std::make_shared<Walks>(study);
    return [walks](const Scene& scene, const std::atomic<bool>* stop) { return walks->run(scene, stop); };
}

bool runs_share_walks(const Study& study) {
    for (const Parameter& parameter : study.parameters) {
        for (const std::string& key : parameter.keys) {
            if (!key.ends_with(".toughness")) {
                return false;
            }
        }
    }
    const auto scenes = scenes_of(study);
    return std::all_of(scenes.begin(), scenes.end(), [](const Scene* scene) { return KeptWalk(*scene).reusable(); });
}

}  // namespace crampfit

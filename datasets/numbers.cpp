#include "datasets/numbers.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "datasets/keys.hpp"
#include "datasets/scene_parts.hpp"

#include <fmt/format.h>

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace crampfit {
namespace {

/// Walks one key through a scene.
class NumberFinder {
  public:
    NumberFinder(const Scene& scene, const std::string& key, const std::string& file, const std::string& value)
        : scene_(scene), key_(key), file_(file), value_(value), parts_(split_key(key, file, value)) {}

    SceneNumber find() const {
        const std::map<std::string, std::function<SceneNumber()>> sections{
            {"model",
             [&] {
                 return member({{"thickness", {&scene_.model.thickness, limits::thickness}}}, 1);
             }},
            {"materials", [&] { return in_material(); }},
            {"specimen", [&] { return in_specimen(); }},
            {"cracks", [&] { return in_crack(); }},
            {"solver",
             [&] {
                 return member({{"damping", {&scene_.solver.damping, limits::damping}}}, 1);
             }},
            {"edges", [&] { return in_edge(); }},
            {"bodies", [&] { return in_body(); }},
        };
        const auto section = sections.find(parts_[0]);
        if (section == sections.end()) {
            fail(suggestion(parts_[0], names_of(sections)));
        }
        return section->second();
    }

  private:
    [[noreturn]] void fail(const std::string& reason) const {
        throw InputError(file_, key_, value_, "is no number of this scene that can be adjusted" + reason);
    }

    template <class Map>
    static std::vector<std::string> names_of(const Map& map) {
        std::vector<std::string> names;
        for (const auto& [name, value] : map) {
            names.push_back(name);
        }
        return names;
    }

    const std::string& part(std::size_t i) const {
        if (i >= parts_.size()) {
            fail(": the key ends too early");
        }
        return parts_[i];
    }

    /// The member that the last part, number `at`, names.
    SceneNumber member(const std::map<std::string, SceneNumber>& members, std::size_t at) const {
        const auto found = members.find(part(at));
        if (found == members.end()) {
            fail(suggestion(part(at), names_of(members)));
        }
        if (at + 1 != parts_.size()) {
            fail(": the key goes too far");
        }
        return found->second;
    }

    SceneNumber in_material() const {
        const auto material = scene_.materials.find(part(1));
        if (material == scene_.materials.end()) {
            fail(fmt::format(": there is no material {}{}", part(1), suggestion(part(1), names_of(scene_.materials))));
        }
        const Material& m = material->second;
        std::map<std::string, SceneNumber> members = elastic_numbers(m);
        members.merge(memory_numbers(m));
        members.insert({{"density", {&m.density, limits::density}}, {"toughness", {&m.toughness, limits::toughness}}});
        if (part(2) != "prony" || !m.viscoelastic) {
            return member(members, 2);
        }
        const auto found = members.find(fmt::format("prony.{}.{}", part(3), part(4)));
        if (found == members.end()) {
            fail(fmt::format(": prony has {} terms, numbered from 0, each with g, k and tau", m.viscoelastic->prony.size()));
        }
        if (parts_.size() > 5) {
            fail(": the key goes too far");
        }
        return found->second;
    }

    SceneNumber in_specimen() const {
        if (part(1) == "rings") {
            if (!scene_.specimen.rings) {
                fail(": the specimen has no rings");
            }
            const Rings& rings = *scene_.specimen.rings;
            if (part(2) == "pith") {
                return component(rings.pith, limits::coordinate, 3);
            }
            return member({{"period", {&rings.period, limits::period}},
                           {"latewood_fraction", {&rings.latewood_fraction, limits::latewood_fraction}},
                           {"transition", {&rings.transition, limits::transition}}},
                          2);
        }
        if (part(1) == "pith") {
            if (!scene_.specimen.pith) {
                fail(": the specimen has no pith of its own");
            }
            return component(*scene_.specimen.pith, limits::coordinate, 2);
        }
        if (part(1) == "density_exponents") {
            return member(exponent_numbers(scene_.specimen.density_exponents), 2);
        }
        if (part(1) == "radial") {
            if (!scene_.specimen.radial) {
                fail(": the specimen has no radial");
            }
            return member({{"radial", {&*scene_.specimen.radial, limits::rotation}}}, 1);
        }
        const SpecimenPlan& plan = scene_.specimen;
        if ((part(1) == "rotation" || part(1) == "offset") && !plan.picture && plan.file.empty()) {
            fail(": the specimen has neither image nor file");
        }
        if (part(1) == "offset") {
            return component(plan.picture ? plan.picture->offset : plan.file_offset, limits::coordinate, 2);
        }
        return member({{"rotation", {plan.picture ? &plan.picture->rotation : &plan.file_rotation, limits::rotation}}}, 1);
    }

    SceneNumber in_crack() const {
        const std::size_t number = member_number(part(1), scene_.cracks.size());
        if (number == scene_.cracks.size()) {
            fail(fmt::format(": there is no crack {}; cracks are numbered from 0", part(1)));
        }
        if (const auto& bridging = scene_.cracks[number].faces.bridging;
            bridging && part(2) == "faces" && part(3) == "traction") {
            return member({{"stress", {&bridging->stress, limits::bridging_stress}},
                           {"opening", {&bridging->opening, limits::bridging_opening}}},
                          4);
        }
        if (part(2) == "faces") {
            return friction(scene_.cracks[number].faces, CrackFaces::Kind::friction);
        }
        return member({{"advance", {&scene_.cracks[number].advance, limits::advance}}}, 2);
    }

    template <class Member>
    const Member& named(const std::vector<Member>& list) const {
        for (const Member& candidate : list) {
            if (candidate.name == part(1)) {
                return candidate;
            }
        }
        const std::size_t number = member_number(part(1), list.size());
        if (number == list.size()) {
            fail(fmt::format(": there is no \"{}\" in {}", part(1), parts_[0]));
        }
        return list[number];
    }

    /// Number 0 or 1 of a vector, the last part of the key, number `at`.
    SceneNumber component(const Vec2& vector, const NumberRule& rule, std::size_t at) const {
        return member({{"0", {&vector.x(), rule}}, {"1", {&vector.y(), rule}}}, at);
    }

    /// Number 0 or 1 of a velocity, the last part of the key.
    SceneNumber velocity(const double* x, const double* y) const {
        if (part(2) != "velocity") {
            fail(suggestion(part(2), {"velocity"}));
        }
        const SceneNumber number = member({{"0", {x, limits::velocity}}, {"1", {y, limits::velocity}}}, 3);
        if (number.value == nullptr) {
            fail(": this component is free");
        }
        return number;
    }

    SceneNumber in_edge() const {
        const Edge& edge = named(scene_.edges);
        if (edge.traction && part(2) == "traction") {
            return component(*edge.traction, limits::traction, 3);
        }
        const auto& [x, y] = edge.velocity;
        return velocity(x ? &*x : nullptr, y ? &*y : nullptr);
    }

    SceneNumber in_body() const {
        const Body& body = named(scene_.bodies);
        if (part(2) == "contact") {
            return friction(body.contact, Contact::Kind::friction);
        }
        if (part(2) == "force") {
            const SceneNumber number = member({{"0", {body.free[0] ? &body.force.x() : nullptr, limits::force}},
                                               {"1", {body.free[1] ? &body.force.y() : nullptr, limits::force}}},
                                              3);
            if (number.value == nullptr) {
                fail(": this component's velocity is prescribed");
            }
            return number;
        }
        return velocity(body.free[0] ? nullptr : &body.velocity.x(), body.free[1] ? nullptr : &body.velocity.y());
    }

    /// The coefficient of a contact or of crack faces, in the last part of the key.
    template <class Meeting>
    SceneNumber friction(const Meeting& meeting, typename Meeting::Kind rubs) const {
        if (meeting.kind != rubs) {
            fail(": there is no friction here");
        }
        return member({{"friction", {&meeting.coefficient, limits::friction}}}, 3);
    }

    const Scene& scene_;
    const std::string& key_;
    const std::string& file_;
    const std::string& value_;
    std::vector<std::string> parts_;
};

}  // namespace

SceneNumber find_number(const Scene& scene, const std::string& key, const std::string& file, const std::string& value) {
    return NumberFinder(scene, key, file, value).find();
}

double get_number(const Scene& scene, const std::string& key) {
    return *find_number(scene, key, scene.file.string(), "(any)").value;
}

void set_number(Scene& scene, const std::string& key, double value) {
    const std::string file = scene.file.string();
    const std::string text = fmt::format("{}", value);
    const SceneNumber number = find_number(scene, key, file, text);
    if (!number.rule.allows(value)) {
        throw InputError(file, key, text, number.rule.rule);
    }
    double& slot = const_cast<double&>(*number.value);  // the scene is ours to change; finding needs no second, mutable copy
    const double before = std::exchange(slot, value);
    try {
        if (scene.specimen.rings) {
            check_rings(*scene.specimen.rings, {file, key}, text);
        }
        for (const auto& [name, material] : scene.materials) {
            if (const auto broken = broken_rule(material)) {
                throw InputError(file, key, text, fmt::format("[materials.{}] {}", name, broken->rule));
            }
        }
    } catch (const InputError&) {
        slot = before;
        throw;
    }
}

}  // namespace crampfit

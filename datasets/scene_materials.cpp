#include "datasets/limits.hpp"
#include "datasets/scene_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

bool has_axial_constants(const OrthotropicElasticity& wood) { return wood.E_L > 0; }

/// The other way round a Poisson's ratio is a number of its own, easily taken for the one that is asked for.
void refuse_converse_ratios(const Entry& entry) {
    for (const char* key : {"nu_TR", "nu_RL", "nu_TL"}) {
        if (const auto given = entry.find(key)) {
            given->fail(fmt::format("give nu_{1}{0} = {2} E_{1} / E_{0} instead: strain along {0} under stress along {1}", key[3],
                                    key[4], key));
        }
    }
}

OrthotropicElasticity read_orthotropic(const Entry& entry, PlaneCondition plane) {
    const auto modulus = [&](const char* key) { return entry.at(key).number(limits::youngs_modulus); };
    const auto ratio = [&](const char* key) { return entry.at(key).number(limits::orthotropic_poisson_ratio); };
    OrthotropicElasticity wood;
    wood.E_R = modulus("E_R");
    wood.E_T = modulus("E_T");
    wood.G_RT = modulus("G_RT");
    wood.nu_RT = ratio("nu_RT");
    if (plane == PlaneCondition::strain || entry.has("E_L") || entry.has("nu_LR") || entry.has("nu_LT")) {
        wood.E_L = modulus("E_L");
        wood.nu_LR = ratio("nu_LR");
        wood.nu_LT = ratio("nu_LT");
    }
    return wood;
}

Viscoelasticity read_viscoelastic(const Entry& entry) {
    Viscoelasticity memory;
    for (const Entry& term : entry.at("prony").list()) {
        term.only({"g", "k", "tau"});
        PronyTerm& read = memory.prony.emplace_back();
        read.tau = term.at("tau").number(limits::relaxation_time);
        if (!term.has("g") && !term.has("k")) {
            term.at("g");  // is missed
        }
        if (const auto g = term.find("g")) {
            read.g = g->number(limits::relaxing_share);
        }
        if (const auto k = term.find("k")) {
            read.k = k->number(limits::relaxing_share);
        }
    }
    if (memory.prony.empty()) {
        entry.at("prony").fail("must hold at least one term, such as { g = 0.2, tau = \"1 s\" }");
    }
    return memory;
}

Plasticity read_plastic(const Entry& entry) {
    Plasticity memory;
    memory.yield_stress = entry.at("yield_stress").number(limits::yield_stress);
    if (const auto hardening = entry.find("hardening")) {
        memory.hardening = hardening->number(limits::hardening);
    }
    if (entry.has("saturation_stress") || entry.has("saturation_strain")) {
        memory.saturation = {entry.at("saturation_stress").number(limits::yield_stress),
                             entry.at("saturation_strain").number(limits::plastic_strain)};
    }
    return memory;
}

}  // namespace

std::optional<BrokenRule> broken_rule(const Material& material) {
    if (material.orthotropic) {
        return broken_rule(*material.orthotropic);
    }
    if (material.plastic && material.plastic->saturation &&
        material.plastic->saturation->stress < material.plastic->yield_stress) {
        return BrokenRule{"saturation_stress", "must not be below yield_stress: the wood hardens as it flows"};
    }
    if (material.viscoelastic) {
        double g = 0.0, k = 0.0;
        for (const PronyTerm& term : material.viscoelastic->prony) {
            g += term.g;
            k += term.k;
        }
        if (g >= 1.0 || k >= 1.0) {
            return BrokenRule{"prony",
                              fmt::format("the sum of all {} must be below 1 and is {:.4g}: some stiffness is left for good",
                                          g >= 1.0 ? "g" : "k", std::max(g, k))};
        }
    }
    return std::nullopt;
}

std::optional<BrokenRule> broken_rule(const OrthotropicElasticity& wood) {
    const auto too_large = [](const char* key, double ratio, const char* moduli, double modulus,
                              double other) -> std::optional<BrokenRule> {
        const double most = std::sqrt(modulus / other);
        if (std::abs(ratio) < most) {
            return std::nullopt;
        }
        return BrokenRule{
            key, fmt::format("{} must lie between -{:.4g} and {:.4g}, the root of {}, or the wood could be strained without work",
                             key, most, most, moduli)};
    };
    if (const auto broken = too_large("nu_RT", wood.nu_RT, "E_R / E_T", wood.E_R, wood.E_T)) {
        return broken;
    }
    if (!has_axial_constants(wood)) {
        return std::nullopt;
    }
    if (const auto broken = too_large("nu_LR", wood.nu_LR, "E_L / E_R", wood.E_L, wood.E_R)) {
        return broken;
    }
    if (const auto broken = too_large("nu_LT", wood.nu_LT, "E_L / E_T", wood.E_L, wood.E_T)) {
        return broken;
    }
    const double rest = 1 - wood.nu_RT * wood.nu_RT * wood.E_T / wood.E_R - wood.nu_LR * wood.nu_LR * wood.E_R / wood.E_L -
                        wood.nu_LT * wood.nu_LT * wood.E_T / wood.E_L -
                        2 * wood.nu_RT * wood.nu_LR * wood.nu_LT * wood.E_T / wood.E_L;
    if (rest > 0) {
        return std::nullopt;
    }
    return BrokenRule{"nu_RT",
                      fmt::format("nu_RT, nu_LR and nu_LT are too large together: 1 - nu_RT^2 E_T/E_R - nu_LR^2 E_R/E_L - "
                                  "nu_LT^2 E_T/E_L - 2 nu_RT nu_LR nu_LT E_T/E_L must be greater than 0 and is {:.4g}",
                                  rest)};
}

std::map<std::string, SceneNumber> elastic_numbers(const Material& material) {
    if (!material.orthotropic) {
        return {{"E", {&material.youngs_modulus, limits::youngs_modulus}},
                {"nu", {&material.poisson_ratio, limits::poisson_ratio}}};
    }
    const OrthotropicElasticity& wood = *material.orthotropic;
    std::map<std::string, SceneNumber> numbers{{"E_R", {&wood.E_R, limits::youngs_modulus}},
                                               {"E_T", {&wood.E_T, limits::youngs_modulus}},
                                               {"G_RT", {&wood.G_RT, limits::youngs_modulus}},
                                               {"nu_RT", {&wood.nu_RT, limits::orthotropic_poisson_ratio}}};
    if (has_axial_constants(wood)) {
        numbers.insert({{"E_L", {&wood.E_L, limits::youngs_modulus}},
                        {"nu_LR", {&wood.nu_LR, limits::orthotropic_poisson_ratio}},
                        {"nu_LT", {&wood.nu_LT, limits::orthotropic_poisson_ratio}}});
    }
    return numbers;
}

std::map<std::string, SceneNumber> memory_numbers(const Material& material) {
    std::map<std::string, SceneNumber> numbers;
    if (material.viscoelastic) {
        for (std::size_t i = 0; i < material.viscoelastic->prony.size(); ++i) {
            const PronyTerm& term = material.viscoelastic->prony[i];
            const std::string key = fmt::format("prony.{}.", i);
            numbers.insert({{key + "g", {&term.g, limits::relaxing_share}},
                            {key + "k", {&term.k, limits::relaxing_share}},
                            {key + "tau", {&term.tau, limits::relaxation_time}}});
        }
    }
    if (material.plastic) {
        numbers.insert({{"yield_stress", {&material.plastic->yield_stress, limits::yield_stress}},
                        {"hardening", {&material.plastic->hardening, limits::hardening}}});
        if (const auto& saturation = material.plastic->saturation) {
            numbers.insert({{"saturation_stress", {&saturation->stress, limits::yield_stress}},
                            {"saturation_strain", {&saturation->strain, limits::plastic_strain}}});
        }
    }
    return numbers;
}

std::map<std::string, Material> read_materials(const Entry& materials, PlaneCondition plane) {
    enum class Kind { isotropic, orthotropic, viscoelastic, plastic };
    std::map<std::string, Material> result;
    for (const auto& [name, entry] : materials.members()) {
        const auto kind = entry.find("kind");
        const Kind choice = kind ? kind->choice<Kind>({{"isotropic", Kind::isotropic},
                                                       {"orthotropic", Kind::orthotropic},
                                                       {"viscoelastic", Kind::viscoelastic},
                                                       {"plastic", Kind::plastic}})
                                 : Kind::isotropic;
        Material material;
        if (choice == Kind::orthotropic) {
            refuse_converse_ratios(entry);
            entry.only({"kind", "E_R", "E_T", "G_RT", "nu_RT", "E_L", "nu_LR", "nu_LT", "density", "toughness"});
            material.orthotropic = read_orthotropic(entry, plane);
        } else {
            std::vector<std::string> keys{"kind", "E", "nu", "density", "toughness"};
            if (choice == Kind::viscoelastic) {
                keys.push_back("prony");
            } else if (choice == Kind::plastic) {
                keys.insert(keys.end(), {"yield_stress", "hardening", "saturation_stress", "saturation_strain"});
            }
            entry.only(keys);
            material.youngs_modulus = entry.at("E").number(limits::youngs_modulus);
            material.poisson_ratio = entry.at("nu").number(limits::poisson_ratio);
            if (choice == Kind::viscoelastic) {
                material.viscoelastic = read_viscoelastic(entry);
            } else if (choice == Kind::plastic) {
                material.plastic = read_plastic(entry);
            }
        }
        if (const auto broken = broken_rule(material)) {
            entry.at(broken->key).fail(broken->rule);
        }
        material.density = entry.at("density").number(limits::density);
        material.toughness = entry.at("toughness").number(limits::toughness);
        result[name] = material;
    }
    return result;
}

}  // namespace crampfit
